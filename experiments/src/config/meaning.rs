//! What a table of settings cannot say: keys that exclude each other, lists of whole numbers, ranges in order, names that
//! refer to something, files that are there.

use std::path::Path;

use serde_json::{Map, Value};

use super::mistakes::Collector;
use super::node::{At, Node, What};
use super::settings::{BuildWhen, Generated, LEAST_MEMORY, SceneSettings};
use crate::generate::{HOUSE_EYE, PLANT_EYE, gallery_height};
use crate::path::{PATHS, ROUTE};

/// How a scene is named.
pub(super) const SCENE_HELP: &str = "source = \"asteroid\", \"house\", \"park\", \"pipes\" or \"plant\" generates a scene, path = \"model.glb\" loads one";

/// Checks, and makes paths absolute and the reference explicit.
pub(super) fn check(
    root: &Node,
    resolved: &mut Map<String, Value>,
    pipelines: &[Map<String, Value>],
    folder: &Path,
    mistakes: &mut Collector<'_>,
) {
    scene(root, resolved, folder, mistakes);
    view(root, resolved, folder, mistakes);
    light(root, resolved, mistakes);
    reference(root, resolved, pipelines, mistakes);
}

/// The place of `table.key`: of its value, of the table, or the file's start.
fn at(root: &Node, table: &str, key: &str) -> At {
    let table = root.get(table);
    table.and_then(|t| t.get(key)).or(table).map_or(At::default(), |n| n.at.clone())
}

fn absolute(folder: &Path, path: &str) -> String {
    let joined = folder.join(path);
    std::path::absolute(&joined).unwrap_or(joined).to_string_lossy().into_owned()
}

fn scene(root: &Node, resolved: &mut Map<String, Value>, folder: &Path, mistakes: &mut Collector<'_>) {
    if root.get("scene").is_none() {
        return;
    }
    let Some(scene) = resolved["scene"].as_object_mut() else { return };
    let help = Some(SCENE_HELP.to_owned());
    match (scene.contains_key("source"), scene.contains_key("path")) {
        (true, true) => {
            mistakes.add(&at(root, "scene", "path"), "[scene] has both `source` and `path`", "one of the two", help)
        }
        // A `source` that is there and wrong has been told already.
        (false, false) if root.get("scene").is_some_and(|s| s.get("source").is_none() && s.get("path").is_none()) => {
            mistakes.add(&at(root, "scene", ""), "[scene] needs `source` or `path`", "neither is here", help);
        }
        _ => {}
    }
    if let Some(kind) = generated(scene) {
        scene.entry("triangles").or_insert(kind.triangles().into());
        if kind != Generated::Park && scene.contains_key("models") {
            let message = format!("`models` makes a park; source \"{}\" is not made of them", kind.name());
            mistakes.add(&at(root, "scene", "models"), message, "not here", None);
        }
        if scene.get("out_of_core") == Some(&Value::Bool(true)) {
            let message = format!("a generated {} is held in memory", kind.name());
            let help =
                "`farfield scene ... --out FILE.ply` writes it to a file that can be read out of core".to_owned();
            mistakes.add(&at(root, "scene", "out_of_core"), message, "not here", Some(help));
        }
        // A resolved experiment says the default, and what is no size has been told already.
        let default = SceneSettings::default().memory_bytes;
        if scene.get("memory_bytes").and_then(Value::as_u64).is_some_and(|b| b >= LEAST_MEMORY && b != default) {
            let message = format!("a generated {} is held in memory, whatever it takes", kind.name());
            let help = "`memory_bytes` in [budget] is the most that a walk holds".to_owned();
            mistakes.add(&at(root, "scene", "memory_bytes"), message, "not here", Some(help));
        }
    }
    for (key, wanted) in [("path", "file"), ("models", "folder")] {
        if let Some(path) = scene.get(key).and_then(Value::as_str).map(str::to_owned) {
            let full = absolute(folder, &path);
            // A path may be a folder too: of model files.
            let there = Path::new(&full).is_dir() || (wanted == "file" && Path::new(&full).is_file());
            if !there {
                mistakes.add(&at(root, "scene", key), format!("there is no {wanted} {full}"), "not there", None);
            }
            scene.insert(key.into(), full.into());
        }
    }
}

/// What generates the scene, where one is named that there is.
fn generated(scene: &Map<String, Value>) -> Option<Generated> {
    let name = scene.get("source").and_then(Value::as_str)?;
    Generated::ALL.into_iter().find(|g| g.name() == name)
}

/// The height above a generated scene's lowest point at which there is always a way, scene units; `None` where there is none of its
/// own.
fn standing(scene: &Map<String, Value>) -> Option<f64> {
    let scale = scene.get("scale").and_then(Value::as_f64)?;
    let height = match generated(scene)? {
        Generated::House => HOUSE_EYE,
        Generated::Asteroid | Generated::Park => return None,
        Generated::Pipes => gallery_height(scene.get("triangles").and_then(Value::as_u64)?),
        Generated::Plant => PLANT_EYE,
    };
    Some(scale * height)
}

fn view(root: &Node, resolved: &mut Map<String, Value>, folder: &Path, mistakes: &mut Collector<'_>) {
    let source = resolved["scene"].as_object().map(|s| (generated(s), standing(s)));
    let Some(view) = resolved["view"].as_object_mut() else { return };
    if let Some(height) = source.and_then(|s| s.1) {
        view.entry("eye_height").or_insert(serde_json::json!([height, height]));
    }
    let numbers = |v: &Map<String, Value>, key: &str| -> Vec<f64> {
        v.get(key).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    if numbers(view, "resolution").iter().any(|x| x.fract() != 0.0 || !(1.0..=16384.0).contains(x)) {
        let message = "`resolution` is two whole numbers of pixels from 1 to 16384";
        mistakes.add(&at(root, "view", "resolution"), message, "not a resolution", None);
    }
    for (key, low, high) in [("eye_height", f64::MIN, f64::MAX), ("pitch_deg", -85.0, 85.0)] {
        let r = numbers(view, key);
        if r.len() == 2 && !(r[0] <= r[1] && r[0] >= low && r[1] <= high) {
            let bounds = if key == "pitch_deg" { " within -85 to 85 degrees" } else { "" };
            let message = format!("`{key}` is a range [lowest, highest]{bounds}, not [{}, {}]", r[0], r[1]);
            mistakes.add(&at(root, "view", key), message, "not a range", None);
        }
    }
    if let Some(path) = view.get("path").and_then(Value::as_str).map(str::to_owned) {
        if Path::new(&path).extension().is_some_and(|e| e == "csv") {
            let full = absolute(folder, &path);
            if !Path::new(&full).is_file() {
                mistakes.add(&at(root, "view", "path"), format!("there is no file {full}"), "not there", None);
            }
            view.insert("path".into(), full.into());
        } else if !PATHS.contains(&path.as_str()) {
            let help = format!("paths: {}, or a .csv of key frames", PATHS.join(", "));
            mistakes.add(&at(root, "view", "path"), format!("no path is called \"{path}\""), "unknown", Some(help));
        } else if path == ROUTE && source.is_some_and(|s| !s.0.is_some_and(Generated::has_route)) {
            let help =
                "a house and a plant bring a route along; elsewhere a .csv of key frames says where to go".to_owned();
            mistakes.add(&at(root, "view", "path"), "the scene brings no route along", "no route", Some(help));
        }
    }
}

fn light(root: &Node, resolved: &Map<String, Value>, mistakes: &mut Collector<'_>) {
    let Some(light) = resolved["light"].as_object() else { return };
    let numbers = |key: &str| -> Vec<f64> {
        light.get(key).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    if numbers("to_light").iter().all(|&x| x == 0.0) && light.contains_key("to_light") {
        mistakes.add(&at(root, "light", "to_light"), "`to_light` has no direction", "all zero", None);
    }
    for key in ["color", "ambient"] {
        if numbers(key).iter().any(|&x| x < 0.0) {
            mistakes.add(&at(root, "light", key), format!("`{key}` is negative"), "light is 0 or more", None);
        }
    }
    for key in ["sky", "ground"] {
        if numbers(key).iter().any(|x| x.fract() != 0.0 || !(0.0..=255.0).contains(x)) {
            let message = format!("`{key}` is three whole numbers from 0 to 255 (sRGB)");
            mistakes.add(&at(root, "light", key), message, "not a colour", None);
        }
    }
}

fn reference(
    root: &Node,
    resolved: &mut Map<String, Value>,
    pipelines: &[Map<String, Value>],
    mistakes: &mut Collector<'_>,
) {
    let names: Vec<&str> = pipelines.iter().filter_map(|p| p.get("name")?.as_str()).collect();
    let Some(reference) = resolved["reference"].as_object_mut() else { return };
    match reference.get("pipeline").and_then(Value::as_str) {
        Some(n) if !names.contains(&n) => {
            let near = super::mistakes::nearest(n, names.iter().copied());
            let label = near.map_or("no such pipeline".into(), |n| format!("did you mean \"{n}\"?"));
            let help =
                format!("pipelines: {}", names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", "));
            mistakes.add(
                &at(root, "reference", "pipeline"),
                format!("no pipeline is called \"{n}\""),
                label,
                Some(help),
            );
        }
        Some(_) => {}
        None => {
            if let Some(first) =
                names.first().filter(|_| root.get("reference").is_none_or(|r| r.get("pipeline").is_none()))
            {
                reference.insert("pipeline".into(), (*first).into());
            }
        }
    }
    // What others are compared with may not lack anything, and what is built on demand does until it is there.
    let chosen = reference.get("pipeline").and_then(Value::as_str).and_then(|n| names.iter().position(|m| *m == n));
    let of = |i: usize| match root.get("pipeline").map(|n| &n.what) {
        Some(What::List(l)) => l.get(i).and_then(|p| p.get("build")),
        _ => None,
    };
    if let Some(build) = chosen.and_then(of).filter(|b| b.text() == Some(BuildWhen::OnDemand.name())) {
        let help = "[reference] pipeline = ... names another".to_owned();
        mistakes.add(&build.at, "the reference is built ahead of the walk", "not on demand", Some(help));
    }
}
