//! The tree of nodes: an octree over the placed chunks, and which vertices stand on its nodes' borders.
//!
//! Nodes are numbered in preorder, so that the nodes below one, and its leaves with them, are a run of numbers.

use std::collections::HashMap;
use std::ops::Range;

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

/// The first and the last leaf that use a vertex, for those that several use.
#[derive(Default)]
pub(crate) struct Borders(HashMap<(ObjectId, u32), [u32; 2]>);

impl Borders {
    /// One look at every chunk, objects in parallel. Memory: 4 bytes a vertex of the objects at work, and the border's vertices.
    pub(crate) fn find(scene: &Scene, tree: &Tree, cx: &Context<'_>) -> Result<Self, Fault> {
        let mut leaf = vec![0u32; scene.chunks.len()];
        for (n, node) in (0u32..).zip(&tree.octree.nodes) {
            node.chunks.iter().for_each(|c| leaf[c.index()] = n);
        }
        let of_object = |o: usize| {
            let (object, mut shared) = (&scene.objects[o], vec![]);
            let chunks = object.chunks.start as usize..object.chunks.end as usize;
            if leaf[chunks.clone()].windows(2).all(|w| w[0] == w[1]) {
                return Ok(shared);
            }
            let mut owner = vec![u32::MAX; scene.meshes[object.mesh.index()].vertex_ids as usize];
            for c in chunks {
                cx.check()?;
                let here = leaf[c];
                scene.geometry.with(scene.chunks[c].source, &mut |chunk| {
                    for &v in &chunk.vertex_ids {
                        let first = &mut owner[v as usize];
                        if *first == u32::MAX {
                            *first = here;
                        } else if *first != here {
                            shared.push(((ObjectId(o as u32), v), [here, *first]));
                        }
                    }
                })?;
            }
            Ok(shared)
        };
        let mut spans: HashMap<(ObjectId, u32), [u32; 2]> = HashMap::new();
        for (name, [a, b]) in collect(cx.run, scene.objects.len(), &of_object)?.into_iter().flatten() {
            let span = spans.entry(name).or_insert([a, a]);
            *span = [span[0].min(a).min(b), span[1].max(a).max(b)];
        }
        Ok(Self(spans))
    }

    /// The first and the last leaf that use a vertex of the leaf `own`.
    pub(crate) fn span(&self, name: (ObjectId, u32), own: u32) -> [u32; 2] {
        self.0.get(&name).copied().unwrap_or([own; 2])
    }
}
