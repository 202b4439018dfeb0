//! Which triangles a region's viewpoints see from in front.
//!
//! Follows textured LOD meshes (2003, section 3.1.5): a polygon that is back-facing to all corners of a cell is back-facing to every
//! point of it. Facing a point is a half-space test, n . (v - x) > 0, linear in v, so it is exact for the convex hull of the corners;
//! the paper tests six corners in the plane, a cell here is a prism and has twelve. A triangle goes only when it is back-facing
//! by more than rounding can make of edge-on (1e-9 of its area times the distance; 64-bit arithmetic).
//!
//! O(triangles x corners).

use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::object::Welded;

/// What "front-facing to the cell" means for a mesh of several views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Facing {
    /// To some corner: only what no viewpoint sees from in front goes.
    #[default]
    AnyCorner,
    /// To every corner: the reading that gives the published counts, at the price of holes.
    AllCorners,
}

/// Rounding in n . (v - x), relative to |n| |v - x|.
const ROUNDING: f64 = 1e-9;

/// A triangle may be seen from in front from some point of the corners' hull. Triangles without area never are.
pub(crate) fn faces_some(piece: &Welded, t: [u32; 3], corners: &[DVec3]) -> bool {
    let n = piece.area_vector(t);
    if n == DVec3::ZERO {
        return false;
    }
    let x = piece.positions[t[0] as usize].as_dvec3();
    corners.iter().any(|&v| n.dot(v - x) > -ROUNDING * n.length() * v.distance(x))
}

/// A triangle is seen from in front from every point of the corners' hull.
pub(crate) fn faces_all(piece: &Welded, t: [u32; 3], corners: &[DVec3]) -> bool {
    corners.iter().all(|&v| piece.facing(t, v) > 0.0)
}

/// Viewpoints that measure lengths in pixels: each with a picture plane at right angles to the line to the piece's origin.
pub(crate) struct Eyes {
    eyes: Vec<Eye>,
    px_per_tan: f32,
}

struct Eye {
    /// Where it stands, relative to the piece's origin.
    at: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
}

impl Eyes {
    /// `at` are relative to the piece's origin.
    pub(crate) fn new(at: &[DVec3], px_per_tan: f32) -> Self {
        let eyes = at
            .iter()
            .map(|&at| {
                let forward = (-at).normalize_or(DVec3::X).as_vec3();
                let (right, up) = forward.any_orthonormal_pair();
                Eye { at: at.as_vec3(), right, up, forward }
            })
            .collect();
        Self { eyes, px_per_tan }
    }

    /// The projected length of a segment, pixels: the longest that any of the eyes sees; infinite beside or behind one.
    pub(crate) fn length_px(&self, a: Vec3, b: Vec3) -> f32 {
        let tan = self.eyes.iter().map(|e| {
            let flat = |p: Vec3| {
                let v = p - e.at;
                let z = v.dot(e.forward);
                (z > 0.0).then(|| glam::Vec2::new(v.dot(e.right), v.dot(e.up)) / z)
            };
            match (flat(a), flat(b)) {
                (Some(a), Some(b)) => a.distance(b),
                _ => f32::INFINITY,
            }
        });
        self.px_per_tan * tan.fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::region::Region;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    fn unit(rng: &mut ChaCha8Rng) -> f32 {
        rng.next_u32() as f32 / u32::MAX as f32
    }

    /// A closed, bumpy ball of n x n patches.
    fn ball(n: u32) -> Welded {
        let at = |i: u32, j: u32| (i % n) + j * n;
        let place = |i: u32, j: u32| {
            let (a, b) = (i as f32 / n as f32 * std::f32::consts::TAU, j as f32 / n as f32 * std::f32::consts::PI);
            let r = 10.0 + 1.5 * (5.0 * a).sin() * (4.0 * b).sin();
            r * Vec3::new(b.sin() * a.cos(), b.cos(), b.sin() * a.sin())
        };
        let positions: Vec<Vec3> = (0..=n).flat_map(|j| (0..n).map(move |i| place(i, j))).collect();
        let triangles: Vec<[u32; 3]> = (0..n)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                [[a, b, c], [b, d, c]]
            })
            .collect();
        Welded { positions, triangles, ..Welded::default() }
    }

    #[test]
    fn no_culled_triangle_faces_any_of_ten_thousand_viewpoints() {
        let polygon: Vec<[f32; 2]> = (0..6)
            .map(|k| (k as f32 * std::f32::consts::FRAC_PI_3).sin_cos())
            .map(|(s, c)| [30.0 + 25.0 * c, -40.0 + 25.0 * s])
            .collect();
        let region = Region::Prism { polygon, y: [-3.0, 8.0] };
        let corners: Vec<DVec3> = region.corners().unwrap().iter().map(|c| c.as_dvec3()).collect();
        assert_eq!(corners.len(), 12);
        let piece = ball(60);
        let culled: Vec<[u32; 3]> =
            piece.triangles.iter().copied().filter(|&t| !faces_some(&piece, t, &corners)).collect();
        let whole: Vec<[u32; 3]> =
            piece.triangles.iter().copied().filter(|&t| faces_all(&piece, t, &corners)).collect();
        assert!(culled.len() * 5 > piece.triangles.len(), "{} of {}", culled.len(), piece.triangles.len());
        assert!(whole.len() * 20 > piece.triangles.len());
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut faced = vec![false; piece.triangles.len()];
        for _ in 0..10_000 {
            let eye = region.sample([unit(&mut rng), unit(&mut rng), unit(&mut rng)]).unwrap().as_dvec3();
            for t in &culled {
                // A rounding in the region's own corners is worth some 1e-6.
                assert!(piece.facing(*t, eye) <= 1e-5, "{t:?} from {eye}");
            }
            assert!(whole.iter().all(|t| piece.facing(*t, eye) > 0.0));
            for (t, faced) in piece.triangles.iter().zip(&mut faced) {
                *faced |= piece.facing(*t, eye) > 0.0;
            }
        }
        // Nor is the test slack: what it keeps is seen from somewhere, but for what only the very corners see.
        let kept = piece.triangles.len() - culled.len();
        let seen = faced.iter().filter(|f| **f).count();
        assert!(seen <= kept && seen * 100 > kept * 97, "{seen} of {kept}");
    }

    #[test]
    fn a_length_is_what_the_nearest_of_the_eyes_sees() {
        let eyes = Eyes::new(&[DVec3::Z * 10.0, DVec3::Z * 20.0], 100.0);
        let px = eyes.length_px(Vec3::ZERO, Vec3::X);
        assert!((px - 10.0).abs() < 1e-4, "{px}");
        assert_eq!(eyes.length_px(Vec3::ZERO, Vec3::Z * 11.0), f32::INFINITY);
    }
}
