//! What each command does: read, call, print.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use farfield_experiments::config::{self, Experiment, Generated};
use farfield_experiments::failure::Failure;
use farfield_experiments::results::Summary;
use farfield_experiments::run::{self, Options};
use farfield_experiments::{calibrate, images, list, plan, report, sample, scene};

use crate::args::{Args, Command, Input};

/// Runs a command.
pub(crate) fn run(args: Args, cancel: &AtomicBool) -> Result<(), Failure> {
    if let Some(n) = args.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n.max(1)).build_global();
        pool.map_err(|e| Failure::work("threads", e))?;
    }
    let options = |store: PathBuf| Options { store, quiet: args.quiet, cancel, say: &|line| eprintln!("{line}") };
    match args.command {
        Command::List { json: true, .. } => print(&json(&list::entries())?),
        Command::List { markdown: true, .. } => print(&list::markdown(&list::entries())),
        Command::List { .. } => print(&list::text(&list::entries())),
        Command::Check { input } => print(&config::to_toml(&load(&input)?.resolved)),
        Command::Plan { input, json: as_json } => {
            let experiment = load(&input)?;
            let prepared = run::prepare(&experiment, &options(PathBuf::new()))?;
            let plan = plan::plan(&experiment, &prepared, cancel)?;
            print(&if as_json { json(&plan)? } else { plan::text(&plan) })
        }
        Command::Build { input, store } => print(&run::build(&load(&input)?, &options(store))?),
        Command::Run { input, out, store } => {
            let experiment = load(&input)?;
            let name = input.file.file_stem().unwrap_or_default();
            let out = out.unwrap_or_else(|| Path::new("out").join(name));
            let table = run::run(&experiment, &out, &options(store))?;
            print(&format!("{table}\nreport: {}\n", out.join("report.html").display()))
        }
        Command::Render { input, pipeline, frame, out, store } => {
            render(&load(&input)?, &pipeline, frame, &out, &options(store))
        }
        Command::Sample { input, at, pipeline, cell, face_px, out, store } => {
            let (experiment, options) = (load(&input)?, options(store));
            print(&match (at, pipeline) {
                (Some(place), _) => sample::at(&experiment, place, face_px, &out, &options)?,
                (None, p) => sample::of_cell(&experiment, &p.unwrap_or_default(), cell, face_px, &out, &options)?,
            })
        }
        Command::Compare { runs, out } => compare(&runs, &out),
        Command::Calibrate { backend } => print(&calibrate::calibrate(backend)?),
        Command::Scene { kind, triangles, seed, out } => generate(kind, triangles, seed, &out, cancel),
    }
}

fn load(input: &Input) -> Result<Experiment, Failure> {
    config::load(&input.file, &input.sets, &list::entries())
}

/// To standard output; a reader that has closed it has seen enough.
fn print(text: &str) -> Result<(), Failure> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::work("standard output", e)),
        _ => Ok(()),
    }
}

fn json<T: serde::Serialize>(value: &T) -> Result<String, Failure> {
    serde_json::to_string_pretty(value).map(|s| s + "\n").map_err(|e| Failure::work("JSON", e))
}

fn render(
    experiment: &Experiment,
    pipeline: &str,
    frame: usize,
    out: &Path,
    options: &Options<'_>,
) -> Result<(), Failure> {
    let exr = match out.extension().and_then(|e| e.to_str()) {
        Some("png") => false,
        Some("exr") => true,
        _ => {
            return Err(Failure::input(
                format!("{}: not a picture", out.display()),
                "give a name ending in .png or .exr",
            ));
        }
    };
    let (_, rendered) = run::render(experiment, pipeline, frame, options)?;
    let written = if exr { images::write_exr(out, &rendered) } else { images::write_png(out, &rendered.picture) };
    written.map_err(|e| Failure::work(format!("{} cannot be written", out.display()), e))
}

fn compare(runs: &[PathBuf], out: &Path) -> Result<(), Failure> {
    let read = |dir: &PathBuf| -> Result<(String, Summary), Failure> {
        let file = dir.join("summary.json");
        let refused =
            |e: &dyn ToString| Failure::input(format!("{}: no results of a run", file.display()), e.to_string());
        let text = std::fs::read_to_string(&file).map_err(|e| refused(&e))?;
        Ok((dir.display().to_string(), serde_json::from_str(&text).map_err(|e| refused(&e))?))
    };
    let all = runs.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let table =
        report::compare(out, &all).map_err(|e| Failure::work(format!("{} cannot be written", out.display()), e))?;
    print(&format!("{table}\nreport: {}\n", out.display()))
}

fn generate(
    kind: Generated,
    triangles: Option<u64>,
    seed: u64,
    out: &Path,
    cancel: &AtomicBool,
) -> Result<(), Failure> {
    if kind == Generated::Asteroid && out.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")) {
        let written = scene::write_asteroid(out, triangles, seed, cancel)?;
        return print(&format!("{}: {written} triangles, 1 object\n", out.display()));
    }
    let parts = scene::generate(kind, triangles, seed)?;
    let (written, objects) = (parts.triangles(), parts.placements.len());
    let what = match kind {
        Generated::Asteroid => "object",
        Generated::House => "objects",
        Generated::Park => "statues",
        Generated::Pipes | Generated::Plant => "parts",
    };
    scene::write(out, parts)?;
    print(&format!("{}: {written} triangles, {objects} {what}\n", out.display()))
}
