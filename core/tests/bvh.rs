//! Hierarchies against brute force: every triangle and box tried, by other formulas, in 64 bits.

use std::ops::ControlFlow;

use farfield_core::Aabb;
use farfield_core::bvh::{BoxBvh, Hit, Ray, TriangleBvh};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

/// Möller and Trumbore 1997, in 64 bits: t, the weights of vertices 1 and 2, and whether the front is met.
fn meet(o: DVec3, d: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64, bool)> {
    let (e1, e2) = (b - a, c - a);
    let p = d.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = o - a;
    let u = s.dot(p) / det;
    let q = s.cross(e1);
    let v = d.dot(q) / det;
    Some((e2.dot(q) / det, u, v, det > 0.0))
}

fn corners(positions: &[Vec3], indices: &[u32], i: usize) -> [DVec3; 3] {
    [0, 1, 2].map(|k| positions[indices[3 * i + k] as usize].as_dvec3())
}

/// How far inside the triangle a hit lies, as a weight: clear of the edges either way, both tests must agree.
fn margin(u: f64, v: f64) -> f64 {
    u.min(v).min(1.0 - u - v)
}

fn points(n: usize) -> impl Strategy<Value = Vec<Vec3>> {
    prop::collection::vec((-1f32..1.0, -1f32..1.0, -1f32..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z)), 3..n)
}

fn soup() -> impl Strategy<Value = (Vec<Vec3>, Vec<u32>)> {
    points(60).prop_flat_map(|p| {
        let n = p.len() as u32;
        (
            Just(p),
            prop::collection::vec(0..n, 0..600).prop_map(|mut i| {
                i.truncate(i.len() / 3 * 3);
                i
            }),
        )
    })
}

fn vector() -> impl Strategy<Value = Vec3> {
    // Zeros among the components, so that rays run along axes.
    let c = || prop_oneof![3 => -1f32..1.0, 1 => Just(0.0), 1 => Just(-0.0), 1 => Just(1.0)];
    (c(), c(), c()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #[test]
    fn closest_hits_are_those_of_brute_force(
        (positions, indices) in soup(), o in vector(), d in vector(), scale in prop_oneof![Just(1e-6f32), Just(1.0), Just(1e6)],
        cull in any::<bool>()
    ) {
        let positions: Vec<Vec3> = positions.iter().map(|&p| p * scale).collect();
        let bvh = TriangleBvh::build(&positions, &indices);
        let origin = (o * scale * 1.5).as_dvec3();
        let Some(ray) = Ray::new(origin, d * scale, 0.0, f32::INFINITY) else { return Ok(()) };
        let got = bvh.closest_hit(&ray, |h| !cull || h.front);

        let mut sure = f64::INFINITY;
        for i in 0..indices.len() / 3 {
            let Some((t, u, v, front)) = meet(origin, (d * scale).as_dvec3(), corners(&positions, &indices, i)) else { continue };
            if margin(u, v) > 1e-4 && t > 1e-4 && (front || !cull) {
                sure = sure.min(t);
            }
        }
        match got {
            None => prop_assert!(sure.is_infinite(), "a hit at {sure} is missed"),
            Some(h) => {
                prop_assert!(f64::from(h.t) <= sure * (1.0 + 1e-3) + 1e-4, "a hit at {sure} is missed for {}", h.t);
                // The hit itself is one: its weights and its t say the same point.
                let [a, b, c] = corners(&positions, &indices, h.triangle as usize);
                let w = h.weights.map(f64::from);
                let on = a * w[0] + b * w[1] + c * w[2];
                let along = origin + (d * scale).as_dvec3() * f64::from(h.t);
                let size = f64::from(scale) * (1.0 + f64::from(h.t));
                let flat = (b - a).cross(c - a).length() < 1e-3 * f64::from(scale * scale);
                prop_assert!(on.distance(along) < 1e-4 * size || flat, "{on} is not {along}");
                prop_assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-5 && w.iter().all(|&w| w >= 0.0));
                prop_assert!(!cull || h.front);
                prop_assert!(bvh.any_hit(&ray, |h| !cull || h.front));
            }
        }
    }

    #[test]
    fn the_tree_changes_nothing(
        (positions, indices) in soup(), o in vector(), d in vector(), near in 0f32..2.0
    ) {
        let whole = TriangleBvh::build(&positions, &indices);
        let Some(ray) = Ray::new((o * 1.5).as_dvec3(), d, near, f32::INFINITY) else { return Ok(()) };
        // The same arithmetic without a tree: every triangle alone.
        let alone = (0..indices.len() / 3).filter_map(|i| {
            let one = TriangleBvh::build(&positions, &indices[3 * i..3 * i + 3]);
            one.closest_hit(&ray, |_| true).map(|h| Hit { triangle: i as u32, ..h })
        });
        let best = alone.reduce(|a, b| if b.t < a.t { b } else { a });
        let got = whole.closest_hit(&ray, |_| true);
        prop_assert_eq!(got, best);
        prop_assert!(got.is_none_or(|h| h.t >= near));
        // Only the third of the triangles, by filter.
        let third = whole.closest_hit(&ray, |h| h.triangle % 3 == 0);
        prop_assert!(third.is_none_or(|h| h.triangle % 3 == 0));
    }

    #[test]
    fn rays_through_shared_edges_and_vertices_never_slip_through(
        heights in prop::collection::vec(-0.2f32..0.2, 36), o in vector(), at in (0usize..25, 0f32..=1.0, 0u8..4), far in 1f64..1e4
    ) {
        // A bumpy sheet of 5 x 5 cells, closed: rays at points of its inner edges must hit it.
        let mut positions = vec![];
        for j in 0..6 {
            for i in 0..6 {
                positions.push(Vec3::new(i as f32 - 2.5, j as f32 - 2.5, heights[6 * j + i]));
            }
        }
        let mut indices = vec![];
        for j in 0..5u32 {
            for i in 0..5u32 {
                let a = 6 * j + i;
                indices.extend([a, a + 1, a + 7, a, a + 7, a + 6]);
            }
        }
        let bvh = TriangleBvh::build(&positions, &indices);
        let (cell, along, which) = at;
        let (i, j) = (cell % 5, cell / 5);
        let a = 6 * j + i;
        let (from, to) = match which { 0 => (a, a + 7), 1 => (a, a + 1), 2 => (a, a + 6), _ => (a, a) };
        let target = positions[from].lerp(positions[to], along);
        prop_assume!(target.truncate().abs().max_element() < 2.4);
        let eye = target.as_dvec3() + DVec3::new(f64::from(o.x), f64::from(o.y), 1.5).normalize() * far;
        let d = (target.as_dvec3() - eye).as_vec3();
        let ray = Ray::new(eye, d, 0.0, f32::INFINITY).unwrap();
        let hit = bvh.closest_hit(&ray, |_| true);
        prop_assert!(hit.is_some(), "a pinhole at {target} seen from {eye}");
    }

    #[test]
    fn nearest_points_are_those_of_brute_force((positions, indices) in soup(), p in vector(), reach in 0.05f32..3.0) {
        let bvh = TriangleBvh::build(&positions, &indices);
        let p = p * 1.5;
        let got = bvh.closest_point(p, reach);
        // No formula: golden-section steps over both weights would do; samples of each triangle bound it from above.
        let mut bound = f64::INFINITY;
        for i in 0..indices.len() / 3 {
            let [a, b, c] = corners(&positions, &indices, i);
            for s in 0..=24 {
                for t in 0..=24 - s {
                    let (u, v) = (f64::from(s) / 24.0, f64::from(t) / 24.0);
                    bound = bound.min((a + (b - a) * u + (c - a) * v).distance(p.as_dvec3()));
                }
            }
        }
        match got {
            None => prop_assert!(bound > f64::from(reach) * (1.0 - 1e-5)),
            Some(n) => {
                prop_assert!(f64::from(n.distance) <= bound * (1.0 + 1e-5) + 1e-6);
                prop_assert!(n.distance <= reach * (1.0 + 1e-6));
                prop_assert!((n.point.distance(p) - n.distance).abs() < 1e-5);
                let [a, b, c] = corners(&positions, &indices, n.triangle as usize);
                let w = n.weights.map(f64::from);
                prop_assert!(w.iter().all(|&w| (0.0..=1.0).contains(&w)));
                prop_assert!((a * w[0] + b * w[1] + c * w[2]).distance(n.point.as_dvec3()) < 1e-5);
                // Samples are at most a cell of the triangle away from the true nearest point.
                prop_assert!(f64::from(n.distance) > bound - 0.2);
            }
        }
    }

    #[test]
    fn every_box_on_the_way_is_visited(
        boxes in prop::collection::vec((vector(), 0f32..0.5, 0f32..0.5, 0f32..0.5), 0..150), o in vector(), d in vector()
    ) {
        let boxes: Vec<Aabb> =
            boxes.iter().map(|&(c, x, y, z)| Aabb { min: c, max: c + Vec3::new(x, y, z) }).collect();
        let bvh = BoxBvh::build(&boxes);
        let Some(ray) = Ray::new((o * 2.0).as_dvec3(), d, 0.0, f32::INFINITY) else { return Ok(()) };
        let mut seen = vec![0; boxes.len()];
        bvh.cast(&ray, |i, _| {
            seen[i as usize] += 1;
            ControlFlow::Continue(())
        });
        for (i, b) in boxes.iter().enumerate() {
            prop_assert!(seen[i] <= 1);
            let (mut near, mut far) = (0f64, f64::INFINITY);
            for k in 0..3 {
                let (o, d) = (f64::from(o[k] * 2.0), f64::from(d[k]));
                let (lo, hi) = (f64::from(b.min[k]) - o, f64::from(b.max[k]) - o);
                if d == 0.0 {
                    if lo > 0.0 || hi < 0.0 {
                        far = -1.0;
                    }
                } else {
                    near = near.max((lo / d).min(hi / d));
                    far = far.min((lo / d).max(hi / d));
                }
            }
            if near <= far {
                prop_assert_eq!(seen[i], 1, "box {} is on the way from {} to {}", i, near, far);
            } else if near > far + 1e-4 * (1.0 + near.abs()) {
                prop_assert_eq!(seen[i], 0, "box {} is not", i);
            }
        }
        let around = o * 0.9;
        let mut near = vec![false; boxes.len()];
        bvh.around(around, 0.7, |i, _| near[i as usize] = true);
        for (i, b) in boxes.iter().enumerate() {
            let d = b.distance(around);
            prop_assert!(near[i] || d > 0.7 * (1.0 - 1e-6));
            prop_assert!(!near[i] || d < 0.7 * (1.0 + 1e-5));
        }
    }

    #[test]
    fn nothing_makes_it_panic(
        bits in prop::collection::vec(any::<u32>(), 0..90), indices in prop::collection::vec(0u32..40, 0..120),
        o in (any::<f64>(), any::<f64>(), any::<f64>()), d in (any::<f32>(), any::<f32>(), any::<f32>()), t in any::<f32>()
    ) {
        let positions: Vec<Vec3> =
            bits.chunks_exact(3).map(|b| Vec3::new(f32::from_bits(b[0]), f32::from_bits(b[1]), f32::from_bits(b[2]))).collect();
        let bvh = TriangleBvh::build(&positions, &indices);
        let direction = Vec3::new(d.0, d.1, d.2);
        for origin in [DVec3::new(o.0, o.1, o.2), DVec3::ZERO] {
            if let Some(ray) = Ray::new(origin, direction, t, f32::INFINITY) {
                if let Some(h) = bvh.closest_hit(&ray, |_| true) {
                    prop_assert!(h.t.is_finite() && h.weights.iter().all(|w| w.is_finite()));
                }
                bvh.any_hit(&ray, |_| true);
            }
        }
        bvh.closest_point(direction, t);
    }
}

#[test]
fn an_empty_set_has_no_hits() {
    let bvh = TriangleBvh::build(&[], &[]);
    let ray = Ray::new(DVec3::ZERO, Vec3::Z, 0.0, f32::INFINITY).unwrap();
    assert!(bvh.is_empty() && bvh.bounds().is_none());
    assert!(bvh.closest_hit(&ray, |_| true).is_none() && !bvh.any_hit(&ray, |_| true));
    assert!(bvh.closest_point(Vec3::ZERO, f32::INFINITY).is_none());
    BoxBvh::build(&[Aabb::EMPTY]).cast(&ray, |_, _| panic!("an empty box is visited"));
    assert!(Ray::new(DVec3::ZERO, Vec3::ZERO, 0.0, 1.0).is_none());
    assert!(Ray::new(DVec3::NAN, Vec3::X, 0.0, 1.0).is_none());
}

#[test]
fn degenerate_triangles_are_missed_and_found_near() {
    let p = Vec3::new(0.3, 0.4, 1.0);
    let positions = [p, p, p, Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    let bvh = TriangleBvh::build(&positions, &[0, 1, 2, 3, 4, 5]);
    assert_eq!(bvh.len(), 2);
    let at =
        |target: Vec3| Ray::new(DVec3::new(0.3, 0.4, -3.0), target - Vec3::new(0.3, 0.4, -3.0), 0.0, f32::INFINITY);
    assert!(bvh.closest_hit(&at(p).unwrap(), |_| true).is_none());
    assert!(bvh.closest_hit(&at(Vec3::X).unwrap(), |_| true).is_none());
    let n = bvh.closest_point(Vec3::new(1.5, 0.5, 0.0), 9.0).unwrap();
    assert_eq!((n.point, n.distance, n.triangle), (Vec3::X * 1.5, 0.5, 1));
    let n = bvh.closest_point(p + Vec3::Z, 9.0).unwrap();
    assert_eq!((n.point, n.distance, n.triangle), (p, 1.0, 0));
}

#[test]
fn front_is_counter_clockwise_as_seen() {
    let bvh = TriangleBvh::build(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[0, 1, 2]);
    for (axis, front) in [(-1.0, true), (1.0, false)] {
        let ray = Ray::new(DVec3::new(0.25, 0.25, -axis), Vec3::Z * axis as f32, 0.0, 9.0).unwrap();
        let hit = bvh.closest_hit(&ray, |_| true).unwrap();
        assert_eq!((hit.front, hit.t, hit.weights), (front, 1.0, [0.5, 0.25, 0.25]));
    }
}

/// Ten thousand triangles in one place must not make the tree too deep, nor may equal hits depend on its shape.
#[test]
fn many_copies_of_one_triangle_give_the_first() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let indices: Vec<u32> = (0..30_000).map(|i| i % 3).collect();
    let bvh = TriangleBvh::build(&positions, &indices);
    let ray = Ray::new(DVec3::new(0.2, 0.2, 4.0), -Vec3::Z, 0.0, 9.0).unwrap();
    assert_eq!(bvh.closest_hit(&ray, |_| true).unwrap().triangle, 0);
    assert_eq!(bvh.closest_hit(&ray, |h| h.triangle >= 777).unwrap().triangle, 777);
    assert_eq!(bvh.closest_point(Vec3::new(0.2, 0.2, 1.0), 9.0).unwrap().triangle, 0);
}

/// Triangles whose sizes and places run over thirty octaves: the clustering makes a long chain of them.
#[test]
fn a_chain_of_shrinking_triangles_is_searched_right() {
    let mut positions = vec![];
    for k in 0..120 {
        let s = 0.5f32.powi(k);
        positions.extend([Vec3::new(s, 0.0, 0.0), Vec3::new(s, s * 0.1, 0.0), Vec3::new(s, 0.0, s * 0.1)]);
    }
    let indices: Vec<u32> = (0..360).collect();
    let bvh = TriangleBvh::build(&positions, &indices);
    for k in [0, 1, 30, 60, 90] {
        let s = f64::from(0.5f32.powi(k));
        let ray = Ray::new(DVec3::new(s * 1.01, s * 0.02, s * 0.02), -Vec3::X * s as f32, 0.0, 9.0).unwrap();
        let hit = bvh.closest_hit(&ray, |_| true).unwrap();
        assert_eq!(hit.triangle, k as u32);
        assert!((hit.t - 0.01).abs() < 1e-5);
    }
}

/// An eye near a surface that is far from the origin: the 64-bit origin keeps the picture sharp.
#[test]
fn rays_start_where_they_are_said_to() {
    let base = 1e6f32;
    let positions = [Vec3::new(base, 0.0, 0.0), Vec3::new(base, 4.0, 0.0), Vec3::new(base, 0.0, 4.0)];
    let bvh = TriangleBvh::build(&positions, &[0, 1, 2]);
    let eye = DVec3::new(f64::from(base) + 0.01234, 1.0, 1.0);
    let hit = bvh.closest_hit(&Ray::new(eye, -Vec3::X, 0.0, 9.0).unwrap(), |_| true).unwrap();
    assert!((hit.t - 0.01234).abs() < 1e-7, "{}", hit.t);
}

#[test]
fn a_hit_farther_than_numbers_go_is_none() {
    let x = 3e37;
    let bvh = TriangleBvh::build(&[Vec3::new(x, -x, -x), Vec3::new(x, x, -x), Vec3::new(x, 0.0, x)], &[0, 1, 2]);
    let ray = Ray::new(DVec3::ZERO, Vec3::X * 1e-20, 0.0, f32::INFINITY).unwrap();
    assert_eq!(bvh.closest_hit(&ray, |_| true), None);
    let ray = Ray::new(DVec3::ZERO, Vec3::X, 0.0, f32::INFINITY).unwrap();
    assert_eq!(bvh.closest_hit(&ray, |_| true).unwrap().t, x);
}

/// Rays that run exactly along the planes of edges and through vertices: the edge functions are 0, not merely small.
#[test]
fn rays_exactly_through_edges_and_vertices_hit() {
    let mut positions = vec![];
    for i in 0..49u16 {
        positions.push(Vec3::new(f32::from(i % 7), f32::from(i / 7), f32::from(i * 37 % 11) * 0.03));
    }
    let mut indices = vec![];
    for j in 0..6u32 {
        for i in 0..6u32 {
            let a = 7 * j + i;
            indices.extend([a, a + 1, a + 8, a, a + 8, a + 7]);
        }
    }
    let bvh = TriangleBvh::build(&positions, &indices);
    for j in 2..=22 {
        for i in 2..=22 {
            // Steps of a quarter: vertices, edges along x and y, diagonals and insides.
            let eye = DVec3::new(f64::from(i) * 0.25, f64::from(j) * 0.25, 5.0);
            let down = Ray::new(eye, -Vec3::Z, 0.0, f32::INFINITY).unwrap();
            assert!(bvh.closest_hit(&down, |h| h.front).is_some(), "a pinhole under {eye}");
            for d in [Vec3::new(0.25, 0.0, -1.0), Vec3::new(0.0, -0.25, -1.0), Vec3::new(0.25, 0.25, -1.0)] {
                let from = DVec3::new(eye.x - 5.0 * f64::from(d.x), eye.y - 5.0 * f64::from(d.y), 5.0);
                let slanting = Ray::new(from, d, 0.0, f32::INFINITY).unwrap();
                assert!(bvh.closest_hit(&slanting, |_| true).is_some(), "a pinhole from {from} along {d}");
            }
        }
    }
}
