//! Hierarchies of clusters on the Stanford dragon: how fast they are built on one thread, how many triangles are left at an allowed error, how many
//! are stored, and how far sampled distances exceed the error that meshoptimizer estimated.
//!
//! ```text
//! FARFIELD_MODELS=../models cargo bench -p farfield-integration-tests --bench clusters [-- FILE ...]
//! ```
//!
//! Time is the building thread's processor time where the system tells it. Files are paths within the models' folder. Errors are relative to the diagonal of the model's box. Each row draws the whole model with the same
//! error allowed everywhere; `measured` are distances of 200,000 random points of either surface, spread by area, from the other one, the
//! largest and the 99.9th percentile; `exceeded` is the largest over the largest error that any drawn group states.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use farfield_core::bvh::TriangleBvh;
use farfield_core::camera::ViewModel;
use farfield_core::cell::Active;
use farfield_core::claim::Claim;
use farfield_core::context::{Context, Forget, Serial};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, CellId, LocalPayload, SplitId};
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder, gather};
use farfield_core::strategy::{FarField, LeftOut, SceneJob, Sink, View};
use farfield_core::{Aabb, Camera, Fault};
use farfield_experiments::build::NoCapture;
use farfield_experiments::load::{LoadOptions, load_mesh};
use farfield_far_cluster_lod::ClusterLod;
use glam::{DAffine3, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SAMPLES: usize = 200_000;
/// Allowed errors over the diagonal.
const ERRORS: [f32; 7] = [1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1];
const FILES: [&str; 2] = ["statuary/dragon_vrip_res2.ply.gz", "scans/dragon_vrip.ply.gz"];

type Error = Box<dyn std::error::Error>;

#[derive(Default)]
struct Keep(Mutex<BTreeMap<LocalPayload, Payload>>);
impl Sink for Keep {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        let mut all = self.0.lock().map_err(|e| Fault::Refused(e.to_string()))?;
        all.insert(id, payload.clone());
        Ok(())
    }
    fn claim(&self, _claim: Claim) {}
    fn left_out(&self, _what: LeftOut) {}
}

/// Positions and indices of what is drawn.
type Surface = (Vec<Vec3>, Vec<u32>);

fn surface(scene: &Scene, payloads: &BTreeMap<LocalPayload, Payload>, draws: &[Draw]) -> Result<Surface, Fault> {
    let origin = scene.objects[0].bounds.centre().as_dvec3();
    let mut out = Surface::default();
    let mut add = |positions: &[Vec3], indices: &mut dyn Iterator<Item = u32>| {
        let first = out.0.len() as u32;
        out.0.extend(positions);
        out.1.extend(indices.map(|i| first + i));
    };
    for d in draws {
        match &d.what {
            DrawWhat::Chunks(set) => {
                let all = gather(scene, set.iter(), origin)?;
                add(&all.positions, &mut all.corners.iter().flat_map(|&c| all.vertices(c)));
            }
            DrawWhat::Payload { id, part, .. } => {
                if let Some(Part::Mesh(m)) = payloads.get(&id.id).map(|p| &p.parts[usize::from(*part)]) {
                    add(&m.positions, &mut m.indices.iter().copied());
                }
            }
        }
    }
    Ok(out)
}

/// Distances of random points of one surface, spread by area, from another, ascending.
fn distances(from: &Surface, to: &Surface) -> Vec<f32> {
    let bvh = TriangleBvh::build(&to.0, &to.1);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let corners = |t: usize| [0, 1, 2].map(|k| from.0[from.1[3 * t + k] as usize]);
    let count = from.1.len() / 3;
    let mut sums = vec![0f64];
    for t in 0..count {
        let [a, b, c] = corners(t);
        sums.push(sums[t] + f64::from((b - a).cross(c - a).length()));
    }
    let mut out: Vec<f32> = (0..SAMPLES)
        .filter_map(|_| {
            let at = rng.random_range(0.0..sums[count]);
            let [a, b, c] = corners(sums.partition_point(|&s| s <= at).clamp(1, count) - 1);
            let (s, t): (f32, f32) = (rng.random_range(0.0..1f32).sqrt(), rng.random_range(0.0..1.0));
            let point = a * (1.0 - s) + (b * (1.0 - t) + c * t) * s;
            bvh.closest_point(point, f32::INFINITY).map(|n| n.distance)
        })
        .collect();
    out.sort_by(f32::total_cmp);
    out
}

/// Processor time of this thread where the system tells it, else time since the first call.
fn now() -> Duration {
    // Linux counts at its ticks, milliseconds apart, and whenever a thread gives way.
    std::thread::yield_now();
    static START: OnceLock<Instant> = OnceLock::new();
    let scheduled = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanos = scheduled.and_then(|s| s.split(' ').next()?.parse().ok());
    nanos.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

fn table(name: &str, scene: &Scene, own: &ClusterLod, more: &str) -> Result<(), Error> {
    let (sink, go) = (Keep::default(), AtomicBool::new(false));
    let cx = Context { capture: &NoCapture, run: &Serial, memo: &Forget, cancel: &go };
    let views = ViewModel {
        fov_y_rad: 1.0,
        resolution: [64, 64],
        near: 0.01,
        eye_height: [0.0; 2],
        pitch_rad: [0.0; 2],
        max_speed: 1.0,
        max_turn_rad: 1.0,
    };
    let start = now();
    let index = own.bake_scene(&SceneJob { scene, views: &views }, &sink, &cx)?;
    let seconds = (now() - start).as_secs_f64();
    let payloads = sink.0.into_inner()?;
    let (triangles, stored) = (scene.triangles(), payloads.values().map(Payload::triangles).sum::<u64>());
    println!(
        "{name}, {more}: {triangles} triangles in {seconds:.2} s, {:.3} Mtri/s; {} payloads of {stored} triangles, {:.3} of the input's",
        triangles as f64 / 1e6 / seconds,
        payloads.len(),
        stored as f64 / triangles as f64
    );
    println!("   allowed | triangles |   share | parts |    stated | measured | 99.9 % of | exceeded");
    let open = own.open(Some((AssetId(0), &index)), (AssetId(1), &[]))?;
    let size = scene.bounds.size().length();
    let eye = scene.bounds.centre().as_dvec3() + DVec3::Z * 1e3 * f64::from(size);
    let camera = Camera::looking(eye, -Vec3::Z, Vec3::Y, 1.0, [64, 64], 0.1);
    let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
    let original = {
        let all = gather(scene, scene.all_chunks().iter(), scene.objects[0].bounds.centre().as_dvec3())?;
        let indices = all.corners.iter().flat_map(|&c| all.vertices(c)).collect();
        (all.positions, indices)
    };
    for error in ERRORS {
        // A view's tolerance is half a pixel, the setting one pixel.
        let tolerance = |_: &Aabb| 0.5 * error * size;
        let view =
            View { scene, camera: &camera, at: &at, tolerance: &tolerance, budget: Default::default(), cell: None };
        let mut draws = vec![];
        let achieved = open.draw(&|_| true, &view, &mut draws);
        let stated = achieved.error_px * error * size;
        let drawn = surface(scene, &payloads, &draws)?;
        let (there, back) = (distances(&original, &drawn), distances(&drawn, &original));
        let at = |share: f64| {
            let of = |all: &[f32]| all[((all.len() - 1) as f64 * share) as usize];
            of(&there).max(of(&back))
        };
        let (left, parts) = (drawn.1.len() / 3, draws.len());
        println!(
            "{:>8.2} % | {left:>9} | {:>5.2} % | {parts:>5} | {:>7.4} % | {:>6.4} % | {:>7.4} % | {:>8.2}",
            1e2 * error,
            1e2 * left as f64 / triangles as f64,
            1e2 * stated / size,
            1e2 * at(1.0) / size,
            1e2 * at(0.999) / size,
            at(1.0) / stated
        );
    }
    Ok(())
}

fn main() -> Result<(), Error> {
    let given: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let files: Vec<&str> = if given.is_empty() { FILES.to_vec() } else { given.iter().map(String::as_str).collect() };
    let Some(folder) = std::env::var_os("FARFIELD_MODELS") else {
        println!("skipped: FARFIELD_MODELS is not set");
        return Ok(());
    };
    for file in files {
        let (mesh, ..) = load_mesh(&Path::new(&folder).join(file), &LoadOptions::default())?;
        let mut b = SceneBuilder::default();
        b.materials.push(Material::default());
        let mesh = b.mesh(file, mesh)?;
        b.place(Placement { mesh, transform: DAffine3::IDENTITY });
        let scene = b.build()?;
        for weight in [0.0, 0.5] {
            let own = ClusterLod { normal_weight: weight, albedo_weight: weight, ..ClusterLod::default() };
            table(file, &scene, &own, &format!("weights {weight}"))?;
        }
    }
    Ok(())
}
