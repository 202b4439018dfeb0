//! What the bake leaves beside its payloads: each object's levels and how far they are off. JSON, as the other far fields' indices.

use farfield_core::Fault;
use serde::{Deserialize, Serialize};

/// Levels that an object may have: payload ids leave room for as many. Halving 2^32 triangles takes no more.
pub(super) const MOST_LEVELS: u32 = 64;

/// All objects that have levels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Index {
    /// Ascending by object.
    pub(super) chains: Vec<Chain>,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Chain {
    pub(super) object: u32,
    /// Below the original, finest first.
    pub(super) levels: Vec<Entry>,
}

/// One level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) payload: u32,
    pub(super) parts: u16,
    pub(super) triangles: u32,
    /// Bytes in memory.
    pub(super) bytes: u64,
    /// How far it is off, scene units.
    pub(super) error: f32,
}

/// The payload of an object's level, counted from 0 below the original.
pub(super) fn payload_id(object: u32, level: usize) -> Option<u32> {
    let level = u32::try_from(level).ok().filter(|l| *l < MOST_LEVELS)?;
    object.checked_mul(MOST_LEVELS)?.checked_add(level)
}

impl Index {
    pub(super) fn encode(&self) -> Result<Vec<u8>, Fault> {
        serde_json::to_vec(self).map_err(|e| Fault::Data { place: "index of static-lod".into(), cause: e.to_string() })
    }

    pub(super) fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        let bad = |cause: String| Fault::Data { place: place.to_owned(), cause };
        let index: Self = serde_json::from_slice(bytes).map_err(|e| bad(e.to_string()))?;
        if !index.chains.is_sorted_by(|a, b| a.object < b.object) {
            return Err(bad("objects are out of order".into()));
        }
        for c in &index.chains {
            let rises = c.levels.is_sorted_by(|a, b| a.error <= b.error && a.triangles >= b.triangles);
            let named = (0..).zip(&c.levels).all(|(i, l)| Some(l.payload) == payload_id(c.object, i) && l.error >= 0.0);
            if c.levels.is_empty() || !rises || !named {
                return Err(bad(format!("object {} has levels that are out of order", c.object)));
            }
        }
        Ok(index)
    }
}
