//! `run`, `build` and `render`: from an experiment to what it leaves behind.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use farfield_core::camera::ViewModel;
use farfield_core::claim::Quantity;
use farfield_core::context::Capture;
use farfield_core::draw::Shading;
use farfield_core::mesh::MeshChunk;
use farfield_core::scene::Scene;
use farfield_core::strategy::LeftOut;
use farfield_core::{Camera, Fault};

use crate::audit::{self, Measured};
use crate::build::{self, Built, Division, NoCapture, Site};
use crate::config::{BackendName, BudgetSettings, BuildWhen, Experiment, Pipeline, to_toml};
use crate::failure::Failure;
use crate::floor::floor;
use crate::gallery::Gallery;
use crate::measure::{self, Change, EQUAL_FRAMES_NOTE, FrameErrors, Metrics, Pieces, Reads, Rendered};
use crate::progress::Progress;
use crate::report;
use crate::results::{
    BoundAudit, FrameRow, Machine, MeanMax, PipelineSummary, SCHEMA, SceneFacts, Summary, Times, TriangleCounts,
};
use crate::store::Store;
use crate::walk::{Device, OnDemand, Opened, References, Tour, Walked, Walker, device, frame};
use crate::{path, scene};

/// Seed of the audits' viewpoints: fixed, so that runs compare.
const AUDIT_SEED: u64 = 0x0061_7564_6974;

/// Floor frames rendered after each walk.
const FLOOR_FRAMES: usize = 9;

/// What a command gets beside the experiment.
pub struct Options<'a> {
    /// The store's folder.
    pub store: PathBuf,
    /// No progress bars.
    pub quiet: bool,
    /// Set to stop.
    pub cancel: &'a AtomicBool,
    /// Told what the user should know, line by line.
    pub say: &'a (dyn Fn(&str) + Sync),
}

/// For tests that keep nothing.
#[cfg(test)]
pub(crate) fn nothing_kept() -> Options<'static> {
    static NEVER: AtomicBool = AtomicBool::new(false);
    Options { store: PathBuf::new(), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") }
}

/// An experiment with its scene, path and cells: everything that needs no building.
pub struct Prepared {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Where it came from.
    pub source: String,
    /// The views.
    pub views: ViewModel,
    /// The path.
    pub cameras: Vec<Camera>,
    /// Light and background of frame 0.
    pub shading: Shading,
    /// How far the light turns from frame to frame, radians.
    pub turn_rad_per_frame: f64,
    /// Each pipeline's cells.
    pub divisions: Vec<Division>,
    /// Where the scene's triangles stay on disk, the most bytes of them that may be held at once.
    pub limit_bytes: Option<u64>,
}

/// Loads the scene, lays the path and divides the viewpoints; far fields are asked whether they serve the scene.
///
/// # Errors
/// [`Failure::Input`]: nothing has been written.
pub fn prepare(experiment: &Experiment, options: &Options<'_>) -> Result<Prepared, Failure> {
    let loaded = scene::scene(experiment, options)?;
    loaded.warnings.iter().for_each(|w| (options.say)(&format!("warning: {w}")));
    let scene = Arc::new(loaded.scene);
    let views = path::views(&experiment.view, &scene);
    let cameras = path::cameras(&experiment.view, &views, &scene, loaded.route.as_ref())?;
    let mut divisions: Vec<Division> = vec![];
    for (i, p) in experiment.pipelines.iter().enumerate() {
        // Pipelines with the same partition share its cells.
        let same = experiment.pipelines[..i].iter().position(|q| q.resolved["partition"] == p.resolved["partition"]);
        divisions.push(match same {
            Some(j) => divisions[j].clone(),
            None => build::divide(p, &scene, &views, &cameras, options.cancel)?,
        });
        let refused = |f| Failure::before(format!("pipeline \"{}\": its far field", p.name), f);
        p.far_field.needs(&scene, None).map_err(refused)?;
    }
    let shading = scene::shading(&experiment.light);
    let turn_rad_per_frame =
        f64::from(experiment.light.turn_deg_per_s).to_radians() / f64::from(experiment.view.frames_per_s);
    let limit_bytes = loaded.limit_bytes;
    Ok(Prepared { scene, source: loaded.source, views, cameras, shading, turn_rad_per_frame, divisions, limit_bytes })
}

pub(crate) fn open_store(options: &Options<'_>) -> Result<Store, Failure> {
    let failed = |e| Failure::work(format!("the store {} cannot be used", options.store.display()), e);
    // The messages outlive this call's borrow, so they go to standard error themselves.
    Store::open(&options.store, Arc::new(|message| eprintln!("{message}"))).map_err(failed)
}

/// The captures that the pipelines need, if any does.
pub(crate) fn captures(
    experiment: &Experiment,
    prepared: &Prepared,
    which: &[usize],
) -> Result<Box<dyn Capture>, Failure> {
    for &i in which {
        let p = &experiment.pipelines[i];
        let needs = p.far_field.needs(&prepared.scene, None);
        if needs.map_err(|f| Failure::before(format!("pipeline \"{}\"", p.name), f))?.captures {
            let who = format!("pipeline \"{}\" takes pictures of the scene while it is built", p.name);
            return capture_of(experiment, &prepared.scene, prepared.limit_bytes, &who);
        }
    }
    Ok(Box::new(NoCapture))
}

/// The captures that `[build]` names, for `who`: they hold all triangles at once.
pub(crate) fn capture_of(
    experiment: &Experiment,
    scene: &Arc<Scene>,
    limit_bytes: Option<u64>,
    who: &str,
) -> Result<Box<dyn Capture>, Failure> {
    if let Some(why) = too_large(scene, limit_bytes) {
        return Err(Failure::input(who, why));
    }
    device::available(experiment.build.capture)?;
    let failed = |f| Failure::during(format!("captures by {}", experiment.build.capture.name()), f);
    build::capture(experiment.build.capture, scene).map_err(failed)
}

/// Why a scene's triangles cannot all be held at once, where they cannot.
fn too_large(scene: &Scene, limit_bytes: Option<u64>) -> Option<String> {
    let bytes: u64 = scene.meshes.iter().flat_map(|m| &m.chunks).map(MeshChunk::bytes).sum();
    let limit = limit_bytes.filter(|&most| bytes > most)?;
    let [all, most] = [bytes, limit].map(|b| b.div_ceil(1_000_000));
    Some(format!(
        "that takes all triangles at once, {all} MB, where [scene] memory_bytes allows {most} MB: \
         raise memory_bytes, or set out_of_core = false"
    ))
}

/// Builds what `which` pipelines need and the store lacks.
///
/// # Errors
/// As [`Site::build`].
pub fn build_pipelines(
    experiment: &Experiment,
    prepared: &Prepared,
    which: &[usize],
    store: &Store,
    options: &Options<'_>,
) -> Result<Vec<Built>, Failure> {
    let capture = captures(experiment, prepared, which)?;
    let progress = Progress::new(options.quiet);
    let site = prepared.site(store, &*capture, options.cancel, &progress);
    which.iter().map(|&i| site.build(&experiment.pipelines[i], &prepared.divisions[i])).collect()
}

impl Prepared {
    /// Light and background of a frame: the same for every pipeline.
    pub fn lit(&self, frame: usize) -> Shading {
        scene::turned(&self.shading, self.turn_rad_per_frame * frame as f64)
    }

    /// Where things are built.
    pub fn site<'a>(
        &'a self,
        store: &'a Store,
        capture: &'a dyn Capture,
        cancel: &'a AtomicBool,
        progress: &'a Progress,
    ) -> Site<'a> {
        Site { scene: &self.scene, views: &self.views, store, capture, cancel, progress }
    }
}

/// `build`: preprocessing only; what it did, in lines.
///
/// # Errors
/// As [`prepare`] and [`Site::build`].
pub fn build(experiment: &Experiment, options: &Options<'_>) -> Result<String, Failure> {
    let prepared = prepare(experiment, options)?;
    let store = open_store(options)?;
    let all: Vec<usize> = (0..experiment.pipelines.len()).collect();
    let built = build_pipelines(experiment, &prepared, &all, &store, options)?;
    let line = |(p, b): (&Pipeline, &Built)| {
        let w = &b.preprocess;
        format!(
            "{}: {} of {} needed cells built in {:.1} s ({} in the partition), {:.1} MB stored\n",
            p.name,
            w.cells_built,
            w.cells_needed,
            w.seconds,
            w.cells_total,
            w.bytes_stored as f64 / 1e6
        )
    };
    let mut out: String = experiment.pipelines.iter().zip(&built).map(line).collect();
    out += &format!("store: {}, peak memory {:.0} MB\n", store.root().display(), build::peak_rss_bytes() as f64 / 1e6);
    Ok(out)
}

/// `run`: builds what is missing, walks, measures, audits, writes; returns the table of results.
///
/// # Errors
/// As [`prepare`], [`Site::build`] and the walk; what writing gives.
pub fn run(experiment: &Experiment, out: &Path, options: &Options<'_>) -> Result<String, Failure> {
    let backends = device::choose(&experiment.pipelines, &mut |line| (options.say)(&line))?;
    let prepared = prepare(experiment, options)?;
    let store = open_store(options)?;
    let all: Vec<usize> = (0..experiment.pipelines.len()).collect();
    let capture = captures(experiment, &prepared, &all)?;
    let progress = Progress::new(options.quiet);
    let site = prepared.site(&store, &*capture, options.cancel, &progress);
    let build = |&i: &usize| site.build(&experiment.pipelines[i], &prepared.divisions[i]);
    let mut built: Vec<Option<Built>> = all.iter().map(|i| build(i).map(Some)).collect::<Result<_, _>>()?;

    let io = |e: std::io::Error| Failure::work(format!("results cannot be written to {}", out.display()), e);
    std::fs::create_dir_all(out.join("frames")).map_err(io)?;
    let references = References::new(prepared.views.resolution).map_err(io)?;
    let mut devices: BTreeMap<BackendName, Device> = BTreeMap::new();
    let failed = |f| Failure::during("the scene's surface", f);
    let surface = experiment.measure.surface_distance.then(|| Pieces::new(&prepared.scene));
    let surface = surface.transpose().map_err(failed)?;
    let mut gallery = Gallery::new(experiment.measure.pictures);
    let mut done: BTreeMap<usize, (PipelineSummary, Vec<FrameRow>)> = BTreeMap::new();
    let mut order = all.clone();
    order.sort_by_key(|&i| i != experiment.reference);
    for i in order {
        if let std::collections::btree_map::Entry::Vacant(v) = devices.entry(backends[i]) {
            v.insert(Device::new(device::open(backends[i], &prepared.scene)?));
        }
        let device = devices.get_mut(&backends[i]).ok_or(Failure::Cancelled)?;
        let one = One { experiment, prepared: &prepared, site: &site, options, index: i, surface: surface.as_ref() };
        let built = built[i].take().ok_or(Failure::Cancelled)?;
        done.insert(i, one.walk(built, device, &references, &mut gallery)?);
        if prepared.limit_bytes.is_some() {
            // Its chunks would stay for the next pipeline, and count against nobody's budget.
            devices.clear();
        }
    }
    let rows: Vec<FrameRow> = done.values().flat_map(|d| d.1.clone()).collect();
    let summary = summary(experiment, &prepared, done.into_values().map(|d| d.0).collect());
    let shown = gallery.finish(&references, &out.join("frames")).map_err(io)?;
    std::fs::write(out.join("resolved.toml"), to_toml(&experiment.resolved)).map_err(io)?;
    report::write(out, &summary, &rows, &shown).map_err(io)?;
    Ok(report::table(&[("run".to_owned(), summary)]))
}

fn summary(experiment: &Experiment, prepared: &Prepared, pipelines: Vec<PipelineSummary>) -> Summary {
    Summary {
        schema: SCHEMA,
        device: Machine {
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        },
        scene: SceneFacts {
            source: prepared.source.clone(),
            triangles: prepared.scene.triangles(),
            objects: prepared.scene.objects.len(),
            chunks: prepared.scene.chunks.len(),
            frames: prepared.cameras.len(),
            resolution_px: prepared.views.resolution,
        },
        reference: experiment.pipelines[experiment.reference].name.clone(),
        equal_frames_note: EQUAL_FRAMES_NOTE.into(),
        peak_rss_bytes: build::peak_rss_bytes(),
        pipelines,
    }
}

/// One pipeline's walk.
struct One<'a> {
    experiment: &'a Experiment,
    prepared: &'a Prepared,
    site: &'a Site<'a>,
    options: &'a Options<'a>,
    index: usize,
    /// Where surfaces are compared.
    surface: Option<&'a Pieces>,
}

impl One<'_> {
    fn pipeline(&self) -> &Pipeline {
        &self.experiment.pipelines[self.index]
    }

    fn is_reference(&self) -> bool {
        self.index == self.experiment.reference
    }

    /// Whether it is the reference of others: a pipeline alone is walked within its budget, and nothing of it is kept.
    fn is_compared_with(&self) -> bool {
        self.is_reference() && self.experiment.pipelines.len() > 1
    }

    fn reference_too_large(&self, frame: usize, missing: u32) -> Failure {
        let most = self.prepared.limit_bytes.unwrap_or(0).div_ceil(1_000_000);
        Failure::work(
            format!("the reference \"{}\" lacks {missing} blocks in frame {frame}", self.pipeline().name),
            format!(
                "what a frame of it draws does not fit in the {most} MB that [scene] memory_bytes allows: raise memory_bytes, take a \
                 [reference] pipeline that draws less, or leave one pipeline only, which is compared with nothing"
            ),
        )
    }

    fn walk(
        &self,
        built: Built,
        device: &mut Device,
        references: &References,
        gallery: &mut Gallery,
    ) -> Result<(PipelineSummary, Vec<FrameRow>), Failure> {
        let (e, p) = (self.experiment, self.prepared);
        let name = &self.pipeline().name;
        let division = &p.divisions[self.index];
        let opened = Opened::new(self.pipeline(), division, built, &p.scene, self.site.store)?;
        let on_demand =
            (self.pipeline().build == BuildWhen::OnDemand).then(|| OnDemand::new(self.site, e.build.on_demand_ms));
        let lit = |frame: usize| p.lit(frame);
        let tour = Tour {
            scene: &p.scene,
            views: &p.views,
            lit: &lit,
            cameras: &p.cameras,
            frames_per_s: e.view.frames_per_s,
            measure: &e.measure,
        };
        let budget = if self.is_compared_with() {
            // It may not lack anything, and of a scene on disk it may hold what that may.
            BudgetSettings { memory_bytes: p.limit_bytes, upload_bytes_per_frame: None }
        } else {
            e.budget.clone()
        };
        let info = device.backend.info().clone();
        let mut walker = Walker::new(&tour, opened, on_demand, device, &budget);
        if let Some(scene) = self.surface {
            walker.compare_surfaces(scene);
        }
        if self.is_compared_with() {
            walker = walker.strict();
        }
        let metrics = Metrics { ssim: e.measure.ssim, flip: e.measure.flip };
        let (mut walked, mut rows, mut errors): (Vec<Walked>, Vec<FrameRow>, Vec<FrameErrors>) =
            (vec![], vec![], vec![]);
        let (reads, mut changes, mut before): (_, Vec<Change>, Option<Vec<f32>>) = (self.reads(), vec![], None);
        let bar = Progress::new(self.options.quiet).frames(name, p.cameras.len());
        let failed = |i: usize| move |f| Failure::during(format!("pipeline \"{name}\", frame {i}"), f);
        let io = |e: std::io::Error| Failure::work("the reference's pictures cannot be kept", e);
        for (i, camera) in p.cameras.iter().enumerate() {
            if self.options.cancel.load(Ordering::Relaxed) {
                return Err(Failure::Cancelled);
            }
            let w = walker.step(camera).map_err(failed(i))?;
            if self.is_compared_with() && p.limit_bytes.is_some() && w.missing > 0 {
                return Err(self.reference_too_large(i, w.missing));
            }
            let mut row = row(name, i, &w);
            if self.is_compared_with() && reads.iter().any(|r| r.read(i)) {
                references.keep(i, &walker.read().map_err(failed(i))?).map_err(io)?;
            }
            let mine = &reads[self.index];
            if !self.is_reference() && mine.read(i) {
                let candidate = walker.read().map_err(failed(i))?;
                let reference = references.get(i).map_err(io)?;
                let after = measure::error_luma(&reference.picture, &candidate.picture);
                if let Some(before) = before.as_ref().filter(|_| mine.pair(i)) {
                    let at_border = walked.last().is_some_and(|last| last.cell != w.cell);
                    let grey_levels = measure::temporal_change(before, &after);
                    row.temporal_change_grey_levels = Some(grey_levels);
                    changes.push(Change { grey_levels, at_border });
                }
                before = Some(after);
                if mine.measured(i) {
                    let mut found = measure::frame(&reference, &candidate, metrics);
                    let surfaces = [&reference.surface, &candidate.surface];
                    found.surface = walker.surface_errors(camera, surfaces).map_err(failed(i))?;
                    with_errors(&mut row, &found);
                    gallery.consider(name, i, i / e.measure.every, &found, candidate.picture);
                    errors.push(found);
                }
            }
            rows.push(row);
            walked.push(w);
            bar.inc();
        }
        bar.done();
        // Audits look at the scene from all sides.
        let whole = too_large(&p.scene, p.limit_bytes);
        let audit_views = if whole.is_some() { 0 } else { e.measure.audit_views };
        let claims = walker.opened.has_claims() && e.measure.audit_views > 0;
        let not_audited = whole.filter(|_| claims).map(|reason| LeftOut {
            stage: "audits of claims".into(),
            reason,
            decided: "run".into(),
        });
        let measured = walker.audit(audit_views, AUDIT_SEED).map_err(failed(p.cameras.len()))?;
        let memory = walker.memory();
        memory.troubles.iter().for_each(|line| (self.options.say)(&format!("pipeline \"{name}\": {line}")));
        let of = |pick: fn(&Walked) -> u64| MeanMax::of(walked.iter().map(|w| pick(w) as f64));
        let times: Vec<f64> = walked.iter().map(|w| w.frame_ms).collect();
        let ratios: Vec<f64> =
            walked.iter().filter_map(|w| w.cell).map(|c| walker.opened.original_over_simplified(c)).collect();
        let Built { preprocess, mut left_out, shared, .. } = walker.opened.built;
        left_out.extend(not_audited);
        let index = shared.as_ref().map(|s| s.1.index.as_slice());
        let levels = self.pipeline().far_field.census(&p.scene, index).map_err(failed(p.cameras.len()))?;
        let floor = floor(&mut *device.backend, &p.views, &p.shading, FLOOR_FRAMES).map_err(failed(p.cameras.len()))?;
        let summary = PipelineSummary {
            name: name.clone(),
            strategies: serde_json::Value::Object(self.pipeline().resolved.clone()),
            device: info,
            preprocess,
            frame_ms: Times::of(&times),
            floor_ms: floor.p50,
            frame_ms_source: if walked.iter().all(|w| w.by_gpu) { "gpu timestamps" } else { "wall clock" }.into(),
            triangles: TriangleCounts {
                near: of(|w| w.near_triangles),
                far: of(|w| w.far_triangles),
                shadow: MeanMax::default(),
                total: of(|w| w.near_triangles + w.far_triangles),
            },
            points: of(|w| w.samples + w.points),
            lines: of(|w| w.lines),
            texture_bytes: walked.iter().map(|w| w.texture_bytes).max().unwrap_or(0),
            resident_bytes: walked.iter().map(|w| w.resident_bytes).max().unwrap_or(0),
            memory,
            far_error_px: MeanMax::of(walked.iter().map(|w| w.far_error_px.into())),
            frames_outside_cells: walked.iter().filter(|w| w.cell.is_none()).count(),
            original_over_simplified: MeanMax::of(ratios).mean,
            error: (!self.is_reference()).then(|| measure::summary(&errors, &changes)),
            bounds: self.bounds(&measured),
            left_out,
            levels,
        };
        Ok((summary, rows))
    }

    /// Which frames each pipeline reads back; the reference those of all.
    fn reads(&self) -> Vec<Reads> {
        let m = &self.experiment.measure;
        self.prepared.divisions.iter().map(|d| Reads::new(m.every, m.temporal, &d.path)).collect()
    }

    /// Near triangles are the partition's to claim, what is not seen the far field's.
    fn bounds(&self, measured: &[Measured]) -> Vec<BoundAudit> {
        let claimant = |key: &str| self.pipeline().resolved[key]["type"].as_str().unwrap_or_default().to_owned();
        let by = |near: bool| -> Vec<Measured> {
            measured.iter().copied().filter(|m| (m.quantity == Quantity::NearTriangles) == near).collect()
        };
        let mut out = audit::join(&claimant("partition"), &by(true));
        out.extend(audit::join(&claimant("far_field"), &by(false)));
        out
    }
}

fn row(pipeline: &str, frame: usize, w: &Walked) -> FrameRow {
    FrameRow {
        pipeline: pipeline.to_owned(),
        frame,
        cell: w.cell.map(|c| c.0),
        frame_ms: w.frame_ms,
        near_triangles: w.near_triangles,
        far_triangles: w.far_triangles,
        points: w.samples + w.points,
        lines: w.lines,
        missing_blocks: w.missing,
        far_error_px: w.far_error_px,
        failed_reads: w.failed_reads,
        uploaded_bytes: w.uploaded_bytes,
        texture_bytes: w.texture_bytes,
        ..FrameRow::default()
    }
}

fn with_errors(row: &mut FrameRow, e: &FrameErrors) {
    row.psnr_y_db = Some(e.luminance.psnr_db());
    row.psnr_y_object_db = (e.luminance_on_objects.pixels > 0).then(|| e.luminance_on_objects.psnr_db());
    (row.ssim, row.flip, row.hole_fraction) = (e.ssim, e.flip, Some(e.hole_fraction));
    row.depth_off_fraction = Some(e.depth_off_fraction);
    row.surface_distance_max_px = e.surface.map(|s| s.max_px);
}

/// The number of a pipeline by its name.
pub(crate) fn position(experiment: &Experiment, pipeline: &str) -> Result<usize, Failure> {
    let names = || experiment.pipelines.iter().map(|p| format!("\"{}\"", p.name)).collect::<Vec<_>>().join(", ");
    let unknown = || Failure::input(format!("no pipeline is called \"{pipeline}\""), format!("pipelines: {}", names()));
    experiment.pipelines.iter().position(|p| p.name == pipeline).ok_or_else(unknown)
}

/// `render`: one frame of one pipeline, all of it resident.
///
/// # Errors
/// [`Failure::Input`] where there is no such pipeline or frame; as [`run`] otherwise.
pub fn render(
    experiment: &Experiment,
    pipeline: &str,
    number: usize,
    options: &Options<'_>,
) -> Result<(Camera, Rendered), Failure> {
    let i = position(experiment, pipeline)?;
    if number >= experiment.view.frames {
        let cause = format!("the path has frames 0 to {}", experiment.view.frames - 1);
        return Err(Failure::input(format!("there is no frame {number}"), cause));
    }
    let backends = device::choose(&experiment.pipelines[i..=i], &mut |line| (options.say)(&line))?;
    let mut prepared = prepare(experiment, options)?;
    let camera = prepared.cameras[number];
    // Only this frame's cell is needed.
    let division = &mut prepared.divisions[i];
    division.needed = division.path[number].into_iter().collect();
    let store = open_store(options)?;
    let pipeline_at = &experiment.pipelines[i];
    let capture = captures(experiment, &prepared, &[i])?;
    let progress = Progress::new(options.quiet);
    let site = prepared.site(&store, &*capture, options.cancel, &progress);
    let built = site.build(pipeline_at, &prepared.divisions[i])?;
    let mut opened = Opened::new(pipeline_at, &prepared.divisions[i], built, &prepared.scene, &store)?;
    let mut device = Device::new(device::open(backends[0], &prepared.scene)?);
    let failed = |f| Failure::during(format!("pipeline \"{pipeline}\", frame {number}"), f);
    if pipeline_at.build == BuildWhen::OnDemand {
        OnDemand::new(&site, f64::INFINITY).serve(&mut opened, &camera).map_err(failed)?;
    }
    let rendered = render_at(&opened, &mut device, &prepared, &camera, &prepared.lit(number)).map_err(failed)?;
    Ok((camera, rendered))
}

/// A pipeline's picture from any viewpoint, everything that it may draw there resident, and no more; nothing is timed.
///
/// # Errors
/// What loading and drawing give.
pub fn render_at(
    opened: &Opened<'_>,
    device: &mut Device,
    prepared: &Prepared,
    camera: &Camera,
    shading: &Shading,
) -> Result<Rendered, Fault> {
    let scene = &*prepared.scene;
    let fetch = |b| opened.fetch(b);
    let drawn = opened.draws(opened.cell_of(camera), camera, &|_| true);
    for block in opened.blocks_of(&drawn.draws)? {
        device.load(block, scene, &fetch)?;
    }
    device.backend.render(&frame(camera, drawn.draws, shading))?;
    crate::walk::read(&mut *device.backend)
}
