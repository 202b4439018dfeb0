//! What nodes promise, for those who hold it against measurements.

use farfield_core::Fault;
use farfield_core::id::ChunkId;

use crate::NAME;
use crate::skeleton::Skeleton;

/// A node's promise. Node i is what payload i holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Promise {
    /// No point of its payload lies farther from the original surface of its chunks, nor the other way round, scene units.
    pub error: f32,
    /// 0 for the root.
    pub depth: u8,
    /// Whether nothing but original chunks stands below it.
    pub leaf: bool,
    /// The original chunks that it stands for.
    pub chunks: Vec<ChunkId>,
}

/// The promises of all nodes, by the index of the scene's asset.
///
/// # Errors
/// [`Fault::Data`] where the bytes are not what the bake wrote.
pub fn promises(index: &[u8]) -> Result<Vec<Promise>, Fault> {
    let skeleton = Skeleton::decode(NAME, index)?;
    let below = |i: u32| (i..skeleton.nodes[i as usize].end).flat_map(|k| &skeleton.nodes[k as usize].chunks);
    let promise = |(i, n): (u32, &crate::skeleton::Node)| Promise {
        error: n.error,
        depth: n.depth,
        leaf: skeleton.is_leaf(i),
        chunks: below(i).copied().collect(),
    };
    Ok((0u32..).zip(&skeleton.nodes).map(promise).collect())
}
