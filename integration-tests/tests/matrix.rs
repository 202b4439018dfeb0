//! Every partition with every far field on every backend that is registered, on a scene of nine stones: each combination either
//! runs, with pictures near those of all geometry, or is refused with the words that are listed here. A strategy that is added
//! to the registry is in the matrix from then on; where it needs a setting, [`GIVEN`] has to have it.
//!
//! The floor is far below what is found (printed with `--nocapture`): it catches pictures that are wrong, not ones that are worse.

use std::path::Path;

use farfield_core::registry::{Entry, Kind, SettingType};
use farfield_experiments::config::BackendName;
use farfield_experiments::list::entries;
use farfield_integration_tests::lab::{Lab, backends, errors};
use farfield_integration_tests::stones;

/// Required settings: of what, and its value.
const GIVEN: [(&str, &str, &str); 2] = [("adaptive-grid", "budget", "6000"), ("hex-cells", "edge", "3.0")];

/// More than the defaults: partitions that make a far field do something else.
const VARIANTS: [(&str, &str); 3] = [
    ("octree-regions", "max_size = 3.0, min_size = 3.0"),
    ("octree-regions", "max_size = 4.0, three_dimensional = true"),
    ("single-cell", "region = [-8.0, 1.0, -1.0, -4.0, 2.0, 1.0]"),
];

/// Far fields whose defaults are meant for larger pictures than these.
const FITTED: [(&str, &str); 6] = [
    ("cluster-lod", "cluster_triangles = 32, group_clusters = 8"),
    ("incremental-tdm", "face_px = 256, sampling_px = 48, max_samples = 8"),
    ("point-polygon-hlod", "node_triangles = 500, resolution = 64, max_px = 1.0"),
    ("static-lod", "max_px = 2.0, max_albedo_off = 64"),
    ("textured-depth-mesh", "face_px = 256"),
    ("textured-lod-mesh", "edge_px = 1.0"),
];

/// Combinations that are refused: partition, far field, and what the refusal must say. All others have to run.
const REFUSED: [(&str, &str, [&str; 3]); 4] = [
    (
        "{ type = \"single-cell\" }",
        "incremental-tdm",
        ["pipeline \"tested\"", "meets the viewpoints of cell 0", "give the partition a region"],
    ),
    (
        "{ type = \"single-cell\" }",
        "layered-depth-image",
        ["pipeline \"tested\"", "meets the viewpoints of cell 0", "give the partition a region"],
    ),
    (
        "{ type = \"single-cell\" }",
        "textured-depth-mesh",
        ["pipeline \"tested\"", "meets the viewpoints of cell 0", "give the partition a region"],
    ),
    (
        "{ type = \"single-cell\" }",
        "textured-lod-mesh",
        ["pipeline \"tested\"", "meets the viewpoints of cell 0", "give the partition a region"],
    ),
];

/// Nested strategies that a far field refuses, and what the refusal must say. All others have to run.
const REFUSED_WITHIN: [(&str, &str, &str); 2] = [
    ("point-polygon-hlod", "metric = { type = \"quadric\" }", "bounds no distance"),
    ("point-polygon-hlod", "metric = { type = \"silhouette-weighted\" }", "bounds no distance"),
];

/// PSNR of luminance against all geometry on the same backend, dB.
const FLOOR_DB: f64 = 32.0;
/// Of far fields whose outlines are pixels of samples: on faces of 256 pixels those are about two pixels of these pictures wide.
const FLOOR_OF: [(&str, f64); 2] = [("incremental-tdm", 28.0), ("textured-depth-mesh", 28.0)];
/// Pixels that show the background instead of an object; objects cover a tenth of the pictures and more.
const MAX_HOLES: f64 = 0.005;

const FRAMES: [usize; 3] = [0, 1, 3];

fn of(kind: Kind) -> Vec<Entry> {
    entries().into_iter().filter(|e| e.kind == kind).collect()
}

/// A strategy's table in an experiment file: its required settings and `more`.
fn table(e: &Entry, more: &str) -> String {
    let mut out = format!("{{ type = \"{}\"", e.name);
    for s in e.settings.iter().filter(|s| s.required) {
        let given = GIVEN.iter().find(|(of, name, _)| *of == e.name && *name == s.name);
        let (.., value) = given.unwrap_or_else(|| panic!("{} requires {}: give it a value in GIVEN", e.name, s.name));
        out += &format!(", {} = {value}", s.name);
    }
    if !more.is_empty() {
        out += &format!(", {more}");
    }
    out + " }"
}

/// A far field's table, fitted to small pictures.
fn far_table(e: &Entry, more: &str) -> String {
    let fitted = FITTED.iter().find(|(of, _)| *of == e.name).map(|(_, setting)| *setting);
    let all: Vec<&str> = fitted.into_iter().chain([more]).filter(|s| !s.is_empty()).collect();
    table(e, &all.join(", "))
}

fn experiment(partition: &str, far_field: &str) -> String {
    let pipelines = format!(
        r#"
        [[pipeline]]
        name = "all geometry"
        far_field = {{ type = "geometry", frustum_culling = false }}
        [[pipeline]]
        name = "tested"
        partition = {partition}
        far_field = {far_field}
        "#
    );
    stones::experiment([160, 120], &pipelines)
}

/// The least PSNR and the most holes over the frames, and the far field's triangles; or the refusal.
fn outcome(text: &str, folder: &Path, on: &[BackendName]) -> Result<Vec<(f64, f64, u64)>, String> {
    let lab = Lab::new(text, folder)?;
    let one = |&b: &BackendName| {
        let mut device = lab.device(b)?;
        let (reference, tested) = (lab.frames(0, &FRAMES, &mut device)?, lab.frames(1, &FRAMES, &mut device)?);
        let objects = reference.iter().map(|f| f.rendered.surface.object.iter().filter(|&&o| o != 0).count());
        assert!(objects.min() > Some(300), "the path looks at nothing");
        let all: Vec<_> = reference.iter().zip(&tested).map(|(r, t)| errors(r, t)).collect();
        let psnr = all.iter().map(|e| e.luminance.psnr_db()).fold(f64::INFINITY, f64::min);
        let holes = all.iter().map(|e| e.hole_fraction).fold(0.0, f64::max);
        Ok((psnr, holes, tested.iter().map(|f| f.far_triangles).sum()))
    };
    on.iter().map(one).collect()
}

#[track_caller]
fn check(what: &str, on: &[BackendName], found: &[(f64, f64, u64)]) {
    for (b, (psnr, holes, far)) in on.iter().zip(found) {
        println!("{what} on {}: {psnr:.1} dB, {:.3} % holes, {far} far triangles", b.name(), 100.0 * holes);
        let own = FLOOR_OF.iter().find(|(of, _)| what.contains(of)).map_or(FLOOR_DB, |(_, floor)| *floor);
        assert!(*psnr >= own && *holes <= MAX_HOLES, "{what} on {}: {psnr:.1} dB, holes {holes}", b.name());
    }
}

#[test]
fn every_combination_runs_or_is_refused_in_so_many_words() {
    let (folder, on) = (stones::folder(), backends("matrix"));
    let (partitions, far_fields) = (of(Kind::Partition), of(Kind::FarField));
    assert!(on.contains(&BackendName::Cpu) && partitions.len() >= 2 && far_fields.len() >= 2);
    let variants = |e: &Entry| -> Vec<String> {
        let own = VARIANTS.iter().filter(|(of, _)| *of == e.name).map(|(_, more)| table(e, more));
        std::iter::once(table(e, "")).chain(own).collect()
    };
    let mut refused = 0;
    for p in partitions.iter().flat_map(variants) {
        for f in &far_fields {
            let found = outcome(&experiment(&p, &far_table(f, "")), folder.path(), &on);
            let listed = REFUSED.iter().find(|(partition, far, _)| *partition == p && *far == f.name);
            match (found, listed) {
                (Ok(found), None) => check(&format!("{p} with {}", f.name), &on, &found),
                (Err(said), Some((.., words))) => {
                    let missing: Vec<&&str> = words.iter().filter(|w| !said.contains(**w)).collect();
                    assert!(missing.is_empty(), "{p} with {} is refused without saying {missing:?}: {said}", f.name);
                    refused += 1;
                }
                (Ok(_), Some(_)) => panic!("{p} with {} runs, although it is listed as refused", f.name),
                (Err(said), None) => panic!("{p} with {} is refused: {said}", f.name),
            }
        }
    }
    assert_eq!(refused, REFUSED.len(), "a listed refusal names no combination");
}

#[test]
fn every_choice_and_every_nested_strategy_of_a_far_field_runs() {
    let folder = stones::folder();
    let hex = table(of(Kind::Partition).iter().find(|e| e.name == "hex-cells").unwrap(), "");
    let (mut tried, mut refused) = (0, 0);
    for f in of(Kind::FarField) {
        for s in &f.settings {
            let values: Vec<String> = match &s.ty {
                SettingType::Choice(names) => names.iter().map(|n| format!("\"{n}\"")).collect(),
                SettingType::Boolean => vec!["true".into(), "false".into()],
                SettingType::Strategy(kind) => of(*kind).iter().map(|e| table(e, "")).collect(),
                _ => vec![],
            };
            for v in values {
                let more = format!("{} = {v}", s.name);
                let found = outcome(&experiment(&hex, &far_table(&f, &more)), folder.path(), &[BackendName::Cpu]);
                tried += 1;
                match REFUSED_WITHIN.iter().find(|(far, with, _)| *far == f.name && *with == more) {
                    None => check(&format!("{} with {more}", f.name), &[BackendName::Cpu], &found.unwrap()),
                    Some((.., words)) => {
                        let said = found.unwrap_err();
                        assert!(
                            said.contains(words),
                            "{} with {more} is refused without saying {words}: {said}",
                            f.name
                        );
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(tried >= 10, "{tried} choices");
    assert_eq!(refused, REFUSED_WITHIN.len(), "a listed refusal names no combination");
}

#[test]
fn one_view_and_several_both_run_with_either_metric_and_either_reading() {
    let folder = stones::folder();
    let hex = table(of(Kind::Partition).iter().find(|e| e.name == "hex-cells").unwrap(), "");
    let textured = |more: String| format!("{{ type = \"textured-lod-mesh\", edge_px = 1.0, {more} }}");
    let mut far = vec![];
    for max_px in ["0.0", "1e9"] {
        for metric in of(Kind::SimplificationMetric) {
            for facing in ["any-corner", "all-corners"] {
                let more = format!(
                    "view_test = {{ type = \"self-occlusion\", max_px = {max_px} }}, collapse = {}, facing = \"{facing}\"",
                    table(&metric, "")
                );
                let found = outcome(&experiment(&hex, &textured(more.clone())), folder.path(), &[BackendName::Cpu]);
                let found = found.unwrap();
                check(&more, &[BackendName::Cpu], &found);
                far.push(found[0].2);
            }
        }
    }
    assert!(far.iter().all(|&n| n > 0), "a frame without a far triangle: {far:?}");
    far.sort_unstable();
    far.dedup();
    // A single view does not ask for the reading; everything else makes other meshes.
    assert!(far.len() >= 6, "settings that change nothing: {far:?}");
}
