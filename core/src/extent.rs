//! What a block holds, counted: enough to say what it takes before it is read.
//!
//! A limit on memory that is never exceeded has to know what a block will take before the first byte of it is read. Bakes note the
//! extent of every payload beside it; what that takes on a device is the backend's to say ([`crate::backend::Backend::takes`]).

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use crate::mesh::MeshChunk;
use crate::payload::{Part, Payload, Projector};

/// See the module. Sums over all parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// Vertices of original chunks.
    pub chunk_vertices: u64,
    /// Vertices of plain and projected meshes.
    pub vertices: u64,
    /// Triangles of all kinds.
    pub triangles: u64,
    /// Triangles textured by projection.
    pub projected_triangles: u64,
    /// Pairs of a projected mesh's vertex and a view set that meets there: what a rasteriser needs a vertex each for.
    pub split_vertices: u64,
    /// Vertices of plain meshes alone.
    pub plain_vertices: u64,
    /// Projectors.
    pub projectors: u64,
    /// Texels of atlases; albedo and normal together are one.
    pub texels: u64,
    /// Pixels of layered depth images.
    pub pixels: u64,
    /// Samples of layered depth images.
    pub samples: u64,
    /// Objects that layered depth images name.
    pub objects: u64,
    /// Points.
    pub points: u64,
    /// Ends that lines share.
    pub line_vertices: u64,
    /// Lines.
    pub lines: u64,
    /// Parts.
    pub parts: u64,
}

/// What a block takes on a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Takes {
    /// As long as it is there, bytes, at most.
    pub resident_bytes: u64,
    /// On top of that while it is uploaded, bytes, at most: copies on their way, and what is needed to prepare it.
    pub passing_bytes: u64,
}

impl Extent {
    /// Of an original chunk; every attribute counts, whether its vertices have it or not.
    pub fn of_chunk(chunk: &MeshChunk) -> Self {
        Self {
            chunk_vertices: u64::from(chunk.vertices),
            triangles: u64::from(chunk.triangles),
            parts: 1,
            ..Self::default()
        }
    }

    /// Of a payload. O(its triangles).
    pub fn of_payload(payload: &Payload) -> Self {
        let mut e = Self { parts: payload.parts.len() as u64, ..Self::default() };
        for part in &payload.parts {
            match part {
                Part::Mesh(m) => {
                    e.vertices += m.positions.len() as u64;
                    e.plain_vertices += m.positions.len() as u64;
                    e.triangles += m.indices.len() as u64 / 3;
                }
                Part::Projected(p) => {
                    let corners = p.mesh.indices.chunks_exact(3).zip(&p.views);
                    let split: HashSet<(u32, u32)> =
                        corners.flat_map(|(t, &set)| t.iter().map(move |&v| (v, set))).collect();
                    e.split_vertices += split.len() as u64;
                    e.vertices += p.mesh.positions.len() as u64;
                    e.triangles += p.mesh.indices.len() as u64 / 3;
                    e.projected_triangles += p.views.len() as u64;
                    e.projectors += p.projectors.len() as u64;
                }
                Part::Atlas(a) => e.texels += a.albedo.len() as u64,
                Part::Layered(l) => {
                    e.pixels += l.counts.len() as u64;
                    e.samples += l.samples() as u64;
                    e.objects += l.objects.len() as u64;
                }
                Part::Points(p) => e.points += p.positions.len() as u64,
                Part::Lines(l) => {
                    e.line_vertices += l.positions.len() as u64;
                    e.lines += l.lines() as u64;
                }
            }
        }
        e
    }

    /// Bytes of it in this process's memory, as it comes from where it is stored.
    pub fn host_bytes(&self) -> u64 {
        40 * self.chunk_vertices
            + 28 * (self.vertices + self.points + self.line_vertices)
            + 12 * self.triangles
            + 4 * self.projected_triangles
            + size_of::<Projector>() as u64 * self.projectors
            + 8 * (self.texels + self.lines)
            + self.pixels
            + 10 * self.samples
            + 4 * self.objects
            + size_of::<Part>() as u64 * self.parts
            + size_of::<Payload>() as u64
    }

    /// What a rasteriser keeps of it, bytes: packed vertices and samples, indices, projectors, texels.
    pub fn packed_bytes(&self) -> u64 {
        28 * self.chunk_vertices
            + 20 * (self.plain_vertices + self.points)
            + 24 * self.split_vertices
            + 12 * self.triangles
            + 112 * self.projectors
            + 8 * self.texels
            // An element of samples holds four objects; each image may leave one part empty.
            + 16 * (self.samples + self.objects.div_ceil(4) + self.parts)
            + 40 * self.lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use crate::payload::{MeshPart, ProjectedPart};
    use glam::{DVec3, Vec3};

    #[test]
    fn a_vertex_between_two_view_sets_is_split_and_one_within_a_set_is_not() {
        let mesh = MeshPart {
            positions: vec![Vec3::ZERO; 5],
            normals: vec![Vec3::Y; 5],
            albedo: vec![[1; 4]; 5],
            indices: vec![0, 1, 2, 0, 2, 3, 0, 3, 4],
            two_sided: false,
        };
        let part = ProjectedPart { mesh: mesh.clone(), views: vec![1, 1, 2], projectors: vec![] };
        let payload =
            Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Projected(part), Part::Mesh(mesh)] };
        let e = Extent::of_payload(&payload);
        // Of the first: 0, 1, 2, 3 in the first set, 0, 3, 4 in the second.
        assert_eq!((e.split_vertices, e.plain_vertices, e.vertices), (7, 5, 10));
        assert_eq!((e.triangles, e.projected_triangles, e.parts), (6, 3, 2));
        assert_eq!(e.packed_bytes(), 7 * 24 + 5 * 20 + 6 * 12 + 2 * 16);
    }
}
