//! What the bake leaves beside its payloads: for each object its groups, what each replaces and what replaces its clusters.
//!
//! Binary (postcard), since a scene of millions of triangles has thousands of groups.

use farfield_core::{Aabb, Fault};
use serde::{Deserialize, Serialize};

/// All objects that have groups.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Index {
    /// Ascending by object.
    pub(crate) objects: Vec<ObjectGroups>,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ObjectGroups {
    /// Index into the scene's objects.
    pub(crate) object: u32,
    /// The group that replaces each of its chunks.
    pub(crate) chunks: Vec<Option<u32>>,
    /// Those below a group come before it.
    pub(crate) groups: Vec<Group>,
}

/// A group: one payload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Group {
    /// Within the asset.
    pub(crate) payload: u32,
    /// Bytes in memory.
    pub(crate) bytes: u64,
    /// meshoptimizer's estimate of how far it is off, scene units; never less than that of a group below.
    pub(crate) error: f32,
    /// Where the error counts: it holds the bounds of all groups below, local frame.
    pub(crate) bounds: Aabb,
    /// Its clusters, those together that one group replaces: the parts of the payload, in order.
    pub(crate) parts: Vec<Patch>,
}

/// Clusters that come and go together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Patch {
    /// The group that replaces them; `None` at the top.
    pub(crate) replaced_by: Option<u32>,
    /// Number of triangles.
    pub(crate) triangles: u32,
    /// Their box, local frame.
    pub(crate) bounds: Aabb,
}

impl ObjectGroups {
    /// For each group the groups whose clusters it replaces, ascending.
    pub(crate) fn below(&self) -> Vec<Vec<u32>> {
        let mut out = vec![vec![]; self.groups.len()];
        for (g, group) in (0u32..).zip(&self.groups) {
            group.parts.iter().filter_map(|p| p.replaced_by).for_each(|h| out[h as usize].push(g));
        }
        out
    }

    fn check(&self) -> Result<(), String> {
        let bad = |why: &str| Err(format!("object {}: {why}", self.object));
        let count = self.groups.len() as u32;
        if !self.chunks.iter().flatten().all(|&g| g < count) {
            return bad("a chunk is replaced by a group that is not there");
        }
        for (g, group) in (0u32..).zip(&self.groups) {
            if !(group.error >= 0.0 && group.error.is_finite()) || group.parts.is_empty() {
                return bad("a group without error or clusters");
            }
            for h in group.parts.iter().filter_map(|p| p.replaced_by) {
                let Some(above) = self.groups.get(h as usize).filter(|_| h > g) else {
                    return bad("groups are out of order");
                };
                let within = above.bounds.union(group.bounds) == above.bounds;
                if above.error < group.error || !within {
                    return bad("a group is off by less than one below it");
                }
            }
        }
        Ok(())
    }
}

impl Index {
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Fault> {
        postcard::to_allocvec(self)
            .map_err(|e| Fault::Data { place: "index of cluster-lod".into(), cause: e.to_string() })
    }

    pub(crate) fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        let bad = |cause: String| Fault::Data { place: place.to_owned(), cause };
        let (index, rest): (Self, _) = postcard::take_from_bytes(bytes).map_err(|e| bad(e.to_string()))?;
        if !rest.is_empty() {
            return Err(bad(format!("{} bytes too many", rest.len())));
        }
        if !index.objects.is_sorted_by(|a, b| a.object < b.object) {
            return Err(bad("objects are out of order".into()));
        }
        index.objects.iter().try_for_each(ObjectGroups::check).map_err(bad)?;
        Ok(index)
    }
}
