//! What preprocessing costs: seconds a cell, parallel efficiency T1 / (2 T2) and peak memory, with cpu captures, as one table.
//!
//! ```text
//! FARFIELD_MODELS=... cargo bench -p farfield-experiments --bench preprocess -- --triangles 8000000 --frames 120 --runs 3
//! ```
//!
//! The park of real meshes where `FARFIELD_MODELS` names their folder, else of sculpted ones; by default 100,000 triangles and 12
//! frames of a tour, a run a kind. Medians over the runs, on one thread and on two in turn, each into an empty store. The peak is the
//! process's own, the scene and all runs in it. Nothing else should run meanwhile.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_experiments::build::peak_rss_bytes;
use farfield_experiments::config;
use farfield_experiments::list::entries;
use farfield_experiments::run::{Options, Prepared, build_pipelines, prepare};
use farfield_experiments::store::Store;

static NEVER: AtomicBool = AtomicBool::new(false);

struct Args {
    triangles: u64,
    frames: u64,
    runs: u64,
}

/// `--name value` pairs; cargo's own `--bench` is passed over.
fn args() -> Result<Args, String> {
    let mut out = Args { triangles: 100_000, frames: 12, runs: 1 };
    let mut all = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = all.next() {
        let to = match name.as_str() {
            "--triangles" => &mut out.triangles,
            "--frames" => &mut out.frames,
            "--runs" => &mut out.runs,
            _ => return Err(format!("{name}: give --triangles, --frames or --runs with a number")),
        };
        let value = all.next().and_then(|v| v.parse().ok()).filter(|v| *v > 0);
        *to = value.ok_or_else(|| format!("{name} takes a number above 0"))?;
    }
    Ok(out)
}

fn experiment(a: &Args) -> String {
    let models = std::env::var("FARFIELD_MODELS").map_or(String::new(), |m| format!("models = {m:?}\n"));
    format!(
        "[scene]\nsource = \"park\"\ntriangles = {}\n{models}\
         [view]\nresolution = [1024, 1024]\nfov_y_deg = 60.0\nnear = 0.5\neye_height = [16.0, 18.0]\nmax_speed = 30.0\n\
         path = \"tour\"\nframes = {}\nframes_per_s = 2.0\n[build]\ncapture = \"cpu\"\n\
         [[pipeline]]\nname = \"hybrid\"\npartition = {{ type = \"hex-cells\", edge = 50.0 }}\n\
         far_field = {{ type = \"textured-lod-mesh\", edge_px = 4.5, view_test = {{ type = \"self-occlusion\", max_px = 5.0 }} }}\n",
        a.triangles, a.frames
    )
}

/// Seconds and cells of one build into an empty store.
fn once(experiment: &config::Experiment, prepared: &Prepared, threads: usize) -> Result<(f64, usize), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let store = Store::open(folder.path(), Arc::new(|m| eprintln!("{m}"))).map_err(|e| e.to_string())?;
    let options = options(folder.path());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
    let built = pool.install(|| build_pipelines(experiment, prepared, &[0], &store, &options));
    let work = built.map_err(|f| format!("{f:?}"))?[0].preprocess;
    Ok((work.seconds, work.cells_built))
}

fn options(store: &Path) -> Options<'static> {
    Options { store: store.to_owned(), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") }
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn run() -> Result<(), String> {
    let a = args()?;
    let experiment = config::parse("preprocess", &experiment(&a), &[], Path::new(""), &entries());
    let experiment = experiment.map_err(|m| format!("{m:?}"))?;
    let prepared = prepare(&experiment, &options(Path::new(""))).map_err(|f| format!("{f:?}"))?;
    println!("{}: {} triangles, {} frames", prepared.source, prepared.scene.triangles(), prepared.cameras.len());
    println!("run | threads | cells | seconds | seconds a cell");
    let (mut one, mut two) = (vec![], vec![]);
    for i in 1..=a.runs {
        for (threads, all) in [(1, &mut one), (2, &mut two)] {
            let (s, cells) = once(&experiment, &prepared, threads)?;
            println!("{i:3} | {threads:7} | {cells:5} | {s:7.2} | {:14.3}", s / cells.max(1) as f64);
            all.push(s);
        }
    }
    let (t1, t2) = (median(one), median(two));
    println!(
        "T1 {t1:.2} s, T2 {t2:.2} s, T1 / (2 T2) = {:.3}, peak {:.0} MB",
        t1 / (2.0 * t2),
        peak_rss_bytes() as f64 / 1e6
    );
    Ok(())
}

fn main() -> std::process::ExitCode {
    match run() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            std::process::ExitCode::FAILURE
        }
    }
}
