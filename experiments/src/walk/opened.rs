//! A built pipeline, opened for drawing: its far views, and the draws of a frame.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use farfield_core::backend::Backend;
use farfield_core::cell::{Active, Cell};
use farfield_core::claim::Claim;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, CellId, PayloadRef, SplitId, TargetId};
use farfield_core::payload::{Part, Payload, Projector};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Candidate, Covers, Demand, DrawBudget, FarView, LeftOut, View};
use farfield_core::{Aabb, Camera, Fault};
use glam::DVec3;

use super::loading::cost;
use super::residency::Residency;
use super::trouble::named;
use crate::build::{Built, BuiltCell, Division};
use crate::config::Pipeline;
use crate::failure::Failure;
use crate::store::{Manifest, Store, Stored, unpack};

/// The asset of the scene; those of cells follow.
pub(super) const SHARED: AssetId = AssetId(0);
/// Where frames are drawn.
pub(super) const SURFACE: TargetId = TargetId(0);
/// Where they are lit.
pub(super) const PICTURE: TargetId = TargetId(1);

/// The asset of a cell.
pub(super) fn asset_of(cell: CellId) -> AssetId {
    AssetId(cell.0 + 1)
}

fn blocks_of(asset: AssetId, m: &Manifest) -> impl Iterator<Item = Block> {
    m.payloads.keys().map(move |&id| Block::Payload(PayloadRef { asset, id }))
}

/// A pipeline ready to draw.
pub struct Opened<'a> {
    /// Its settings.
    pub pipeline: &'a Pipeline,
    /// Its cells.
    pub division: &'a Division,
    /// What was built; grows while walking where cells are built on demand.
    pub built: Built,
    scene: &'a Scene,
    store: &'a Store,
    views: BTreeMap<CellId, Box<dyn FarView>>,
}

/// What a frame draws.
pub struct Drawn {
    /// The cell that served it.
    pub cell: Option<CellId>,
    /// The draws of its surface pass.
    pub draws: Vec<Draw>,
    /// Blocks that it missed.
    pub missing: u32,
    /// The error that the far field believes in, pixels.
    pub error_px: f32,
}

impl<'a> Opened<'a> {
    /// Opens what was built.
    ///
    /// # Errors
    /// What the far field says of the stored bytes.
    pub fn new(
        pipeline: &'a Pipeline,
        division: &'a Division,
        mut built: Built,
        scene: &'a Scene,
        store: &'a Store,
    ) -> Result<Self, Failure> {
        let cells = std::mem::take(&mut built.cells);
        let mut opened = Self { pipeline, division, built, scene, store, views: BTreeMap::new() };
        for (id, cell) in cells {
            let failed = |f| Failure::during(format!("pipeline \"{}\": opening cell {}", pipeline.name, id.0), f);
            opened.add(id, cell).map_err(failed)?;
        }
        Ok(opened)
    }

    /// Adds a cell, or its far field to one that was there without.
    ///
    /// # Errors
    /// What the far field says of the stored bytes.
    pub(super) fn add(&mut self, id: CellId, cell: BuiltCell) -> Result<(), Fault> {
        if let Some(manifest) = &cell.manifest {
            let shared = self.built.shared.as_ref().map(|s| (SHARED, s.1.index.as_slice()));
            self.views.insert(id, self.pipeline.far_field.open(shared, (asset_of(id), &manifest.index))?);
        }
        self.built.cells.insert(id, cell);
        Ok(())
    }

    /// Notes what was left out, each once.
    pub(super) fn note(&mut self, left_out: &[LeftOut]) {
        for l in left_out {
            if !self.built.left_out.contains(l) {
                self.built.left_out.push(l.clone());
            }
        }
    }

    /// The built cell that serves a camera.
    pub fn cell_of(&self, camera: &Camera) -> Option<CellId> {
        self.division.cells.find(camera).filter(|id| self.built.cells.contains_key(id))
    }

    /// What is stored of a payload block.
    pub fn stored(&self, block: Block) -> Option<&Stored> {
        let Block::Payload(p) = block else { return None };
        let manifest: &Manifest = if p.asset == SHARED {
            &self.built.shared.as_ref()?.1
        } else {
            self.built.cells.get(&CellId(p.asset.0 - 1))?.manifest.as_ref()?
        };
        manifest.payloads.get(&p.id)
    }

    /// A payload from the store, read once.
    ///
    /// # Errors
    /// [`Fault::Data`] with the file and what is wrong with it.
    pub(super) fn read(&self, block: Block) -> Result<Payload, Fault> {
        let gone = || Fault::Data { place: named(block), cause: "it is not in the store".into() };
        let s = self.stored(block).ok_or_else(gone)?;
        unpack(&self.store.read(&s.key, s.bytes, s.raw_bytes)?)
    }

    /// A payload from the store; what fails is read once more.
    ///
    /// # Errors
    /// [`Fault::Data`] with the block, its file and what is wrong with it.
    pub fn fetch(&self, block: Block) -> Result<Payload, Fault> {
        let failed = |f: Fault| Fault::Data { place: named(block), cause: format!("{f} (read twice)") };
        self.read(block).or_else(|_| self.read(block)).map_err(failed)
    }

    /// Forgets a cell's far field, so that it is built again when it is asked for.
    pub(super) fn unbuild(&mut self, cell: CellId) {
        if let Some(built) = self.built.cells.get_mut(&cell) {
            built.manifest = None;
            self.views.remove(&cell);
        }
    }

    /// The blocks that draws need: chunks, payloads, and the atlases that their projectors take from.
    ///
    /// # Errors
    /// As [`Opened::fetch`].
    pub fn blocks_of(&self, draws: &[Draw]) -> Result<BTreeSet<Block>, Fault> {
        let mut out = BTreeSet::new();
        for d in draws {
            match &d.what {
                DrawWhat::Chunks(set) => {
                    out.extend(set.iter().map(|c| Block::Chunk(self.scene.chunks[c.index()].source)));
                }
                DrawWhat::Payload { id, .. } => {
                    let block = Block::Payload(*id);
                    if out.insert(block) {
                        let atlas = |p: &Projector| Block::Payload(PayloadRef { asset: id.asset, id: p.atlas });
                        for part in &self.fetch(block)?.parts {
                            if let Part::Projected(p) = part {
                                out.extend(p.projectors.iter().map(atlas));
                            }
                        }
                    }
                }
            }
        }
        Ok(out)
    }

    /// Every payload block of a cell, its scene's asset included.
    pub fn payloads(&self, cell: CellId) -> Vec<Block> {
        let own = self.manifest(cell).into_iter().flat_map(|m| blocks_of(asset_of(cell), m));
        self.shared_payloads().chain(own).collect()
    }

    /// Every payload block of all built cells.
    pub(super) fn all_payloads(&self) -> impl Iterator<Item = Block> {
        let cells = self.built.cells.iter().filter_map(|(id, c)| Some((*id, c.manifest.as_ref()?)));
        self.shared_payloads().chain(cells.flat_map(|(id, m)| blocks_of(asset_of(id), m)))
    }

    fn shared_payloads(&self) -> impl Iterator<Item = Block> {
        self.built.shared.iter().flat_map(|s| blocks_of(SHARED, &s.1))
    }

    /// What is stored of a cell, once it is built.
    fn manifest(&self, cell: CellId) -> Option<&Manifest> {
        self.built.cells.get(&cell)?.manifest.as_ref()
    }

    /// What the far field claims of a cell.
    pub fn claims(&self, cell: CellId) -> &[Claim] {
        self.manifest(cell).map_or(&[], |m| &m.claims)
    }

    /// Whether anything is claimed of any built cell.
    pub fn has_claims(&self) -> bool {
        self.built.cells.iter().any(|(id, c)| !c.cell.claims.is_empty() || !self.claims(*id).is_empty())
    }

    /// A cell, and what a camera uses of it.
    pub fn active(&self, id: CellId, camera: &Camera) -> Option<(&Cell, Active)> {
        let cell = &self.built.cells.get(&id)?.cell;
        Some((cell, self.division.cells.active(cell, camera)))
    }

    fn with_view<R>(
        &self,
        id: CellId,
        camera: &Camera,
        budget: DrawBudget,
        f: impl FnOnce(&dyn FarView, &View<'_>) -> R,
    ) -> Option<R> {
        let ((cell, at), far) = (self.active(id, camera)?, self.views.get(&id)?);
        // Half a pixel, at a box's nearest point and at its farthest from the picture's middle: a length s at distance d and at an angle a covers at most
        // s / d px_per_tan / cos^2 a.
        let half_px = |b: &Aabb| 0.5 * b.distance(camera.eye.as_vec3()) / (camera.px_per_tan() * stretch(camera, b));
        let view = View { scene: self.scene, camera, at: &at, tolerance: &half_px, budget, cell: Some(cell) };
        Some(f(&**far, &view))
    }

    /// The near chunks that a frame draws beside its far field, culled to the camera; all that it may see where the camera
    /// is in no cell.
    pub fn near(&self, cell: Option<CellId>, camera: &Camera) -> ChunkSet {
        let scene = self.scene;
        let near = cell.and_then(|id| self.active(id, camera)).map(|(cell, at)| match self.built.covers {
            Covers::Everything => ChunkSet::default(),
            Covers::Far => cell.splits[at.split.index()].far.complement(scene.chunks.len() as u32),
        });
        scene.cull(&near.unwrap_or_else(|| scene.all_chunks()), camera)
    }

    /// The draws of a frame, of blocks that are `resident`.
    pub fn draws(&self, cell: Option<CellId>, camera: &Camera, resident: &dyn Fn(Block) -> bool) -> Drawn {
        let near = self.near(cell, camera);
        let there: ChunkSet =
            near.iter().filter(|c| resident(Block::Chunk(self.scene.chunks[c.index()].source))).collect();
        let mut missing = (near.len() - there.len()) as u32;
        let (mut draws, mut error_px) = (vec![], 0.0);
        if !there.is_empty() {
            draws.push(Draw { what: DrawWhat::Chunks(there), bounds: self.scene.bounds, error_px: 0.0 });
        }
        if let Some(id) = cell {
            let achieved = self.with_view(id, camera, self.pipeline.far_field.draw_budget(), |far, view| {
                far.draw(resident, view, &mut draws)
            });
            error_px = achieved.map_or(0.0, |a| a.error_px);
            // A cell that is not built yet lacks what its windows show, or all of it.
            let windows = || self.active(id, camera).map_or(0, |(_, at)| at.sectors.len() as u32);
            let everything = u32::from(self.built.covers == Covers::Everything);
            missing += achieved.map(|a| a.missing).unwrap_or_else(|| windows().max(everything));
        }
        Drawn { cell, draws, missing, error_px }
    }

    /// What a cell's far field alone draws, all of it resident and cut short by no budget.
    pub fn far_draws(&self, cell: CellId, camera: &Camera) -> Vec<Draw> {
        let mut draws = vec![];
        self.with_view(cell, camera, DrawBudget::default(), |far, view| far.draw(&|_| true, view, &mut draws));
        draws
    }

    /// Where a cell's far field was sampled from, split by split, each with what is far there.
    pub fn viewpoints(&self, id: CellId) -> Vec<(SplitId, &ChunkSet, DVec3)> {
        let (Some(built), Some(far)) = (self.built.cells.get(&id), self.views.get(&id)) else { return vec![] };
        let cell = &built.cell;
        let mut out = vec![];
        for (i, split) in cell.splits.iter().enumerate() {
            let id = SplitId(i as u32);
            out.extend(far.viewpoints(cell, id).into_iter().map(|eye| (id, &split.far, eye)));
        }
        out
    }

    /// Original triangles over triangles that a cell draws, not culled to any frustum; 0 where nothing is simplified, or where
    /// what is far depends on the view's direction.
    pub fn original_over_simplified(&self, cell: CellId) -> f64 {
        let Some(BuiltCell { cell, manifest: Some(manifest) }) = self.built.cells.get(&cell) else { return 0.0 };
        let [split] = cell.splits.as_slice() else { return 0.0 };
        let all = self.scene.triangles();
        let far = self.scene.triangles_of(&split.far);
        let simplified = manifest.triangles();
        if self.built.covers == Covers::Everything || manifest.payloads.is_empty() {
            return 0.0;
        }
        all as f64 / (all - far + simplified).max(1) as f64
    }
}

/// The largest 1 / cos^2 over the part of a picture that a box's ball covers, at most that of the picture's corner.
fn stretch(camera: &Camera, b: &Aabb) -> f32 {
    let (to, radius) = ((b.centre().as_dvec3() - camera.eye).as_vec3(), 0.5 * b.size().length());
    let (distance, most) = (to.length(), camera.corner_stretch());
    if radius >= distance {
        return most;
    }
    let angle = to.angle_between(camera.forward) + (radius / distance).asin();
    if angle < std::f32::consts::FRAC_PI_2 { most.min(angle.cos().powi(-2)) } else { most }
}

/// A frame as two passes: what is seen, then light.
pub fn frame(camera: &Camera, draws: Vec<Draw>, shading: &Shading) -> DrawList {
    let shade = PassKind::Shade { surface: SURFACE, shading: shading.clone() };
    DrawList {
        passes: vec![
            Pass { kind: PassKind::Surface, camera: *camera, writes: SURFACE, draws },
            Pass { kind: shade, camera: *camera, writes: PICTURE, draws: vec![] },
        ],
    }
}

/// What far fields want, for schedulers.
pub(super) struct Wants<'a> {
    /// The pipeline.
    pub(super) opened: &'a Opened<'a>,
    /// What is held.
    pub(super) residency: &'a Residency,
    /// Who says what blocks take.
    pub(super) backend: &'a dyn Backend,
    /// The limit on all that is held.
    pub(super) limit: Option<u64>,
    /// Blocks that are not to be had.
    pub(super) given_up: &'a BTreeSet<Block>,
    /// The cells that were asked for and are not built, first to last; `None` where nothing is built on demand.
    pub(super) asked: Option<RefCell<Vec<CellId>>>,
}

impl Wants<'_> {
    /// What a block takes on the device; `None` where it is not to be had, ever.
    fn bytes(&self, block: Block) -> Option<u64> {
        if let Some(bytes) = self.residency.bytes_of(block) {
            return Some(bytes);
        }
        // What is not stored is asked for in vain, which is told.
        let cost = cost(self.opened, self.opened.scene, self.backend, block).unwrap_or_default();
        let fits = self.limit.is_none_or(|l| cost.most_bytes() <= l);
        (fits && !self.given_up.contains(&block)).then_some(cost.resident_bytes)
    }

    /// Puts the device's account of bytes in the place of the far field's, and leaves out what is not to be had and what is useless
    /// without it.
    fn weigh(&self, candidates: &mut Vec<Candidate>, first: usize) {
        let mut gone: BTreeSet<Block> = BTreeSet::new();
        for c in &mut candidates[first..] {
            match self.bytes(c.block) {
                Some(bytes) => c.bytes = bytes,
                None => _ = gone.insert(c.block),
            }
            if c.after.is_some_and(|b| self.bytes(b).is_none()) {
                gone.insert(c.block);
            }
        }
        while !gone.is_empty() {
            let before = gone.len();
            let behind = candidates[first..].iter().filter(|c| c.after.is_some_and(|b| gone.contains(&b)));
            gone.extend(behind.map(|c| c.block).collect::<Vec<_>>());
            if gone.len() == before {
                break;
            }
        }
        let mut at = 0;
        candidates.retain(|c| {
            at += 1;
            at <= first || !gone.contains(&c.block)
        });
    }
}

impl Demand for Wants<'_> {
    fn near(&self, eye: &Camera, radius: f32) -> Vec<CellId> {
        let here = self.opened.cell_of(eye);
        let at = Aabb::of([eye.eye.as_vec3()]);
        let outlines = self.opened.division.cells.outlines();
        let known = |id: &CellId| self.asked.is_some() || self.opened.built.cells.contains_key(id);
        let mut near: Vec<(bool, f32, CellId)> = (0..outlines.len() as u32)
            .map(CellId)
            .filter(known)
            .map(|id| (Some(id) != here, outlines[id.index()].region.distance(&at), id))
            .filter(|(elsewhere, d, _)| !elsewhere || *d <= radius)
            .collect();
        near.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        near.into_iter().map(|n| n.2).collect()
    }

    fn of(&self, cell: CellId, from: &Camera, out: &mut Vec<Candidate>) {
        let (first, budget) = (out.len(), self.opened.pipeline.far_field.draw_budget());
        let built = self.opened.with_view(cell, from, budget, |far, view| far.wanted(view, out));
        self.weigh(out, first);
        if let (None, Some(asked)) = (built, &self.asked) {
            asked.borrow_mut().push(cell);
        }
    }

    fn resident(&self, block: Block) -> bool {
        self.residency.has(block)
    }

    fn distance(&self, cell: CellId, eye: &Camera) -> f32 {
        let outlines = self.opened.division.cells.outlines();
        outlines[cell.index()].region.distance(&Aabb::of([eye.eye.as_vec3()]))
    }
}
