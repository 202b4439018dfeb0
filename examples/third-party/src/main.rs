//! A visibility metric from outside the project, registered beside the project's own and used by name.
//!
//! `parallax` passes an object when no viewpoint of the cell can see two of its points, which coincide from the cell's centre,
//! more than `max_px` apart. A closed form that looks at nothing but the object's box: cheaper and far coarser than
//! `self-occlusion`. O(1) an object.
//!
//! Run: `cargo run --release -p farfield-example-third-party`
//!
//! Expected output: a table of results with a row for each of four pipelines, then `parallax decided for ...` with the settings that
//! the harness resolved. Under `self-occlusion` and `parallax` alike no audited claim is violated.

use farfield_core::Fault;
use farfield_core::claim::Quantity;
use farfield_core::context::Context;
use farfield_core::registry::{Entry, Kind, settings_of};
use farfield_core::strategy::{Subject, Verdict, VisibilityMetric};
use farfield_experiments::{config, failure::Failure, list, results::Summary, run};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Parallax under a number of pixels.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Parallax {
    /// An object passes below this.
    #[serde(default = "three")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f64,
}

fn three() -> f64 {
    3.0
}

#[typetag::serde(name = "parallax")]
impl VisibilityMetric for Parallax {
    fn judge(&self, subject: &Subject<'_>, _cx: &Context<'_>) -> Result<Verdict, Fault> {
        let outline = &subject.cell.outline;
        let corners = outline.region.corners().ok_or_else(|| Fault::Refused("parallax needs a bounded cell".into()))?;
        // Points A and B that coincide from the centre C are seen apart from E by ACE's angle at A less that at B (the exterior
        // angle of a triangle), so by at most asin(|CE| / |AE|) <= asin(m / d). A pixel in the picture's corner is narrower in
        // angle by cos^2 of half the diagonal field of view.
        let m = corners.iter().map(|c| c.distance(outline.centre)).fold(0.0, f32::max);
        let d = outline.region.distance(&subject.bounds);
        let apart_rad = if d > m { (m / d).asin() } else { std::f32::consts::PI };
        let value = f64::from(subject.px_per_tan * apart_rad / subject.views.half_diagonal_rad().cos().powi(2));
        Ok(Verdict { value, claim: value, quantity: Quantity::HoleWidthPx, passes: value < self.max_px })
    }
}

/// The project's strategies, and this one.
fn entries() -> Vec<Entry> {
    let mut all = list::entries();
    all.push(Entry {
        kind: Kind::VisibilityMetric,
        name: "parallax",
        summary: "How far an object's points can shift against each other, in pixels",
        source: "an example",
        settings: settings_of::<Parallax>(),
    });
    all
}

const EXPERIMENT: &str = r#"
[scene]
path = "columns.obj"
two_sided = false

[view]
resolution = 96
eye_height = 2.0
near = 0.05
path = "line"
max_speed = 60.0
frames_per_s = 5
frames = 6

[[pipeline]]
name = "all geometry"
backend = "cpu"
far_field = { type = "geometry", frustum_culling = false }

[[pipeline]]
name = "self-occlusion"
backend = "cpu"
partition = { type = "hex-cells", edge = 8.0 }
far_field = { type = "textured-lod-mesh", view_test = { type = "self-occlusion" } }

[[pipeline]]
name = "parallax"
backend = "cpu"
partition = { type = "hex-cells", edge = 8.0 }
far_field = { type = "textured-lod-mesh", view_test = { type = "parallax" } }

[sweep]
"parallax.far_field.view_test.max_px" = [3.0, 300.0]
"#;

fn experiment(out: &Path) -> Result<(String, Summary), Failure> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let experiment = config::parse("example", EXPERIMENT, &[], folder, &entries())?;
    let never = AtomicBool::new(false);
    let options =
        run::Options { store: out.join("store"), quiet: true, cancel: &never, say: &|line| eprintln!("{line}") };
    let table = run::run(&experiment, out, &options)?;
    let text = std::fs::read_to_string(out.join("summary.json")).map_err(|e| Failure::work("summary.json", e))?;
    Ok((table, serde_json::from_str(&text).map_err(|e| Failure::work("summary.json", e))?))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let dir = tempfile::tempdir()?;
    let (table, summary) = experiment(dir.path())?;
    println!("{table}");
    for p in summary.pipelines.iter().filter(|p| p.name.starts_with("parallax")) {
        println!("parallax decided for \"{}\": {}", p.name, p.strategies["far_field"]["view_test"]);
    }
    Ok(())
}

#[test]
fn the_metric_decides_what_is_built() {
    let dir = tempfile::tempdir().unwrap();
    let (_, s) = experiment(dir.path()).unwrap();
    let [strict, loose] = [&s.pipelines[2], &s.pipelines[3]];
    assert_eq!(loose.strategies["far_field"]["view_test"]["max_px"], 300.0);
    assert_ne!(strict.triangles.far.mean, loose.triangles.far.mean, "other objects pass, other meshes are built");
    assert!(s.pipelines.iter().flat_map(|p| &p.bounds).all(|b| b.violations == 0), "{:?}", strict.bounds);
}
