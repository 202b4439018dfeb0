//! Walking a path with a pipeline: per frame the cell, the scheduler's plan, the draw list, the time, the counts; on measured
//! frames the picture.
//!
//! Only [`farfield_core::backend::Backend::render`] is timed. The reference is walked first and without a budget; its measured
//! pictures wait in a temporary folder for those that are compared with them.

pub mod device;
mod loading;
mod on_demand;
mod opened;
mod reference;
mod residency;
mod trouble;

use std::cell::RefCell;
use std::collections::BTreeSet;

use farfield_core::backend::Backend;
use farfield_core::camera::ViewModel;
use farfield_core::claim::{Claim, Quantity};
use farfield_core::draw::{Draw, Shading};
use farfield_core::id::{Block, CellId};
use farfield_core::image::SurfaceImage;
use farfield_core::scene::Scene;
use farfield_core::strategy::Planner;
use farfield_core::{Camera, Fault};

pub use loading::cost;
pub use on_demand::OnDemand;
pub use opened::{Drawn, Opened, frame};
pub use reference::References;
pub use residency::{Cost, Device, Residency};
pub use trouble::{TRIES, Trouble};

use crate::audit::{CellAudit, Measured, Truth};
use crate::config::{BudgetSettings, MeasureSettings};
use crate::measure::{Pieces, Rendered, Surface, SurfaceErrors, surface_distances};
use crate::results::MemoryUse;
use opened::{PICTURE, SURFACE, asset_of};

/// What all walks of an experiment share.
pub struct Tour<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The views.
    pub views: &'a ViewModel,
    /// Light and background of a frame.
    pub lit: &'a dyn Fn(usize) -> Shading,
    /// The path.
    pub cameras: &'a [Camera],
    /// Frames a second of the path.
    pub frames_per_s: f32,
    /// What is measured.
    pub measure: &'a MeasureSettings,
}

/// One pipeline on one device.
pub struct Walker<'a> {
    /// What it draws.
    pub opened: Opened<'a>,
    tour: &'a Tour<'a>,
    on_demand: Option<OnDemand<'a>>,
    device: &'a mut Device,
    residency: Residency,
    planner: Box<dyn Planner>,
    trouble: Trouble,
    limit: Option<u64>,
    /// What has to stay free so that any block can come, bytes.
    headroom: u64,
    /// Payloads that `headroom` speaks of.
    sized: usize,
    /// Blocks that never fit the limit.
    too_large: u64,
    /// What the smallest and the largest block take while they are loaded, bytes.
    smallest: u64,
    largest: u64,
    /// Cells that were built again.
    rebuilt: BTreeSet<CellId>,
    strict: bool,
    upload_bytes_per_frame: Option<u64>,
    last: Option<Camera>,
    frames: usize,
    /// Where surfaces are compared.
    surfaces: Option<Surfaces>,
}

/// What surfaces are compared with, and what was drawn last.
struct Surfaces {
    pieces: RefCell<Pieces>,
    original: Surface,
    drawn: Vec<Draw>,
}

/// A frame, timed and counted.
pub struct Walked {
    /// The cell that served it.
    pub cell: Option<CellId>,
    /// Time, milliseconds.
    pub frame_ms: f64,
    /// By the device's own clock.
    pub by_gpu: bool,
    /// Original triangles.
    pub near_triangles: u64,
    /// Payload triangles.
    pub far_triangles: u64,
    /// Samples of layered depth images.
    pub samples: u64,
    /// Points of payloads.
    pub points: u64,
    /// Lines of payloads.
    pub lines: u64,
    /// Blocks not there.
    pub missing: u32,
    /// The error that its far field believes in, pixels.
    pub far_error_px: f32,
    /// Reads that failed, of what it asked for and of what the one before asked for.
    pub failed_reads: u64,
    /// Bytes that the scheduler had uploaded for it: what its blocks take on the device at most.
    pub uploaded_bytes: u64,
    /// Bytes resident.
    pub resident_bytes: u64,
    /// Bytes of resident texels.
    pub texture_bytes: u64,
}

impl<'a> Walker<'a> {
    /// At the start of the path. A reference gets no budget. `on_demand` builds what is missing, where cells are not built ahead.
    pub fn new(
        tour: &'a Tour<'a>,
        opened: Opened<'a>,
        on_demand: Option<OnDemand<'a>>,
        device: &'a mut Device,
        budget: &BudgetSettings,
    ) -> Self {
        // The next pipeline has its own payloads; chunks may stay, but under a limit everything there has to be its own.
        if budget.memory_bytes.is_some() {
            device.free_all();
        } else {
            device.free_payloads();
        }
        let mut walker = Self {
            planner: opened.pipeline.scheduler.start(),
            tour,
            opened,
            on_demand,
            device,
            residency: Residency::new(budget.memory_bytes),
            upload_bytes_per_frame: budget.upload_bytes_per_frame,
            trouble: Trouble::default(),
            limit: budget.memory_bytes,
            headroom: 0,
            sized: 0,
            too_large: 0,
            smallest: 0,
            largest: 0,
            rebuilt: BTreeSet::new(),
            strict: false,
            last: None,
            frames: 0,
            surfaces: None,
        };
        walker.size_up();
        walker
    }

    /// From here on surfaces can be compared with that of the scene.
    pub fn compare_surfaces(&mut self, scene: &Pieces) {
        let pieces = scene.for_another();
        self.surfaces = Some(Surfaces { original: pieces.original(), pieces: RefCell::new(pieces), drawn: vec![] });
    }

    /// Nothing may be missing: a block that cannot be read stops the walk.
    pub fn strict(self) -> Self {
        Self { strict: true, ..self }
    }

    /// What could not be had so far.
    pub fn trouble(&self) -> &Trouble {
        &self.trouble
    }

    /// Memory so far, and what could not be had.
    pub fn memory(&self) -> MemoryUse {
        MemoryUse {
            limit_bytes: self.limit,
            peak_bytes: self.residency.peak_bytes,
            smallest_block_bytes: self.smallest,
            largest_block_bytes: self.largest,
            blocks_too_large: self.too_large,
            failed_reads: self.trouble.failed_reads,
            blocks_given_up: self.trouble.given_up.len() as u64,
            troubles: self.trouble.lines.clone(),
        }
    }

    /// Builds the cells that were asked for, and those again whose payloads could not be read.
    fn build(&mut self, asked: &[CellId]) -> Result<(), Fault> {
        let Some(builder) = &mut self.on_demand else { return Ok(()) };
        let lost: BTreeSet<CellId> = self.trouble.given_up.iter().filter_map(|&b| trouble::cell_of(b)).collect();
        for cell in lost.difference(&self.rebuilt).copied().collect::<Vec<_>>() {
            self.rebuilt.insert(cell);
            self.opened.unbuild(cell);
            self.trouble.made_anew(|b| trouble::cell_of(*b) == Some(cell));
        }
        builder.build(&mut self.opened, asked)?;
        self.size_up();
        Ok(())
    }

    /// The next frame of the path.
    ///
    /// # Errors
    /// What loading and drawing give.
    pub fn step(&mut self, camera: &Camera) -> Result<Walked, Fault> {
        if let Some(builder) = &mut self.on_demand {
            builder.enter(&mut self.opened, camera)?;
        }
        let cell = self.opened.cell_of(camera);
        let (failed_before, first) = (self.trouble.failed_reads, self.frames == 0);
        let waited = self.arrive()?;
        let (mut asked, cells) = self.plan(camera, cell);
        let from_memory = self.upload_from_memory(&mut asked)?;
        // What others are compared with waits for what it lacks.
        let now = first || self.strict || self.limit.is_none();
        let mut uploaded_bytes = waited + from_memory;
        if now {
            uploaded_bytes = waited + self.fetch(&asked, from_memory, true)?;
        }
        self.build(&cells)?;
        (self.last, self.frames) = (Some(*camera), self.frames + 1);
        let residency = &self.residency;
        let drawn = self.opened.draws(cell, camera, &|b| residency.has(b));
        if let Some(s) = &mut self.surfaces {
            s.drawn.clone_from(&drawn.draws);
        }
        // This frame is counted already.
        let list = frame(camera, drawn.draws, &(self.tour.lit)(self.frames - 1));
        let warm_up = if self.frames == 1 { self.tour.measure.warm_up } else { 0 };
        for _ in 0..warm_up {
            self.device.backend.render(&list)?;
        }
        let mut best = self.device.backend.render(&list)?;
        let time = |c: &farfield_core::backend::Counted| c.gpu_ms.unwrap_or(c.wall_ms);
        for _ in 1..self.tour.measure.repeats {
            let again = self.device.backend.render(&list)?;
            if time(&again) < time(&best) {
                best = again;
            }
        }
        if !now {
            self.fetch(&asked, from_memory, false)?;
        }
        Ok(Walked {
            cell,
            frame_ms: time(&best),
            by_gpu: best.gpu_ms.is_some(),
            near_triangles: best.near_triangles,
            far_triangles: best.far_triangles,
            samples: best.samples,
            points: best.points,
            lines: best.lines,
            missing: drawn.missing,
            far_error_px: drawn.error_px,
            failed_reads: self.trouble.failed_reads - failed_before,
            uploaded_bytes,
            resident_bytes: self.residency.bytes,
            texture_bytes: self.residency.texture_bytes,
        })
    }

    /// The frame that was drawn last, read back.
    ///
    /// # Errors
    /// What the backend gives.
    pub fn read(&mut self) -> Result<Rendered, Fault> {
        read(&mut *self.device.backend)
    }

    /// How far what the last frame shows lies from the scene's surface, and what the reference shows from what it drew; `None` where surfaces are
    /// not compared, or what was drawn has none.
    ///
    /// # Errors
    /// What reading payloads gives.
    pub fn surface_errors(
        &self,
        camera: &Camera,
        pictures: [&SurfaceImage; 2],
    ) -> Result<Option<SurfaceErrors>, Fault> {
        let Some(s) = &self.surfaces else { return Ok(None) };
        let Some(drawn) = s.pieces.borrow_mut().drawn(&s.drawn, &|b| self.opened.fetch(b))? else { return Ok(None) };
        let all = surface_distances(camera, pictures, &s.original, &drawn);
        let claims = self.opened.pipeline.far_field.frame_claims();
        let claimed = claims.iter().find(|c| c.quantity == Quantity::SurfaceDistancePx);
        Ok(Some(SurfaceErrors::of(&all, claimed.map(|c| c.max))))
    }

    /// Audits the claims of all built cells at `views` held-out viewpoints over all of them: partition and far field.
    ///
    /// # Errors
    /// What loading and drawing give.
    pub fn audit(&mut self, views: usize, seed: u64) -> Result<Vec<Measured>, Fault> {
        let (tour, opened) = (self.tour, &self.opened);
        let frames: Vec<Claim> = opened.pipeline.far_field.frame_claims();
        // How far surfaces are off is looked at only where that was asked for.
        let of_frames = frames.iter().filter(|c| c.quantity != Quantity::SurfaceDistancePx || self.surfaces.is_some());
        let claims = |id: CellId| opened.claims(id).iter().chain(of_frames.clone()).cloned().collect::<Vec<Claim>>();
        let claimed = |id: &CellId| !claims(*id).is_empty() || !opened.built.cells[id].cell.claims.is_empty();
        let cells: Vec<CellId> = opened.built.cells.keys().copied().filter(claimed).collect();
        let each = views.div_ceil(cells.len().max(1));
        let mut out = vec![];
        if cells.is_empty() || views == 0 {
            return Ok(out);
        }
        let fetch = |b: Block| opened.fetch(b);
        for id in tour.scene.mesh_chunk_ids() {
            self.device.load(Block::Chunk(id), tour.scene, &fetch)?;
        }
        for id in cells {
            let payloads = opened.payloads(id);
            let lost = payloads.iter().find_map(|&b| self.device.load(b, tour.scene, &fetch).err());
            if let Some(fault) = lost {
                if self.strict || !matches!(fault, Fault::Data { .. }) {
                    return Err(fault);
                }
                self.trouble.line(format!("the claims of cell {} are not audited: {fault}", id.0));
                payloads.into_iter().filter(|&b| !self.residency.has(b)).for_each(|b| self.device.free(b));
                continue;
            }
            let draws = |c: &Camera| opened.far_draws(id, c);
            let drawn = |d: &[Draw], s: &Surfaces| s.pieces.borrow_mut().drawn(d, &fetch);
            let truth =
                self.surfaces.as_ref().map(|s| Truth { original: &s.original, drawn: Box::new(|d| drawn(d, s)) });
            let audit = CellAudit {
                scene: tour.scene,
                views: tour.views,
                cell: &opened.built.cells[&id].cell,
                cells: &*opened.division.cells,
                asset: asset_of(id),
                claims: &claims(id),
                draws: &draws,
                truth,
            };
            out.extend(audit.sample(&mut *self.device.backend, each, seed)?);
            for b in payloads.into_iter().filter(|&b| !self.residency.has(b)) {
                self.device.free(b);
            }
        }
        Ok(out)
    }
}

/// The frame that a backend drew last, read back.
///
/// # Errors
/// What the backend gives.
pub fn read(backend: &mut dyn Backend) -> Result<Rendered, Fault> {
    Ok(Rendered { picture: backend.read_picture(PICTURE)?, surface: backend.read_surface(SURFACE)? })
}
