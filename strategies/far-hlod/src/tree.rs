//! The tree of nodes: an octree over the placed chunks, and which vertices stand on its nodes' borders.
//!
//! Nodes are numbered in preorder, so that the nodes below one, and its leaves with them, are a run of numbers.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use farfield_core::Fault;
use farfield_core::context::{Context, collect};
use farfield_core::id::ObjectId;
use farfield_core::octree::Octree;
use farfield_core::scene::Scene;

/// The octree with the ends of its subtrees.
pub(crate) struct Tree {
    pub(crate) octree: Octree,
    /// One past the last node below each.
    ends: Vec<u32>,
    /// Edge of the root's cube, scene units.
    pub(crate) edge: f32,
}

impl Tree {
    /// Divided until a node holds at most `node_triangles` or one chunk.
    pub(crate) fn over(scene: &Scene, node_triangles: u64) -> Self {
        let boxes: Vec<_> = scene.chunks.iter().map(|c| (c.bounds, c.triangles)).collect();
        let octree = Octree::over(&boxes, node_triangles);
        let mut ends: Vec<u32> = (1..=octree.nodes.len() as u32).collect();
        for n in (0..octree.nodes.len()).rev() {
            if let Some(last) = octree.children(n as u32).last() {
                ends[n] = ends[last as usize];
            }
        }
        let edge = if scene.bounds.is_empty() { 0.0 } else { scene.bounds.size().max_element() };
        Self { octree, ends, edge }
    }

    pub(crate) fn len(&self) -> usize {
        self.octree.nodes.len()
    }

    /// The numbers of a node and of all below it.
    pub(crate) fn below(&self, node: u32) -> Range<u32> {
        node..self.ends[node as usize]
    }

    pub(crate) fn is_leaf(&self, node: u32) -> bool {
        self.octree.nodes[node as usize].children.is_none()
    }

    /// The error that a node may have, scene units: the edge of its cube over the resolution (section 3).
    pub(crate) fn allowance(&self, node: u32, resolution: f32) -> f32 {
        self.edge * 0.5f32.powi(self.octree.nodes[node as usize].depth as i32) / resolution
    }
}

/// The first and the last leaf that use a vertex, for those that several use; sorted by vertex.
#[derive(Default)]
pub(crate) struct Borders(Vec<((ObjectId, u32), [u32; 2])>);

impl Borders {
    /// Two looks at every chunk, leaves in parallel: which vertices several leaves use, then by which. Memory: a quarter of a byte a vertex of the
    /// objects at work, and the border's vertices.
    pub(crate) fn find(scene: &Scene, tree: &Tree, cx: &Context<'_>) -> Result<Self, Fault> {
        let mut leaf = vec![0u32; scene.chunks.len()];
        for (n, node) in (0u32..).zip(&tree.octree.nodes) {
            node.chunks.iter().for_each(|c| leaf[c.index()] = n);
        }
        let of_object = |o: usize| {
            let object = &scene.objects[o];
            let mut leaves: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
            (object.chunks.start as usize..object.chunks.end as usize)
                .for_each(|c| leaves.entry(leaf[c]).or_default().push(c));
            if leaves.len() <= 1 {
                return Ok(vec![]);
            }
            let leaves: Vec<(u32, Vec<usize>)> = leaves.into_iter().collect();
            // A leaf's vertices, each once.
            let vertices = |i: usize| -> Result<Vec<u32>, Fault> {
                let mut all = vec![];
                for &c in &leaves[i].1 {
                    cx.check()?;
                    scene.geometry.with(scene.chunks[c].source, &mut |chunk| all.extend(&chunk.vertex_ids))?;
                }
                all.sort_unstable();
                all.dedup();
                Ok(all)
            };
            let count = scene.meshes[object.mesh.index()].vertex_ids;
            let (used, shared) = (Bits::new(count), Bits::new(count));
            cx.run.each(leaves.len(), &|i| {
                vertices(i)?.into_iter().filter(|&v| used.set(v)).for_each(|v| _ = shared.set(v));
                Ok(())
            })?;
            let uses = collect(cx.run, leaves.len(), &|i| {
                let own = vertices(i)?.into_iter().filter(|&v| shared.has(v));
                Ok(own.map(|v| (v, leaves[i].0)).collect::<Vec<(u32, u32)>>())
            })?;
            let mut uses = uses.concat();
            uses.sort_unstable();
            let span = |run: &[(u32, u32)]| ((ObjectId(o as u32), run[0].0), [run[0].1, run[run.len() - 1].1]);
            Ok(uses.chunk_by(|a, b| a.0 == b.0).map(span).collect())
        };
        Ok(Self(collect(cx.run, scene.objects.len(), &of_object)?.concat()))
    }

    /// The first and the last leaf that use a vertex of the leaf `own`.
    pub(crate) fn span(&self, name: (ObjectId, u32), own: u32) -> [u32; 2] {
        self.0.binary_search_by_key(&name, |s| s.0).map_or([own; 2], |i| self.0[i].1)
    }
}

/// A bit a number, set from many threads.
struct Bits(Vec<AtomicU64>);

impl Bits {
    fn new(count: u32) -> Self {
        Self((0..count.div_ceil(64)).map(|_| AtomicU64::new(0)).collect())
    }

    /// Sets a bit and tells whether it was set.
    fn set(&self, bit: u32) -> bool {
        let mask = 1 << (bit % 64);
        self.0[bit as usize / 64].fetch_or(mask, Ordering::Relaxed) & mask != 0
    }

    fn has(&self, bit: u32) -> bool {
        self.0[bit as usize / 64].load(Ordering::Relaxed) & (1 << (bit % 64)) != 0
    }
}
