//! Run time: a cut through each object's hierarchy. O(groups) a frame.

use std::collections::BTreeMap;

use farfield_core::Aabb;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, ChunkId, LocalPayload, PayloadRef};
use farfield_core::scene::{ChunkSet, Object};
use farfield_core::strategy::{Achieved, Candidate, FarView, View};

use crate::cut::{Cut, Has};
use crate::index::{Index, ObjectGroups};

/// What a view's tolerance stands for, pixels.
const TOLERANCE_PX: f32 = 0.5;

/// The opened hierarchies of a scene.
pub(crate) struct Clusters {
    asset: AssetId,
    max_px: f32,
    /// Of each object that has groups, with the groups below each group.
    objects: BTreeMap<u32, (ObjectGroups, Vec<Vec<u32>>)>,
}

impl Clusters {
    pub(crate) fn new(asset: AssetId, index: Index, max_px: f32) -> Self {
        let objects = index.objects.into_iter().map(|o| {
            let below = o.below();
            (o.object, (o, below))
        });
        Self { asset, max_px, objects: objects.collect() }
    }

    fn block(&self, groups: &ObjectGroups, group: u32) -> Block {
        let id = LocalPayload(groups.groups[group as usize].payload);
        Block::Payload(PayloadRef { asset: self.asset, id })
    }

    /// What the view's tolerance allows: groups that are off by at most `max_px`.
    fn allowed(&self, groups: &ObjectGroups, below: &[Vec<u32>], view: &View<'_>) -> Cut {
        Cut::allowed(groups, below, |g| {
            let group = &groups.groups[g as usize];
            group.error <= (view.tolerance)(&group.bounds) * self.max_px / TOLERANCE_PX
        })
    }

    /// The cut that is drawn of what is there, and how much is missing.
    fn settled(
        &self,
        groups: &ObjectGroups,
        below: &[Vec<u32>],
        view: &View<'_>,
        first: u32,
        resident: &dyn Fn(Block) -> bool,
    ) -> (Cut, u32) {
        let placed = |c: usize| &view.scene.chunks[first as usize + c];
        let has = Has {
            group: &|g| resident(self.block(groups, g)),
            chunk: &|c| resident(Block::Chunk(placed(c).source)),
            sees_part: &|g, p| view.camera.may_see(&groups.groups[g as usize].parts[p].bounds),
            sees_chunk: &|c| view.camera.may_see(&placed(c).bounds),
        };
        self.allowed(groups, below, view).settle(groups, below, &has)
    }
}

/// A length at a box's nearest point, pixels.
fn px(length: f32, bounds: &Aabb, view: &View<'_>) -> f32 {
    length * TOLERANCE_PX / (view.tolerance)(bounds).max(f32::MIN_POSITIVE)
}

/// The blocks that are wanted: chunks once, whoever places them.
#[derive(Default)]
struct Wanted {
    chunks: BTreeMap<Block, Candidate>,
}

impl Wanted {
    fn chunk(&mut self, chunk: u32, view: &View<'_>, drawn: bool, error_px_without: f32, after: Option<Block>) {
        let placed = &view.scene.chunks[chunk as usize];
        let info = &view.scene.meshes[placed.source.mesh.index()].chunks[placed.source.chunk as usize];
        let in_view = drawn && view.camera.may_see(&placed.bounds);
        let block = Block::Chunk(placed.source);
        let (bytes, bounds) = (info.bytes(), placed.bounds);
        let one = Candidate { block, bytes, bounds, error_px_without, in_view, after };
        let known = self.chunks.entry(block).or_insert(one);
        // Of the objects that place it the one that needs it most speaks for it.
        if (in_view, error_px_without) > (known.in_view, known.error_px_without) {
            *known = one;
        }
    }
}

impl Clusters {
    /// What an object wants: its cut, all groups above it, coarsest first, which stand in for what is missing, and what the next
    /// step closer would uncover.
    fn wanted_of(
        &self,
        object: &Object,
        groups: &ObjectGroups,
        below: &[Vec<u32>],
        view: &View<'_>,
        chunks: &mut Wanted,
        out: &mut Vec<Candidate>,
    ) {
        let cut = self.allowed(groups, below, view);
        let whole = px(object.bounds.size().length(), &object.bounds, view);
        let count = groups.groups.len();
        let error_px: Vec<f32> = groups.groups.iter().map(|g| px(g.error, &g.bounds, view)).collect();
        // Without a part, what replaces it is drawn instead; at the top, nothing is.
        let without = |replaced_by: Option<u32>| replaced_by.map_or(whole, |h| error_px[h as usize]);
        let draws = |g: u32| (0..groups.groups[g as usize].parts.len()).any(|p| cut.draws(groups, g, p));
        // Drawn or above; or right below.
        let mut kept: Vec<bool> = (0..count as u32).map(|g| !cut.applied[g as usize] || draws(g)).collect();
        let stands_in = kept.clone();
        for g in (0..count as u32).filter(|&g| cut.applied[g as usize] && draws(g)) {
            below[g as usize].iter().for_each(|&b| kept[b as usize] = true);
        }
        for g in (0..count as u32).rev().filter(|&g| kept[g as usize]) {
            let group = &groups.groups[g as usize];
            let above = group.parts.iter().map(|p| p.replaced_by);
            let error_px_without = match stands_in[g as usize] {
                true => above.clone().map(without).fold(0.0, f32::max),
                // It is there for the next step: without it what is drawn now stays.
                false => above.clone().flatten().map(|h| error_px[h as usize]).fold(0.0, f32::max),
            };
            out.push(Candidate {
                block: self.block(groups, g),
                bytes: group.bytes,
                bounds: group.bounds,
                error_px_without,
                in_view: stands_in[g as usize] && group.parts.iter().any(|p| view.camera.may_see(&p.bounds)),
                after: above.flatten().min().map(|h| self.block(groups, h)),
            });
        }
        for (c, replaced_by) in object.chunks.clone().zip(&groups.chunks) {
            let drawn = replaced_by.is_none_or(|g| !cut.applied[g as usize]);
            let next = replaced_by.is_some_and(|g| cut.applied[g as usize] && draws(g));
            if drawn || next {
                let after = replaced_by.map(|g| self.block(groups, g));
                chunks.chunk(c, view, drawn, without(*replaced_by), after);
            }
        }
    }
}

impl FarView for Clusters {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        let mut chunks = Wanted::default();
        for (i, object) in (0u32..).zip(&view.scene.objects) {
            match self.objects.get(&i) {
                Some((groups, below)) => self.wanted_of(object, groups, below, view, &mut chunks, out),
                None => {
                    let whole = px(object.bounds.size().length(), &object.bounds, view);
                    object.chunks.clone().for_each(|c| chunks.chunk(c, view, true, whole, None));
                }
            }
        }
        out.extend(chunks.chunks.into_values());
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let mut achieved = Achieved::default();
        let (mut plain, mut bounds): (Vec<ChunkId>, Aabb) = (vec![], Aabb::EMPTY);
        let seen = (0u32..).zip(&view.scene.objects).filter(|(_, o)| view.camera.may_see(&o.bounds));
        for (i, object) in seen {
            let settled = self
                .objects
                .get(&i)
                .map(|(groups, below)| (groups, self.settled(groups, below, view, object.chunks.start, resident)));
            for (c, id) in object.chunks.clone().enumerate() {
                let placed = &view.scene.chunks[id as usize];
                let drawn = settled.as_ref().is_none_or(|(groups, (cut, _))| cut.draws_chunk(groups, c));
                if !drawn || !view.camera.may_see(&placed.bounds) {
                    continue;
                }
                if resident(Block::Chunk(placed.source)) {
                    bounds = bounds.union(placed.bounds);
                    plain.push(ChunkId(id));
                } else if settled.is_none() {
                    achieved.missing += 1;
                }
            }
            let Some((groups, (cut, missing))) = settled else { continue };
            achieved.missing += missing;
            for (g, group) in (0u32..).zip(&groups.groups) {
                let block = self.block(groups, g);
                let Block::Payload(id) = block else { continue };
                if !cut.applied[g as usize] || !resident(block) {
                    continue;
                }
                let error_px = px(group.error, &group.bounds, view);
                for (p, part) in group.parts.iter().enumerate() {
                    if cut.draws(groups, g, p) && view.camera.may_see(&part.bounds) {
                        achieved.error_px = achieved.error_px.max(error_px);
                        let what = DrawWhat::Payload { id, part: p as u16, object: i + 1 };
                        out.push(Draw { what, bounds: part.bounds, error_px });
                    }
                }
            }
        }
        if !plain.is_empty() {
            let what = DrawWhat::Chunks(plain.into_iter().collect::<ChunkSet>());
            out.push(Draw { what, bounds, error_px: 0.0 });
        }
        achieved
    }
}
