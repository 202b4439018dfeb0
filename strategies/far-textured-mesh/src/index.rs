//! What a bake leaves beside its payloads: which payload shows what, through which windows, and what it needs.
//!
//! Encoded as JSON: a few hundred bytes an object beside megabytes of texels, readable by hand, and no format of our own.

use farfield_core::scene::ChunkSet;
use farfield_core::{Aabb, Fault};
use serde::{Deserialize, Serialize};

/// One cell's index.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Index {
    /// Meshes.
    pub(crate) meshes: Vec<Entry>,
    /// Atlases.
    pub(crate) atlases: Vec<Atlas>,
    /// Chunks that are drawn as they are, by split.
    pub(crate) plain: Vec<ChunkSet>,
}

/// A payload that is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Its id in the asset.
    pub(crate) payload: u32,
    /// How many parts it has.
    pub(crate) parts: u16,
    /// The object that it stands for.
    pub(crate) object: u32,
    /// The split that it belongs to.
    pub(crate) split: u32,
    /// The windows that show it.
    pub(crate) sectors: Vec<u32>,
    /// Its box, local frame.
    pub(crate) bounds: Aabb,
    /// Bytes in memory.
    pub(crate) bytes: u64,
    /// The error it was made with, pixels.
    pub(crate) error_px: f32,
    /// Its pixels from the cell's centre, across: what is missing without it.
    pub(crate) size_px: f32,
    /// Its atlas, as an index into the atlases.
    pub(crate) atlas: Option<u32>,
}

/// A payload of texels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Atlas {
    /// Its id in the asset.
    pub(crate) payload: u32,
    /// The box of all that is textured from it, local frame.
    pub(crate) bounds: Aabb,
    /// Bytes in memory.
    pub(crate) bytes: u64,
}

impl Index {
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Fault> {
        serde_json::to_vec(self)
            .map_err(|e| Fault::Data { place: "index of textured-lod-mesh".into(), cause: e.to_string() })
    }

    pub(crate) fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        if bytes.is_empty() {
            return Ok(Self::default());
        }
        let bad = |cause: String| Fault::Data { place: place.to_owned(), cause };
        let index: Self = serde_json::from_slice(bytes).map_err(|e| bad(e.to_string()))?;
        match index.meshes.iter().filter_map(|m| m.atlas).find(|&a| a as usize >= index.atlases.len()) {
            Some(a) => Err(bad(format!("atlas {a} of {}", index.atlases.len()))),
            None => Ok(index),
        }
    }
}
