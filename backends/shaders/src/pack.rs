//! Packing: chunks and payload parts as vertices, indices, projectors, samples, points and lines. O(n).

use std::collections::HashMap;

use farfield_core::image::octahedral;
use farfield_core::layered::LayeredPart;
use farfield_core::mesh::ChunkMesh;
use farfield_core::payload::{LinesPart, MeshPart, PointsPart, ProjectedPart};
use glam::Vec3;

use crate::layout::{ChunkVertex, GpuLine, GpuPoint, GpuProjector, GpuSample, MeshVertex, ProjectedVertex};

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

/// A layered depth image: its samples in their order, then its objects, the last elements filled up with 0. Columns and rows of its
/// pixels are below 2^16.
pub fn samples(l: &LayeredPart) -> Vec<GpuSample> {
    let width = l.camera.size[0];
    let pixels = l.counts.iter().zip(0u32..).flat_map(|(&n, i)| std::iter::repeat_n(i, usize::from(n)));
    let mut out: Vec<GpuSample> = pixels
        .enumerate()
        .map(|(s, pixel)| {
            let [r, g, b] = l.albedo[s];
            GpuSample {
                depth: l.depth_at(s),
                pixel: [(pixel % width) as u16, (pixel / width) as u16],
                normal: l.normal[s],
                object: l.object[s],
                albedo: [r, g, b, 0],
            }
        })
        .collect();
    if !out.is_empty() {
        out.extend(l.objects.chunks(4).map(|c| {
            let four: [u32; 4] = std::array::from_fn(|i| c.get(i).copied().unwrap_or(0));
            bytemuck::cast::<_, GpuSample>(four)
        }));
    }
    out
}

/// Points, in their order.
pub fn points(p: &PointsPart) -> Vec<GpuPoint> {
    (0..p.positions.len()).map(|i| point(p.positions[i], p.normals[i], p.albedo[i])).collect()
}

/// Lines, in their order, each with both its ends.
pub fn lines(l: &LinesPart) -> Vec<GpuLine> {
    let end = |i: u32| point(l.positions[i as usize], l.normals[i as usize], l.albedo[i as usize]);
    l.indices.chunks_exact(2).map(|pair| GpuLine { ends: [end(pair[0]), end(pair[1])] }).collect()
}

fn point(position: Vec3, normal: Vec3, color: [u8; 4]) -> GpuPoint {
    GpuPoint { position: position.to_array(), normal: octahedral(normal), color }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Camera;
    use glam::DVec3;

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

    #[test]
    fn samples_know_their_pixels_and_objects_follow_them() {
        let camera = Camera::looking(DVec3::ZERO, Vec3::X, Vec3::Y, 1.0, [2, 3], 0.1);
        let part = LayeredPart {
            camera,
            inverse_depth: [1.0, 0.25],
            counts: vec![1, 0, 0, 2, 0, 1],
            depth: vec![0, 65535, 0, 65535],
            albedo: vec![[1, 2, 3]; 4],
            normal: vec![[127, 0], [0, -127], [-1, 1], [5, 6]],
            object: vec![4, 0, 1, 2],
            objects: vec![10, 11, 12, 13, 14],
            smooth: false,
        };
        let packed = samples(&part);
        let of = |f: &dyn Fn(&GpuSample) -> u32| packed[..4].iter().map(f).collect::<Vec<_>>();
        assert_eq!(of(&|s| u32::from(s.pixel[0]) + 10 * u32::from(s.pixel[1])), [0, 11, 11, 21]);
        assert_eq!(of(&|s| s.depth as u32), [1, 4, 1, 4]);
        let words: &[u32] = bytemuck::cast_slice(&packed);
        // As the shader takes them apart: normal in the low half, object in the high one.
        assert_eq!([words[2], words[6], words[10]], [4 << 16 | 127, 0x8100, 1 << 16 | 0x01ff]);
        assert_eq!(words[3], 0x0003_0201);
        assert_eq!(words[16..], [10, 11, 12, 13, 14, 0, 0, 0]);
        let none =
            LayeredPart { counts: vec![0; 6], depth: vec![], albedo: vec![], normal: vec![], object: vec![], ..part };
        assert!(samples(&none).is_empty());
    }
}
