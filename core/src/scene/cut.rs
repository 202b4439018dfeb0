//! Cutting a mesh into chunks: an octree in the mesh's own space, by the triangles' centroids, one material a chunk.
//! O(n log n).

use glam::Vec3;

use crate::Aabb;
use crate::id::MaterialId;
use crate::mesh::{ChunkMesh, MeshChunk, TriangleMesh, position_ids};

/// The most triangles of a chunk: small enough to cull finely, large enough for one draw.
pub const MAX_CHUNK_TRIANGLES: usize = 4096;

/// A mesh in chunks: what is known of each, and each.
pub struct CutMesh {
    /// The chunks' descriptions.
    pub infos: Vec<MeshChunk>,
    /// The chunks.
    pub chunks: Vec<ChunkMesh>,
    /// Positions that differ.
    pub vertex_ids: u32,
}

/// Cuts `mesh` until no chunk has more than `max_triangles`. Normals are made where the mesh has none.
///
/// # Panics
/// When indices or sections of the mesh are out of range: importers check them.
pub fn cut(mut mesh: TriangleMesh, max_triangles: usize) -> CutMesh {
    if mesh.normals.len() != mesh.positions.len() {
        mesh.smooth_normals();
    }
    let first = position_ids(&mesh.positions);
    let mut names = vec![u32::MAX; mesh.positions.len()];
    let mut vertex_ids = 0;
    for (i, &f) in first.iter().enumerate() {
        if f as usize == i {
            names[i] = vertex_ids;
            vertex_ids += 1;
        }
    }
    let names: Vec<u32> = first.iter().map(|&f| names[f as usize]).collect();

    let (mut infos, mut chunks) = (vec![], vec![]);
    let mut local = vec![u32::MAX; mesh.positions.len()];
    for (range, material) in &mesh.sections {
        let triangles: Vec<u32> = (range.start / 3..range.end / 3).collect();
        let centroid = |t: u32| -> Vec3 {
            let at = |k| mesh.positions[mesh.indices[3 * t as usize + k] as usize] / 3.0;
            at(0) + at(1) + at(2)
        };
        let bounds = Aabb::of(triangles.iter().map(|&t| centroid(t)));
        divide(triangles, bounds, max_triangles.max(1), 0, &centroid, &mut |part| {
            let (info, chunk) = compact(&mesh, &names, part, *material, &mut local);
            infos.push(info);
            chunks.push(chunk);
        });
    }
    CutMesh { infos, chunks, vertex_ids }
}

/// Octree division in Morton order; the depth limit stops coincident centroids, which are then cut by number.
fn divide(
    triangles: Vec<u32>,
    bounds: Aabb,
    max: usize,
    depth: u32,
    centroid: &dyn Fn(u32) -> Vec3,
    emit: &mut dyn FnMut(&[u32]),
) {
    if triangles.is_empty() {
        return;
    }
    if triangles.len() <= max {
        return emit(&triangles);
    }
    if depth == 24 {
        return triangles.chunks(max).for_each(emit);
    }
    let c = bounds.centre();
    let mut parts: [Vec<u32>; 8] = Default::default();
    for t in triangles {
        let p = centroid(t);
        parts[usize::from(p.x > c.x) | usize::from(p.y > c.y) << 1 | usize::from(p.z > c.z) << 2].push(t);
    }
    for (i, part) in parts.into_iter().enumerate() {
        let high = glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
        let b = Aabb { min: Vec3::select(high, c, bounds.min), max: Vec3::select(high, bounds.max, c) };
        divide(part, b, max, depth + 1, centroid, emit);
    }
}

fn compact(
    mesh: &TriangleMesh,
    names: &[u32],
    triangles: &[u32],
    material: MaterialId,
    local: &mut [u32],
) -> (MeshChunk, ChunkMesh) {
    let mut out = ChunkMesh::default();
    let mut used = vec![];
    for &t in triangles {
        for k in 0..3 {
            let v = mesh.indices[3 * t as usize + k] as usize;
            if local[v] == u32::MAX {
                local[v] = used.len() as u32;
                used.push(v);
            }
            out.indices.push(local[v]);
        }
    }
    out.positions = used.iter().map(|&v| mesh.positions[v]).collect();
    out.normals = used.iter().map(|&v| mesh.normals[v]).collect();
    out.vertex_ids = used.iter().map(|&v| names[v]).collect();
    if !mesh.uvs.is_empty() {
        out.uvs = used.iter().map(|&v| mesh.uvs[v]).collect();
    }
    if !mesh.colors.is_empty() {
        out.colors = used.iter().map(|&v| mesh.colors[v]).collect();
    }
    used.iter().for_each(|&v| local[v] = u32::MAX);
    let info = MeshChunk {
        triangles: triangles.len() as u32,
        vertices: out.positions.len() as u32,
        bounds: Aabb::of(out.positions.iter().copied()),
        material,
    };
    (info, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: u32) -> TriangleMesh {
        let at = |x: u32, z: u32| x + z * (n + 1);
        let indices: Vec<u32> = (0..n * n)
            .flat_map(|i| {
                let (x, z) = (i % n, i / n);
                [at(x, z), at(x, z + 1), at(x + 1, z), at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]
            })
            .collect();
        TriangleMesh {
            positions: (0..(n + 1) * (n + 1))
                .map(|i| Vec3::new((i % (n + 1)) as f32, 0.0, (i / (n + 1)) as f32))
                .collect(),
            sections: vec![(0..indices.len() as u32, MaterialId(0))],
            indices,
            ..Default::default()
        }
    }

    #[test]
    fn chunks_hold_every_triangle_once_and_weld_back() {
        let mesh = grid(40);
        let cut = cut(mesh.clone(), 100);
        assert!(cut.infos.iter().all(|c| c.triangles <= 100));
        assert_eq!(cut.vertex_ids, 41 * 41);
        let mut position = vec![Vec3::NAN; 41 * 41];
        let mut back: Vec<[u32; 3]> = vec![];
        for c in &cut.chunks {
            c.vertex_ids.iter().zip(&c.positions).for_each(|(&i, &p)| position[i as usize] = p);
            back.extend(c.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| c.vertex_ids[t[k] as usize])));
        }
        let key = |t: [Vec3; 3]| t.map(|p| [p.x as i32, p.z as i32]);
        let mut a: Vec<_> = back.iter().map(|t| key(t.map(|v| position[v as usize]))).collect();
        let mut b: Vec<_> =
            mesh.indices.chunks_exact(3).map(|t| key([0, 1, 2].map(|k| mesh.positions[t[k] as usize]))).collect();
        a.sort_unstable();
        b.sort_unstable();
        assert_eq!(a, b);
        assert!(cut.chunks.iter().all(|c| c.normals.iter().all(|n| n.distance(Vec3::Y) < 1e-6)));
    }

    #[test]
    fn coincident_triangles_are_cut_by_number() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
            indices: [0, 1, 2].repeat(1000),
            sections: vec![(0..3000, MaterialId(0))],
            ..Default::default()
        };
        assert_eq!(cut(mesh, 100).infos.len(), 10);
    }
}
