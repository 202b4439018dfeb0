//! What is kept of every node beside its payload: box, error, normal cone, size. In preorder, as the tree numbers them.

use farfield_core::id::ChunkId;
use farfield_core::{Aabb, Fault};
use serde::{Deserialize, Serialize};

use crate::cone::Cone;

/// A node; its payload has its number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Node {
    /// Of its payload and of all below, local frame.
    pub(crate) bounds: Aabb,
    /// No point of it lies farther from the original surface, nor the other way round, scene units.
    pub(crate) error: f32,
    /// Of its triangles and of all below.
    pub(crate) cone: Cone,
    /// One past the last node below it.
    pub(crate) end: u32,
    /// 0 for the root.
    pub(crate) depth: u8,
    /// Parts of its payload; 0 where it has none.
    pub(crate) parts: u8,
    /// Triangles of its payload.
    pub(crate) triangles: u32,
    /// Points of its payload.
    pub(crate) points: u32,
    /// Bytes of its payload in memory.
    pub(crate) bytes: u64,
    /// What the object plane says: the object of most of its triangles, plus 1.
    pub(crate) object: u32,
    /// The original chunks of a leaf.
    pub(crate) chunks: Vec<ChunkId>,
}

/// All nodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Skeleton {
    pub(crate) nodes: Vec<Node>,
}

impl Skeleton {
    pub(crate) fn is_leaf(&self, node: u32) -> bool {
        self.nodes[node as usize].end == node + 1
    }

    /// A node's children, in order.
    pub(crate) fn children(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        let (mut next, end) = (node + 1, self.nodes[node as usize].end);
        std::iter::from_fn(move || {
            let child = (next < end).then_some(next)?;
            next = self.nodes[child as usize].end;
            Some(child)
        })
    }

    pub(crate) fn encode(&self) -> Result<Vec<u8>, Fault> {
        let place = "skeleton of point-polygon-hlod".to_owned();
        postcard::to_allocvec(self).map_err(|e| Fault::Data { place, cause: e.to_string() })
    }

    pub(crate) fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        let bad = |cause: String| Fault::Data { place: place.to_owned(), cause };
        let (all, rest): (Self, _) = postcard::take_from_bytes(bytes).map_err(|e| bad(e.to_string()))?;
        if !rest.is_empty() {
            return Err(bad(format!("{} bytes after its end", rest.len())));
        }
        let count = all.nodes.len() as u32;
        for (i, n) in (0u32..).zip(&all.nodes) {
            // Written so that NaN fails.
            if !(n.error >= 0.0 && n.end > i && n.end <= count) {
                return Err(bad(format!("node {i} of {count} is damaged")));
            }
        }
        let inside = |i: u32| all.children(i).all(|c| all.nodes[c as usize].end <= all.nodes[i as usize].end);
        if (0..count).any(|i| !inside(i)) || all.nodes.first().is_some_and(|n| n.end != count) {
            return Err(bad("its nodes are no tree".into()));
        }
        Ok(all)
    }
}
