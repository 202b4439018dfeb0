//! Baking one cell in memory: scenes, a sink, an executor of any number of threads.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Cell, Outline};
use farfield_core::claim::Claim;
use farfield_core::context::{Context, Executor, Forget};
use farfield_core::id::{CellId, LocalPayload, MaterialId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::Payload;
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::{CellJob, Cells, FarField, LeftOut, Partition, Sink};
use farfield_core::{Aabb, Fault};
use farfield_cpu::CpuCapture;
use farfield_partition_hex::HexCells;
use glam::{DAffine3, DQuat, DVec3, Vec3};

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

/// One mesh, turned about the vertical, alone in a scene.
pub(crate) fn alone(mesh: TriangleMesh, yaw_deg: f64, scale: f64) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let mesh = b.mesh("object", mesh).unwrap();
    let turn = DQuat::from_rotation_y(yaw_deg.to_radians());
    b.place(Placement { mesh, transform: DAffine3::from_scale_rotation_translation(DVec3::splat(scale), turn, DVec3::ZERO) });
    b.build().unwrap()
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

/// The folder of real meshes; `None`, said loudly, where there is none.
pub(crate) fn models() -> Option<PathBuf> {
    let expected = std::env::var_os("FARFIELD_EXPECT_MODELS").is_some_and(|v| v == "1");
    match std::env::var_os("FARFIELD_MODELS").map(PathBuf::from).filter(|p| p.is_dir()) {
        Some(p) => Some(p),
        None if expected => panic!("FARFIELD_MODELS names no folder, and FARFIELD_EXPECT_MODELS = 1"),
        None => {
            println!("SKIPPED: FARFIELD_MODELS names no folder of meshes");
            None
        }
    }
}

/// Positions and triangles of an ascii PLY of vertices (x y z ...) and triangular faces, scaled axis by axis to `size` and put on
/// the ground.
pub(crate) fn ascii_ply(path: &Path, size: Vec3) -> TriangleMesh {
    let mut text = String::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    let (head, body) = text.split_once("end_header\n").unwrap();
    let count = |what: &str| -> usize {
        head.lines().find_map(|l| l.strip_prefix(what)).unwrap().trim().parse().unwrap()
    };
    let (vertices, faces) = (count("element vertex"), count("element face"));
    let mut lines = body.lines();
    let numbers = |line: &str| -> Vec<f32> { line.split_whitespace().map(|n| n.parse().unwrap()).collect() };
    let mut positions: Vec<Vec3> = lines.by_ref().take(vertices).map(|l| Vec3::from_slice(&numbers(l))).collect();
    let indices: Vec<u32> = lines.take(faces).flat_map(|l| numbers(l)[1..4].to_vec()).map(|n| n as u32).collect();
    let b = Aabb::of(positions.iter().copied());
    let foot = b.centre().with_y(b.min.y);
    positions.iter_mut().for_each(|p| *p = (*p - foot) * size / b.size());
    TriangleMesh {
        sections: vec![(0..indices.len() as u32, MaterialId(0))],
        positions,
        indices,
        ..TriangleMesh::default()
    }
}
