//! What incremental textured depth meshes cost and what they show, beside the published figures (Wilson and Manocha 2003).
//!
//! ```text
//! cargo bench -p farfield-integration-tests --bench depth_meshes -- MODE [SCENE] [options]
//!   samples   void against number of samples: greedy Voronoi, uniform grid, exhaustive search (figure 8) [--plot FILE.svg]
//!   table     samples a region, points removed, bytes and triangles a scan cube, with and without redundancy removal (table 1)
//!   truth     the void surface beside rays: difference and correlation
//!   growth    preprocessing against number of samples and resolution of faces
//! SCENE is house or plant; options: --triangles N, --cells N (how many regions of the route), --px N (faces of samples),
//!   --sampling-px N, --most N (samples), --set KEY=JSON (of the far field)
//! ```
//!
//! What a mode does not need it ignores: `samples` and `truth` build no meshes. Regions are those that the scene's own route visits, spread
//! evenly over it.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use farfield_core::Aabb;
use farfield_core::cell::Cell;
use farfield_core::claim::Claim;
use farfield_core::context::{Capture, Context, Forget, Shot, collect};
use farfield_core::id::{CellId, LocalPayload};
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::SkinTests;
use farfield_core::payload::Payload;
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, FarField, LeftOut, Sink, Subject, VisibilityMetric};
use farfield_core::{Camera, Fault};
use farfield_cpu::CpuCapture;
use farfield_experiments::build::Pool;
use farfield_experiments::run::{Options, Prepared, prepare};
use farfield_experiments::store::encode;
use farfield_experiments::{config, list::entries};
use farfield_far_itdm::Index;
use farfield_integration_tests::unseen::Truth;
use farfield_metrics::{VoidSurface, Voids};
use glam::{DVec3, Vec3};
use plotters::prelude::*;

static NEVER: AtomicBool = AtomicBool::new(false);

type Error = Box<dyn std::error::Error>;

/// What was asked for.
struct Args {
    mode: String,
    scene: String,
    triangles: u64,
    cells: usize,
    px: u32,
    sampling_px: u32,
    most: usize,
    plot: Option<String>,
    set: serde_json::Map<String, serde_json::Value>,
}

fn args() -> Result<Args, Error> {
    let mut words = std::env::args().skip(1).filter(|a| a != "--bench");
    let mode = words.next().unwrap_or_default();
    let mut out = Args {
        mode,
        scene: "house".into(),
        triangles: 0,
        cells: 3,
        px: 512,
        sampling_px: 128,
        most: 20,
        plot: None,
        set: Default::default(),
    };
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "house" | "plant" => out.scene = word,
            "--triangles" => out.triangles = value()?.parse()?,
            "--cells" => out.cells = value()?.parse()?,
            "--px" => out.px = value()?.parse()?,
            "--sampling-px" => out.sampling_px = value()?.parse()?,
            "--most" => out.most = value()?.parse()?,
            "--set" => {
                let text = value()?;
                let (key, set) = text.split_once('=').ok_or("--set takes key=value")?;
                out.set.insert(key.into(), serde_json::from_str(set)?);
            }
            "--plot" => out.plot = Some(value()?),
            _ => return Err(format!("what is {word}?").into()),
        }
    }
    if out.triangles == 0 {
        out.triangles = if out.scene == "house" { 262_879 } else { 1_000_000 };
    }
    Ok(out)
}

/// A scene divided into regions.
struct Site {
    prepared: Prepared,
    cells: Vec<Cell>,
}

fn site(a: &Args) -> Result<Site, Error> {
    let partition = match a.scene.as_str() {
        "house" => "{ type = \"octree-regions\", min_size = 2.0, max_size = 2.0 }",
        _ => "{ type = \"octree-regions\", min_size = 2.0, max_triangles = 20_000 }",
    };
    let text = format!(
        "[scene]\nsource = \"{}\"\ntriangles = {}\n[view]\nresolution = [512, 512]\nnear = 0.05\npath = \"route\"\n\
         frames_per_s = 1.0\nmax_speed = 1.0\nframes = 60\n\
         [[pipeline]]\nname = \"regions\"\npartition = {partition}\nfar_field = {{ type = \"incremental-tdm\" }}\n",
        a.scene, a.triangles
    );
    let experiment = config::parse("bench", &text, &[], Path::new(""), &entries()).map_err(|m| format!("{m:?}"))?;
    let options =
        Options { store: Path::new("").to_owned(), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") };
    let prepared = prepare(&experiment, &options).map_err(|f| format!("{f:?}"))?;
    let division = &prepared.divisions[0];
    let mut visited: Vec<CellId> = vec![];
    for id in prepared.cameras.iter().filter_map(|c| division.cells.find(c)) {
        if !visited.contains(&id) {
            visited.push(id);
        }
    }
    let n = a.cells.min(visited.len()).max(1);
    let cx = Context { capture: &farfield_experiments::build::NoCapture, run: &Pool, memo: &Forget, cancel: &NEVER };
    let cells = (0..n)
        .map(|i| division.cells.inside(visited[i * visited.len() / n], &prepared.scene, &cx))
        .collect::<Result<Vec<Cell>, Fault>>()?;
    println!(
        "{} of {} triangles; {} of {} regions that the route visits, {} in all",
        a.scene,
        prepared.scene.triangles(),
        n,
        visited.len(),
        division.cells.outlines().len()
    );
    Ok(Site { prepared, cells })
}

impl Site {
    fn far<'a>(&self, cell: &'a Cell) -> &'a ChunkSet {
        &cell.splits[0].far
    }

    fn bounds(&self, cell: &Cell) -> Aabb {
        self.far(cell).iter().fold(Aabb::EMPTY, |b, c| b.union(self.prepared.scene.chunks[c.index()].bounds))
    }

    fn take(
        &self,
        cell: &Cell,
        eyes: &[DVec3],
        px: u32,
        capture: &CpuCapture,
    ) -> Result<Vec<(Camera, SurfaceImage)>, Fault> {
        let cameras: Vec<Camera> = eyes.iter().flat_map(|&e| Camera::cube(e, px, self.prepared.views.near)).collect();
        let shots: Vec<Shot> = cameras.iter().map(|&camera| Shot { chunks: self.far(cell).clone(), camera }).collect();
        Ok(cameras.into_iter().zip(capture.shoot(&shots)?).collect())
    }

    /// Viewpoints of a cell in a grid of n x n, its border included, at the height of its centre.
    fn dense(&self, cell: &Cell, n: u32) -> Vec<DVec3> {
        let flat = cell.outline.region.footprint();
        let b = Aabb::of(flat.iter().map(|p| Vec3::new(p[0], cell.outline.centre.y, p[1])));
        let at = |i: u32| {
            let t = Vec3::new((i % n) as f32, 0.0, (i / n) as f32) / (n - 1).max(1) as f32;
            (b.min + b.size() * t).as_dvec3()
        };
        (0..n * n).map(at).collect()
    }

    fn corners(&self, cell: &Cell) -> Vec<DVec3> {
        let at = |p: &[f32; 2]| Vec3::new(p[0], cell.outline.centre.y, p[1]).as_dvec3();
        cell.outline.region.footprint().iter().map(at).collect()
    }
}

/// F at many places for one set of samples.
fn voids_at(
    site: &Site,
    cell: &Cell,
    samples: &[(Camera, SurfaceImage)],
    places: &[DVec3],
    px: u32,
    cx: &Context<'_>,
) -> Result<Vec<f64>, Fault> {
    let metric = VoidSurface::default();
    let voids = Voids::new(samples, site.bounds(cell), &metric.skin_tests(), cx)?;
    collect(cx.run, places.len(), &|i| Ok(voids.unseen(places[i], px, site.prepared.views.near).sr))
}

/// Places of a dense set at which everything is judged: what a strategy chose by is not what it is measured by.
const DENSE: u32 = 9;

fn samples(a: &Args) -> Result<(), Error> {
    let site = site(a)?;
    let capture = CpuCapture::new(&site.prepared.scene)?;
    let cx = Context { capture: &capture, run: &Pool, memo: &Forget, cancel: &NEVER };
    let metric = VoidSurface { max_sr: 0.0, face_px: a.sampling_px, ..VoidSurface::default() };
    let mut curves: Vec<(String, Vec<(usize, f64)>)> = vec![];
    for cell in &site.cells {
        let dense = site.dense(cell, DENSE);
        println!("region {}: largest F over {} places, sr", cell.outline.id.0, dense.len());
        let worst = |eyes: &[DVec3]| -> Result<f64, Fault> {
            let pictures = site.take(cell, eyes, a.sampling_px, &capture)?;
            let all = voids_at(&site, cell, &pictures, &dense, a.sampling_px, &cx)?;
            Ok(all.into_iter().fold(0.0, f64::max))
        };
        let mut greedy = site.corners(cell);
        let mut exhaustive = greedy.clone();
        let mut lines: [Vec<(usize, f64)>; 3] = Default::default();
        while greedy.len() <= a.most {
            let pictures = site.take(cell, &greedy, a.sampling_px, &capture)?;
            let subject = Subject {
                cell,
                views: &site.prepared.views,
                bounds: site.bounds(cell),
                facing: &[],
                px_per_tan: site.prepared.views.px_per_tan(),
                samples: &pictures,
            };
            lines[0].push((greedy.len(), worst(&greedy)?));
            let Some(next) = metric.next(&subject, &cx)? else { break };
            greedy.push(next.as_dvec3());
        }
        for n in 2..=((a.most as f64).sqrt() as u32) {
            lines[1].push(((n * n) as usize, worst(&site.dense(cell, n))?));
        }
        while exhaustive.len() <= a.most {
            let pictures = site.take(cell, &exhaustive, a.sampling_px, &capture)?;
            let all = voids_at(&site, cell, &pictures, &dense, a.sampling_px, &cx)?;
            let best = (0..all.len()).max_by(|&i, &j| all[i].total_cmp(&all[j])).unwrap_or_default();
            lines[2].push((exhaustive.len(), all[best]));
            if exhaustive.contains(&dense[best]) {
                break;
            }
            exhaustive.push(dense[best]);
        }
        for (name, line) in ["greedy Voronoi", "uniform grid", "exhaustive"].iter().zip(lines) {
            let told: Vec<String> = line.iter().map(|(n, f)| format!("{n}: {f:.3}")).collect();
            println!("  {name:<15} {}", told.join("  "));
            curves.push((format!("{name}, region {}", cell.outline.id.0), line));
        }
    }
    if let Some(file) = &a.plot {
        plot(Path::new(file), &curves)?;
    }
    Ok(())
}

fn plot(file: &Path, curves: &[(String, Vec<(usize, f64)>)]) -> Result<(), Error> {
    let area = SVGBackend::new(file, (760, 460)).into_drawing_area();
    area.fill(&WHITE)?;
    let points = || curves.iter().flat_map(|c| &c.1);
    let most = points().map(|p| p.0).max().unwrap_or(4) as f64 + 0.5;
    let top = points().map(|p| p.1).fold(0.1, f64::max) * 1.05;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(60)
        .build_cartesian_2d(3.5..most, 0.0..top)?;
    chart.configure_mesh().x_desc("samples").y_desc("largest void surface, sr").draw()?;
    for (i, (name, line)) in curves.iter().enumerate() {
        let color = [RGBColor(31, 119, 180), RGBColor(214, 39, 40), RGBColor(44, 160, 44)][i % 3];
        let style = color.mix(if i < 3 { 1.0 } else { 0.45 }).stroke_width(2);
        let at = |&(n, f): &(usize, f64)| (n as f64, f);
        chart
            .draw_series(LineSeries::new(line.iter().map(at), style).point_size(3))?
            .label(name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    chart.configure_series_labels().border_style(BLACK.mix(0.3)).background_style(WHITE.mix(0.8)).draw()?;
    area.present()?;
    Ok(())
}

/// Counts what is put out.
#[derive(Default)]
struct Weigh {
    bytes: Mutex<u64>,
}

impl Sink for Weigh {
    fn put(&self, _id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        // As the store packs them.
        let packed = zstd::bulk::compress(&encode(payload)?, 3);
        let stored = packed.map_err(|e| Fault::Refused(e.to_string()))?.len() as u64;
        *self.bytes.lock().unwrap_or_else(std::sync::PoisonError::into_inner) += stored;
        Ok(())
    }
    fn claim(&self, _claim: Claim) {}
    fn left_out(&self, _what: LeftOut) {}
}

/// One bake: its index, stored bytes, seconds.
fn baked(site: &Site, cell: &Cell, settings: &serde_json::Value, cx: &Context<'_>) -> Result<(Index, u64, f64), Error> {
    let far: Box<dyn FarField> = serde_json::from_value(settings.clone())?;
    let outlines = site.prepared.divisions[0].cells.outlines();
    let job = CellJob { scene: &site.prepared.scene, views: &site.prepared.views, cell, outlines, shared: None };
    let sink = Weigh::default();
    let start = Instant::now();
    let index = far.bake_cell(&job, &sink, cx)?;
    let seconds = start.elapsed().as_secs_f64();
    let bytes = *sink.bytes.lock().map_err(|e| e.to_string())?;
    Ok((Index::decode("bench", &index)?, bytes, seconds))
}

fn settings(a: &Args, more: serde_json::Value) -> serde_json::Value {
    let mut out = serde_json::json!({ "type": "incremental-tdm", "face_px": a.px, "sampling_px": a.sampling_px, "max_samples": a.most });
    if let (Some(o), Some(m)) = (out.as_object_mut(), more.as_object()) {
        o.extend(a.set.clone());
        o.extend(m.clone());
    }
    out
}

fn table(a: &Args) -> Result<(), Error> {
    let site = site(a)?;
    let capture = CpuCapture::new(&site.prepared.scene)?;
    let cx = Context { capture: &capture, run: &Pool, memo: &Forget, cancel: &NEVER };
    println!(
        "region | incremental | samples | removed % | put back % | triangles a cube | dense triangles a cube | kB a cube | texels a cube | s"
    );
    let mut sums = [[0.0; 4]; 2];
    for cell in &site.cells {
        for (row, incremental) in [true, false].into_iter().enumerate() {
            let (index, bytes, seconds) =
                baked(&site, cell, &settings(a, serde_json::json!({ "incremental": incremental })), &cx)?;
            let n = index.cubes.len().max(1) as f64;
            let sum = |f: fn(&farfield_far_itdm::Cube) -> u64| index.cubes.iter().map(f).sum::<u64>() as f64;
            let deltas = || index.cubes.iter().filter(|c| c.parent.is_some());
            let points: u64 = deltas().map(|c| c.points).sum();
            let removed: u64 = deltas().map(|c| c.points - c.kept).sum();
            let mended: u64 = deltas().map(|c| c.mended).sum();
            println!(
                "{:>6} | {incremental:>11} | {:>7} | {:>9.1} | {:>10.2} | {:>16.0} | {:>22.0} | {:>9.0} | {:>13.0} | {seconds:.1}",
                cell.outline.id.0,
                index.cubes.len(),
                1e2 * removed as f64 / points.max(1) as f64,
                1e2 * mended as f64 / points.max(1) as f64,
                sum(|c| c.triangles()) / n,
                sum(|c| c.dense_triangles) / n,
                bytes as f64 / 1e3 / n,
                sum(|c| c.texels) / n,
            );
            for (to, v) in sums[row].iter_mut().zip([n, sum(|c| c.triangles()), bytes as f64, seconds]) {
                *to += v;
            }
        }
    }
    let [with, without] = sums;
    println!(
        "samples a region {:.1}; all samples intra over incremental: triangles x {:.2}, bytes x {:.2}, time x {:.2} (paper: size 2, time of simplification 6)",
        with[0] / site.cells.len() as f64,
        without[1] / with[1],
        without[2] / with[2],
        without[3] / with[3]
    );
    Ok(())
}

fn truth(a: &Args) -> Result<(), Error> {
    let site = site(a)?;
    let capture = CpuCapture::new(&site.prepared.scene)?;
    let cx = Context { capture: &capture, run: &Pool, memo: &Forget, cancel: &NEVER };
    let mut pairs: Vec<(f64, f64)> = vec![];
    for cell in &site.cells {
        let truth = Truth::new(&site.prepared.scene, site.far(cell))?;
        let corners = site.corners(cell);
        let places = site.dense(cell, 5);
        for n in [1, 2, corners.len()] {
            let eyes = &corners[..n.min(corners.len())];
            let pictures = site.take(cell, eyes, a.px, &capture)?;
            let tests: SkinTests = VoidSurface::default().skin_tests();
            let voids = Voids::new(&pictures, site.bounds(cell), &tests, &cx)?;
            let near = site.prepared.views.near;
            let found: Vec<(f64, f64)> = collect(&Pool, places.len(), &|i| {
                let f = voids.unseen(places[i], a.sampling_px, near).sr;
                Ok((f, truth.unseen_sr(places[i], eyes, a.sampling_px, near)))
            })?;
            println!(
                "region {}, {n} samples of {} px: F {:.3} by skins, {:.3} by rays (means over {} places)",
                cell.outline.id.0,
                a.px,
                mean(found.iter().map(|p| p.0)),
                mean(found.iter().map(|p| p.1)),
                found.len()
            );
            pairs.extend(found);
        }
    }
    let (mx, my) = (mean(pairs.iter().map(|p| p.0)), mean(pairs.iter().map(|p| p.1)));
    let covariance = mean(pairs.iter().map(|p| (p.0 - mx) * (p.1 - my)));
    let deviation = |f: fn(&(f64, f64)) -> f64, m: f64| mean(pairs.iter().map(|p| (f(p) - m).powi(2))).sqrt();
    let correlation = covariance / (deviation(|p| p.0, mx) * deviation(|p| p.1, my));
    let off: Vec<f64> = pairs.iter().map(|p| p.0 - p.1).collect();
    println!(
        "{} places: F - truth mean {:.3} sr, least {:.3}, most {:.3}; correlation {correlation:.3}",
        pairs.len(),
        mean(off.iter().copied()),
        off.iter().copied().fold(f64::INFINITY, f64::min),
        off.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    );
    Ok(())
}

fn mean(v: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = v.fold((0, 0.0), |(n, s), x| (n + 1, s + x));
    sum / f64::from(n.max(1))
}

fn growth(a: &Args) -> Result<(), Error> {
    let site = site(&Args {
        cells: 1,
        scene: a.scene.clone(),
        mode: String::new(),
        plot: None,
        set: Default::default(),
        ..*a
    })?;
    let capture = CpuCapture::new(&site.prepared.scene)?;
    let cx = Context { capture: &capture, run: &Pool, memo: &Forget, cancel: &NEVER };
    let cell = &site.cells[0];
    println!("faces px | samples | s | s a sample");
    let none = serde_json::json!({ "type": "void-surface", "max_sr": 0.0 });
    let runs = [(a.px, 4), (a.px, 8), (a.px, 16), (a.px / 2, 8), (a.px / 4, 8)];
    for (px, n) in runs {
        let more = serde_json::json!({ "face_px": px, "max_samples": n, "sampling": none });
        let (index, _, seconds) = baked(&site, cell, &settings(a, more), &cx)?;
        let n = index.cubes.len();
        println!("{px:>8} | {n:>7} | {seconds:>6.1} | {:.2}", seconds / n as f64);
    }
    Ok(())
}

fn main() -> Result<(), Error> {
    let a = args()?;
    match a.mode.as_str() {
        "samples" => samples(&a),
        "table" => table(&a),
        "truth" => truth(&a),
        "growth" => growth(&a),
        "" => {
            println!("modes: samples, table, truth, growth");
            Ok(())
        }
        other => Err(format!("no mode {other}: samples, table, truth, growth").into()),
    }
}
