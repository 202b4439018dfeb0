//! Rooms with partition walls and blocks, pictures of them, and what rays say about who sees what.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use farfield_core::bvh::{Ray, TriangleBvh};
use farfield_core::camera::ViewModel;
use farfield_core::cell::{Cell, Outline, Split};
use farfield_core::context::{Capture, Context, Executor, Forget, Shot};
use farfield_core::id::{CellId, ChunkId, MaterialId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::panorama::SkinTests;
use farfield_core::panorama::raster::Raster;
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::Subject;
use farfield_core::{Aabb, Camera, Fault};
use farfield_cpu::CpuCapture;
use farfield_metrics::{Unseen, Voids};
use glam::{DAffine3, DVec3, Vec3};

/// Triangles, the scene of them, and where the scene's local frame begins.
pub(crate) struct World {
    pub(crate) scene: Scene,
    pub(crate) bvh: TriangleBvh,
    pub(crate) bounds: Aabb,
    /// Size of everything against the numbers in this file.
    pub(crate) scale: f32,
}

/// A rectangle from its corner along two edges.
pub(crate) type Sheet = [Vec3; 3];

/// The six sides of a box.
pub(crate) fn sides(min: Vec3, max: Vec3) -> Vec<Sheet> {
    let s = max - min;
    let (x, y, z) = (Vec3::X * s.x, Vec3::Y * s.y, Vec3::Z * s.z);
    vec![[min, x, y], [min, y, z], [min, z, x], [max, -x, -y], [max, -y, -z], [max, -z, -x]]
}

/// A room of 16 x 8 x 16 whose rear part begins behind a wall at z = -5, pierced by a gap of 2 x 2.
pub(crate) fn pierced() -> Vec<Sheet> {
    let mut out = sides(Vec3::new(-8.0, -4.0, -12.0), Vec3::new(8.0, 4.0, 4.0));
    let sheet =
        |x: [f32; 2], y: [f32; 2]| [Vec3::new(x[0], y[0], -5.0), Vec3::X * (x[1] - x[0]), Vec3::Y * (y[1] - y[0])];
    out.push(sheet([-8.0, -1.0], [-4.0, 4.0]));
    out.push(sheet([1.0, 8.0], [-4.0, 4.0]));
    out.push(sheet([-1.0, 1.0], [-4.0, -1.0]));
    out.push(sheet([-1.0, 1.0], [1.0, 4.0]));
    out
}

/// A room of 24 x 8 x 24 with blocks that stand around an open place in the middle.
pub(crate) fn furnished() -> Vec<Sheet> {
    let mut out = sides(Vec3::new(-12.0, -4.0, -12.0), Vec3::new(12.0, 4.0, 12.0));
    for (x, z, w, d, h) in [
        (-7.0, -6.0, 2.0, 3.0, 6.0),
        (5.0, -8.0, 3.0, 1.0, 4.5),
        (7.0, 2.0, 1.0, 4.0, 7.0),
        (-1.0, -9.0, 1.5, 1.5, 7.5),
        (-9.0, 5.0, 2.0, 2.0, 3.0),
        (2.0, 8.0, 5.0, 1.0, 5.0),
    ] {
        out.extend(sides(Vec3::new(x, -4.0, z), Vec3::new(x + w, h - 4.0, z + d)));
    }
    out
}

/// A room of 60 x 20 x 60 with blocks that hang in the air, none within 9 of the origin.
pub(crate) fn hanging(n: usize) -> Vec<Sheet> {
    let mut out = sides(Vec3::new(-30.0, -5.0, -30.0), Vec3::new(30.0, 15.0, 30.0));
    let mut state = 1u32;
    let mut random = |low: f32, high: f32| {
        state = state.wrapping_mul(1664525).wrapping_add(1013904223);
        low + (high - low) * (state >> 8) as f32 / 16777216.0
    };
    let mut placed = 0;
    while placed < n {
        let at = Vec3::new(random(-27.0, 27.0), random(-4.0, 12.0), random(-27.0, 27.0));
        let size = Vec3::from([(); 3].map(|()| random(0.5, 3.0)));
        if at.length() > 9.0 + 3.0 {
            out.extend(sides(at, at + size));
            placed += 1;
        }
    }
    out
}

impl World {
    pub(crate) fn new(sheets: &[Sheet], scale: f32) -> Self {
        let mut m = TriangleMesh::default();
        for [corner, a, b] in sheets {
            let first = m.positions.len() as u32;
            m.positions.extend([*corner, corner + a, corner + a + b, corner + b].map(|p| p * scale));
            m.normals.extend([a.cross(*b).normalize(); 4]);
            m.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
        m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
        let mut b = SceneBuilder::default();
        b.materials.push(Material { two_sided: true, ..Material::default() });
        let bvh = TriangleBvh::build(&m.positions, &m.indices);
        let mesh = b.mesh("room", m).unwrap();
        b.place(Placement { mesh, transform: DAffine3::IDENTITY });
        let scene = b.build().unwrap();
        let bounds = scene.chunks.iter().fold(Aabb::EMPTY, |b, c| b.union(c.bounds));
        Self { scene, bvh, bounds, scale }
    }

    /// A place in the scene's local frame.
    pub(crate) fn local(&self, p: Vec3) -> DVec3 {
        (p * self.scale).as_dvec3() - self.scene.origin
    }

    pub(crate) fn near(&self) -> f32 {
        1e-2 * self.scale
    }

    pub(crate) fn shoot(&self, cameras: &[Camera]) -> Vec<(Camera, SurfaceImage)> {
        let chunks: ChunkSet = (0..self.scene.chunks.len() as u32).map(ChunkId).collect();
        let shots: Vec<Shot> = cameras.iter().map(|c| Shot { chunks: chunks.clone(), camera: *c }).collect();
        let images = CpuCapture::new(&self.scene).unwrap().shoot(&shots).unwrap();
        cameras.iter().copied().zip(images).collect()
    }

    /// Cubes of pictures from several places.
    pub(crate) fn samples(&self, eyes: &[Vec3], face_px: u32) -> Vec<(Camera, SurfaceImage)> {
        let cube = |e: &Vec3| Camera::cube(self.local(*e), face_px, self.near());
        self.shoot(&eyes.iter().flat_map(cube).collect::<Vec<_>>())
    }

    pub(crate) fn voids(&self, samples: &[(Camera, SurfaceImage)]) -> Voids {
        let tests = SkinTests { far: f32::INFINITY, alpha_rad: 3f32.to_radians() };
        self.with(1, |cx| Voids::new(samples, self.bounds, &tests, cx)).unwrap()
    }

    pub(crate) fn with<T>(&self, threads: usize, f: impl FnOnce(&Context<'_>) -> T) -> T {
        let (capture, go) = (CpuCapture::new(&self.scene).unwrap(), AtomicBool::new(false));
        f(&Context { capture: &capture, run: &Threads(threads), memo: &Forget, cancel: &go })
    }

    /// By rays: for each pixel around `eye` whether it shows something that none of the samples sees.
    pub(crate) fn truly_unseen(&self, eye: Vec3, samples: &[Vec3], face_px: u32) -> Vec<bool> {
        let at = (eye * self.scale).as_dvec3();
        let raster = Raster::new(&Camera::cube(at, face_px, self.near()));
        let mut out = vec![];
        for view in 0..6 {
            for i in 0..face_px * face_px {
                let direction = raster.ray(view, i % face_px, i / face_px);
                let ray = Ray::new(at, direction, self.near(), f32::INFINITY).unwrap();
                let hit = self.bvh.closest_hit(&ray, |_| true).map(|h| at + direction.as_dvec3() * f64::from(h.t));
                out.push(hit.is_some_and(|p| samples.iter().all(|s| !self.sees((*s * self.scale).as_dvec3(), p))));
            }
        }
        out
    }

    /// By points along rays: for each pixel around `eye` whether every sample loses sight of the ray before it hits anything,
    /// be it each of another piece.
    pub(crate) fn truly_void(&self, eye: Vec3, samples: &[Vec3], face_px: u32) -> Vec<bool> {
        let at = (eye * self.scale).as_dvec3();
        let raster = Raster::new(&Camera::cube(at, face_px, self.near()));
        let mut out = vec![];
        for view in 0..6 {
            for i in 0..face_px * face_px {
                let direction = raster.ray(view, i % face_px, i / face_px);
                let ray = Ray::new(at, direction, self.near(), f32::INFINITY).unwrap();
                let end = self.bvh.closest_hit(&ray, |_| true).map_or(0.0, |h| f64::from(h.t));
                let lost = |s: &Vec3| {
                    let s = (*s * self.scale).as_dvec3();
                    (1..400).any(|k| !self.sees(s, at + direction.as_dvec3() * (end * f64::from(k) / 400.0)))
                };
                out.push(samples.iter().all(lost));
            }
        }
        out
    }

    fn sees(&self, from: DVec3, p: DVec3) -> bool {
        let Some(ray) = Ray::new(from, (p - from).as_vec3(), 0.0, 1.0 - 1e-4) else { return true };
        !self.bvh.any_hit(&ray, |_| true)
    }

    /// A cell with a square of viewpoints at height 0, or a cube of them.
    pub(crate) fn cell(&self, centre: Vec3, half: f32, flat: bool) -> Cell {
        let c = self.local(centre).as_vec3();
        let h = half * self.scale;
        let region = if flat {
            let polygon = [[-h, -h], [h, -h], [h, h], [-h, h]].map(|p| [c.x + p[0], c.z + p[1]]).to_vec();
            Region::Prism { polygon, y: [c.y; 2] }
        } else {
            Region::Box(Aabb { min: c - h, max: c + h })
        };
        Cell {
            outline: Outline { id: CellId(0), region, centre: c, neighbours: vec![] },
            splits: vec![Split::default()],
            sectors: vec![],
            own: vec![],
            claims: vec![],
        }
    }

    pub(crate) fn subject<'a>(
        &self,
        cell: &'a Cell,
        views: &'a ViewModel,
        samples: &'a [(Camera, SurfaceImage)],
    ) -> Subject<'a> {
        Subject { cell, views, bounds: self.bounds, facing: &[], px_per_tan: views.px_per_tan(), samples }
    }

    pub(crate) fn views(&self) -> ViewModel {
        ViewModel {
            fov_y_rad: 60f32.to_radians(),
            resolution: [512, 512],
            near: self.near(),
            eye_height: [0.0; 2],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        }
    }
}

/// Jobs on this many threads, backwards, to differ from serial order.
struct Threads(usize);

impl Executor for Threads {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        let (next, failed) = (AtomicUsize::new(0), std::sync::Mutex::new(None));
        let work = || {
            while let Some(i) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|&i| i < n) {
                if let Err(e) = job(n - 1 - i) {
                    *failed.lock().unwrap() = Some(e);
                }
            }
        };
        std::thread::scope(|s| (0..self.0).for_each(|_| drop(s.spawn(work))));
        failed.into_inner().unwrap().map_or(Ok(()), Err)
    }
}

/// How a mask compares with what rays say.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Compared {
    /// Solid angles, steradians: by the metric, by rays.
    pub(crate) sr: f64,
    pub(crate) true_sr: f64,
    /// Of pixels in which they differ, farther than one pixel from the border of the true region (the border's width is that of
    /// a pixel of the view and one of the sample).
    pub(crate) apart_sr: f64,
    /// Perimeter of the true region x pixel size, steradians.
    pub(crate) border_sr: f64,
}

pub(crate) fn compare(found: &Unseen, truth: &[bool], face_px: u32) -> Compared {
    let n = face_px as usize;
    let mut out = Compared { sr: found.sr, ..Compared::default() };
    for (i, &t) in truth.iter().enumerate() {
        let (face, x, y) = (i / (n * n), i % n, i / n % n);
        let weight = farfield_core::panorama::pixel_solid_angle_sr(&found.cameras[face], x as u32, y as u32);
        // Does a pixel within a distance say something else? (Borders between faces are not looked over.)
        let differs = |reach: usize| {
            let near = |c: usize| c.saturating_sub(reach)..(c + reach + 1).min(n);
            near(y).any(|v| near(x).any(|u| truth[face * n * n + v * n + u] != t))
        };
        out.true_sr += if t { weight } else { 0.0 };
        out.border_sr += if t && differs(1) { weight } else { 0.0 };
        out.apart_sr += if t != found.mask[i] && !differs(2) { weight } else { 0.0 };
    }
    out
}
