//! Walking a path with a pipeline: per frame the cell, the scheduler's plan, the draw list, the time, the counts; on measured
//! frames the picture.
//!
//! Only [`farfield_core::backend::Backend::render`] is timed. The reference is walked first and without a budget; its measured
//! pictures wait in a temporary folder for those that are compared with them.

pub mod device;
mod on_demand;
mod opened;
mod reference;
mod residency;

use std::cell::RefCell;

use farfield_core::backend::Backend;
use farfield_core::camera::ViewModel;
use farfield_core::claim::{Claim, Quantity};
use farfield_core::draw::{Draw, Shading};
use farfield_core::id::{Block, CellId};
use farfield_core::image::SurfaceImage;
use farfield_core::scene::Scene;
use farfield_core::strategy::{Motion, Planner};
use farfield_core::{Camera, Fault};

pub use on_demand::OnDemand;
pub use opened::{Drawn, Opened, frame};
pub use reference::References;
pub use residency::{Device, Residency};

use crate::audit::{CellAudit, Measured, Truth};
use crate::config::{BudgetSettings, MeasureSettings};
use crate::measure::{Pieces, Rendered, Surface, SurfaceErrors, surface_distances};
use opened::{PICTURE, SURFACE, Wants, asset_of};

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
    /// The largest error that the far field states of its draws, pixels.
    pub stated_error_px: f32,
    /// Bytes that the scheduler had uploaded for it, by the far field's own account of its blocks.
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
        device.free_payloads();
        Self {
            planner: opened.pipeline.scheduler.start(),
            tour,
            opened,
            on_demand,
            device,
            residency: Residency::new(budget.memory_bytes),
            upload_bytes_per_frame: budget.upload_bytes_per_frame,
            last: None,
            frames: 0,
            surfaces: None,
        }
    }

    /// From here on surfaces can be compared with that of the scene.
    pub fn compare_surfaces(&mut self, scene: &Pieces) {
        let pieces = scene.for_another();
        self.surfaces = Some(Surfaces { original: pieces.original(), pieces: RefCell::new(pieces), drawn: vec![] });
    }

    /// Loads what a frame needs: its near chunks, then what the scheduler plans; the bytes of the latter.
    fn load(&mut self, camera: &Camera, cell: Option<CellId>) -> Result<u64, Fault> {
        let (scene, opened) = (self.tour.scene, &self.opened);
        let fetch = |b: Block| opened.fetch(b);
        self.residency.tick();
        for c in opened.near(cell, camera).iter() {
            let block = Block::Chunk(scene.chunks[c.index()].source);
            self.residency.hold(self.device, block, false, 0, scene, &fetch)?;
        }
        let before = self.last.unwrap_or(*camera);
        let motion = Motion {
            time_s: self.frames as f64 / f64::from(self.tour.frames_per_s),
            moved: before.eye.distance(camera.eye) as f32,
            turned_rad: before.forward.angle_between(camera.forward),
            eye: camera,
            lights: &[],
            future: self.tour.cameras.get(self.frames + 1..),
        };
        let asked = self.on_demand.as_ref().map(|_| RefCell::default());
        let wants = Wants { opened, residency: &self.residency, asked };
        let plan = self.planner.plan(&motion, &wants, self.residency.left_for_scheduler());
        let sizes = wants.sizes(&plan.fetch, cell, camera);
        let asked = wants.asked.map(RefCell::into_inner).unwrap_or_default();
        plan.evict.into_iter().for_each(|b| self.residency.release(self.device, b));
        let mut uploaded = 0;
        for block in plan.fetch {
            let bytes = sizes.get(&block).copied().unwrap_or(0);
            // At least one block a frame, or one that is larger than the limit would never come. What is left waits, in its
            // order: a later, smaller block may be useless without it.
            let there = self.residency.has(block);
            if !there && uploaded > 0 && self.upload_bytes_per_frame.is_some_and(|most| uploaded + bytes > most) {
                break;
            }
            let texels = opened.stored(block).map_or(0, |s| s.texture_bytes);
            if self.residency.hold(self.device, block, true, texels, scene, &fetch)? && !there {
                uploaded += bytes;
            }
        }
        if let Some(builder) = &mut self.on_demand {
            builder.build(&mut self.opened, &asked)?;
        }
        (self.last, self.frames) = (Some(*camera), self.frames + 1);
        Ok(uploaded)
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
        let uploaded_bytes = self.load(camera, cell)?;
        let residency = &self.residency;
        let drawn = self.opened.draws(cell, camera, &|b| residency.has(b));
        if let Some(s) = &mut self.surfaces {
            s.drawn.clone_from(&drawn.draws);
        }
        let stated_error_px = drawn.draws.iter().map(|d| d.error_px).fold(0.0, f32::max);
        // `load` has counted this frame already.
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
            stated_error_px,
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
            for &b in &payloads {
                self.device.load(b, tour.scene, &fetch)?;
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
