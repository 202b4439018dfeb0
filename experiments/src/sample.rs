//! `sample`: panoramic samples as files, to be looked at in a viewer of EXR layers.
//!
//! A sample is what six cameras of a cube see from a viewpoint: albedo, depth, normal and object number of each pixel. Either one
//! of the whole scene from any place ([`at`]), or those that a pipeline's far field was built from, each with the cell's far chunks
//! only ([`of_cell`]): what a depth mesh or a layered image could know of the scene. Taken with the experiment's capture backend.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use farfield_core::context::{Capture, Context, Forget, Shot};
use farfield_core::id::CellId;
use farfield_core::image::SurfaceImage;
use farfield_core::scene::ChunkSet;
use farfield_core::{Camera, Fault};
use glam::DVec3;

use crate::build::{Division, NoCapture, Pool};
use crate::config::{BuildWhen, Experiment};
use crate::failure::Failure;
use crate::images::write_sample;
use crate::progress::Progress;
use crate::run::{self, Options, Prepared};
use crate::walk::{OnDemand, Opened};
use crate::{path, scene};

/// A sample of all geometry from a place of the world, with faces of `face_px` x `face_px`, into one EXR file; what was written, in
/// a line.
///
/// # Errors
/// [`Failure::Input`] where the file's name or the experiment is wrong: nothing is written then. What capturing and writing give.
pub fn at(
    experiment: &Experiment,
    world: [f64; 3],
    face_px: u32,
    out: &Path,
    options: &Options<'_>,
) -> Result<String, Failure> {
    let refused =
        |cause: &str| Err(Failure::input(format!("{}: no sample can be written there", out.display()), cause));
    if out.extension().is_none_or(|e| e != "exr") {
        return refused("give a name ending in .exr");
    }
    if out.parent().is_some_and(|p| !p.as_os_str().is_empty() && !p.is_dir()) {
        return refused("there is no such folder");
    }
    if out.is_dir() {
        return refused("it is a folder");
    }
    let loaded = scene::scene(experiment, options)?;
    loaded.warnings.iter().for_each(|w| (options.say)(&format!("warning: {w}")));
    let (scene, limit_bytes) = (Arc::new(loaded.scene), loaded.limit_bytes);
    let near = path::views(&experiment.view, &scene).near;
    let eye = DVec3::from(world) - scene.origin;
    if !eye.as_vec3().is_finite() {
        let what = format!("no sample can be taken at {world:?}");
        return Err(Failure::input(what, "it is farther from the scene than 32-bit numbers reach"));
    }
    let capture = run::capture_of(experiment, &scene, limit_bytes, "a sample is a picture of the scene")?;
    let shots = Shots { capture: &*capture, face_px, near, origin: scene.origin };
    shots.write(eye, &scene.all_chunks(), out)
}

/// The samples that a pipeline's far field was built from in a cell, without one in that of the path's first camera; builds what
/// the store lacks. One EXR file a viewpoint in the folder `out`, named by its number; what was written, a line each.
///
/// # Errors
/// [`Failure::Input`] where there is no such pipeline or cell, or its far field was not made of samples: nothing is written to `out`
/// then. What building, capturing and writing give.
pub fn of_cell(
    experiment: &Experiment,
    pipeline: &str,
    cell: Option<u32>,
    face_px: u32,
    out: &Path,
    options: &Options<'_>,
) -> Result<String, Failure> {
    let index = run::position(experiment, pipeline)?;
    if out.ancestors().find(|p| p.exists()).is_some_and(|p| !p.is_dir()) {
        let what = format!("{}: no samples can be written there", out.display());
        return Err(Failure::input(what, "it is not a folder"));
    }
    let mut prepared = run::prepare(experiment, options)?;
    let id = chosen(&prepared.divisions[index], cell)?;
    prepared.divisions[index].needed = vec![id];
    takes_pictures(experiment, &prepared, index, id, options)?;
    let (store, capture) = (run::open_store(options)?, run::captures(experiment, &prepared, &[index])?);
    let progress = Progress::new(options.quiet);
    let site = prepared.site(&store, &*capture, options.cancel, &progress);
    let (settings, division) = (&experiment.pipelines[index], &prepared.divisions[index]);
    let mut opened = Opened::new(settings, division, site.build(settings, division)?, &prepared.scene, &store)?;
    if settings.build == BuildWhen::OnDemand {
        let failed = |f| Failure::during(format!("pipeline \"{pipeline}\", cell {}", id.0), f);
        OnDemand::new(&site, f64::INFINITY).serve_cell(&mut opened, id).map_err(failed)?;
    }
    let viewpoints = opened.viewpoints(id);
    if viewpoints.is_empty() {
        // The store has been filled by now: this is not what wrong input may do.
        let what = format!("the far field of pipeline \"{pipeline}\" was not sampled for cell {}", id.0);
        return Err(Failure::work(what, "it names no viewpoints that it was sampled from"));
    }
    let unwritten = |e| Failure::work(format!("{} cannot be written", out.display()), e);
    std::fs::create_dir_all(out).map_err(unwritten)?;
    let shots = Shots { capture: &*capture, face_px, near: prepared.views.near, origin: prepared.scene.origin };
    let bar = progress.samples(pipeline, viewpoints.len());
    let (mut said, next) = (String::new(), out.join(name(viewpoints.len())));
    for (number, (split, far, eye)) in viewpoints.into_iter().enumerate() {
        if options.cancel.load(Ordering::Relaxed) {
            return Err(Failure::Cancelled);
        }
        let line = shots.write(eye, far, &out.join(name(number)))?;
        said += &format!("cell {}, split {}: {line}", id.0, split.0);
        bar.inc();
    }
    bar.done();
    if next.exists() {
        (options.say)(&format!("warning: {} and later files are of an earlier run", next.display()));
    }
    Ok(said)
}

/// The file of a viewpoint's sample.
fn name(number: usize) -> String {
    format!("{number:03}.exr")
}

/// The cell that is asked for, or that of the path's first camera.
fn chosen(division: &Division, cell: Option<u32>) -> Result<CellId, Failure> {
    let all = division.cells.outlines().len();
    match cell {
        Some(n) if (n as usize) < all => Ok(CellId(n)),
        Some(n) => {
            Err(Failure::input(format!("there is no cell {n}"), format!("the partition has {all} cells, from 0")))
        }
        None => division.path.first().copied().flatten().ok_or_else(|| {
            Failure::input("the path's first camera is in no cell", format!("name one of the {all} cells, from 0"))
        }),
    }
}

/// Refuses a far field that is known to take no pictures for the cell, before anything is built.
fn takes_pictures(
    experiment: &Experiment,
    prepared: &Prepared,
    index: usize,
    id: CellId,
    options: &Options<'_>,
) -> Result<(), Failure> {
    let p = &experiment.pipelines[index];
    let cx = Context { capture: &NoCapture, run: &Pool, memo: &Forget, cancel: options.cancel };
    let refused = |f: Fault| Failure::before(format!("pipeline \"{}\", cell {}", p.name, id.0), f);
    let cell = prepared.divisions[index].cells.inside(id, &prepared.scene, &cx).map_err(refused)?;
    let needs = p.far_field.needs(&prepared.scene, Some(&cell)).map_err(refused)?;
    if needs.cell_asset && needs.captures {
        return Ok(());
    }
    let mut why = vec!["it takes no pictures there".to_owned()];
    why.extend(needs.left_out.iter().map(|l| format!("{}: {}", l.stage, l.reason)));
    Err(no_viewpoints(&p.name, id, &why.join("; ")))
}

fn no_viewpoints(pipeline: &str, id: CellId, why: &str) -> Failure {
    Failure::input(format!("the far field of pipeline \"{pipeline}\" was not sampled for cell {}", id.0), why)
}

/// How samples are taken.
struct Shots<'a> {
    capture: &'a dyn Capture,
    face_px: u32,
    near: f32,
    /// Where the local frame stands in the world.
    origin: DVec3,
}

impl Shots<'_> {
    /// Takes a sample of `chunks` from `eye`, local frame, and writes it.
    fn write(&self, eye: DVec3, chunks: &ChunkSet, file: &Path) -> Result<String, Failure> {
        let shots = Camera::cube(eye, self.face_px, self.near).map(|camera| Shot { chunks: chunks.clone(), camera });
        let failed = |f| Failure::during(format!("{}: its pictures", file.display()), f);
        let images = self.capture.shoot(&shots).map_err(failed)?;
        let short = |v: Vec<SurfaceImage>| failed(Fault::Refused(format!("a capture gave {} of 6 pictures", v.len())));
        let faces: [SurfaceImage; 6] = images.try_into().map_err(short)?;
        let [x, y, z] = (eye + self.origin).to_array();
        let place = format!("{x},{y},{z}");
        let unwritten = |e| Failure::work(format!("{} cannot be written", file.display()), e);
        write_sample(file, &faces, &format!("panoramic sample at {place} of the world")).map_err(unwritten)?;
        let pixels = faces.iter().map(|f| f.object.len()).sum::<usize>().max(1);
        let hit = faces.iter().flat_map(|f| &f.object).filter(|o| **o != 0).count();
        let share = 100.0 * hit as f64 / pixels as f64;
        Ok(format!("{}: at {place}, {share:.1} % of its pixels show a surface\n", file.display()))
    }
}
