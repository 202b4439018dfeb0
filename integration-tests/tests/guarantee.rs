//! The promise of automatic image placement (Aliaga and Lastra 1999), held against views by the ten thousand: whatever the
//! position in the model space and the direction, the original triangles drawn never exceed the budget, some grid point serves the
//! view, and no image lies behind the eye. Culling here is its own: a chunk is left out when all eight corners of its box lie
//! outside one side plane, in 64 bits; nothing of the library's culling is asked.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use farfield_core::Camera;
use farfield_core::cell::Cell;
use farfield_core::context::{Context, Forget};
use farfield_core::id::CellId;
use farfield_core::scene::Scene;
use farfield_experiments::build::{NoCapture, Pool};
use farfield_integration_tests::lab::{Lab, models};
use glam::DVec3;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Views of one kind over one scene: eight times this many in all are more than 200,000.
const VIEWS: usize = 25_600;

/// Views are taken in this many independent runs.
const RUNS: usize = 64;

struct Case<'a> {
    name: &'a str,
    /// The `[scene]` table's lines.
    scene: String,
    /// Of the scene's triangles, the share that is the budget.
    share: f64,
    /// Depth of the partition's leaves: what is far apart on a plain needs deeper ones than what fills a box.
    leaf_depth: u32,
    /// Whether eyes stand at all heights of the scene, or at one.
    all_heights: bool,
}

#[derive(Default, Debug)]
struct Found {
    views: usize,
    with_image: usize,
    unserved: usize,
    over_budget: usize,
    behind: usize,
    most: u64,
}

/// The scene's bounds and triangles, loaded without an eye height of its own.
fn measure(case: &Case<'_>) -> (f32, f32, u64) {
    let text = format!(
        "[scene]\n{}\n[view]\nframes = 1\npath = \"still\"\n[[pipeline]]\nname = \"all\"\nfar_field = {{ type = \"geometry\" }}",
        case.scene
    );
    let lab = Lab::new(&text, Path::new(".")).unwrap();
    let s = &lab.prepared.scene;
    (s.bounds.min.y, s.bounds.max.y, s.triangles())
}

fn lab(case: &Case<'_>, pitch_deg: [f64; 2]) -> Lab {
    let (low, high, triangles) = measure(case);
    let eye = if case.all_heights { [low, high] } else { [low + 0.02 * (high - low); 2] };
    let budget = (case.share * triangles as f64) as u64;
    let text = format!(
        "[scene]\n{}\n[view]\nfov_y_deg = 60.0\nresolution = [640, 512]\nframes = 1\npath = \"still\"\n\
         eye_height = [{:?}, {:?}]\npitch_deg = [{:?}, {:?}]\n\
         [[pipeline]]\nname = \"grid\"\npartition = {{ type = \"adaptive-grid\", budget = {budget}, leaf_depth = {} }}\n\
         far_field = {{ type = \"geometry\" }}",
        case.scene, eye[0], eye[1], pitch_deg[0], pitch_deg[1], case.leaf_depth,
    );
    Lab::new(&text, Path::new(".")).unwrap_or_else(|e| panic!("{}: {e}", case.name))
}

/// A camera of the view model anywhere in the model space, one in four at its very edge.
fn view(lab: &Lab, rng: &mut impl Rng) -> Camera {
    let (bounds, views) = (&lab.prepared.scene.bounds, &lab.prepared.views);
    let mut u: [f64; 3] = std::array::from_fn(|_| rng.random());
    if rng.random::<f32>() < 0.25 {
        u[rng.random_range(0..3)] = f64::from(rng.random_range(0u8..2));
    }
    let at = |low: f32, high: f32, u: f64| f64::from(low) + (f64::from(high) - f64::from(low)) * u;
    let eye = DVec3::new(
        at(bounds.min.x, bounds.max.x, u[0]),
        at(views.eye_height[0], views.eye_height[1], u[1]),
        at(bounds.min.z, bounds.max.z, u[2]),
    );
    let [low, high] = views.pitch_rad;
    views.camera(eye, std::f32::consts::TAU * rng.random::<f32>(), low + (high - low) * rng.random::<f32>())
}

/// Triangles of the chunks that are not far and not left out by one side plane.
fn drawn(scene: &Scene, cell: Option<(&Cell, usize)>, camera: &Camera) -> u64 {
    let planes = camera.side_planes().map(|n| n.as_dvec3());
    let outside = |b: &farfield_core::Aabb| {
        let corners = b.corners().map(|c| c.as_dvec3() - camera.eye);
        planes.iter().any(|n| corners.iter().all(|c| n.dot(*c) < 0.0))
    };
    let far = cell.map(|(cell, split)| &cell.splits[split].far);
    let chunks = scene.chunks.iter().enumerate();
    chunks
        .filter(|(i, _)| far.is_none_or(|f| !f.contains(farfield_core::id::ChunkId(*i as u32))))
        .filter(|(_, c)| !outside(&c.bounds))
        .map(|(_, c)| u64::from(c.triangles))
        .sum()
}

fn check(case: &Case<'_>, pitch_deg: [f64; 2]) {
    let lab = lab(case, pitch_deg);
    let (scene, cells) = (&lab.prepared.scene, &lab.prepared.divisions[0].cells);
    let budget = lab.experiment.pipelines[0].resolved["partition"]["budget"].as_u64().unwrap();
    let never = AtomicBool::new(false);
    let cx = Context { capture: &NoCapture, run: &Pool, memo: &Forget, cancel: &never };
    let insides: Mutex<BTreeMap<CellId, std::sync::Arc<Cell>>> = Mutex::default();
    let inside = |id: CellId| {
        if let Some(known) = insides.lock().unwrap().get(&id) {
            return known.clone();
        }
        let made = std::sync::Arc::new(cells.inside(id, scene, &cx).unwrap());
        insides.lock().unwrap().entry(id).or_insert(made).clone()
    };
    let one = |run: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(run as u64 ^ 0x1999);
        let mut found = Found::default();
        for _ in 0..VIEWS.div_ceil(RUNS) {
            let camera = view(&lab, &mut rng);
            found.views += 1;
            let Some(id) = cells.find(&camera) else {
                found.unserved += 1;
                continue;
            };
            let cell = inside(id);
            let active = cells.active(&cell, &camera);
            let n = drawn(scene, Some((&cell, active.split.index())), &camera);
            found.most = found.most.max(n);
            found.over_budget += usize::from(n > budget);
            found.with_image += usize::from(!active.sectors.is_empty());
            let behind = active.sectors.iter().any(|s| {
                let w = &cell.sectors[s.index()].window;
                w.corners.iter().any(|c| w.axis.as_dvec3().dot(c.as_dvec3() - camera.eye) <= 0.0)
            });
            found.behind += usize::from(behind);
        }
        found
    };
    let add = |a: Found, b: Found| Found {
        views: a.views + b.views,
        with_image: a.with_image + b.with_image,
        unserved: a.unserved + b.unserved,
        over_budget: a.over_budget + b.over_budget,
        behind: a.behind + b.behind,
        most: a.most.max(b.most),
    };
    let all = (0..RUNS).into_par_iter().map(one).reduce(Found::default, add);
    let images: usize = insides.lock().unwrap().values().map(|c| c.sectors.len()).sum();
    println!(
        "{}, pitch {pitch_deg:?}: budget {budget}, {} points, {images} images at those used: {all:?}",
        case.name,
        cells.outlines().len()
    );
    assert_eq!((all.over_budget, all.unserved, all.behind), (0, 0, 0), "{}: {all:?}", case.name);
    // The test would be empty where no view needs an image, or where the budget never binds.
    assert!(all.with_image * 20 > all.views, "{}: {all:?}", case.name);
    assert!(all.most * 2 > budget, "{}: {all:?}", case.name);
}

fn both(case: &Case<'_>) {
    check(case, [0.0, 0.0]);
    check(case, [-30.0, 30.0]);
}

#[test]
fn pipes_stay_within_their_budget() {
    let scene = "source = \"pipes\"\ntriangles = 1_000_000".to_owned();
    both(&Case { name: "pipes", scene, share: 0.2, leaf_depth: 5, all_heights: true });
}

#[test]
fn the_park_stays_within_its_budget() {
    let scene = "source = \"park\"\ntriangles = 500_000".to_owned();
    both(&Case { name: "park", scene, share: 0.6, leaf_depth: 7, all_heights: false });
}

#[test]
fn san_francisco_stays_within_its_budget() {
    let Some(folder) = models("san_francisco_stays_within_its_budget") else { return };
    let path = folder.join("architecture/san_francisco/san_francisco.obj.gz");
    let scene = format!("path = {:?}\nup = \"z\"", path.to_str().unwrap());
    both(&Case { name: "San Francisco", scene, share: 0.25, leaf_depth: 5, all_heights: true });
}

#[test]
fn the_valve_and_pipe_scene_stays_within_its_budget() {
    let Some(folder) = models("the_valve_and_pipe_scene_stays_within_its_budget") else { return };
    let scene = format!("path = {:?}", folder.join("cad/pipes").to_str().unwrap());
    both(&Case { name: "valves and pipes", scene, share: 0.5, leaf_depth: 5, all_heights: true });
}
