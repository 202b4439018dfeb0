//! One group of neighbouring clusters: merged, simplified to half its triangles, and split into new clusters; all three by meshoptimizer
//! (Kapoulkine; crate meshopt).
//!
//! Vertices are wedges, so that seams keep their sides; vertices at one place are welded by meshoptimizer itself, by equal positions. A
//! locked place keeps all its wedges, and no edge between two locked places at the group's border goes: what borders the group fits its
//! new clusters as it fitted the old ones.
//!
//! meshoptimizer's error is an estimate: the root of a weighted mean of squared distances to the planes around a vertex, with
//! attributes' differences added. It is no bound on any distance. O(n log n) for n triangles.

use std::collections::HashMap;

use farfield_core::Fault;
use farfield_core::scene::Gathered;
use glam::Vec3;
use meshopt::{SimplifyOptions, VertexDataAdapter};

use crate::ClusterLod;

/// A simplified group is worth its bytes with at most this share of the triangles it had (0.5 is asked for); else its clusters wait for
/// other neighbours. meshoptimizer's own builder of hierarchies has the same.
const MOST_LEFT: f32 = 0.85;

/// A group after simplification.
pub(crate) struct Simplified {
    /// Triangles of each new cluster, a wedge a corner; at least one cluster.
    pub(crate) clusters: Vec<Vec<[u32; 3]>>,
    /// meshoptimizer's estimate, scene units.
    pub(crate) error: f32,
    /// Mean edge length of the triangles that are left, scene units.
    pub(crate) mean_edge: f32,
}

/// The group of `corners`, simplified; `None` where that does not get far enough. `locked` tells of each welded vertex whether it stays.
///
/// # Errors
/// [`Fault::Data`] where meshoptimizer does not take the vertices.
pub(crate) fn simplify(
    own: &ClusterLod,
    source: &Gathered,
    corners: &[[u32; 3]],
    locked: &[bool],
) -> Result<Option<Simplified>, Fault> {
    // Vertices of the group alone: what is done here must not depend on the size of the whole.
    let mut wedges: Vec<u32> = corners.iter().flatten().copied().collect();
    wedges.sort_unstable();
    wedges.dedup();
    let local: HashMap<u32, u32> = wedges.iter().copied().zip(0..).collect();
    let vertex = |w: &u32| source.wedges[*w as usize].vertex as usize;
    let positions: Vec<Vec3> = wedges.iter().map(|w| source.positions[vertex(w)]).collect();
    if !positions.iter().all(|p| p.is_finite()) {
        return Ok(None);
    }
    let attributes: Vec<[f32; 6]> = wedges
        .iter()
        .map(|w| {
            let Vec3 { x, y, z } = source.wedges[*w as usize].normal;
            let [r, g, b, _] = source.wedges[*w as usize].albedo.map(|c| f32::from(c) / 255.0);
            [x, y, z, r, g, b]
        })
        .collect();
    let locks: Vec<bool> = wedges.iter().map(|w| locked[vertex(w)]).collect();
    let indices: Vec<u32> = corners.iter().flatten().map(|w| local[w]).collect();
    let vertices = VertexDataAdapter::new(bytemuck::cast_slice(&positions), size_of::<Vec3>(), 0)
        .map_err(|e| Fault::Data { place: "cluster-lod: a group".into(), cause: e.to_string() })?;
    let (n, a) = (own.normal_weight, own.albedo_weight);
    let mut error = 0.0;
    let left = meshopt::simplify_with_attributes_and_locks(
        &indices,
        &vertices,
        attributes.as_flattened(),
        &[n, n, n, a, a, a],
        size_of::<[f32; 6]>(),
        &locks,
        corners.len() / 2 * 3,
        f32::MAX,
        // Permissive: collapses may cross seams at the price of their attributes, or faceted models would keep every triangle.
        SimplifyOptions::ErrorAbsolute | SimplifyOptions::ErrorClamped | SimplifyOptions::Permissive,
        Some(&mut error),
    );
    if left.is_empty() || left.len() as f32 > MOST_LEFT * indices.len() as f32 || !error.is_finite() {
        return Ok(None);
    }
    let edge = |t: &[u32]| -> f32 {
        let p = [0, 1, 2].map(|k| positions[t[k] as usize]);
        p[0].distance(p[1]) + p[1].distance(p[2]) + p[2].distance(p[0])
    };
    let mean_edge = left.chunks_exact(3).map(edge).sum::<f32>() / left.len() as f32;
    Ok(Some(Simplified { clusters: split(own, &left, &vertices, &wedges), error, mean_edge }))
}

/// Triangles in clusters. The least size and the factor from which scattered clusters are split are those of meshoptimizer's own
/// builder of hierarchies.
fn split(own: &ClusterLod, indices: &[u32], vertices: &VertexDataAdapter<'_>, wedges: &[u32]) -> Vec<Vec<[u32; 3]>> {
    let most = own.cluster_triangles as usize;
    let least = most / 12 * 4;
    let all = meshopt::build_meshlets_flex(indices, vertices, most.min(256), least, most, 0.0, 2.0);
    let triangles = |m: meshopt::Meshlet<'_>| {
        let corner = |i: &u8| wedges[m.vertices[usize::from(*i)] as usize];
        m.triangles.chunks_exact(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]).collect()
    };
    all.iter().map(triangles).collect()
}
