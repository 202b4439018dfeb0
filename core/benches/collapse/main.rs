//! Edge collapse beside `meshopt::simplify`: time against measured surface distance, one thread, one run.
//!
//! `FARFIELD_MODELS=../models cargo bench -p farfield-core --bench collapse [-- name]` prints one table. Times are the least of nine
//! runs, in which the methods take turns, and include everything from positions and indices to the new indices (meshopt's: its
//! search for equal positions too, which farfield's importers have done before). On Linux they are the thread's processor
//! time, so that a busy machine disturbs them less; it still shares its caches. meshopt knows no link condition, so it is off
//! here; everything else is as by default. Distances are over 100,000 points, half of them on either surface, relative to the
//! diagonal of the mesh's box. `speed` is meshopt's time divided by the method's at equal root mean square distance: the
//! method's time is interpolated along its own curve (log-log) at meshopt's distance; `-` where the curve does not reach that.

mod distance;
mod meshes;

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use distance::{Surface, two_sided};
use farfield_core::collapse::{LiveMesh, Mode, Placement, QuadricSettings, Quadrics, Settings, collapse};
use glam::Vec3;
use meshes::Mesh;
use meshopt::{SimplifyOptions, VertexDataAdapter};

/// Triangles kept, as shares of the input's. The last one is there for the curves of the better methods to reach meshopt's last but one.
const SHARES: [f64; 7] = [0.5, 0.25, 0.1, 0.05, 0.02, 0.01, 0.005];
const SAMPLES: usize = 50_000;
const RUNS: usize = 9;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    Meshopt,
    Ours(Mode, Placement),
}

const METHODS: [Method; 5] = [
    Method::Meshopt,
    Method::Ours(Mode::Exact, Placement::HalfEdge),
    Method::Ours(Mode::Exact, Placement::Optimal),
    Method::Ours(Mode::Batched, Placement::HalfEdge),
    Method::Ours(Mode::Batched, Placement::Optimal),
];

struct Point {
    millis: f64,
    triangles: usize,
    rms: f64,
    max: f64,
}

fn main() {
    let only = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let mut inputs: Vec<(&str, Mesh)> = vec![("sphere-200k", meshes::sphere(158)), ("sphere-1M", meshes::sphere(354))];
    match std::env::var_os("FARFIELD_MODELS") {
        Some(folder) => {
            for (name, file) in [
                ("bunny", "statuary/bun_zipper.ply.gz"),
                ("dragon-200k", "statuary/dragon_vrip_res2.ply.gz"),
                ("dragon", "scans/dragon_vrip.ply.gz"),
            ] {
                match meshes::ply(&std::path::Path::new(&folder).join(file)) {
                    Ok(mesh) => inputs.push((name, mesh)),
                    Err(e) => println!("skipped {name}: {e}"),
                }
            }
        }
        None => println!("skipped the scans: FARFIELD_MODELS is not set"),
    }
    println!(
        "{:<12} {:<22} {:>9} {:>9} {:>9} {:>10} {:>10} {:>7}",
        "mesh", "method", "wanted", "triangles", "ms", "rms 1e-6", "max 1e-6", "speed"
    );
    for (name, mesh) in inputs.iter().filter(|(name, _)| only.as_ref().is_none_or(|o| name.contains(o.as_str()))) {
        table(name, mesh);
    }
}

fn table(name: &str, mesh: &Mesh) {
    let diagonal = {
        let low = mesh.0.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let high = mesh.0.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        low.distance(high) as f64
    };
    let curves = curves(mesh, diagonal);
    let theirs: Vec<(f64, f64)> = curves[0].iter().map(|p| (p.rms, p.millis)).collect();
    for (method, curve) in METHODS.into_iter().zip(&curves) {
        let label = match method {
            Method::Meshopt => "meshopt".to_owned(),
            Method::Ours(mode, placement) => format!("{mode:?} {placement:?}"),
        };
        for (i, (p, share)) in curve.iter().zip(SHARES).enumerate() {
            let speed = at_distance(curve, theirs[i].0).map_or("-".into(), |ms| format!("{:.2}", theirs[i].1 / ms));
            let wanted = (mesh.1.len() as f64 / 3.0 * share) as usize;
            println!(
                "{name:<12} {label:<22} {wanted:>9} {:>9} {:>9.1} {:>10.2} {:>10.1} {speed:>7}",
                p.triangles,
                p.millis,
                p.rms * 1e6,
                p.max * 1e6
            );
        }
    }
}

/// A curve for each method. The methods take turns, so that a machine that slows down does so for all.
fn curves(mesh: &Mesh, diagonal: f64) -> Vec<Vec<Point>> {
    let original = Surface::new(&mesh.0, &mesh.1);
    let mut curves: Vec<Vec<Point>> = METHODS.iter().map(|_| Vec::new()).collect();
    for share in SHARES {
        let wanted = (mesh.1.len() as f64 / 3.0 * share) as usize;
        let mut least = [Duration::MAX; METHODS.len()];
        for _ in 0..RUNS {
            for (method, least) in METHODS.iter().zip(&mut least) {
                *least = run(*method, mesh, wanted).0.min(*least);
            }
        }
        for ((method, least), curve) in METHODS.iter().zip(least).zip(&mut curves) {
            let (positions, indices) = run(*method, mesh, wanted).1;
            let (rms, max) = two_sided(&original, &Surface::new(&positions, &indices), SAMPLES);
            curve.push(Point {
                millis: least.as_secs_f64() * 1e3,
                triangles: indices.len() / 3,
                rms: rms / diagonal,
                max: max / diagonal,
            });
        }
    }
    curves
}

/// The time at which a method's curve has this distance, milliseconds.
fn at_distance(curve: &[Point], rms: f64) -> Option<f64> {
    let first = curve.iter().position(|p| p.rms >= rms)?;
    if curve[first].rms == rms {
        return Some(curve[first].millis);
    }
    let (a, b) = (&curve[first.checked_sub(1)?], &curve[first]);
    let part = (rms / a.rms).ln() / (b.rms / a.rms).ln();
    Some(a.millis * (b.millis / a.millis).powf(part))
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

fn run(method: Method, (positions, indices): &Mesh, wanted: usize) -> (Duration, Mesh) {
    let start = now();
    match method {
        Method::Meshopt => {
            let bytes = bytemuck::cast_slice(positions);
            let vertices = VertexDataAdapter::new(bytes, 12, 0).unwrap();
            let out = meshopt::simplify(indices, &vertices, wanted * 3, f32::MAX, SimplifyOptions::None, None);
            (now() - start, (positions.clone(), out))
        }
        Method::Ours(mode, placement) => {
            let live = LiveMesh::new(positions, indices, &[]).unwrap();
            let mut cost = Quadrics::new(&live, QuadricSettings { placement, ..QuadricSettings::default() });
            let settings = Settings { mode, min_triangles: wanted, link_condition: false, ..Settings::default() };
            let out = collapse(live, &mut cost, &settings);
            (now() - start, (out.positions, out.indices))
        }
    }
}
