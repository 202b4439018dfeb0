//! Baking one cell in memory: scenes, a sink, an executor of any number of threads.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use farfield_core::Fault;
use farfield_core::camera::ViewModel;
use farfield_core::cell::{Cell, Outline};
use farfield_core::claim::Claim;
use farfield_core::context::{Context, Executor, Forget};
use farfield_core::id::{CellId, LocalPayload};
use farfield_core::payload::Payload;
use farfield_core::scene::Scene;
use farfield_core::strategy::{CellJob, Cells, FarField, LeftOut, Partition, Sink};
use farfield_cpu::CpuCapture;
use farfield_partition_hex::HexCells;
use glam::DVec3;

/// What a bake put out.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) payloads: BTreeMap<LocalPayload, Payload>,
    pub(crate) claims: Vec<Claim>,
    pub(crate) left_out: Vec<LeftOut>,
    pub(crate) index: Vec<u8>,
}

#[derive(Default)]
struct Keep(Mutex<Kept>);

impl Sink for Keep {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        assert!(self.0.lock().unwrap().payloads.insert(id, payload.clone()).is_none(), "{id:?} put twice");
        Ok(())
    }
    fn claim(&self, claim: Claim) {
        self.0.lock().unwrap().claims.push(claim);
    }
    fn left_out(&self, what: LeftOut) {
        self.0.lock().unwrap().left_out.push(what);
    }
}

/// Jobs on this many threads, in whatever order they come.
pub(crate) struct Threads(pub(crate) usize);

impl Executor for Threads {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
        std::thread::scope(|s| {
            for _ in 0..self.0 {
                s.spawn(|| {
                    loop {
                        // Backwards, to differ from serial order.
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= n {
                            return;
                        }
                        if let Err(e) = job(n - 1 - i) {
                            *failed.lock().unwrap() = Some(e);
                        }
                    }
                });
            }
        });
        failed.into_inner().unwrap().map_or(Ok(()), Err)
    }
}

pub(crate) fn views(eye_height: f32, resolution: u32) -> ViewModel {
    ViewModel {
        fov_y_rad: 60f32.to_radians(),
        resolution: [resolution; 2],
        near: 0.1,
        eye_height: [eye_height; 2],
        pitch_rad: [0.0; 2],
        max_speed: 30.0,
        max_turn_rad: 0.8,
    }
}

/// Hexagonal cells of a scene, reaching `cells` cells beyond it.
pub(crate) fn hexagons(scene: &Scene, views: &ViewModel, edge: f32, cells: f32) -> Box<dyn Cells> {
    let capture = CpuCapture::new(scene).unwrap();
    let go = AtomicBool::new(false);
    let cx = Context { capture: &capture, run: &Threads(1), memo: &Forget, cancel: &go };
    HexCells { edge, margin: Some(edge * cells * 2.0) }.divide(scene, views, &cx).unwrap()
}

/// The cell k cells away from the local frame's origin, along +z.
pub(crate) fn cell_at(cells: &dyn Cells, views: &ViewModel, edge: f32, k: u32) -> CellId {
    let z = f64::from(edge) * 3f64.sqrt() * f64::from(k);
    cells.find(&views.camera(DVec3::new(0.0, f64::from(views.eye_height[0]), z), 0.0, 0.0)).unwrap()
}

pub(crate) struct Baker<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) views: &'a ViewModel,
    pub(crate) capture: CpuCapture,
    pub(crate) threads: usize,
}

impl<'a> Baker<'a> {
    pub(crate) fn new(scene: &'a Scene, views: &'a ViewModel) -> Self {
        Self { scene, views, capture: CpuCapture::new(scene).unwrap(), threads: 2 }
    }

    pub(crate) fn inside(&self, cells: &dyn Cells, id: CellId) -> Cell {
        self.with(|cx| cells.inside(id, self.scene, cx).unwrap())
    }

    pub(crate) fn with<T>(&self, f: impl FnOnce(&Context<'_>) -> T) -> T {
        let go = AtomicBool::new(false);
        f(&Context { capture: &self.capture, run: &Threads(self.threads), memo: &Forget, cancel: &go })
    }

    pub(crate) fn bake(&self, far: &dyn FarField, cell: &Cell, outlines: &[Outline]) -> Result<Kept, Fault> {
        let sink = Keep::default();
        let job = CellJob { scene: self.scene, views: self.views, cell, outlines, shared: None };
        let index = self.with(|cx| far.bake_cell(&job, &sink, cx))?;
        Ok(Kept { index, ..sink.0.into_inner().unwrap() })
    }
}

/// A far field from its table in an experiment file, without its type.
pub(crate) fn textured(settings: &str) -> Box<dyn FarField> {
    assert!(farfield_strategies::link() > 0);
    toml::from_str(&format!("type = \"textured-lod-mesh\"\n{settings}")).unwrap()
}

pub(crate) fn triangles(kept: &Kept) -> u64 {
    kept.payloads.values().map(Payload::triangles).sum()
}
