//! Baking one cell in memory and drawing it beside the scene itself.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use farfield_core::backend::{Backend, BlockData};
use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Cell, Outline, Sector, Split, Window};
use farfield_core::claim::Claim;
use farfield_core::context::{Capture, Context, Executor, Forget, Shot};
use farfield_core::draw::{DrawList, Pass, PassKind};
use farfield_core::id::{
    AssetId, Block, CellId, ChunkId, LocalPayload, MaterialId, PayloadRef, SectorId, SplitId, TargetId,
};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::Payload;
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::{CellJob, FarField, LeftOut, Sink, View};
use farfield_core::{Camera, Fault};
use farfield_cpu::{CpuBackend, CpuCapture, CpuOptions, SplatOrder};
use farfield_far_ldi::Index;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// What a bake put out.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) payloads: BTreeMap<LocalPayload, Payload>,
    pub(crate) claims: Vec<Claim>,
    pub(crate) left_out: Vec<LeftOut>,
    pub(crate) index: Vec<u8>,
}

impl Kept {
    pub(crate) fn index(&self) -> Index {
        Index::decode("test", &self.index).unwrap()
    }
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

/// Jobs on this many threads, backwards, to differ from serial order.
struct Threads(usize);

impl Executor for Threads {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
        std::thread::scope(|s| {
            for _ in 0..self.0 {
                s.spawn(|| {
                    loop {
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

pub(crate) fn views(resolution: [u32; 2]) -> ViewModel {
    ViewModel {
        fov_y_rad: 60f32.to_radians(),
        resolution,
        near: 0.1,
        eye_height: [2.0; 2],
        pitch_rad: [0.0; 2],
        max_speed: 30.0,
        max_turn_rad: 0.8,
    }
}

pub(crate) fn with<T>(scene: &Scene, threads: usize, f: impl FnOnce(&Context<'_>) -> T) -> T {
    let (capture, go) = (CpuCapture::new(scene).unwrap(), AtomicBool::new(false));
    f(&Context { capture: &capture, run: &Threads(threads), memo: &Forget, cancel: &go })
}

/// A far field from its table in an experiment file, without its type.
pub(crate) fn ldi(settings: &str) -> Box<dyn FarField> {
    toml::from_str::<farfield_far_ldi::LayeredDepthImage>("").unwrap();
    toml::from_str(&format!("type = \"layered-depth-image\"\n{settings}")).unwrap()
}

pub(crate) fn bake(scene: &Scene, views: &ViewModel, cell: &Cell, settings: &str, threads: usize) -> Kept {
    let sink = Keep::default();
    let outlines: [Outline; 1] = [cell.outline.clone()];
    let job = CellJob { scene, views, cell, outlines: &outlines, shared: None };
    let index = with(scene, threads, |cx| ldi(settings).bake_cell(&job, &sink, cx)).unwrap();
    Kept { index, ..sink.0.into_inner().unwrap() }
}

pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }
    /// Uniform in a range.
    pub(crate) fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.0.next_u32() as f32 / u32::MAX as f32)
    }
}

/// A closed pipe of radius and length 1 along y, around the origin; smooth, coloured in rings.
fn pipe(sides: u32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    let rings = 8;
    for r in 0..=rings {
        for s in 0..sides {
            let (sin, cos) = (s as f32 / sides as f32 * std::f32::consts::TAU).sin_cos();
            m.positions.push(Vec3::new(cos, r as f32 / rings as f32 - 0.5, -sin));
            m.normals.push(Vec3::new(cos, 0.0, -sin));
            let c = if r % 2 == 0 { 220 } else { 90 };
            m.colors.push([c, (128.0 + 100.0 * cos) as u8, (128.0 + 100.0 * sin) as u8, 255]);
        }
    }
    for r in 0..rings {
        for s in 0..sides {
            let at = |r: u32, s: u32| r * sides + s % sides;
            let [a, b, c, d] = [at(r, s), at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)];
            m.indices.extend([a, b, c, a, c, d]);
        }
    }
    for (y, up) in [(-0.5, false), (0.5, true)] {
        let first = m.positions.len() as u32;
        for s in 0..sides {
            let (sin, cos) = (s as f32 / sides as f32 * std::f32::consts::TAU).sin_cos();
            m.positions.push(Vec3::new(cos, y, -sin));
            m.normals.push(Vec3::new(0.0, y * 2.0, 0.0));
            m.colors.push([200, 200, 60, 255]);
        }
        for s in 1..sides - 1 {
            let t = [first, first + s, first + s + 1];
            m.indices.extend(if up { t } else { [t[0], t[2], t[1]] });
        }
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// A box of edge 1 around the origin, its faces flat and of different colours.
pub(crate) fn block() -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for (k, n) in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].into_iter().enumerate() {
        let a = if n.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let b = n.cross(a);
        let first = m.positions.len() as u32;
        for (s, t) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
            m.positions.push(0.5 * n + s * a + t * b);
            m.normals.push(n);
            m.colors.push([60 + 30 * k as u8, 220 - 25 * k as u8, if s > t { 200 } else { 80 }, 255]);
        }
        m.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// `n` pipes and blocks along the axes, in a cube of 60 around the origin but for what comes within 10 of it.
pub(crate) fn pipes(n: u32, seed: u64) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [1.0; 4], ..Material::default() });
    let shapes = [b.mesh("pipe", pipe(16)).unwrap(), b.mesh("block", block()).unwrap()];
    let mut random = Random::new(seed);
    let mut placed = 0;
    // The local frame starts in the middle of everything, at the lowest point: two specks fix both.
    for y in [-40.0, 40.0] {
        let transform = DAffine3::from_translation(DVec3::new(0.0, y, 0.0)) * DAffine3::from_scale(DVec3::splat(1e-3));
        b.place(Placement { mesh: shapes[1], transform });
    }
    while placed < n {
        let at = Vec3::from([(); 3].map(|()| random.within(-30.0, 30.0)));
        let (radius, length) = (random.within(0.2, 0.8), random.within(4.0, 16.0));
        let (turn, kind) = (random.within(0.0, 3.0) as u32, usize::from(random.within(0.0, 1.0) > 0.75));
        if at.length() < 10.0 + length {
            continue;
        }
        let size =
            if kind == 0 { Vec3::new(radius, length, radius) } else { Vec3::new(2.5, 2.0, 3.0) * (0.5 + radius) };
        let turn = match turn {
            0 => DQuat::IDENTITY,
            1 => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
            _ => DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
        };
        let transform = DAffine3::from_scale_rotation_translation(size.as_dvec3(), turn, at.as_dvec3());
        b.place(Placement { mesh: shapes[kind], transform });
        placed += 1;
    }
    b.build().unwrap()
}

/// The origin of [`pipes`] in the scene's local frame.
pub(crate) fn origin(scene: &Scene) -> Vec3 {
    (-scene.origin).as_vec3()
}

/// As image placement makes cells: a ball of viewpoints, and a square window ahead (-z) that fills a field of view of 60 degrees.
/// Everything beyond it is far.
pub(crate) fn ball(scene: &Scene, radius: f32, window: f32, px_per_tan: f32) -> Cell {
    let centre = origin(scene);
    let half = window * 30f32.to_radians().tan();
    let corner = |s: f32, u: f32| centre + Vec3::new(s * half, u * half, -window);
    let far: ChunkSet = (0..scene.chunks.len() as u32)
        .map(ChunkId)
        .filter(|c| scene.chunks[c.index()].bounds.max.z < centre.z - window)
        .collect();
    let window = Window {
        axis: -Vec3::Z,
        corners: [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        px_per_tan,
    };
    let region = Region::Sphere { centre, radius };
    Cell {
        outline: Outline { id: CellId(0), region, centre, neighbours: vec![] },
        splits: vec![Split { far: far.clone(), near_budget: None }],
        sectors: vec![Sector { split: SplitId(0), window, seen: far }],
        own: vec![],
        claims: vec![],
    }
}

/// A backend with everything that a bake put out.
pub(crate) fn loaded(scene: &Scene, kept: &Kept, splats: SplatOrder) -> CpuBackend {
    let mut backend = CpuBackend::new(scene, CpuOptions { splats, ..CpuOptions::default() }).unwrap();
    for (id, payload) in &kept.payloads {
        let block = Block::Payload(PayloadRef { asset: AssetId(3), id: *id });
        farfield_core::backend::validate(block, &BlockData::Payload(payload)).unwrap();
        backend.upload(block, &BlockData::Payload(payload)).unwrap();
    }
    backend
}

/// What a cell's images show through a camera.
pub(crate) fn warped(
    backend: &mut CpuBackend,
    scene: &Scene,
    kept: &Kept,
    split: u32,
    camera: &Camera,
) -> SurfaceImage {
    let open = ldi("").open(None, (AssetId(3), &kept.index)).unwrap();
    let sectors = (0..kept.payloads.len() as u32).map(SectorId).collect();
    let at = Active { cell: CellId(0), split: SplitId(split), sectors };
    let view = View { scene, camera, at: &at, tolerance: &|_| 0.0, budget: Default::default(), cell: None };
    let mut draws = vec![];
    assert_eq!(open.draw(&|_| true, &view, &mut draws).missing, 0);
    let pass = Pass { kind: PassKind::Surface, camera: *camera, writes: TargetId(0), draws };
    backend.render(&DrawList { passes: vec![pass] }).unwrap();
    backend.read_surface(TargetId(0)).unwrap()
}

/// What chunks show through a camera.
pub(crate) fn direct(scene: &Scene, chunks: &ChunkSet, cameras: &[Camera]) -> Vec<SurfaceImage> {
    let shots: Vec<Shot> = cameras.iter().map(|c| Shot { chunks: chunks.clone(), camera: *c }).collect();
    CpuCapture::new(scene).unwrap().shoot(&shots).unwrap()
}

/// How a picture differs from what it should be, in pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Apart {
    /// All.
    pub(crate) pixels: u64,
    /// Something should be there and nothing is.
    pub(crate) holes: u64,
    /// Holes not on an outline: the eight pixels around should show the same object.
    pub(crate) inner: u64,
    /// Nothing should be there and something is.
    pub(crate) extra: u64,
    /// Another object.
    pub(crate) other: u64,
    /// Sum of absolute differences of albedo over pixels that both hit, in bytes, three channels averaged.
    pub(crate) albedo: f64,
}

impl Apart {
    pub(crate) fn add(&mut self, reference: &SurfaceImage, picture: &SurfaceImage) {
        for i in 0..reference.depth.len() {
            let (r, p) = (reference.hit(i), picture.hit(i));
            self.pixels += 1;
            self.holes += u64::from(r && !p);
            self.inner += u64::from(r && !p && !outline(reference, i));
            self.extra += u64::from(p && !r);
            self.other += u64::from(p && r && reference.object[i] != picture.object[i]);
            if r && p {
                let d: u32 = (0..3).map(|k| u32::from(reference.albedo[i][k].abs_diff(picture.albedo[i][k]))).sum();
                self.albedo += f64::from(d) / 3.0;
            }
        }
    }
    pub(crate) fn share(&self, n: u64) -> f64 {
        n as f64 / self.pixels as f64
    }
}

/// Cameras of a walk through the ball: those whose frustum lies within the centre's, as image placement uses a cell.
pub(crate) fn tour(cell: &Cell, views: &ViewModel, n: u32, seed: u64) -> Vec<Camera> {
    let Region::Sphere { centre, radius } = cell.outline.region else { panic!("a ball") };
    let mut random = Random::new(seed);
    let tan = 30f32.to_radians().tan();
    (0..n)
        .map(|_| {
            loop {
                let a = random.within(0.0, radius);
                let v = Vec3::new(random.within(-1.0, 1.0) * a * tan, random.within(-1.0, 1.0) * a * tan, -a);
                if v.length() <= radius {
                    return views.camera((centre + v).as_dvec3(), 0.0, 0.0);
                }
            }
        })
        .collect()
}

/// Whether some pixel around shows another object, or lies outside.
fn outline(image: &SurfaceImage, i: usize) -> bool {
    let [w, h] = image.size.map(|n| n as i32);
    let (x, y) = (i as i32 % w, i as i32 / w);
    let differs = |u: i32, v: i32| {
        !(0..w).contains(&u) || !(0..h).contains(&v) || image.object[(v * w + u) as usize] != image.object[i]
    };
    (-1..2).any(|dy| (-1..2).any(|dx| differs(x + dx, y + dy)))
}
