//! What a bake leaves beside its scan cubes: where each was taken, on which it depends, what it is made of.
//!
//! Encoded as JSON, readable by hand: a few hundred bytes a cube beside megabytes of texels.

use farfield_core::{Aabb, Fault};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// One cell's index.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Index {
    /// Its scan cubes, every one after its parent.
    pub cubes: Vec<Cube>,
}

/// A scan cube: the meshes that one sample contributes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cube {
    /// The payload's id in the asset.
    pub payload: u32,
    /// The split that it belongs to.
    pub split: u32,
    /// Where the sample was taken, local frame.
    pub eye: DVec3,
    /// The cube that it is a difference to, as an index into the cubes; none for the intra cube.
    pub parent: Option<u32>,
    /// What the object plane says of its pixels.
    pub object: u32,
    /// Bytes in memory.
    pub bytes: u64,
    /// The box of its meshes, local frame.
    pub bounds: Aabb,
    /// Its drawable parts.
    pub pieces: Vec<Piece>,
    /// The sample's pixels that show a surface.
    pub points: u64,
    /// Of these, the pixels that no ancestor shows: what its meshes are made of.
    pub kept: u64,
    /// Of the kept ones, those that were put back because they would have left a crack.
    pub mended: u64,
    /// Triangles before simplification.
    pub dense_triangles: u64,
    /// Texels stored.
    pub texels: u64,
}

/// A part of a scan cube that is drawn or culled as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// The payload's part.
    pub part: u16,
    /// Its box, local frame.
    pub bounds: Aabb,
    /// Its triangles.
    pub triangles: u64,
}

impl Cube {
    /// Triangles of all its parts.
    pub fn triangles(&self) -> u64 {
        self.pieces.iter().map(|p| p.triangles).sum()
    }
}

impl Index {
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Fault> {
        serde_json::to_vec(self)
            .map_err(|e| Fault::Data { place: "index of depth meshes".into(), cause: e.to_string() })
    }

    /// Reads what a bake wrote; nothing gives an index of no cubes.
    ///
    /// # Errors
    /// [`Fault::Data`] where the bytes are something else, or a cube stands before its parent.
    pub fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        if bytes.is_empty() {
            return Ok(Self::default());
        }
        let bad = |cause: String| Fault::Data { place: place.to_owned(), cause };
        let index: Self = serde_json::from_slice(bytes).map_err(|e| bad(e.to_string()))?;
        match index.cubes.iter().enumerate().find(|(i, c)| c.parent.is_some_and(|p| p as usize >= *i)) {
            Some((i, _)) => Err(bad(format!("scan cube {i} does not stand after its parent"))),
            None => Ok(index),
        }
    }
}
