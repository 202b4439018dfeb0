//! The world octree: nodes own the placed chunks whose box centre they hold, and keep loose bounds. O(n log n) to build.

use glam::Vec3;

use crate::Aabb;
use crate::id::ChunkId;

/// Below this depth nodes are not divided: more would tell chunks with coincident centres apart.
const MAX_DEPTH: u32 = 16;

/// A node of the octree.
#[derive(Clone, Debug)]
pub struct OctNode {
    /// The cube it divides, for centres.
    pub cube: Aabb,
    /// The union of its chunks' boxes; may reach out of the cube.
    pub loose: Aabb,
    /// Its children, x fastest; `None` for a leaf. Empty children are left out (`u32::MAX`).
    pub children: Option<[u32; 8]>,
    /// Chunks of a leaf.
    pub chunks: Vec<ChunkId>,
    /// Triangles in it.
    pub triangles: u64,
    /// 0 for the root.
    pub depth: u32,
}

/// The octree; node 0 is the root.
#[derive(Clone, Debug, Default)]
pub struct Octree {
    /// Its nodes, parents before children.
    pub nodes: Vec<OctNode>,
}

impl Octree {
    /// Divides until a node holds at most `max_triangles` or one chunk. `boxes` are the chunks' boxes and triangles.
    pub fn over(boxes: &[(Aabb, u32)], max_triangles: u64) -> Self {
        let centres = Aabb::of(boxes.iter().map(|b| b.0.centre()));
        let mut tree = Self::default();
        if !boxes.is_empty() {
            let half = 0.5 * centres.size().max_element().max(f32::MIN_POSITIVE);
            let cube = Aabb { min: centres.centre() - half, max: centres.centre() + half };
            tree.node(boxes, (0..boxes.len() as u32).map(ChunkId).collect(), cube, 0, max_triangles);
        }
        tree
    }

    fn node(&mut self, boxes: &[(Aabb, u32)], chunks: Vec<ChunkId>, cube: Aabb, depth: u32, max: u64) -> u32 {
        let id = self.nodes.len();
        let loose = chunks.iter().fold(Aabb::EMPTY, |b, c| b.union(boxes[c.index()].0));
        let triangles = chunks.iter().map(|c| u64::from(boxes[c.index()].1)).sum();
        self.nodes.push(OctNode { cube, loose, children: None, chunks: vec![], triangles, depth });
        if triangles <= max || chunks.len() <= 1 || depth == MAX_DEPTH {
            self.nodes[id].chunks = chunks;
            return id as u32;
        }
        let c = cube.centre();
        let mut parts: [Vec<ChunkId>; 8] = Default::default();
        for k in chunks {
            let p = boxes[k.index()].0.centre();
            parts[usize::from(p.x > c.x) | usize::from(p.y > c.y) << 1 | usize::from(p.z > c.z) << 2].push(k);
        }
        let mut children = [u32::MAX; 8];
        for (i, part) in parts.into_iter().enumerate().filter(|(_, p)| !p.is_empty()) {
            let high = glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
            let b = Aabb { min: Vec3::select(high, c, cube.min), max: Vec3::select(high, cube.max, c) };
            children[i] = self.node(boxes, part, b, depth + 1, max);
        }
        self.nodes[id].children = Some(children);
        id as u32
    }

    /// The nodes' children that are there.
    pub fn children(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        self.nodes[node as usize].children.iter().flatten().copied().filter(|&c| c != u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn leaves_own_every_chunk_once_and_bound_it(
            at in prop::collection::vec((-9f32..9.0, -9f32..9.0, -9f32..9.0, 0f32..3.0, 1u32..500), 0..200)
        ) {
            let boxes: Vec<_> = at.iter().map(|&(x, y, z, s, n)| {
                let c = Vec3::new(x, y, z);
                (Aabb { min: c - s, max: c + s }, n)
            }).collect();
            let tree = Octree::over(&boxes, 1000);
            let mut owned: Vec<u32> = vec![];
            for n in &tree.nodes {
                for c in &n.chunks {
                    owned.push(c.0);
                    let b = boxes[c.index()].0;
                    prop_assert_eq!(n.loose.union(b), n.loose);
                }
                prop_assert!(n.children.is_some() || n.triangles <= 1000 || n.chunks.len() == 1 || n.depth == 16);
            }
            owned.sort_unstable();
            prop_assert_eq!(owned, (0..boxes.len() as u32).collect::<Vec<_>>());
        }
    }
}
