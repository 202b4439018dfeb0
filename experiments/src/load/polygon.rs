//! Polygons to triangles: a fan where the polygon is convex, ear clipping (earcut) where it is not.
//!
//! A polygon of n corners gives n - 2 triangles. Non-planar ones are judged in the plane of their Newell normal
//! (I. Sutherland, R. Sproull, R. Schumacker, "A characterization of ten hidden-surface algorithms", 1974). Where
//! ear clipping does not give n - 2 triangles (the outline crosses itself), and beyond 1,000 corners, where its worst case
//! of O(n^2) would let a file stop the program, the fan is taken. O(n) convex, O(n log n) mostly else.

use glam::DVec3;

/// The most corners of a concave polygon.
const MAX_EAR_CORNERS: usize = 1_000;

/// Appends the triangles of the polygon, as indices into `corners`, in the polygon's winding.
pub(super) fn triangulate(corners: &[DVec3], out: &mut Vec<[u32; 3]>) {
    let n = corners.len() as u32;
    if n < 3 {
        return;
    }
    let fan = (1..n - 1).map(|i| [0, i, i + 1]);
    if n == 3 {
        return out.extend(fan);
    }
    let at = |i: usize| corners[i % corners.len()] - corners[0];
    // Newell: the sum of cross products of consecutive corners is twice the vector area.
    let area2 = (0..corners.len()).fold(DVec3::ZERO, |s, i| s + at(i).cross(at(i + 1)));
    let Some(normal) = area2.try_normalize() else { return out.extend(fan) };
    let convex = (0..corners.len())
        .all(|i| (at(i + 1) - at(i)).cross(at(i + 2) - at(i + 1)).dot(normal) >= -1e-9 * area2.length());
    if convex || corners.len() > MAX_EAR_CORNERS {
        return out.extend(fan);
    }
    let (u, v) = normal.any_orthonormal_pair();
    let (u, v) = if u.cross(v).dot(normal) > 0.0 { (u, v) } else { (v, u) };
    let flat: Vec<[f64; 2]> = (0..corners.len()).map(|i| [at(i).dot(u), at(i).dot(v)]).collect();
    let mut ears: Vec<u32> = vec![];
    earcut::Earcut::new().earcut(flat.iter().copied(), &[], &mut ears);
    if ears.len() as u32 != 3 * (n - 2) {
        return out.extend(fan);
    }
    out.extend(ears.chunks_exact(3).map(|t| {
        let [a, b, c] = [0, 1, 2].map(|k| flat[t[k] as usize]);
        let left = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) >= 0.0;
        if left { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(corners: &[DVec3]) -> DVec3 {
        let mut out = vec![];
        triangulate(corners, &mut out);
        out.iter().fold(DVec3::ZERO, |s, t| {
            let [a, b, c] = t.map(|i| corners[i as usize]);
            s + (b - a).cross(c - a) * 0.5
        })
    }

    #[test]
    fn a_dart_is_not_filled_beyond_its_outline() {
        // The fan from corner 0 would cover area outside the dart; ears must not, so unsigned areas add up.
        let dart = [(0.0, 0.0), (2.0, 0.0), (0.4, 0.4), (0.0, 2.0)].map(|(x, y)| DVec3::new(x, y, 3.0));
        for turn in 0..4 {
            let mut p = dart;
            p.rotate_left(turn);
            let mut out = vec![];
            triangulate(&p, &mut out);
            assert_eq!(out.len(), 2);
            for t in out {
                let [a, b, c] = t.map(|i| p[i as usize]);
                assert!((b - a).cross(c - a).z > 0.0, "turn {turn}: {t:?}");
            }
            assert!((area(&p).z - 0.8).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn any_polygon_gives_n_minus_2_triangles(
            xyz in prop::collection::vec((-1.0..1.0, -1.0..1.0, -1.0..1.0), 3..12)
        ) {
            let p: Vec<DVec3> = xyz.into_iter().map(|(x, y, z)| DVec3::new(x, y, z)).collect();
            let mut out = vec![];
            triangulate(&p, &mut out);
            prop_assert_eq!(out.len(), p.len() - 2);
            prop_assert!(out.iter().flatten().all(|&i| (i as usize) < p.len()));
        }

        // A polygon that its centre sees whole is simple: its triangles wind as it does and add up to its area.
        #[test]
        fn stars_are_filled_exactly(
            radii in prop::collection::vec(0.1f64..1.0, 3..12), tilt in -1.0f64..1.0
        ) {
            let n = radii.len() as f64;
            let (s, c) = tilt.sin_cos();
            let p: Vec<DVec3> = radii.iter().enumerate().map(|(i, r)| {
                let a = i as f64 / n * std::f64::consts::TAU;
                DVec3::new(r * a.cos(), r * a.sin() * c, r * a.sin() * s)
            }).collect();
            let normal = DVec3::new(0.0, -s, c);
            let mut out = vec![];
            triangulate(&p, &mut out);
            let areas: Vec<f64> = out.iter().map(|t| {
                let [a, b, c] = t.map(|i| p[i as usize]);
                (b - a).cross(c - a).dot(normal) * 0.5
            }).collect();
            let want: f64 = (0..p.len()).map(|i| p[i].cross(p[(i + 1) % p.len()]).dot(normal) * 0.5).sum();
            prop_assert!(areas.iter().all(|&a| a > -1e-12), "{:?}", areas);
            prop_assert!((areas.iter().sum::<f64>() - want).abs() < 1e-12);
        }
    }
}
