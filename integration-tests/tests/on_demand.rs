//! Cells built while walking: what is not there yet is a counted hole, never geometry over the budget; what was built is stored,
//! so that the second walk builds nothing; and a budget of no time builds nothing.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use farfield_experiments::config::{self, Experiment};
use farfield_experiments::list::entries;
use farfield_experiments::results::Summary;
use farfield_experiments::run::{self, Options};
use farfield_integration_tests::stones;

static NEVER: AtomicBool = AtomicBool::new(false);

/// Of the nine stones' triangles: some views hold more.
const BUDGET: u64 = 6_000;

fn experiment(folder: &Path, build: &str, on_demand_ms: f64) -> Experiment {
    let pipelines = format!(
        r#"
        [build]
        on_demand_ms = {on_demand_ms:?}
        [measure]
        every = 1
        ssim = false
        flip = false
        audit_views = 40
        [[pipeline]]
        name = "all geometry"
        backend = "cpu"
        far_field = {{ type = "geometry", frustum_culling = false }}
        [[pipeline]]
        name = "tested"
        backend = "cpu"
        build = "{build}"
        partition = {{ type = "adaptive-grid", budget = {BUDGET} }}
        far_field = {{ type = "layered-depth-image" }}
        scheduler = {{ type = "near-to-far-lru", radius = 0.0 }}
        "#
    );
    let text = stones::experiment([96, 72], &pipelines);
    config::parse("experiment", &text, &[], folder, &entries()).unwrap()
}

/// The tested pipeline's summary and its blocks missing over the walk, with a store that may hold something.
fn walk(
    folder: &Path,
    build: &str,
    on_demand_ms: f64,
    store: &str,
) -> (farfield_experiments::results::PipelineSummary, u64) {
    let out = tempfile::tempdir().unwrap();
    let options = Options { store: folder.join(store), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") };
    run::run(&experiment(folder, build, on_demand_ms), out.path(), &options).unwrap();
    let summary: Summary = serde_json::from_slice(&std::fs::read(out.path().join("summary.json")).unwrap()).unwrap();
    let csv = std::fs::read_to_string(out.path().join("frames.csv")).unwrap();
    let mut lines = csv.lines();
    let column = lines.next().unwrap().split(',').position(|c| c == "missing_blocks").unwrap();
    let missing =
        lines.filter(|l| l.starts_with("tested")).map(|l| l.split(',').nth(column).unwrap().parse::<u64>().unwrap());
    let missing = missing.sum();
    (summary.pipelines.into_iter().find(|p| p.name == "tested").unwrap(), missing)
}

#[test]
fn images_are_built_while_walking_and_kept_for_the_next_walk() {
    let folder = stones::folder();
    let (ahead, none) = walk(folder.path(), "ahead", 100.0, "ahead");
    assert!(ahead.preprocess.cells_built > 0 && ahead.points.max > 0.0, "the walk needs images");
    assert_eq!(none, 0, "nothing is missing where all was built ahead");

    let (idle, all) = walk(folder.path(), "on-demand", 0.0, "idle");
    assert_eq!((idle.preprocess.cells_built, idle.points.max), (0, 0.0), "no time, no image");
    assert!(all > 0 && idle.error.unwrap().hole_fraction.mean > ahead.error.unwrap().hole_fraction.mean);
    assert!(idle.triangles.near.max <= BUDGET as f64, "a hole is never filled with geometry: {:?}", idle.triangles);

    let (first, missed) = walk(folder.path(), "on-demand", 1e9, "demand");
    assert!(first.preprocess.cells_built > 0 && missed < all, "{missed} of {all} were missing");
    assert!(first.left_out.iter().any(|l| l.stage == "building ahead"), "{:?}", first.left_out);
    let (again, missed_again) = walk(folder.path(), "on-demand", 1e9, "demand");
    assert_eq!(again.preprocess.cells_built, 0, "the second walk finds them in the store");
    assert!(missed_again <= missed);
    for p in [&ahead, &idle, &first, &again] {
        let near = p.bounds.iter().find(|b| b.claimant == "adaptive-grid").expect("the budget is audited");
        assert_eq!((near.predicted_max, near.violations), (BUDGET as f64, 0), "{near:?}");
        assert!(near.samples > 0);
    }
}
