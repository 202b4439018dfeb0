//! `--set path=value` and `[sweep]`: values put into an experiment's tree before it is walked.
//!
//! A path is `table.key` of one of the harness's tables, or `pipeline name.key`, deeper for nested strategies. A sweep holds lists
//! by path; their cartesian product, in the order of the file, takes each swept pipeline's place, and the swept values
//! enter its name: `hybrid edge_px=3`.

use serde_json::Value;

use super::mistakes::Collector;
use super::node::{At, Entry, Node, What};

/// What a path leads to.
enum Target {
    /// A table of the harness, and the keys from the root.
    Table(Vec<String>),
    /// Pipelines by their index, and the keys within each.
    Pipeline(usize, Vec<String>),
}

/// The names of the pipelines with their index; those without a usable name are left to the walk.
pub(super) fn pipelines(root: &Node) -> Vec<(usize, &str)> {
    let list = match root.get("pipeline").map(|n| &n.what) {
        Some(What::List(l)) => l.as_slice(),
        _ => &[],
    };
    list.iter().enumerate().filter_map(|(i, p)| Some((i, p.get("name")?.text()?))).collect()
}

fn target(root: &Node, tables: &[&str], path: &str) -> Option<Target> {
    let keys = |rest: &str| rest.split('.').map(|k| k.trim().trim_matches('"').to_owned()).collect::<Vec<_>>();
    // The longest name first: one pipeline's name may start with another's.
    let mut named = pipelines(root);
    named.sort_by_key(|(_, n)| std::cmp::Reverse(n.len()));
    for (i, name) in named {
        for prefix in
            [name.to_owned(), format!("\"{name}\""), format!("pipeline.{name}"), format!("pipeline.\"{name}\"")]
        {
            if let Some(rest) = path.strip_prefix(&prefix).and_then(|r| r.strip_prefix('.')) {
                return Some(Target::Pipeline(i, keys(rest)));
            }
        }
    }
    let all = keys(path);
    (all.len() > 1 && tables.contains(&all[0].as_str())).then_some(Target::Table(all))
}

fn choices(root: &Node, tables: &[&str]) -> String {
    let names: Vec<String> = pipelines(root).iter().map(|p| format!("`{}`", p.1)).collect();
    format!("pipelines: {}; tables: {}", names.join(", "), tables.join(", "))
}

/// Carries out one `--set`; `source` is the number of its text `path=value`, whose first `=` stands at byte `equals`.
pub(super) fn set(root: &mut Node, tables: &[&str], source: usize, text: &str, mistakes: &mut Collector<'_>) {
    let Some((path, value)) = text.split_once('=') else {
        let at = At { source, span: 0..text.len() };
        return mistakes.add(&at, "--set takes path=value", "no `=` here", None);
    };
    let key_at = At { source, span: 0..path.trim_end().len() };
    let from = path.len() + 1;
    let value_at = At { source, span: from..text.len() };
    // What is no TOML value is text: --set scene.path=city.glb.
    let node = match Node::parse(source, &format!("v={value}")) {
        Ok(n) => n.get("v").map(|v| at_everywhere(v.clone(), &value_at)),
        Err(_) => None,
    };
    let text = || Node { at: value_at.clone(), what: What::Leaf(Value::from(value.trim())) };
    let node = node.unwrap_or_else(text);
    match target(root, tables, path.trim()) {
        Some(Target::Table(keys)) => root.set(&keys, &key_at, node),
        Some(Target::Pipeline(i, keys)) => {
            if let Some(p) = pipeline_mut(root, i) {
                p.set(&keys, &key_at, node);
            }
        }
        None => mistakes.add(&key_at, "--set: no such setting", "leads nowhere", Some(choices(root, tables))),
    }
}

fn at_everywhere(mut node: Node, at: &At) -> Node {
    node.at = at.clone();
    match &mut node.what {
        What::Table(t) => t.iter_mut().for_each(|e| {
            e.at = at.clone();
            e.value = at_everywhere(e.value.clone(), at);
        }),
        What::List(l) => l.iter_mut().for_each(|n| *n = at_everywhere(n.clone(), at)),
        _ => {}
    }
    node
}

fn pipeline_mut(root: &mut Node, i: usize) -> Option<&mut Node> {
    let What::Table(entries) = &mut root.what else { return None };
    match &mut entries.iter_mut().find(|e| e.key == "pipeline")?.value.what {
        What::List(l) => l.get_mut(i),
        _ => None,
    }
}

/// Takes `[sweep]` out of the tree and puts the pipelines that it spans in place of those it names.
pub(super) fn sweep(root: &mut Node, tables: &[&str], mistakes: &mut Collector<'_>) {
    let What::Table(entries) = &mut root.what else { return };
    let Some(i) = entries.iter().position(|e| e.key == "sweep") else { return };
    let swept = entries.remove(i);
    let Some(lines) = swept.value.entries() else {
        return mistakes.add(&swept.value.at, "sweep is a table of lists by path", "not a table", None);
    };
    // Pipeline index, keys, values, in the order of the file.
    let mut axes: Vec<(usize, Vec<String>, Entry)> = vec![];
    for (path, line) in lines.iter().flat_map(|e| flattened(e.key.clone(), e)) {
        let help = Some(choices(root, &[]));
        match (target(root, tables, &path), &line.value.what) {
            (Some(Target::Pipeline(p, keys)), What::List(values)) if !values.is_empty() => {
                if keys == ["name"] {
                    mistakes.add(&line.at, "sweep: a pipeline's name cannot be swept", "a name", None);
                } else {
                    axes.push((p, keys, line));
                }
            }
            (Some(Target::Pipeline(..)), _) => {
                let message = format!("sweep: `{path}` takes a list of values, not {}", line.value.describe());
                mistakes.add(&line.value.at, message, "not a list of values", None);
            }
            _ => mistakes.add(&line.at, format!("sweep: `{path}` is no pipeline's setting"), "leads nowhere", help),
        }
    }
    let What::Table(entries) = &mut root.what else { return };
    let Some(list) = entries.iter_mut().find(|e| e.key == "pipeline") else { return };
    let What::List(pipelines) = &mut list.value.what else { return };
    let old = std::mem::take(pipelines);
    for (i, p) in old.into_iter().enumerate() {
        let mut made = vec![p];
        for (_, keys, line) in axes.iter().filter(|a| a.0 == i) {
            let What::List(values) = &line.value.what else { continue };
            made = made.iter().flat_map(|p| values.iter().map(|v| varied(p.clone(), keys, line, v))).collect();
        }
        pipelines.extend(made);
    }
}

/// A key of a sweep may be quoted (`"hybrid.far_field.edge_px"`) or dotted (`hybrid.far_field.edge_px`).
fn flattened(path: String, e: &Entry) -> Vec<(String, Entry)> {
    match e.value.entries() {
        Some(inner) if !inner.is_empty() => {
            inner.iter().flat_map(|x| flattened(format!("{path}.{}", x.key), x)).collect()
        }
        _ => vec![(path, e.clone())],
    }
}

fn varied(mut pipeline: Node, keys: &[String], line: &Entry, value: &Node) -> Node {
    let shown = match &value.what {
        What::Leaf(Value::String(s)) => s.clone(),
        What::Leaf(v) => v.as_f64().map_or_else(|| v.to_string(), |x| x.to_string()),
        What::Table(_) => value.get("type").and_then(Node::text).unwrap_or("table").to_owned(),
        _ => "list".to_owned(),
    };
    let name = pipeline.get("name").cloned();
    pipeline.set(keys, &line.at, value.clone());
    if let Some(mut name) = name {
        let text = format!("{} {}={shown}", name.text().unwrap_or_default(), keys.last().map_or("", String::as_str));
        name.what = What::Leaf(Value::from(text));
        let at = name.at.clone();
        pipeline.set(&["name".to_owned()], &at, name);
    }
    pipeline
}
