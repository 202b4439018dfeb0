//! Packing: chunks and payload parts as vertices, indices and projectors. O(n).

use std::collections::HashMap;

use farfield_core::image::octahedral;
use farfield_core::mesh::ChunkMesh;
use farfield_core::payload::{MeshPart, ProjectedPart};

use crate::layout::{ChunkVertex, GpuProjector, MeshVertex, ProjectedVertex};

/// A chunk's vertices, in its order.
pub fn chunk_vertices(c: &ChunkMesh) -> Vec<ChunkVertex> {
    (0..c.positions.len())
        .map(|i| ChunkVertex {
            position: c.positions[i].to_array(),
            normal: octahedral(c.normals[i]),
            uv: c.uvs.get(i).map_or([0.0; 2], |uv| uv.to_array()),
            color: c.colors.get(i).copied().unwrap_or([255; 4]),
        })
        .collect()
}

/// A plain mesh's vertices, in its order.
pub fn mesh_vertices(m: &MeshPart) -> Vec<MeshVertex> {
    (0..m.positions.len())
        .map(|i| MeshVertex {
            position: m.positions[i].to_array(),
            normal: octahedral(m.normals[i]),
            color: m.albedo[i],
        })
        .collect()
}

/// A projected mesh's vertices and indices: a vertex for each pair of one of its vertices and a view set that meets there.
pub fn projected_vertices(p: &ProjectedPart) -> (Vec<ProjectedVertex>, Vec<u32>) {
    let (mut vertices, mut indices) = (vec![], Vec::with_capacity(p.mesh.indices.len()));
    let mut known: HashMap<(u32, u32), u32> = HashMap::with_capacity(p.mesh.positions.len());
    for (triangle, &views) in p.mesh.indices.chunks_exact(3).zip(&p.views) {
        for &v in triangle {
            indices.push(*known.entry((v, views)).or_insert_with(|| {
                let v = v as usize;
                vertices.push(ProjectedVertex {
                    position: p.mesh.positions[v].to_array(),
                    normal: octahedral(p.mesh.normals[v]),
                    color: p.mesh.albedo[v],
                    views,
                });
                vertices.len() as u32 - 1
            }));
        }
    }
    (vertices, indices)
}

/// A part's projectors; `slot_of` gives the slot that each one's atlas is bound to.
pub fn projectors(p: &ProjectedPart, slot_of: impl Fn(usize) -> u32) -> Vec<GpuProjector> {
    p.projectors
        .iter()
        .enumerate()
        .map(|(i, q)| {
            let [x, y, w, h] = q.rect.map(|v| v as f32);
            GpuProjector {
                matrix: q.matrix.to_cols_array_2d(),
                eye: q.eye.to_array(),
                slot: slot_of(i),
                low: [x + 0.5, y + 0.5],
                high: [x + w - 0.5, y + h - 0.5],
                layer: q.layer,
                unused: [0; 3],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn triangles_share_a_vertex_only_where_they_share_their_views() {
        let mesh = MeshPart {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE],
            normals: vec![Vec3::Z; 4],
            albedo: vec![[1, 2, 3, 255]; 4],
            indices: vec![0, 1, 2, 2, 1, 3, 0, 3, 2],
            two_sided: false,
        };
        let part = ProjectedPart { mesh, views: vec![1, 1, 2], projectors: vec![] };
        let (vertices, indices) = projected_vertices(&part);
        assert_eq!(indices, [0, 1, 2, 2, 1, 3, 4, 5, 6]);
        assert_eq!(vertices.iter().map(|v| v.views).collect::<Vec<_>>(), [1, 1, 1, 1, 2, 2, 2]);
        for (packed, original) in indices.iter().zip(&part.mesh.indices) {
            let position = part.mesh.positions[*original as usize].to_array();
            assert_eq!(vertices[*packed as usize].position, position);
        }
    }
}
