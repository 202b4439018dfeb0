//! `hausdorff`: how far a simplified surface is from the one that it began with, in both directions.
//!
//! What out-of-core simplification with guaranteed error tolerance steers by (Borodin, Guthe, Klein 2003; Guthe, Borodin, Balazs, Klein
//! 2004, section 3, its purely geometric measure). How the distance is had is not printed there. Here edges are priced by the distance of the
//! original vertices from what a collapse would leave (the file beside it, `deviation`), and by how far new edges pass over or under
//! those they replace; when all is done a bound of the two-sided Hausdorff distance is measured on the whole (`measured`), and that is
//! what was paid, as far as 32-bit arithmetic goes. It may be more than the dearest price: vertices are samples.
//!
//! Pixels: the largest projection of a segment along x, y or z. Where the far field's measure is the same everywhere (an object-space
//! hierarchy) the bound is exact in its unit.

use farfield_core::Fault;
use farfield_core::collapse::Cost;
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::deviation::Deviation;

/// The two-sided distance from the original surface.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hausdorff {}

#[typetag::serde(name = "hausdorff")]
impl SimplificationMetric for Hausdorff {
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        _seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault> {
        Ok((Box::new(Deviation::new(mesh, px, None, max_px)), max_px))
    }

    fn bounds_distance(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::MARGIN;
    use farfield_core::bvh::TriangleBvh;
    use farfield_core::collapse::{Collapsed, LiveMesh, Mode, Settings, collapse};
    use proptest::prelude::*;

    /// n x n squares over the unit square, at heights.
    fn field(n: u32, height: impl Fn(f32, f32) -> f32) -> (Vec<Vec3>, Vec<u32>) {
        let at = |x: u32, y: u32| x + y * (n + 1);
        let positions = (0..(n + 1) * (n + 1))
            .map(|i| ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32))
            .map(|(x, y)| Vec3::new(x, y, height(x, y)))
            .collect();
        let square = |i: u32| {
            let (x, y) = (i % n, i / n);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
        };
        (positions, (0..n * n).flat_map(square).collect())
    }

    fn simplified(positions: &[Vec3], indices: &[u32], most: f32, settings: Settings) -> Collapsed {
        let normals = vec![Vec3::Z; positions.len()];
        let mesh = MeshView { positions, normals: &normals, albedo: &[], indices };
        let px = |a: Vec3, b: Vec3| a.distance(b);
        let seen = vec![VertexSeen::default(); positions.len()];
        let (mut cost, max_cost) = Hausdorff::default().begin(mesh, &seen, &px, most).unwrap();
        collapse(LiveMesh::new(positions, indices, &[]).unwrap(), cost.as_mut(), &Settings { max_cost, ..settings })
    }

    /// The largest distance of points on one surface from another, on a lattice of k steps a triangle.
    fn sampled(positions: &[Vec3], from: &[u32], to: &[u32], k: u32) -> f32 {
        let bvh = TriangleBvh::build(positions, to);
        let mut most = 0f32;
        for t in from.chunks_exact(3) {
            let p = [0, 1, 2].map(|i| positions[t[i] as usize]);
            for (i, j) in (0..=k).flat_map(|i| (0..=k - i).map(move |j| (i, j))) {
                let (u, v) = (i as f32 / k as f32, j as f32 / k as f32);
                let at = p[0] * (1.0 - u - v) + p[1] * u + p[2] * v;
                most = most.max(bvh.closest_point(at, f32::INFINITY).map_or(f32::INFINITY, |n| n.distance));
            }
        }
        most
    }

    #[test]
    fn a_flat_square_costs_nothing_with_its_border() {
        let (positions, indices) = field(12, |_, _| 0.25);
        let out = simplified(&positions, &indices, 1e-6, Settings::default());
        eprintln!("{:?}", out.indices.iter().map(|&i| positions[i as usize]).collect::<Vec<_>>());
        assert_eq!(out.indices.len(), 6);
        assert!(out.max_cost <= 1e-6);
    }

    #[test]
    fn a_tip_costs_its_height() {
        // A pyramid of four triangles over a square: the tip onto a corner leaves the flat square.
        let positions = [
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(2.0, 2.0, 0.0),
            Vec3::new(0.0, 2.0, 0.0),
            Vec3::new(1.0, 1.0, 0.75),
        ];
        let indices = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4];
        // With what is added for what lies between vertices.
        let most = 0.75 * MARGIN;
        assert_eq!(simplified(&positions, &indices, 0.99 * most, Settings::default()).indices.len(), 12);
        let out = simplified(&positions, &indices, 1.01 * most, Settings::default());
        assert_eq!(out.indices.len(), 6);
        assert!((out.max_cost - 0.75).abs() < 1e-6, "{}", out.max_cost);
    }

    #[test]
    fn a_tip_over_a_new_edge_is_never_lost_to_rounding() {
        // A new edge from the survivor to the opposite corner passes right under the tip, whichever way all of it is turned.
        for i in 0..500 {
            let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, i as f32 * 0.37, i as f32 * 0.11, i as f32 * 0.71);
            let offset = Vec3::new(3.0, -7.0, 11.0) * (i % 5) as f32;
            let around = |k: u32| {
                let a = std::f32::consts::TAU * k as f32 / 6.0;
                turn * Vec3::new(a.cos(), a.sin(), 0.0) + offset
            };
            let positions: Vec<Vec3> = (0..6).map(around).chain([turn * (Vec3::Z * 0.2) + offset]).collect();
            let indices: Vec<u32> = (0..6).flat_map(|k| [k, (k + 1) % 6, 6]).collect();
            // The corners are held: the tip alone may go.
            let normals = vec![Vec3::Z; 7];
            let mesh = MeshView { positions: &positions, normals: &normals, albedo: &[], indices: &indices };
            let locked = [true, true, true, true, true, true, false];
            let px = |a: Vec3, b: Vec3| a.distance(b);
            let (mut cost, _) = Hausdorff::default().begin(mesh, &[], &px, 1.0).unwrap();
            let out =
                collapse(LiveMesh::new(&positions, &indices, &locked).unwrap(), cost.as_mut(), &Settings::default());
            assert_eq!(out.indices.len(), 12);
            assert!((out.max_cost - 0.2).abs() < 1e-4, "turned {i}: {}", out.max_cost);
        }
    }

    #[test]
    fn a_surface_never_vanishes() {
        for indices in [&[0u32, 1, 2][..], &[0, 1, 2, 2, 1, 3]] {
            let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
            let settings = Settings { link_condition: false, max_turn_rad: 4.0, ..Settings::default() };
            let out = simplified(&positions, indices, f32::MAX, settings);
            let bound = out.max_cost * (1.0 + 1e-5) + 1e-6;
            assert!(!out.indices.is_empty() && sampled(&positions, indices, &out.indices, 16) <= bound);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn no_point_is_farther_than_the_bound(
            waves in prop::collection::vec((0f32..9.0, 0f32..9.0, -0.1f32..0.1), 1..5), noise in 0f32..0.03,
            most in 0.002f32..0.3, batched: bool, link_condition: bool, fold: bool
        ) {
            let height = |x: f32, y: f32| {
                let rough = (((x * 913.0).sin() + (y * 717.0).cos()) * 4375.5).fract() * noise;
                waves.iter().map(|(a, b, h)| h * (a * x + b * y).sin()).sum::<f32>() + rough
            };
            let (positions, indices) = field(14, height);
            let settings = Settings {
                mode: if batched { Mode::Batched } else { Mode::Exact },
                link_condition,
                max_turn_rad: if fold { 4.0 } else { 1.3 },
                ..Settings::default()
            };
            let out = simplified(&positions, &indices, most, settings);
            let bound = out.max_cost * (1.0 + 1e-4) + 1e-6;
            prop_assert!(out.max_cost <= most && out.indices.len() < indices.len());
            let there = sampled(&positions, &indices, &out.indices, 4);
            let back = sampled(&positions, &out.indices, &indices, 12);
            prop_assert!(there.max(back) <= bound, "{there} {back} {bound}");
            // Nor is it much more than what is found.
            prop_assert!(out.max_cost <= 1.5 * there.max(back).max(0.5 * most), "{there} {back} {}", out.max_cost);
        }
    }
}
