//! What the guarantee costs: grid points, images, how near the placements come to the optimisation budget, and the time of it all,
//! for the pipes at several budgets and sizes, beside the published counts and two curves derived here.
//!
//! ```text
//! cargo bench -p farfield-integration-tests --bench placement -- [--bake N] [--plot FILE.svg] [--triangles N ...]
//! ```
//!
//! With `--bake N` the layered depth images of N points, spread over the grid, are built too, and the time of all is
//! extrapolated. Figure 13 of the paper (Aliaga and Lastra 1999) plots images / triangles against budget / triangles between a best
//! and a near-worst case whose derivations it leaves to a thesis; ours, with f = P / G the budget's share, t_x and t_y the tangents of half
//! the fields of view, r the spacing and 2 r the star-shape's radius:
//!
//! * **Best**: geometry is spread evenly through a cube of edge A and one image a point serves. A view holds G (4 t_x t_y / 3) z^3 / A^3
//!   triangles up to depth z, so an image has to stand at z = A (3 f / (4 t_x t_y))^(1/3), and outside the star-shape: r = z / 2.
//!   Points are those within 2 r of the cube (farther ones serve no eye): with L = A / r, by Steiner's formula
//!   N = L^3 + 6 L^2 2 + 3 pi L 2^2 + (4 pi / 3) 2^3.
//! * **Near worst**: however geometry is spread, a triangle lies in the star-shapes of at most (4 pi / 3) 2^3 = 33.5 points of a
//!   level, so at most 33.5 / f points of a level hold more than P and are divided, into at most 14 new ones; with K levels and 4 images
//!   a point (the most that the paper saw on average) 4 (N_0 + 14 K 33.5 / f), N_0 the points of the coarsest grid.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use farfield_core::cell::Cell;
use farfield_core::context::{Context, Forget, collect};
use farfield_core::id::CellId;
use farfield_core::region::Region;
use farfield_experiments::build::{NoCapture, Pool};
use farfield_experiments::run::{Options, build_pipelines, prepare};
use farfield_experiments::store::Store;
use farfield_experiments::{config, list::entries};
use farfield_partition_adaptive_grid::{AdaptiveGrid, Directions};
use plotters::prelude::*;

static NEVER: AtomicBool = AtomicBool::new(false);

/// Table 1 of the paper, pipes: budget and images.
const PAPER: [(u64, u64); 3] = [(150_000, 893), (200_000, 331), (250_000, 282)];

type Error = Box<dyn std::error::Error>;

fn options(store: &Path) -> Options<'static> {
    Options { store: store.to_owned(), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") }
}

/// One division of the pipes.
struct Row {
    triangles: u64,
    budget: u64,
    points: usize,
    images: usize,
    levels: f64,
}

fn percentile(sorted: &[f64], p: f64) -> f64 {
    sorted.get(((sorted.len() as f64 * p).ceil() as usize).saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Divides, places every image, and bakes those of `bake` points.
fn one(triangles: u64, budget: u64, bake: usize) -> Result<Row, Error> {
    let text = format!(
        "[scene]\nsource = \"pipes\"\ntriangles = {triangles}\n\
         [view]\nfov_y_deg = 60.0\nresolution = [512, 512]\npath = \"still\"\nframes = 1\n{}\n\
         [[pipeline]]\nname = \"grid\"\npartition = {{ type = \"adaptive-grid\", budget = {budget} }}\n\
         far_field = {{ type = \"layered-depth-image\" }}\n",
        heights(triangles)?
    );
    let experiment = config::parse("placement", &text, &[], Path::new(""), &entries()).map_err(|m| format!("{m:?}"))?;
    let folder = tempfile::tempdir()?;
    let start = Instant::now();
    let mut prepared = prepare(&experiment, &options(folder.path())).map_err(|f| format!("{f:?}"))?;
    let divided = start.elapsed().as_secs_f64();
    let (scene, cells) = (&prepared.scene, &prepared.divisions[0].cells);
    let cx = Context { capture: &NoCapture, run: &Pool, memo: &Forget, cancel: &NEVER };
    let start = Instant::now();
    let n = cells.outlines().len();
    let insides: Vec<Cell> = collect(&Pool, n, &|i| cells.inside(CellId(i as u32), scene, &cx))?;
    let placed = start.elapsed().as_secs_f64();
    let images: usize = insides.iter().map(|c| c.sectors.len()).sum();
    let with: Vec<&Cell> = insides.iter().filter(|c| !c.sectors.is_empty()).collect();
    let all = scene.triangles();
    let target = AdaptiveGrid::new(budget).placed_for(scene) as f64;
    let mut off: Vec<f64> = vec![];
    for c in &with {
        off.extend(Directions::of(c)?.left.iter().map(|&l| (l as f64 - target).abs() / target));
    }
    off.sort_by(f64::total_cmp);
    let mean_off = off.iter().sum::<f64>() / off.len().max(1) as f64;
    let radii = with.iter().filter_map(|c| match c.outline.region {
        Region::Sphere { radius, .. } => Some(f64::from(radius)),
        _ => None,
    });
    let (least, most) = radii.fold((f64::INFINITY, 0f64), |(a, b), r| (a.min(r), b.max(r)));
    let levels = if with.is_empty() { 0.0 } else { (2.0 * (most / least).log2()).ceil() };
    println!(
        "{all:>9} | {:>6} | {budget:>8} | {n:>6} | {:>6} | {images:>6} | {:>10.2} | {:>8.2} % | {:>8.2} % | {divided:>7.1} s | {placed:>7.1} s",
        scene.chunks.len(),
        with.len(),
        images as f64 / with.len().max(1) as f64,
        1e2 * mean_off,
        1e2 * percentile(&off, 0.95),
    );
    if bake > 0 && !with.is_empty() {
        let chosen: Vec<CellId> =
            (0..bake.min(with.len())).map(|i| with[i * with.len() / bake.min(with.len())].outline.id).collect();
        let of_chosen: usize = chosen.iter().map(|c| insides[c.index()].sectors.len()).sum();
        prepared.divisions[0].needed = chosen;
        let store = Store::open(folder.path(), Arc::new(|m| eprintln!("{m}")))?;
        let start = Instant::now();
        let built = build_pipelines(&experiment, &prepared, &[0], &store, &options(folder.path()))
            .map_err(|f| format!("{f:?}"))?;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "          {of_chosen} images in {seconds:.1} s, {:.2} s each, {:.0} kB each: all {images} in {:.1} min, {:.0} MB",
            seconds / of_chosen.max(1) as f64,
            built[0].preprocess.bytes_stored as f64 / 1e3 / of_chosen.max(1) as f64,
            seconds / of_chosen.max(1) as f64 * images as f64 / 60.0,
            built[0].preprocess.bytes_stored as f64 / 1e6 / of_chosen.max(1) as f64 * images as f64,
        );
    }
    Ok(Row { triangles: all, budget, points: n, images, levels })
}

/// Eyes at all heights of the scene.
fn heights(triangles: u64) -> Result<String, Error> {
    let text = format!(
        "[scene]\nsource = \"pipes\"\ntriangles = {triangles}\n[view]\npath = \"still\"\nframes = 1\n\
         [[pipeline]]\nname = \"all\"\nfar_field = {{ type = \"geometry\" }}\n"
    );
    let experiment = config::parse("heights", &text, &[], Path::new(""), &entries()).map_err(|m| format!("{m:?}"))?;
    let prepared = prepare(&experiment, &options(Path::new(""))).map_err(|f| format!("{f:?}"))?;
    let b = prepared.scene.bounds;
    Ok(format!("eye_height = [{:?}, {:?}]", b.min.y, b.max.y))
}

/// Points within two spacings of a cube of `l` spacings.
fn steiner(l: f64) -> f64 {
    let pi = std::f64::consts::PI;
    l.powi(3) + 12.0 * l * l + 12.0 * pi * l + 32.0 * pi / 3.0
}

/// Images of the best case for a share f of the triangles and 60 degrees, both ways.
fn best(f: f64) -> f64 {
    let tan = 30f64.to_radians().tan();
    steiner(2.0 * (4.0 * tan * tan / (3.0 * f)).cbrt())
}

/// Images of the near-worst case.
fn near_worst(f: f64, levels: f64) -> f64 {
    4.0 * (steiner(2.0) + 14.0 * levels * 33.5 / f)
}

fn plot(file: &Path, rows: &[Row]) -> Result<(), Error> {
    let area = SVGBackend::new(file, (760, 460)).into_drawing_area();
    area.fill(&WHITE)?;
    let g = rows.first().ok_or("nothing to plot")?.triangles as f64;
    let levels = rows.iter().map(|r| r.levels).fold(1.0, f64::max);
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(10.0..50.0, (1e-5..1e-1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("budget / triangles, %")
        .y_desc("images / triangles (logarithmic)")
        .light_line_style(WHITE)
        .draw()?;
    let curve = |images: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
        (20..=100).map(|i| f64::from(i) * 0.5).map(|p| (p, images(p / 100.0) / g)).collect()
    };
    let lines = [
        ("best case", BLACK, curve(&best)),
        ("near-worst case", RGBColor(150, 150, 150), curve(&|f| near_worst(f, levels))),
    ];
    for (name, color, points) in lines {
        let line = chart.draw_series(LineSeries::new(points, color))?;
        line.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color));
    }
    let published = PAPER.map(|(p, n)| (p as f64 / 1e4, n as f64 / 1e6));
    let ours = rows.iter().map(|r| (1e2 * r.budget as f64 / r.triangles as f64, r.images as f64 / r.triangles as f64));
    for (name, color, points) in [("pipes, paper", BLUE, published.to_vec()), ("pipes, here", RED, ours.collect())] {
        let dots = chart.draw_series(points.into_iter().map(|p| Circle::new(p, 4, color.filled())))?;
        dots.label(name).legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    area.present()?;
    Ok(())
}

fn main() -> Result<(), Error> {
    let (mut bake, mut file, mut sizes) = (0, None, vec![]);
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = args.next() {
        let mut value = || args.next().ok_or(format!("{name} takes a value"));
        match name.as_str() {
            "--bake" => bake = value()?.parse()?,
            "--plot" => file = Some(value()?),
            "--triangles" => sizes.push(value()?.parse::<u64>()?),
            _ => return Err(format!("{name}: there are --bake, --plot and --triangles").into()),
        }
    }
    println!(
        "triangles | chunks |   budget | points |  need | images | a point | off target | off, p95 | divided | placed"
    );
    let mut rows = vec![];
    for p in [150_000, 200_000, 250_000, 300_000, 400_000] {
        rows.push(one(1_000_000, p, if p == 150_000 { bake } else { 0 })?);
    }
    for r in &rows {
        let f = r.budget as f64 / r.triangles as f64;
        let published = PAPER.iter().find(|p| p.0 == r.budget).map_or(String::new(), |p| format!("{}", p.1));
        println!(
            "P = {:.0} % of the triangles: {} points, {} images; paper {published}; best {:.0}, near worst {:.0}",
            1e2 * f,
            r.points,
            r.images,
            best(f),
            near_worst(f, r.levels)
        );
    }
    for n in sizes {
        one(n, n * 15 / 100, 0)?;
    }
    if let Some(file) = file {
        plot(Path::new(&file), &rows)?;
    }
    Ok(())
}
