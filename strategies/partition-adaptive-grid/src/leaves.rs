//! Pseudo-leaves: the parts of the scene that the partition keeps or replaces, never in halves.
//!
//! The placed chunks' octree, divided down to single chunks and cut at a depth (the paper's 5: at most 32,768 leaves). The
//! scene's own octree stops at 20,000 triangles a node, far too coarse for budgets of 100,000, so one is built here.
//! O(chunks log chunks).

use farfield_core::Aabb;
use farfield_core::id::ChunkId;
use farfield_core::octree::Octree;
use farfield_core::scene::Scene;
use glam::DVec3;

/// A leaf's box is larger by this part of the extent of scene and eyes: what run-time culling, in 32 bits and with a camera
/// whose axes are rounded, lets through has been counted here. An eye is at most three extents from what it sees, where 32
/// bits are worth 1e-6 of the extent.
const SLACK: f64 = 1e-5;

/// The leaves, as one table a property.
#[derive(Debug, Default)]
pub(crate) struct Leaves {
    /// Lowest corners.
    pub(crate) min: Vec<DVec3>,
    /// Highest corners.
    pub(crate) max: Vec<DVec3>,
    /// Triangles.
    pub(crate) triangles: Vec<u32>,
    /// Placed chunks.
    pub(crate) chunks: Vec<Vec<ChunkId>>,
    /// Triangles of all.
    pub(crate) total: u64,
}

impl Leaves {
    /// The leaves at `depth` of an octree over the scene's chunks. `extent` is the longest edge of scene and eyes together.
    /// Leaves without triangles are left out: nothing is drawn for them.
    pub(crate) fn of(scene: &Scene, depth: u32, extent: f64) -> Self {
        let boxes: Vec<(Aabb, u32)> = scene.chunks.iter().map(|c| (c.bounds, c.triangles)).collect();
        let tree = Octree::over(&boxes, 0);
        let mut out = Self::default();
        let slack = SLACK * extent;
        let mut to_do: Vec<u32> = if tree.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(at) = to_do.pop() {
            let node = &tree.nodes[at as usize];
            if node.triangles == 0 {
                continue;
            }
            if node.children.is_some() && node.depth < depth {
                let mut below: Vec<u32> = tree.children(at).collect();
                below.reverse();
                to_do.extend(below);
                continue;
            }
            out.min.push(node.loose.min.as_dvec3() - slack);
            out.max.push(node.loose.max.as_dvec3() + slack);
            out.triangles.push(node.triangles.min(u64::from(u32::MAX)) as u32);
            out.chunks.push(gather(&tree, at));
            out.total += node.triangles;
        }
        out
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Box and triangles of each.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = (DVec3, DVec3, u64)> + '_ {
        (0..self.len()).map(|i| (self.min[i], self.max[i], u64::from(self.triangles[i])))
    }
}

/// The chunks below a node, ascending.
fn gather(tree: &Octree, root: u32) -> Vec<ChunkId> {
    let (mut found, mut to_do) = (vec![], vec![root]);
    while let Some(at) = to_do.pop() {
        found.extend_from_slice(&tree.nodes[at as usize].chunks);
        to_do.extend(tree.children(at));
    }
    found.sort_unstable();
    found
}
