//! Experiment files: read, overridden, swept, checked with every mistake at its place, resolved, and made into strategies.
//!
//! Three steps. The TOML text becomes a tree with places ([`node`]); `--set` and `[sweep]` change the tree ([`overrides`]);
//! a walk against the registry's settings finds every mistake and fills in every default ([`check`]). Only a tree without
//! mistakes reaches serde. What comes out is itself a valid experiment that gives the same run.

mod check;
mod meaning;
pub mod mistakes;
mod node;
mod overrides;
mod settings;

use std::path::Path;

use farfield_core::registry::{Entry, Kind, Setting, SettingType};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

pub use settings::*;

use crate::failure::Failure;
use check::Walk;
use mistakes::{Collector, Mistakes, Sources};
use node::{At, Node, What};

/// The scheduler of pipelines that name none.
pub const DEFAULT_SCHEDULER: &str = "load-on-entry";
/// The partition of pipelines that name none.
pub const DEFAULT_PARTITION: &str = "single-cell";

/// Reads an experiment file. `entries` are the strategies and backends that it may name: [`crate::list::entries`], and those of
/// third parties beside them.
///
/// # Errors
/// [`Failure::Input`] where it cannot be read, or has mistakes: all of them.
pub fn load(file: &Path, sets: &[String], entries: &[Entry]) -> Result<Experiment, Failure> {
    let text = std::fs::read_to_string(file)
        .map_err(|e| Failure::input(format!("{}: cannot be read", file.display()), e.to_string()))?;
    let mut out = parse(&file.display().to_string(), &text, sets, file.parent().unwrap_or(Path::new("")), entries)?;
    out.file = file.to_owned();
    Ok(out)
}

/// Checks and resolves an experiment's text. `name` stands in messages; relative paths start in `folder`.
///
/// # Errors
/// All mistakes.
pub fn parse(
    name: &str,
    text: &str,
    sets: &[String],
    folder: &Path,
    entries: &[Entry],
) -> Result<Experiment, Mistakes> {
    let mut texts = vec![(name.to_owned(), text.to_owned())];
    texts.extend(sets.iter().map(|s| ("--set".to_owned(), s.clone())));
    let sources = Sources(texts);
    let mut mistakes = Collector::new(&sources);
    let mut root = match Node::parse(0, text) {
        Ok(root) => root,
        Err((message, at)) => {
            mistakes.add(&at, message, "here", None);
            return Err(mistakes.finish().err().unwrap_or(Mistakes { all: vec![] }));
        }
    };
    let tables = tables();
    let names: Vec<&str> = tables.keys().copied().collect();
    for (i, s) in sets.iter().enumerate() {
        overrides::set(&mut root, &names, i + 1, s, &mut mistakes);
    }
    overrides::sweep(&mut root, &names, &mut mistakes);

    let mut walk = Walk { entries, mistakes: &mut mistakes };
    let mut resolved = Map::new();
    for e in root.entries().unwrap_or_default() {
        if e.key != "pipeline" && !names.contains(&e.key.as_str()) {
            let all: Vec<String> = names.iter().chain(&["pipeline", "sweep"]).map(|n| format!("`{n}`")).collect();
            let near = mistakes::nearest(&e.key, names.iter().copied().chain(["pipeline", "sweep"]));
            let label = near.map_or("unknown".into(), |n| format!("did you mean `{n}`?"));
            let help = format!("an experiment has {}", all.join(", "));
            walk.mistakes.add(&e.at, format!("unknown key `{}` in the experiment", e.key), label, Some(help));
        }
    }
    let start = At::default();
    if root.get("scene").is_none() {
        let help = format!("in [scene], {}", meaning::SCENE_HELP);
        walk.mistakes.add(&start, "the experiment needs a table `scene`", "no [scene] in this file", Some(help));
    }
    for name in ["scene", "view", "light", "reference", "budget", "measure", "build"] {
        let node = root.get(name);
        let at = node.map_or(&start, |n| &n.at);
        let table = walk.table(&format!("[{name}]"), &tables[name], node, at, &[]);
        resolved.insert(name.into(), Value::Object(table));
    }
    let pipelines = walk_pipelines(&mut walk, &root);
    meaning::check(&root, &mut resolved, &pipelines, folder, &mut mistakes);
    let made = make(&root, resolved, pipelines, &mut mistakes);
    mistakes.finish()?;
    // `make` leaves nothing out without a mistake.
    made.ok_or_else(|| Mistakes { all: vec![] })
}

/// What a `[[pipeline]]` takes.
fn pipeline_settings() -> Vec<Setting> {
    let one = |name: &str, ty, default, required, doc: &str| Setting {
        name: name.into(),
        ty,
        default,
        required,
        unit: String::new(),
        doc: doc.into(),
    };
    let backends = [BackendName::Cpu, BackendName::Vulkan, BackendName::Wgpu].map(|b| b.name().to_owned());
    let when = [BuildWhen::Ahead, BuildWhen::OnDemand].map(|w| w.name().to_owned());
    let of_type = |name: &str| Value::from(Map::from_iter([("type".to_owned(), Value::from(name))]));
    vec![
        one("name", SettingType::Text, Value::Null, true, "what results call it"),
        one(
            "backend",
            SettingType::Choice(backends.into()),
            Value::Null,
            false,
            "what draws it; without it what this machine has",
        ),
        one(
            "build",
            SettingType::Choice(when.into()),
            Value::from(BuildWhen::Ahead.name()),
            false,
            "when its cells are built: ahead of the walk, or on demand within [build] on_demand_ms a frame",
        ),
        one("partition", SettingType::Strategy(Kind::Partition), of_type(DEFAULT_PARTITION), false, "its cells"),
        one("far_field", SettingType::Strategy(Kind::FarField), Value::Null, true, "what stands in for far geometry"),
        one(
            "scheduler",
            SettingType::Strategy(Kind::Scheduler),
            of_type(DEFAULT_SCHEDULER),
            false,
            "what is resident when",
        ),
    ]
}

fn walk_pipelines(walk: &mut Walk<'_, '_>, root: &Node) -> Vec<Map<String, Value>> {
    let list = match root.get("pipeline").map(|n| (n, &n.what)) {
        Some((_, What::List(l))) if !l.is_empty() => l,
        Some((n, _)) => {
            walk.mistakes.add(&n.at, "pipelines are tables [[pipeline]]", "not a list of tables", None);
            return vec![];
        }
        None => {
            let help = Some("[[pipeline]] takes a name and a far_field".to_owned());
            walk.mistakes.add(
                &At::default(),
                "the experiment needs at least one [[pipeline]]",
                "none in this file",
                help,
            );
            return vec![];
        }
    };
    let settings = pipeline_settings();
    let mut out = vec![];
    for (i, p) in list.iter().enumerate() {
        let what =
            p.get("name").and_then(Node::text).map_or(format!("pipeline {}", i + 1), |n| format!("pipeline \"{n}\""));
        out.push(walk.table(&what, &settings, Some(p), &p.at, &[]));
        let name = |n: &Node| n.get("name").and_then(Node::text).map(str::to_owned);
        if let Some(own) = p.get("name").filter(|n| n.text().is_some()) {
            if own.text() == Some("") {
                walk.mistakes.add(&own.at, "a pipeline's name is empty", "empty", None);
            }
            if list[..i].iter().any(|q| name(q) == name(p)) {
                let message = format!("two pipelines are called \"{}\"", own.text().unwrap_or_default());
                walk.mistakes.add(&own.at, message, "taken", None);
            }
        }
    }
    out
}

/// Makes the typed experiment; `None` where there was a mistake, which then is noted.
fn make(
    root: &Node,
    mut resolved: Map<String, Value>,
    tables: Vec<Map<String, Value>>,
    mistakes: &mut Collector<'_>,
) -> Option<Experiment> {
    if !mistakes.is_empty() {
        return None;
    }
    let scene = typed(root, &resolved, "scene", mistakes);
    let view = typed(root, &resolved, "view", mistakes);
    let light = typed(root, &resolved, "light", mistakes);
    let budget = typed(root, &resolved, "budget", mistakes);
    let measure = typed(root, &resolved, "measure", mistakes);
    let build = typed(root, &resolved, "build", mistakes);
    let reference = typed::<ReferenceSettings>(root, &resolved, "reference", mistakes)?;
    let name = |t: &Map<String, Value>| t["name"].as_str().unwrap_or_default().to_owned();
    let reference = tables.iter().position(|t| Some(name(t)) == reference.pipeline)?;
    let list = match root.get("pipeline").map(|n| &n.what) {
        Some(What::List(l)) => l.as_slice(),
        _ => &[],
    };
    let mut pipelines = vec![];
    for (table, node) in tables.iter().zip(list) {
        let at = |key: &str| node.get(key).map_or(&node.at, |n| &n.at);
        let partition = strategy(&table["partition"], at("partition"), mistakes);
        let far_field = strategy(&table["far_field"], at("far_field"), mistakes);
        let scheduler = strategy(&table["scheduler"], at("scheduler"), mistakes);
        let backend = table.get("backend").and_then(|b| serde_json::from_value(b.clone()).ok());
        if let (Some(partition), Some(far_field), Some(scheduler)) = (partition, far_field, scheduler) {
            let (name, resolved) = (name(table), table.clone());
            let build = serde_json::from_value(table["build"].clone()).unwrap_or_default();
            pipelines.push(Pipeline { name, backend, build, partition, far_field, scheduler, resolved });
        }
    }
    resolved.insert("pipeline".into(), tables.into_iter().map(Value::Object).collect());
    Some(Experiment {
        file: Default::default(),
        resolved,
        scene: scene?,
        view: view?,
        light: light?,
        reference,
        budget: budget?,
        measure: measure?,
        build: build?,
        pipelines,
    })
}

fn typed<T: DeserializeOwned>(
    root: &Node,
    resolved: &Map<String, Value>,
    name: &str,
    mistakes: &mut Collector<'_>,
) -> Option<T> {
    let at = root.get(name).map_or(At::default(), |n| n.at.clone());
    strategy(&resolved[name], &at, mistakes)
}

/// The last word is serde's: a strategy may refuse what its table of settings allows.
fn strategy<T: DeserializeOwned>(table: &Value, at: &At, mistakes: &mut Collector<'_>) -> Option<T> {
    T::deserialize(table.clone()).map_err(|e| mistakes.add(at, e.to_string(), "refused", None)).ok()
}

/// A resolved experiment as TOML.
pub fn to_toml(resolved: &Map<String, Value>) -> String {
    // Every table that the walk makes is of TOML's types: maps, lists, text, numbers, truth values.
    toml::to_string(&Value::Object(resolved.clone())).unwrap_or_default()
}

#[cfg(test)]
mod tests;
