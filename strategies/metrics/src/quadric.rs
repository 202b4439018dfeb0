//! `quadric`: how far a collapse moves the surface, as a picture shows it. An alternative to `silhouette-weighted`.
//!
//! The quadric error of Garland and Heckbert (1997) on the vertices' own places, turned into pixels at the edge: with e the error
//! in scene units (root mean square distance to the planes of the original triangles),
//!
//! ```text
//! cost = e g,  g = the longest of the projections of three segments of the edge's length, along x, y and z, at its first end,
//!              over that length                                   pixels a scene unit
//! ```
//!
//! It knows no silhouettes, so it spends as much on the inside of a surface as on its outline; it does keep the mesh's
//! borders. What is collapsed costs at most `share` of the far field's tolerance. An estimate, no bound. O(1) an edge.

use farfield_core::Fault;
use farfield_core::collapse::{Candidate, Cost, LiveMesh, Placement, QuadricSettings, Quadrics, Reach};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The quadric error in pixels.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Quadric {
    /// The highest error, as a share of the far field's tolerance (which is an edge's length in pixels).
    #[serde(default = "tenth")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub share: f32,
    /// Weight of the planes that hold borders; 0 lets borders go.
    #[serde(default = "ten")]
    #[schemars(range(min = 0.0))]
    pub border_weight: f32,
}

fn tenth() -> f32 {
    0.1
}
fn ten() -> f32 {
    10.0
}

impl Default for Quadric {
    fn default() -> Self {
        Self { share: tenth(), border_weight: ten() }
    }
}

#[typetag::serde(name = "quadric")]
impl SimplificationMetric for Quadric {
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault> {
        if !(self.share.is_finite() && self.share > 0.0 && self.border_weight.is_finite() && self.border_weight >= 0.0)
        {
            let (a, b) = (self.share, self.border_weight);
            return Err(Fault::Refused(format!(
                "quadric: share = {a} has to be above 0 and border_weight = {b} at least 0"
            )));
        }
        let locked: Vec<bool> = seen.iter().map(|s| s.locked).collect();
        let live = LiveMesh::new(mesh.positions, mesh.indices, &locked)?;
        let settings = QuadricSettings {
            placement: Placement::HalfEdge,
            border_weight: self.border_weight,
            ..QuadricSettings::default()
        };
        Ok((Box::new(Worker { quadrics: Quadrics::new(&live, settings), px }), self.share * max_px))
    }
}

struct Worker<'a> {
    quadrics: Quadrics,
    px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
}

impl Cost for Worker<'_> {
    fn costs(&mut self, live: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.quadrics.costs(live, edges, out);
        for (&[a, b], out) in edges.iter().zip(out) {
            let (p, length) = (live.position(a), live.position(a).distance(live.position(b)));
            if out.cost > 0.0 && out.cost < f32::INFINITY && length > 0.0 {
                let longest = Vec3::AXES.iter().map(|&x| (self.px)(p, p + x * length)).fold(0.0, f32::max);
                out.cost *= longest / length;
            }
        }
    }

    fn collapsed(&mut self, live: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        self.quadrics.collapsed(live, from, onto, at);
    }

    fn reach(&self) -> Reach {
        self.quadrics.reach()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::collapse::{Settings, collapse};

    /// A field of n x n squares with a bump of this height in the middle.
    fn field(n: u32, bump: f32) -> (Vec<Vec3>, Vec<u32>) {
        let at = |x: u32, y: u32| x + y * (n + 1);
        let positions = (0..(n + 1) * (n + 1))
            .map(|i| (i % (n + 1), i / (n + 1)))
            .map(|(x, y)| Vec3::new(x as f32, y as f32, if (x, y) == (n / 2, n / 2) { bump } else { 0.0 }))
            .collect();
        let square = |i: u32| {
            let (x, y) = (i % n, i / n);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
        };
        (positions, (0..n * n).flat_map(square).collect())
    }

    fn triangles(bump: f32, px_per_unit: f32, max_px: f32) -> (usize, bool) {
        let (positions, indices) = field(10, bump);
        let normals = vec![Vec3::Z; positions.len()];
        let mesh = MeshView { positions: &positions, normals: &normals, albedo: &[], indices: &indices };
        let px = |a: Vec3, b: Vec3| a.truncate().distance(b.truncate()) * px_per_unit;
        let seen = vec![VertexSeen::default(); positions.len()];
        let (mut cost, max_cost) = Quadric::default().begin(mesh, &seen, &px, max_px).unwrap();
        let live = LiveMesh::new(&positions, &indices, &[]).unwrap();
        let out = collapse(live, cost.as_mut(), &Settings { max_cost, ..Settings::default() });
        (out.indices.len() / 3, out.remap[60] == 60)
    }

    #[test]
    fn flat_parts_go_and_a_bump_stays_while_its_height_shows() {
        let (flat, _) = triangles(0.0, 1.0, 1.0);
        assert!(flat <= 4, "{flat} triangles are left of a square");
        let (with_bump, bump_there) = triangles(2.0, 1.0, 1.0);
        assert!(bump_there && with_bump > flat, "{with_bump}");
        // From afar, at a hundredth of the pixels a unit, it does not show.
        let (far, bump_there) = triangles(2.0, 0.01, 1.0);
        assert!(!bump_there && far <= with_bump);
    }
}
