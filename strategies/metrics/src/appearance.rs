//! `appearance`: how far one has to go on the simplified surface to find what the original looked like.
//!
//! The measure of Guthe, Borodin, Balazs and Klein (2004, section 3.1): e^2 = e_geo^2 + e_app^2, where e_geo is the geometric distance
//! (`hausdorff`) and, for a vertex that died,
//!
//! ```text
//! e_app = arccos(n . n_int) / kappa_1,    kappa_1 = max over the triangle's edges of arccos(n_a . n_b) / |P_a - P_b|
//! ```
//!
//! n is its normal, n_int the one that is interpolated at its place on the simplified surface, kappa_1 how fast normals turn there. Any
//! attribute with a distance works so: albedo with the largest difference of a channel. The larger of the two counts.
//!
//! Every dead vertex is kept, under the triangle that covers it, and looked at again whenever that triangle changes: e_app is what the
//! formula says of all of them, never a sum of estimates. Between vertices, and where a triangle's attributes hardly vary, it is an
//! estimate; only of e_geo a bound is measured when all is done.
//!
//! Traps: angles are taken from sine and cosine, so that rounding over 1 does no harm. On a triangle without any variation kappa_1 is 0
//! and no other place looks otherwise: what differs there costs infinity, what does not differ nothing. Differences of less than
//! half a grey level of Lambert's shading, 1/510, do not count.

use farfield_core::Fault;
use farfield_core::collapse::Cost;
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::deviation::{Deviation, Foot};

/// A difference of attributes that nobody sees: radians of a normal, since |d cos| <= |d angle|, and parts of white of an albedo.
const LEAST: f32 = 0.5 / 255.0;

/// Geometric distance and distance to the same looks.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Appearance {}

#[typetag::serde(name = "appearance")]
impl SimplificationMetric for Appearance {
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        _seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault> {
        if mesh.normals.len() != mesh.positions.len()
            || !(mesh.albedo.is_empty() || mesh.albedo.len() == mesh.positions.len())
        {
            let (n, a, p) = (mesh.normals.len(), mesh.albedo.len(), mesh.positions.len());
            let cause = format!("{n} normals and {a} albedos for {p} positions");
            return Err(Fault::Data { place: "appearance".into(), cause });
        }
        let looks = Looks { normals: mesh.normals, albedo: mesh.albedo };
        Ok((Box::new(Deviation::new(mesh, px, Some(looks), max_px)), max_px))
    }

    fn bounds_distance(&self) -> bool {
        true
    }
}

/// What vertices look like.
pub(crate) struct Looks<'a> {
    normals: &'a [Vec3],
    albedo: &'a [[u8; 4]],
}

impl Looks<'_> {
    /// How far the looks of a vertex are from its foot, scene units.
    pub(crate) fn off(&self, positions: &[Vec3], v: u32, &Foot { corners, weights: w, .. }: &Foot) -> f32 {
        let p = corners.map(|c| positions[c as usize]);
        let n = corners.map(|c| self.normals[c as usize]);
        let between = |x: [Vec3; 3]| x[0] * w[0] + x[1] * w[1] + x[2] * w[2];
        let turn = away(angle(self.normals[v as usize], between(n).normalize_or_zero()), |i, j| angle(n[i], n[j]), &p);
        if self.albedo.is_empty() {
            return turn;
        }
        let [a, b, c] = corners.map(|c| unit(self.albedo[c as usize]));
        let colours = [a, b, c];
        let off = |x: Vec3, y: Vec3| (x - y).abs().max_element();
        turn.max(away(off(unit(self.albedo[v as usize]), between(colours)), |i, j| off(colours[i], colours[j]), &p))
    }
}

/// A difference over how fast it varies along a triangle's edges: a length.
fn away(difference: f32, along: impl Fn(usize, usize) -> f32, p: &[Vec3; 3]) -> f32 {
    if difference <= LEAST {
        return 0.0;
    }
    let steepest = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| {
        let length = p[i].distance(p[j]);
        if length > 0.0 { along(i, j) / length } else { 0.0 }
    });
    difference / steepest.into_iter().fold(0.0, f32::max)
}

/// The angle between two vectors, radians, exact near 0 too.
fn angle(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}

fn unit(c: [u8; 4]) -> Vec3 {
    Vec3::new(f32::from(c[0]), f32::from(c[1]), f32::from(c[2])) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::collapse::{Collapsed, LiveMesh, Settings, collapse};

    /// n x n unit squares in the plane.
    fn plane(n: u32) -> (Vec<Vec3>, Vec<u32>) {
        let at = |x: u32, y: u32| x + y * (n + 1);
        let positions = (0..(n + 1) * (n + 1)).map(|i| Vec3::new((i % (n + 1)) as f32, (i / (n + 1)) as f32, 0.0));
        let square = |i: u32| {
            let (x, y) = (i % n, i / n);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
        };
        (positions.collect(), (0..n * n).flat_map(square).collect())
    }

    fn simplified(positions: &[Vec3], indices: &[u32], normals: &[Vec3], albedo: &[[u8; 4]], most: f32) -> Collapsed {
        let mesh = MeshView { positions, normals, albedo, indices };
        let px = |a: Vec3, b: Vec3| a.distance(b);
        let seen = vec![VertexSeen::default(); positions.len()];
        let (mut cost, max_cost) = Appearance::default().begin(mesh, &seen, &px, most).unwrap();
        let live = LiveMesh::new(positions, indices, &[]).unwrap();
        collapse(live, cost.as_mut(), &Settings { max_cost, ..Settings::default() })
    }

    #[test]
    fn a_flat_plane_goes_and_what_looks_otherwise_nowhere_else_stays() {
        let (positions, indices) = plane(8);
        // Slightly longer than 1: dot products round over it.
        let mut normals = vec![Vec3::Z * (1.0 + f32::EPSILON); positions.len()];
        let mut albedo = vec![[90, 90, 90, 255]; positions.len()];
        assert_eq!(simplified(&positions, &indices, &normals, &albedo, 1e-3).indices.len(), 6);
        normals[40] = Vec3::new(0.3, 0.0, 1.0).normalize();
        let out = simplified(&positions, &indices, &normals, &albedo, 0.4);
        assert!(out.remap[40] == 40 && out.indices.len() > 6);
        normals[40] = Vec3::Z;
        albedo[30] = [200, 90, 90, 255];
        let out = simplified(&positions, &indices, &normals, &albedo, 0.4);
        assert!(out.remap[30] == 30 && out.remap[40] != 40);
        // A difference of less than half a grey level is none.
        albedo[30] = [90, 90, 90, 0];
        assert_eq!(simplified(&positions, &indices, &normals, &albedo, 1e-3).indices.len(), 6);
    }

    #[test]
    fn an_even_gradient_costs_nothing() {
        let (positions, indices) = plane(8);
        let normals = vec![Vec3::Z; positions.len()];
        let albedo: Vec<[u8; 4]> = positions.iter().map(|p| [(p.x * 20.0) as u8, (p.y * 10.0) as u8, 0, 255]).collect();
        assert_eq!(simplified(&positions, &indices, &normals, &albedo, 1e-3).indices.len(), 6);
    }

    #[test]
    fn on_a_sphere_the_distance_is_the_arc() {
        // kappa_1 of a sphere of radius r is nearly 1 / r, so an angle a is found a r away: a little less than 1 / r along chords.
        let r = 3.0;
        let p = [Vec3::X, Vec3::new(0.98, 0.2, 0.0).normalize(), Vec3::new(0.98, 0.0, 0.2).normalize()];
        let along = |i: usize, j: usize| angle(p[i], p[j]);
        let off = away(0.05, along, &p.map(|p| p * r));
        assert!((off / (0.05 * r) - 1.0).abs() < 0.01, "{off}");
        assert_eq!(away(LEAST, along, &p), 0.0);
        assert_eq!(away(0.1, |_, _| 0.0, &p), f32::INFINITY);
    }

    #[test]
    fn angles_are_exact_near_nothing_and_finite_for_rounded_normals() {
        let n = Vec3::new(0.6, 0.8, 0.0) * (1.0 + 3.0 * f32::EPSILON);
        assert_eq!(angle(n, n), 0.0);
        let tilted = Vec3::new(1e-5, 0.0, 1.0);
        assert!((angle(Vec3::Z, tilted) - 1e-5).abs() < 1e-9);
        assert!((angle(Vec3::X, -Vec3::X) - std::f32::consts::PI).abs() < 1e-6);
    }

    #[test]
    fn what_has_no_triangle_to_lie_on_keeps_its_looks() {
        // A flap of two triangles back to back on the edge of two others: its tip looks otherwise.
        let positions = [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.5, -0.01, 0.0)];
        let indices = [0, 1, 2, 0, 2, 1, 0, 3, 1, 1, 3, 0];
        let mut normals = [Vec3::Z; 4];
        normals[3] = Vec3::new(0.0, 0.6, 0.8);
        let simplify = |normals: &[Vec3]| {
            let mesh = MeshView { positions: &positions, normals, albedo: &[], indices: &indices };
            let px = |a: Vec3, b: Vec3| a.distance(b);
            let (mut cost, max_cost) = Appearance::default().begin(mesh, &[], &px, 0.9).unwrap();
            let settings = Settings { max_cost, link_condition: false, max_turn_rad: 4.0, ..Settings::default() };
            let live = LiveMesh::new(&positions, &indices, &[true, true, true, false]).unwrap();
            collapse(live, cost.as_mut(), &settings).remap[3]
        };
        assert_eq!(simplify(&normals), 3);
    }

    #[test]
    fn a_dead_vertex_keeps_its_say() {
        // A strip whose normals swing more and more: what died early still bounds what is collapsed late.
        let (positions, indices) = plane(10);
        let normals: Vec<Vec3> = positions
            .iter()
            .map(|p| Vec3::new((p.x * 0.9).sin() * 0.4, (p.y * 0.7).cos() * 0.2, 1.0).normalize())
            .collect();
        let most = 0.6;
        let out = simplified(&positions, &indices, &normals, &[], most);
        assert!(out.indices.len() < indices.len());
        // Every vertex, dead or not, finds its normal within `most` by the formula on the triangle that covers it.
        for (v, &p) in positions.iter().enumerate() {
            let least = out.indices.chunks_exact(3).filter_map(|t| {
                let t = [t[0], t[1], t[2]];
                let c = t.map(|i| out.positions[i as usize]);
                let [a, b, q] = [c[1] - c[0], c[2] - c[0], p - c[0]].map(|v| v.truncate());
                let [x, y] = [q.perp_dot(b), a.perp_dot(q)].map(|w| w / a.perp_dot(b));
                if !(x >= 0.0 && y >= 0.0 && x + y <= 1.0) {
                    return None;
                }
                let n = t.map(|i| normals[i as usize]);
                let between = (n[0] * (1.0 - x - y) + n[1] * x + n[2] * y).normalize();
                Some(away(angle(normals[v], between), |i, j| angle(n[i], n[j]), &c))
            });
            let least = least.fold(f32::INFINITY, f32::min);
            assert!(least <= most * 1.001, "vertex {v}: {least}");
        }
    }

    #[test]
    fn attributes_that_do_not_fit_are_refused() {
        let (positions, indices) = plane(2);
        let mesh = MeshView { positions: &positions, normals: &[], albedo: &[], indices: &indices };
        let px = |a: Vec3, b: Vec3| a.distance(b);
        assert!(Appearance::default().begin(mesh, &[], &px, 1.0).is_err());
    }
}
