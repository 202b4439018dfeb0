//! The geometry of a node while the tree is built: welded, with the leaves that share each vertex.

use std::collections::HashMap;
use std::ops::Range;

use farfield_core::Fault;
use farfield_core::collapse::{LiveMesh, Mode, Settings, collapse};
use farfield_core::id::ObjectId;
use farfield_core::scene::{Gathered, Wedge};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A node's geometry, positions not yet rounded.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct Piece {
    /// Welded; it lists no textured triangles.
    pub(crate) mesh: Gathered,
    /// For each vertex the first and the last leaf that use it.
    pub(crate) spans: Vec<[u32; 2]>,
    /// No point of it lies farther from the original, nor the other way round, scene units.
    pub(crate) error: f32,
}

impl Piece {
    /// Several in one, welded again where they were divided. O(vertices + triangles).
    pub(crate) fn joined(pieces: &[&Self]) -> Self {
        let mut out = Self::default();
        let mut border: HashMap<(ObjectId, u32), (u32, Vec<u32>)> = HashMap::new();
        for p in pieces {
            (out.error, out.mesh.origin) = (out.error.max(p.error), p.mesh.origin);
            let mut add = |v: usize| {
                out.mesh.positions.push(p.mesh.positions[v]);
                out.mesh.names.push(p.mesh.names[v]);
                out.spans.push(p.spans[v]);
                out.mesh.positions.len() as u32 - 1
            };
            let shared = |v: usize| p.spans[v][0] != p.spans[v][1];
            let vertices: Vec<u32> = (0..p.mesh.positions.len())
                .map(|v| {
                    if shared(v) { border.entry(p.mesh.names[v]).or_insert_with(|| (add(v), vec![])).0 } else { add(v) }
                })
                .collect();
            let all = &mut out.mesh.wedges;
            let wedges: Vec<u32> = (p.mesh.wedges.iter())
                .map(|w| {
                    let own = Wedge { vertex: vertices[w.vertex as usize], ..*w };
                    let known = shared(w.vertex as usize).then(|| border.get_mut(&p.mesh.names[w.vertex as usize]));
                    let known = known.flatten().map(|k| &mut k.1);
                    if let Some(&i) = known.iter().flat_map(|k| k.iter()).find(|&&i| all[i as usize] == own) {
                        return i;
                    }
                    all.push(own);
                    let i = all.len() as u32 - 1;
                    known.into_iter().for_each(|k| k.push(i));
                    i
                })
                .collect();
            out.mesh.corners.extend(p.mesh.corners.iter().map(|c| c.map(|w| wedges[w as usize])));
            out.mesh.two_sided.extend(&p.mesh.two_sided);
        }
        out
    }

    /// Whether each vertex is used outside the leaves `own`.
    pub(crate) fn outside(&self, own: &Range<u32>) -> impl Iterator<Item = bool> {
        self.spans.iter().map(|s| !own.contains(&s[0]) || !own.contains(&s[1]))
    }

    /// Smooths the normals of vertices all of whose triangles are smaller than `size`, so that shading does not alias (section 3.1): the
    /// mean of its triangles' normals at their corners. Those used outside `own`, and seams, keep theirs.
    pub(crate) fn smooth(&mut self, own: &Range<u32>, size: f32) {
        let m = &self.mesh;
        let mut kept: Vec<bool> = self.outside(own).collect();
        let mut wedge = vec![u32::MAX; m.positions.len()];
        for (i, w) in (0u32..).zip(&m.wedges) {
            let first = &mut wedge[w.vertex as usize];
            kept[w.vertex as usize] |= *first != u32::MAX;
            *first = i;
        }
        let mut sums = vec![Vec3::ZERO; m.positions.len()];
        for &c in &m.corners {
            let ([a, b, d], v) = (m.places(c), m.vertices(c));
            let edges = [a.distance(b), b.distance(d), d.distance(a)];
            let large = edges.iter().any(|e| e.is_nan() || *e >= size);
            let mean = c.iter().map(|&w| m.wedges[w as usize].normal).sum::<Vec3>();
            for v in v {
                kept[v as usize] |= large;
                sums[v as usize] += mean;
            }
        }
        for v in (0..kept.len()).filter(|&v| !kept[v] && wedge[v] != u32::MAX) {
            let own = &mut self.mesh.wedges[wedge[v] as usize].normal;
            *own = sums[v].try_normalize().unwrap_or(*own);
        }
    }

    /// Simplified by at most `allowance` beyond what it is off already. Vertices used outside `own` stay, so that no neighbour at any level
    /// is torn off; seams stay, since a vertex has one normal and one albedo while it is priced.
    ///
    /// # Errors
    /// What the metric gives.
    pub(crate) fn simplified(
        self,
        own: &Range<u32>,
        allowance: f32,
        metric: &dyn SimplificationMetric,
    ) -> Result<Self, Fault> {
        let budget = allowance - self.error;
        if budget.is_nan() || budget <= 0.0 || self.mesh.corners.is_empty() {
            return Ok(self);
        }
        let m = &self.mesh;
        let wedges = m.wedges_of_vertices();
        let locked: Vec<bool> = self.outside(own).zip(wedges.iter()).map(|(out, w)| out || w.len() > 1).collect();
        let first = |v: &[u32]| v.first().map(|&w| m.wedges[w as usize]);
        let normals: Vec<Vec3> = wedges.iter().map(|v| first(v).map_or(Vec3::Y, |w| w.normal)).collect();
        let albedo: Vec<[u8; 4]> = wedges.iter().map(|v| first(v).map_or([0; 4], |w| w.albedo)).collect();
        let indices: Vec<u32> = m.corners.iter().flat_map(|&c| m.vertices(c)).collect();
        let seen: Vec<VertexSeen> = locked.iter().map(|&locked| VertexSeen { locked, ..Default::default() }).collect();
        let view = MeshView { positions: &m.positions, normals: &normals, albedo: &albedo, indices: &indices };
        let length = |a: Vec3, b: Vec3| a.distance(b);
        let (mut cost, max_cost) = metric.begin(view, &seen, &length, budget)?;
        let settings = Settings { mode: Mode::Batched, max_cost, link_condition: false, ..Settings::default() };
        let left = collapse(LiveMesh::new(&m.positions, &indices, &locked)?, cost.as_mut(), &settings);
        drop(cost);
        let corner = |w: u32| {
            let wedge = &m.wedges[w as usize];
            let vertex = left.remap[wedge.vertex as usize];
            if vertex == wedge.vertex { w } else { m.alike(wedges.of(vertex), wedge) }
        };
        let corners = left.triangles.iter().map(|&t| m.corners[t as usize].map(corner)).collect();
        let two_sided = left.triangles.iter().map(|&t| m.two_sided[t as usize]).collect();
        Ok(self.compact(corners, two_sided, left.max_cost))
    }

    /// With other triangles, and only what they use.
    fn compact(self, mut corners: Vec<[u32; 3]>, two_sided: Vec<bool>, more: f32) -> Self {
        let (m, spans) = (self.mesh, self.spans);
        let mut out = Self { error: self.error + more, ..Self::default() };
        let (mut vertices, mut wedges) = (vec![u32::MAX; m.positions.len()], vec![u32::MAX; m.wedges.len()]);
        for w in corners.iter_mut().flatten() {
            let at = &mut wedges[*w as usize];
            if *at == u32::MAX {
                let wedge = m.wedges[*w as usize];
                let v = wedge.vertex as usize;
                if vertices[v] == u32::MAX {
                    vertices[v] = out.mesh.positions.len() as u32;
                    out.mesh.positions.push(m.positions[v]);
                    out.mesh.names.push(m.names[v]);
                    out.spans.push(spans[v]);
                }
                *at = out.mesh.wedges.len() as u32;
                out.mesh.wedges.push(Wedge { vertex: vertices[v], ..wedge });
            }
            *w = *at;
        }
        (out.mesh.origin, out.mesh.corners, out.mesh.two_sided) = (m.origin, corners, two_sided);
        out
    }
}
