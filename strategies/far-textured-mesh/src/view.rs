//! Run time: window culling, frustum culling, and the draws that are left.
//!
//! Follows textured LOD meshes (2003, section 3.2): what no active window shows is skipped first, then what the frustum does not
//! meet; the rest is drawn by projective texturing. O(objects) a frame.

use farfield_core::Aabb;
use farfield_core::cell::{Active, Cell};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, SplitId};
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{Achieved, Candidate, FarView, View};
use glam::DVec3;

use crate::index::{Entry, Index};

/// An opened cell.
pub(crate) struct TexturedView {
    pub(crate) asset: AssetId,
    pub(crate) index: Index,
}

impl TexturedView {
    fn payload(&self, id: u32) -> PayloadRef {
        PayloadRef { asset: self.asset, id: LocalPayload(id) }
    }

    fn atlas_block(&self, entry: &Entry) -> Option<Block> {
        entry.atlas.map(|a| Block::Payload(self.payload(self.index.atlases[a as usize].payload)))
    }

    fn plain(&self, at: &Active) -> Option<&ChunkSet> {
        self.index.plain.get(at.split.index()).filter(|c| !c.is_empty())
    }
}

/// Window culling, then frustum culling.
fn in_view(entry: &Entry, view: &View<'_>) -> bool {
    entry.split == view.at.split.0
        && view.at.sectors.iter().any(|s| entry.sectors.contains(&s.0))
        && view.camera.may_see(&entry.bounds)
}

impl FarView for TexturedView {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        let mut used = vec![(false, 0f32); self.index.atlases.len()];
        let first = out.len();
        // Entries of one payload, one a split that shares it, follow each other.
        for entries in self.index.meshes.chunk_by(|a, b| a.payload == b.payload) {
            let (entry, in_view) = (&entries[0], entries.iter().any(|e| in_view(e, view)));
            if let Some(a) = entry.atlas {
                let (seen, px) = &mut used[a as usize];
                (*seen, *px) = (*seen || in_view, px.max(entry.size_px));
            }
            out.push(Candidate {
                block: Block::Payload(self.payload(entry.payload)),
                bytes: entry.bytes,
                bounds: entry.bounds,
                error_px_without: entry.size_px,
                in_view,
                after: self.atlas_block(entry),
            });
        }
        let atlases = self.index.atlases.iter().zip(used).map(|(atlas, (in_view, px))| Candidate {
            block: Block::Payload(self.payload(atlas.payload)),
            bytes: atlas.bytes,
            bounds: atlas.bounds,
            error_px_without: px,
            in_view,
            after: None,
        });
        out.splice(first..first, atlases);
        for c in self.plain(view.at).into_iter().flat_map(ChunkSet::iter) {
            let placed = &view.scene.chunks[c.index()];
            let info = &view.scene.meshes[placed.source.mesh.index()].chunks[placed.source.chunk as usize];
            out.push(Candidate {
                block: Block::Chunk(placed.source),
                bytes: info.bytes(),
                bounds: placed.bounds,
                error_px_without: f32::INFINITY,
                in_view: view.camera.may_see(&placed.bounds),
                after: None,
            });
        }
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let mut achieved = Achieved::default();
        for entry in self.index.meshes.iter().filter(|e| in_view(e, view)) {
            let id = self.payload(entry.payload);
            if !resident(Block::Payload(id)) || !self.atlas_block(entry).is_none_or(resident) {
                achieved.missing += 1;
                continue;
            }
            achieved.error_px = achieved.error_px.max(entry.error_px);
            out.extend((0..entry.parts).map(|part| Draw {
                what: DrawWhat::Payload { id, part, object: entry.object + 1 },
                bounds: entry.bounds,
                error_px: entry.error_px,
            }));
        }
        if let Some(plain) = self.plain(view.at) {
            let wanted = view.scene.cull(plain, view.camera);
            let there: ChunkSet =
                wanted.iter().filter(|c| resident(Block::Chunk(view.scene.chunks[c.index()].source))).collect();
            achieved.missing += (wanted.len() - there.len()) as u32;
            if !there.is_empty() {
                let bounds = there.iter().fold(Aabb::EMPTY, |b, c| b.union(view.scene.chunks[c.index()].bounds));
                out.push(Draw { what: DrawWhat::Chunks(there), bounds, error_px: 0.0 });
            }
        }
        achieved
    }

    /// The cell's centre; the further views of objects that one view does not serve are not named.
    fn viewpoints(&self, cell: &Cell, split: SplitId) -> Vec<DVec3> {
        let any = self.index.meshes.iter().any(|m| m.split == split.0);
        any.then_some(cell.outline.centre.as_dvec3()).into_iter().collect()
    }
}
