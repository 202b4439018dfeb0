//! Triangle meshes: as importers and generators make them, and cut into chunks.

use std::ops::Range;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::Aabb;
use crate::id::MaterialId;

/// A triangle mesh in its own space, as an importer or a generator makes it.
///
/// `normals`, `uvs` and `colors` are empty or as long as `positions`. Triangles are counter-clockwise seen from in front.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions, scene units.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, (0, 0) at the picture's top left.
    pub uvs: Vec<Vec2>,
    /// sRGB vertex colours.
    pub colors: Vec<[u8; 4]>,
    /// Three indices a triangle.
    pub indices: Vec<u32>,
    /// Runs of `indices` with their material; together they cover all of `indices`, in order.
    pub sections: Vec<(Range<u32>, MaterialId)>,
}

/// One chunk of a mesh, compact: at most a few thousand triangles of one material.
///
/// `vertex_ids` names each vertex's *position* mesh-wide, so that chunks can be welded exactly: two vertices have the
/// same id where, and only where, their positions are equal bit for bit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChunkMesh {
    /// Vertex positions in mesh space.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, always there.
    pub normals: Vec<Vec3>,
    /// Texture coordinates; empty or one a vertex.
    pub uvs: Vec<Vec2>,
    /// sRGB vertex colours; empty or one a vertex.
    pub colors: Vec<[u8; 4]>,
    /// Mesh-wide names of the positions, one a vertex.
    pub vertex_ids: Vec<u32>,
    /// Three chunk-local indices a triangle.
    pub indices: Vec<u32>,
}

/// What is known of a chunk without its triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshChunk {
    /// Number of triangles.
    pub triangles: u32,
    /// Number of vertices.
    pub vertices: u32,
    /// Its box in mesh space.
    pub bounds: Aabb,
    /// The one material of its triangles.
    pub material: MaterialId,
}

impl MeshChunk {
    /// Bytes of the chunk in memory: position, normal, texture coordinate, colour and name a vertex, three indices a triangle.
    pub fn bytes(&self) -> u64 {
        u64::from(self.vertices) * 40 + u64::from(self.triangles) * 12
    }
}

impl TriangleMesh {
    /// Number of triangles.
    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    /// Area-weighted vertex normals over exactly equal positions; (0, 1, 0) where all triangles are degenerate.
    pub fn smooth_normals(&mut self) {
        let ids = position_ids(&self.positions);
        let mut sums = vec![glam::DVec3::ZERO; self.positions.len()];
        for t in self.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| self.positions[t[k] as usize].as_dvec3());
            let n = (b - a).cross(c - a);
            if n.is_finite() {
                t.iter().for_each(|&v| sums[ids[v as usize] as usize] += n);
            }
        }
        self.normals = ids.iter().map(|&i| sums[i as usize].try_normalize().map_or(Vec3::Y, |n| n.as_vec3())).collect();
    }
}

/// For each position the index of the first one that equals it bit for bit (-0 counts as 0).
pub fn position_ids(positions: &[Vec3]) -> Vec<u32> {
    let mut first = std::collections::HashMap::with_capacity(positions.len());
    positions
        .iter()
        .enumerate()
        .map(|(i, p)| *first.entry((*p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(i as u32))
        .collect()
}
