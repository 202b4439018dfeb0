//! The scene: meshes cut into chunks, objects that place them, materials, textures and lights.
//!
//! Everything lives in a *local frame* of 32-bit coordinates whose origin stands somewhere in the 64-bit world
//! ([`Scene::origin`]); objects keep 64-bit transforms to it, and backends draw relative to the eye. So a scene placed 1e7
//! units away is as good as at home.

mod builder;
mod chunk_set;
mod cut;
mod looks;
mod wedges;

pub use builder::{ChunkDigest, Placement, SceneBuilder};
pub use chunk_set::ChunkSet;
pub use cut::{Cell, CutMesh, Cutter, MAX_CHUNK_TRIANGLES, centroid, cut};
pub use looks::{normal_matrix, texture_at, vertex_albedo, vertex_tint};
pub use wedges::{Gathered, Textured, Wedge, WedgesOfVertices, gather};

use std::ops::Range;

use glam::{DAffine3, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::id::{ChunkId, MaterialId, MeshChunkId, MeshId, ObjectId, TextureId};
use crate::mesh::{ChunkMesh, MeshChunk};
use crate::octree::Octree;
use crate::{Aabb, Fault};

/// What every stage may read. Tables are resident; triangles are reached through [`Scene::geometry`] only.
pub struct Scene {
    /// Where the local frame's origin stands in the world.
    pub origin: DVec3,
    /// The box of all objects, local frame.
    pub bounds: Aabb,
    /// Meshes, as tables of chunks.
    pub meshes: Vec<MeshInfo>,
    /// Placed meshes.
    pub objects: Vec<Object>,
    /// Placed chunks: those of object 0, then those of object 1, ...
    pub chunks: Vec<PlacedChunk>,
    /// Over the placed chunks, local frame.
    pub octree: Octree,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// A digest of all of the above and of every triangle: part of every store key.
    pub digest: [u8; 32],
    /// The way to triangles.
    pub geometry: Box<dyn Geometry>,
}

/// A mesh without its triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshInfo {
    /// As its file or generator calls it.
    pub name: String,
    /// Its chunks.
    pub chunks: Vec<MeshChunk>,
    /// Its box, mesh space.
    pub bounds: Aabb,
    /// Its triangles in all.
    pub triangles: u64,
    /// Positions that differ, mesh-wide: every [`ChunkMesh::vertex_ids`] is below.
    pub vertex_ids: u32,
    /// Of its chunks, as [`ChunkDigest`] makes it.
    pub digest: [u8; 32],
}

impl MeshInfo {
    /// Of a mesh with these chunks.
    pub fn new(name: &str, chunks: Vec<MeshChunk>, vertex_ids: u32, digest: [u8; 32]) -> Self {
        let bounds = chunks.iter().fold(Aabb::EMPTY, |b, c| b.union(c.bounds));
        let triangles = chunks.iter().map(|c| u64::from(c.triangles)).sum();
        Self { name: name.to_owned(), chunks, bounds, triangles, vertex_ids, digest }
    }
}

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Object {
    /// Which mesh.
    pub mesh: MeshId,
    /// From mesh space to the local frame.
    pub placement: DAffine3,
    /// Its placed chunks, as indices into [`Scene::chunks`], in the order of the mesh's chunks.
    pub chunks: Range<u32>,
    /// Its box, local frame.
    pub bounds: Aabb,
}

/// A chunk where an object puts it: the atom of culling and of budgets.
#[derive(Clone, Debug)]
pub struct PlacedChunk {
    /// Whose.
    pub object: ObjectId,
    /// What.
    pub source: MeshChunkId,
    /// Triangles in it.
    pub triangles: u32,
    /// Its box, local frame.
    pub bounds: Aabb,
}

/// How a surface looks before light: albedo = base colour x texture x vertex colour, in linear light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// As its file calls it.
    pub name: String,
    /// Linear base colour; alpha is not used.
    pub base_color: [f32; 4],
    /// Its texture.
    pub texture: Option<TextureId>,
    /// Seen from behind too, with its normal turned to the eye; else back faces are not drawn.
    pub two_sided: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self { name: "default".into(), base_color: [0.6, 0.6, 0.6, 1.0], texture: None, two_sided: false }
    }
}

/// A texture: sRGB, repeated outside 0..1, filtered bilinearly.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// As its file calls it.
    pub name: String,
    /// Width and height, texels.
    pub size: [u32; 2],
    /// sRGB texels, rows from the top.
    pub rgba: Vec<[u8; 4]>,
}

/// A light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// What it is.
    pub kind: LightKind,
    /// Linear colour times strength.
    pub color: Vec3,
    /// Whether it moves along a path.
    pub moves: bool,
}

/// The kinds of lights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum LightKind {
    /// Infinitely far away.
    Directional {
        /// Unit vector from the surface to the light.
        to_light: Vec3,
        /// Angular diameter, radians; 0 for sharp shadows.
        angle_rad: f32,
    },
    /// At a point, without falloff.
    Point {
        /// Where, local frame.
        position: Vec3,
        /// Radius, scene units; 0 for sharp shadows.
        radius: f32,
    },
}

/// The only way to triangles: a chunk's, while a call lasts. In memory, mapped, or loaded in blocks.
///
/// What is held may be limited, so that `f` neither reads geometry itself nor waits for others that do.
pub trait Geometry: Send + Sync {
    /// Calls `f` once with the chunk.
    ///
    /// # Errors
    /// [`Fault::Data`] where the chunk cannot be read.
    fn with(&self, id: MeshChunkId, f: &mut dyn FnMut(&ChunkMesh)) -> Result<(), Fault>;

    /// Bytes that the chunk takes while [`Geometry::with`] reads it; by default 0, for what is in memory and not read.
    fn read_bytes(&self, _id: MeshChunkId) -> u64 {
        0
    }

    /// Lets go of chunks that were read and are not in use: for callers that keep their own. By default nothing.
    fn let_go(&self) {}
}

/// Geometry in memory.
pub struct InMemory(pub Vec<Vec<ChunkMesh>>);

impl Geometry for InMemory {
    fn with(&self, id: MeshChunkId, f: &mut dyn FnMut(&ChunkMesh)) -> Result<(), Fault> {
        let chunk = self.0.get(id.mesh.index()).and_then(|m| m.get(id.chunk as usize));
        f(chunk.ok_or_else(|| Fault::Data { place: format!("{id:?}"), cause: "there is no such chunk".into() })?);
        Ok(())
    }
}

impl Scene {
    /// Triangles over all objects.
    pub fn triangles(&self) -> u64 {
        self.chunks.iter().map(|c| u64::from(c.triangles)).sum()
    }

    /// Triangles of a set of placed chunks.
    pub fn triangles_of(&self, set: &ChunkSet) -> u64 {
        set.iter().map(|c| u64::from(self.chunks[c.index()].triangles)).sum()
    }

    /// Every placed chunk.
    pub fn all_chunks(&self) -> ChunkSet {
        ChunkSet::from_range(0..self.chunks.len() as u32)
    }

    /// The material of a placed chunk.
    pub fn material_of(&self, c: ChunkId) -> MaterialId {
        let s = self.chunks[c.index()].source;
        self.meshes[s.mesh.index()].chunks[s.chunk as usize].material
    }

    /// Every chunk of every mesh, in order.
    pub fn mesh_chunk_ids(&self) -> impl Iterator<Item = MeshChunkId> + '_ {
        self.meshes.iter().enumerate().flat_map(|(m, mesh)| {
            (0..mesh.chunks.len() as u32).map(move |chunk| MeshChunkId { mesh: MeshId(m as u32), chunk })
        })
    }

    /// The placed chunks of `within` that a camera's four side planes let through.
    pub fn cull(&self, within: &ChunkSet, camera: &crate::Camera) -> ChunkSet {
        within.iter().filter(|c| camera.may_see(&self.chunks[c.index()].bounds)).collect()
    }
}
