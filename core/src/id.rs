//! Names of things, each a type of its own, so that a cell is never taken for a chunk.

use serde::{Deserialize, Serialize};

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// As an index into a table.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    )*};
}

ids! {
    /// One opened result of a bake: of the scene, or of one cell.
    AssetId,
    /// A cell of the partition.
    CellId,
    /// A placed chunk: one object's copy of one mesh chunk. Index into [`crate::scene::Scene::chunks`].
    ChunkId,
    /// A light of the scene.
    LightId,
    /// A payload within its asset.
    LocalPayload,
    /// A material of the scene.
    MaterialId,
    /// A mesh of the scene.
    MeshId,
    /// A placed mesh. Index into [`crate::scene::Scene::objects`].
    ObjectId,
    /// A window of a cell.
    SectorId,
    /// A division of the scene into near and far, of one cell.
    SplitId,
    /// What a pass writes or reads.
    TargetId,
    /// A texture of the scene.
    TextureId,
}

/// One chunk of one mesh, in the mesh's own space; objects that share the mesh share it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MeshChunkId {
    /// Whose chunk it is.
    pub mesh: MeshId,
    /// Which of its chunks.
    pub chunk: u32,
}

/// A payload by the asset that holds it. A cell's asset may refer to the scene's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PayloadRef {
    /// The opened asset.
    pub asset: AssetId,
    /// Which of its payloads.
    pub id: LocalPayload,
}

/// The unit of loading and of memory budgets: payloads and original geometry alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Block {
    /// A chunk of an original mesh.
    Chunk(MeshChunkId),
    /// A payload that a far field baked.
    Payload(PayloadRef),
}
