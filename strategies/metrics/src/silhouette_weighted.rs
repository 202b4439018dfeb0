//! `silhouette-weighted`: edges are dear where silhouettes run, where the surface bends and where they are long in the picture.
//!
//! Follows textured LOD meshes (2003, sections 3.1.3 and 3.1.4):
//!
//! ```text
//! cost(i, j) = cost_scale (1.5 - n_i . n_j)^2 l (w_i + w_j)     compared with T_l, pixels
//! ```
//!
//! n are unit vertex normals, l the edge's projected length in pixels (from the cell's centre, or the longest from its corners), w
//! the weights that the far field found on its depth images. The lighter vertex goes onto the heavier one; a locked vertex counts as
//! heavier than all others.
//!
//! Deviations, on purpose:
//!
//! * `cost_scale` (8; 1 is the printed formula). With the printed formula and the printed tolerances meshes come out 3 to 10 times
//!   too coarse; with weights relative to the interior weight 0.125, which is 8 times the cost, the published numbers come out.
//! * Equal weights: of the two directions the one onto the smaller vertex id is taken, so that results depend on nothing else.
//!
//! O(1) an edge with kept normals, O(valence) with recomputed ones.

use farfield_core::Fault;
use farfield_core::collapse::{Candidate, Cost, LiveMesh, Place, Reach};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The cost of textured LOD meshes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SilhouetteWeighted {
    /// Factor on the printed cost; 1 is the printed formula.
    #[serde(default = "eight")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub cost_scale: f32,
    /// Which normals the bend is measured on.
    #[serde(default)]
    pub normals: Normals,
}

/// Normals under collapse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Normals {
    /// Those of the original vertices.
    #[default]
    Kept,
    /// Area-weighted ones of the triangles as they are.
    Recomputed,
}

fn eight() -> f32 {
    8.0
}

impl Default for SilhouetteWeighted {
    fn default() -> Self {
        Self { cost_scale: eight(), normals: Normals::default() }
    }
}

#[typetag::serde(name = "silhouette-weighted")]
impl SimplificationMetric for SilhouetteWeighted {
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault> {
        if !(self.cost_scale.is_finite() && self.cost_scale > 0.0) {
            let given = self.cost_scale;
            return Err(Fault::Refused(format!("silhouette-weighted: cost_scale = {given} is not a number above 0")));
        }
        if mesh.normals.len() != mesh.positions.len() || seen.len() != mesh.positions.len() {
            let (n, m, k) = (mesh.normals.len(), seen.len(), mesh.positions.len());
            let cause = format!("{n} normals and {m} weights for {k} vertices");
            return Err(Fault::Data { place: "mesh to simplify".into(), cause });
        }
        let worker = Worker { scale: self.cost_scale, recompute: self.normals == Normals::Recomputed, mesh, seen, px };
        Ok((Box::new(worker), max_px))
    }
}

struct Worker<'a> {
    scale: f32,
    recompute: bool,
    mesh: MeshView<'a>,
    seen: &'a [VertexSeen],
    px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
}

impl Worker<'_> {
    fn normal(&self, live: &LiveMesh, v: u32) -> Vec3 {
        let kept = self.mesh.normals[v as usize];
        if !self.recompute {
            return kept;
        }
        let unit = live.unit();
        let sum: Vec3 = live
            .triangles_of(v)
            .iter()
            .map(|&t| {
                let [a, b, c] = live.corners(t).map(|v| live.position(v));
                ((b - a) * unit).cross((c - a) * unit)
            })
            .sum();
        sum.try_normalize().unwrap_or(kept)
    }
}

impl Cost for Worker<'_> {
    fn costs(&mut self, live: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (&[a, b], out) in edges.iter().zip(out) {
            let (i, j) = (&self.seen[a as usize], &self.seen[b as usize]);
            let place = match (i.locked, j.locked) {
                (true, true) => {
                    *out = Candidate::FORBIDDEN;
                    continue;
                }
                (true, false) => Place::First,
                (false, true) => Place::Second,
                (false, false) if j.weight > i.weight => Place::Second,
                (false, false) => Place::First,
            };
            let bend = 1.5 - self.normal(live, a).dot(self.normal(live, b));
            let l = (self.px)(live.position(a), live.position(b));
            *out = Candidate { cost: self.scale * bend * bend * l * (i.weight + j.weight), place };
        }
    }

    fn reach(&self) -> Reach {
        if self.recompute { Reach::Ring } else { Reach::Ends }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::collapse::{Settings, collapse};

    /// A fan of four triangles round vertex 4; the rim is heavier.
    fn fan() -> (Vec<Vec3>, Vec<Vec3>, Vec<u32>) {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y, Vec3::new(0.5, 0.5, 0.0)];
        (positions, vec![Vec3::Z; 5], vec![0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4])
    }

    fn run(metric: &dyn SimplificationMetric, seen: &[VertexSeen], normals: &[Vec3], max_px: f32) -> (Vec<u32>, f32) {
        let (positions, _, indices) = fan();
        let mesh = MeshView { positions: &positions, normals, albedo: &[], indices: &indices };
        let px = |a: Vec3, b: Vec3| a.distance(b) * 10.0;
        let (mut cost, max_cost) = metric.begin(mesh, seen, &px, max_px).unwrap();
        let live = LiveMesh::new(&positions, &indices, &[]).unwrap();
        let out = collapse(live, cost.as_mut(), &Settings { max_cost, ..Settings::default() });
        (out.remap, out.max_cost)
    }

    fn weights(rim: f32, hub: f32) -> Vec<VertexSeen> {
        [rim, rim, rim, rim, hub].map(|weight| VertexSeen { weight, ..VertexSeen::default() }).to_vec()
    }

    #[test]
    fn the_cost_is_the_papers_and_the_lighter_vertex_goes() {
        // 8 (1.5 - 1)^2 (10 sqrt(1/2) px) (0.4 + 0.125)
        let expected = 8.0 * 0.25 * 50f32.sqrt() * 0.525;
        let (remap, paid) = run(&SilhouetteWeighted::default(), &weights(0.4, 0.125), &[Vec3::Z; 5], expected + 1e-3);
        assert_eq!(remap[4], 0);
        assert_eq!(remap[..4], [0, 1, 2, 3]);
        assert!((paid - expected).abs() < 1e-4);
        let (remap, _) = run(&SilhouetteWeighted::default(), &weights(0.4, 0.125), &[Vec3::Z; 5], expected - 1e-3);
        assert_eq!(remap, [0, 1, 2, 3, 4]);
        // The printed formula is an eighth of it.
        let printed = SilhouetteWeighted { cost_scale: 1.0, ..Default::default() };
        let (remap, paid) = run(&printed, &weights(0.4, 0.125), &[Vec3::Z; 5], expected / 8.0 + 1e-3);
        assert!(remap[4] == 0 && (paid - expected / 8.0).abs() < 1e-4);
    }

    #[test]
    fn locked_vertices_stay_however_light_they_are() {
        let mut seen = weights(0.05, 0.5);
        seen.iter_mut().take(4).for_each(|s| s.locked = true);
        let (remap, _) = run(&SilhouetteWeighted::default(), &seen, &[Vec3::Z; 5], 100.0);
        assert_eq!(remap[..4], [0, 1, 2, 3]);
        assert!(remap[4] < 4);
    }

    #[test]
    fn bent_surfaces_are_dearer_and_recomputed_normals_see_the_triangles() {
        let mut normals = [Vec3::Z; 5];
        normals[4] = Vec3::X;
        // (1.5 - 0)^2 instead of (1.5 - 1)^2: nine times the cost.
        let flat = 8.0 * 0.25 * 50f32.sqrt() * 0.25;
        let kept = SilhouetteWeighted::default();
        assert_eq!(run(&kept, &weights(0.125, 0.125), &normals, flat * 8.9).0[4], 4);
        assert_eq!(run(&kept, &weights(0.125, 0.125), &normals, flat * 9.1).0[4], 0);
        let recomputed = SilhouetteWeighted { normals: Normals::Recomputed, ..Default::default() };
        assert_eq!(run(&recomputed, &weights(0.125, 0.125), &normals, flat * 1.1).0[4], 0);
    }
}
