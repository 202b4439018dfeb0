//! Run time: for each object in the frustum the coarsest level that is not off by more than the view allows. O(objects) a frame.

use std::collections::BTreeMap;

use farfield_core::Aabb;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, ChunkId, LocalPayload, PayloadRef};
use farfield_core::scene::{ChunkSet, Object};
use farfield_core::strategy::{Achieved, Candidate, FarView, View};

use super::index::{Entry, Index};

/// What a view's tolerance stands for, pixels.
const TOLERANCE_PX: f32 = 0.5;

/// The opened levels of a scene.
pub(super) struct Levels {
    pub(super) asset: AssetId,
    pub(super) index: Index,
    pub(super) max_px: f32,
}

impl Levels {
    fn chain(&self, object: u32) -> &[Entry] {
        let found = self.index.chains.binary_search_by_key(&object, |c| c.object);
        found.map_or(&[], |i| self.index.chains[i].levels.as_slice())
    }

    fn payload(&self, entry: &Entry) -> PayloadRef {
        PayloadRef { asset: self.asset, id: LocalPayload(entry.payload) }
    }

    /// How many levels below the original: 0 is the original. Errors rise along a chain.
    fn level(&self, chain: &[Entry], object: &Object, view: &View<'_>) -> usize {
        let allowed = (view.tolerance)(&object.bounds) * self.max_px / TOLERANCE_PX;
        chain.partition_point(|l| l.error <= allowed)
    }

    /// The error of a level in pixels, at the object's nearest point.
    fn error_px(chain: &[Entry], level: usize, object: &Object, view: &View<'_>) -> f32 {
        let Some(entry) = level.checked_sub(1).map(|l| &chain[l]) else { return 0.0 };
        entry.error * TOLERANCE_PX / (view.tolerance)(&object.bounds).max(f32::MIN_POSITIVE)
    }
}

fn chunks_in_view(object: &Object, view: &View<'_>) -> impl Iterator<Item = ChunkId> {
    object.chunks.clone().map(ChunkId).filter(|c| view.camera.may_see(&view.scene.chunks[c.index()].bounds))
}

impl FarView for Levels {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        // Objects that share a mesh share its chunks.
        let mut chunks: BTreeMap<Block, Candidate> = BTreeMap::new();
        for (i, object) in (0u32..).zip(&view.scene.objects) {
            let (chain, seen) = (self.chain(i), view.camera.may_see(&object.bounds));
            let level = self.level(chain, object, view);
            let diagonal = object.bounds.size().length();
            let tolerance = (view.tolerance)(&object.bounds).max(f32::MIN_POSITIVE);
            // Of what is drawn now all of the object is missing without it; of its neighbours in the chain, their step.
            let whole = diagonal * TOLERANCE_PX / tolerance;
            for k in level.saturating_sub(1)..=(level + 1).min(chain.len()) {
                let drawn = k == level;
                let px = if drawn { whole } else { Self::error_px(chain, k.max(level), object, view) };
                let Some(entry) = k.checked_sub(1).map(|k| &chain[k]) else {
                    for c in object.chunks.clone().map(ChunkId) {
                        let placed = &view.scene.chunks[c.index()];
                        let info = &view.scene.meshes[placed.source.mesh.index()].chunks[placed.source.chunk as usize];
                        let block = Block::Chunk(placed.source);
                        let known = chunks.entry(block).or_insert(Candidate {
                            block,
                            bytes: info.bytes(),
                            bounds: placed.bounds,
                            error_px_without: px,
                            in_view: false,
                            after: None,
                        });
                        known.error_px_without = known.error_px_without.max(px);
                        if drawn && view.camera.may_see(&placed.bounds) && !known.in_view {
                            (known.in_view, known.bounds) = (true, placed.bounds);
                        }
                    }
                    continue;
                };
                out.push(Candidate {
                    block: Block::Payload(self.payload(entry)),
                    bytes: entry.bytes,
                    bounds: object.bounds,
                    error_px_without: px,
                    in_view: drawn && seen,
                    after: None,
                });
            }
        }
        out.extend(chunks.into_values());
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let mut achieved = Achieved::default();
        let (mut plain, mut bounds): (Vec<ChunkId>, Aabb) = (vec![], Aabb::EMPTY);
        let there = |c: &ChunkId| resident(Block::Chunk(view.scene.chunks[c.index()].source));
        let seen = (0u32..).zip(&view.scene.objects).filter(|(_, o)| view.camera.may_see(&o.bounds));
        for (i, object) in seen {
            let chain = self.chain(i);
            let level = self.level(chain, object, view);
            let whole = |k: usize| match k.checked_sub(1) {
                Some(k) => resident(Block::Payload(self.payload(&chain[k]))),
                None => chunks_in_view(object, view).all(|c| there(&c)),
            };
            // Where the level is not there: the next coarser one that is, then the next finer one.
            let drawn = (level..=chain.len()).chain((0..level).rev()).find(|&k| whole(k));
            let Some(k) = drawn.unwrap_or(0).checked_sub(1) else {
                for c in chunks_in_view(object, view) {
                    if there(&c) {
                        bounds = bounds.union(view.scene.chunks[c.index()].bounds);
                        plain.push(c);
                    } else {
                        achieved.missing += 1;
                    }
                }
                continue;
            };
            let error_px = Self::error_px(chain, k + 1, object, view);
            achieved.error_px = achieved.error_px.max(error_px);
            let id = self.payload(&chain[k]);
            out.extend((0..chain[k].parts).map(|part| Draw {
                what: DrawWhat::Payload { id, part, object: i + 1 },
                bounds: object.bounds,
                error_px,
            }));
        }
        if !plain.is_empty() {
            let what = DrawWhat::Chunks(plain.into_iter().collect::<ChunkSet>());
            out.push(Draw { what, bounds, error_px: 0.0 });
        }
        achieved
    }
}
