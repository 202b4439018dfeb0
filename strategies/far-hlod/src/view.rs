//! Run time (section 4): the tree is walked from its root, culling to the frustum and by normal cones, until a node's error is small enough.
//!
//! A node is refined only where all of its visible children are there, so that nothing is drawn twice and nothing is missing: under pressure the
//! error rises, and is told. Below its leaves stand the original chunks. O(nodes on and above the cut) a frame.

use std::collections::BTreeMap;

use farfield_core::Aabb;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, ChunkId, LocalPayload, PayloadRef};
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{Achieved, Candidate, FarView, View};

use crate::skeleton::{Node, Skeleton};

/// What a view's tolerance stands for, pixels.
const TOLERANCE_PX: f32 = 0.5;

/// The opened tree.
pub(crate) struct Hierarchy {
    pub(crate) asset: AssetId,
    pub(crate) skeleton: Skeleton,
    pub(crate) max_px: f32,
}

/// What a frame's walk collects.
struct Frame<'a> {
    view: &'a View<'a>,
    resident: &'a dyn Fn(Block) -> bool,
    out: &'a mut Vec<Draw>,
    plain: Vec<ChunkId>,
    achieved: Achieved,
}

impl Hierarchy {
    fn node(&self, node: u32) -> &Node {
        &self.skeleton.nodes[node as usize]
    }

    fn payload(&self, node: u32) -> PayloadRef {
        PayloadRef { asset: self.asset, id: LocalPayload(node) }
    }

    fn is_there(&self, node: u32, resident: &dyn Fn(Block) -> bool) -> bool {
        self.node(node).parts == 0 || resident(Block::Payload(self.payload(node)))
    }

    fn visible(&self, node: u32, view: &View<'_>) -> bool {
        let n = self.node(node);
        view.camera.may_see(&n.bounds) && !n.cone.shows_backs(&n.bounds, view.camera.eye.as_vec3())
    }

    /// A length in pixels, at the nearest point of a box.
    fn px(length: f32, bounds: &Aabb, view: &View<'_>) -> f32 {
        if length > 0.0 { length * TOLERANCE_PX / tolerance(bounds, view).max(f32::MIN_POSITIVE) } else { 0.0 }
    }

    fn good_enough(&self, node: u32, view: &View<'_>) -> bool {
        let n = self.node(node);
        n.error * TOLERANCE_PX <= tolerance(&n.bounds, view) * self.max_px
    }

    fn visible_children(&self, node: u32, view: &View<'_>) -> Vec<u32> {
        self.skeleton.children(node).filter(|&c| self.visible(c, view)).collect()
    }

    /// Draws a visible node or what is below it.
    fn walk(&self, node: u32, frame: &mut Frame<'_>) {
        let n = self.node(node);
        let there = self.is_there(node, frame.resident);
        if !there || !self.good_enough(node, frame.view) {
            if self.skeleton.is_leaf(node) {
                let view = frame.view;
                let seen = |c: &ChunkId| view.camera.may_see(&view.scene.chunks[c.index()].bounds);
                let has = |c: &ChunkId| (frame.resident)(Block::Chunk(view.scene.chunks[c.index()].source));
                let chunks: Vec<ChunkId> = n.chunks.iter().copied().filter(seen).collect();
                if !there || chunks.iter().all(has) {
                    let (found, missing): (Vec<_>, Vec<_>) = chunks.into_iter().partition(has);
                    frame.plain.extend(found);
                    frame.achieved.missing += missing.len() as u32;
                    return;
                }
            } else {
                let children = self.visible_children(node, frame.view);
                if !there || children.iter().all(|&c| self.is_there(c, frame.resident)) {
                    children.into_iter().for_each(|c| self.walk(c, frame));
                    return;
                }
            }
        }
        let error_px = Self::px(n.error, &n.bounds, frame.view);
        frame.achieved.error_px = frame.achieved.error_px.max(error_px);
        frame.out.extend((0..u16::from(n.parts)).map(|part| Draw {
            what: DrawWhat::Payload { id: self.payload(node), part, object: n.object },
            bounds: n.bounds,
            error_px,
        }));
    }

    /// What a node and those below it are wanted for; `before` is what would be drawn without it, pixels.
    fn want(
        &self,
        node: u32,
        (after, before): (Option<Block>, f32),
        view: &View<'_>,
        chunks: &mut BTreeMap<Block, Candidate>,
        out: &mut Vec<Candidate>,
    ) {
        let (n, block) = (self.node(node), Block::Payload(self.payload(node)));
        let seen = self.visible(node, view);
        if n.parts > 0 {
            out.push(Candidate {
                block,
                bytes: n.bytes,
                bounds: n.bounds,
                error_px_without: before,
                in_view: seen,
                after,
            });
        }
        if self.good_enough(node, view) {
            return;
        }
        let own = Self::px(n.error, &n.bounds, view);
        let below = (if n.parts > 0 { Some(block) } else { after }, own);
        self.skeleton.children(node).for_each(|c| self.want(c, below, view, chunks, out));
        for &c in &n.chunks {
            let placed = &view.scene.chunks[c.index()];
            let info = &view.scene.meshes[placed.source.mesh.index()].chunks[placed.source.chunk as usize];
            let (block, in_view) = (Block::Chunk(placed.source), seen && view.camera.may_see(&placed.bounds));
            // Objects that share a mesh share its chunks.
            let known = chunks.entry(block).or_insert(Candidate {
                block,
                bytes: info.bytes(),
                bounds: placed.bounds,
                error_px_without: own,
                in_view: false,
                after: None,
            });
            known.error_px_without = known.error_px_without.max(own);
            if in_view && !known.in_view {
                (known.in_view, known.bounds) = (true, placed.bounds);
            }
        }
    }
}

/// The error allowed at a box, scene units. For an eye outside the cell, of a cell that is loaded in advance: what the cell's
/// nearest viewpoint allows, so that nothing is wanted that no viewpoint of the cell can need.
fn tolerance(bounds: &Aabb, view: &View<'_>) -> f32 {
    let (allowed, eye) = ((view.tolerance)(bounds), view.camera.eye.as_vec3());
    match view.cell.map(|c| &c.outline.region) {
        Some(region) if !region.contains(eye) => {
            let from_eye = bounds.distance(eye);
            if from_eye > 0.0 { allowed * region.distance(bounds) / from_eye } else { allowed }
        }
        _ => allowed,
    }
}

impl FarView for Hierarchy {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        if self.skeleton.nodes.is_empty() {
            return;
        }
        // Without the root nothing is there.
        let whole = Self::px(self.node(0).bounds.size().length(), &self.node(0).bounds, view);
        let mut chunks = BTreeMap::new();
        self.want(0, (None, whole), view, &mut chunks, out);
        out.extend(chunks.into_values());
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let mut frame = Frame { view, resident, out, plain: vec![], achieved: Achieved::default() };
        if !self.skeleton.nodes.is_empty() && self.visible(0, view) {
            self.walk(0, &mut frame);
        }
        let Frame { plain, achieved, .. } = frame;
        if !plain.is_empty() {
            let bounds = plain.iter().map(|c| view.scene.chunks[c.index()].bounds).fold(Aabb::EMPTY, Aabb::union);
            let what = DrawWhat::Chunks(plain.into_iter().collect::<ChunkSet>());
            out.push(Draw { what, bounds, error_px: 0.0 });
        }
        achieved
    }
}
