//! The walk of an experiment's tree against tables of settings: every unknown key, wrong type, value out of range, unknown
//! name and missing setting is found at its place before serde runs, and what comes out is resolved: every setting that
//! has a default is there, in the order of its table, nested strategies included. O(keys x settings).

use farfield_core::registry::{Entry, Kind, Setting, SettingType};
use serde_json::{Map, Value};

use super::mistakes::{Collector, nearest};
use super::node::{At, Node, What};

/// The walk: what is registered, and where mistakes go.
pub(super) struct Walk<'a, 'b> {
    /// Strategies and backends.
    pub(super) entries: &'a [Entry],
    /// Mistakes.
    pub(super) mistakes: &'a mut Collector<'b>,
}

fn quoted<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    names.into_iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

impl Walk<'_, '_> {
    /// A table of settings, resolved. `at` is where a missing setting is missed; `extra` are keys that are dealt with elsewhere.
    pub(super) fn table(
        &mut self,
        what: &str,
        settings: &[Setting],
        node: Option<&Node>,
        at: &At,
        extra: &[&str],
    ) -> Map<String, Value> {
        let entries = match node.map(|n| (n, n.entries())) {
            None => &[],
            Some((_, Some(e))) => e,
            Some((n, None)) => {
                self.mistakes.add(&n.at, format!("{what} is a table, not {}", n.describe()), "not a table", None);
                return Map::new();
            }
        };
        for e in entries {
            if !settings.iter().any(|s| s.name == e.key) && !extra.contains(&e.key.as_str()) {
                let names =
                    || settings.iter().map(|s| s.name.as_str()).chain(extra.iter().copied()).filter(|n| *n != "type");
                let label = nearest(&e.key, names()).map_or("unknown".into(), |n| format!("did you mean `{n}`?"));
                let help = match quoted(names()) {
                    s if s.is_empty() => format!("{what} has no settings"),
                    s => format!("{what} has {s}"),
                };
                self.mistakes.add(&e.at, format!("unknown key `{}` in {what}", e.key), label, Some(help));
            }
        }
        let mut out = Map::new();
        for s in settings {
            let value = match entries.iter().find(|e| e.key == s.name) {
                Some(e) => self.value(s, &e.value),
                None if s.required => {
                    let help = format!("{}: {}", s.name, s.doc);
                    self.mistakes.add(
                        at,
                        format!("{what} needs `{}`", s.name),
                        format!("no `{}` here", s.name),
                        Some(help),
                    );
                    None
                }
                None => self.default(s, at),
            };
            if let Some(v) = value.filter(|v| !v.is_null()) {
                out.insert(s.name.clone(), v);
            }
        }
        out
    }

    /// A strategy's table, resolved: its `type`, then its settings.
    pub(super) fn strategy(&mut self, kind: Kind, node: &Node) -> Option<Value> {
        let what = kind.name();
        let of_kind = || self.entries.iter().filter(|e| e.kind == kind);
        let help = Some(format!("registered as {what}: {}", quoted(of_kind().map(|e| e.name))));
        let Some(name) = node.get("type") else {
            let message =
                format!("{what} is a table with a `type`, such as {{ type = \"{}\" }}", of_kind().next()?.name);
            self.mistakes.add(&node.at, message, "no `type` here", help);
            return None;
        };
        let Some(entry) = of_kind().find(|e| Some(e.name) == name.text()) else {
            let near = name.text().and_then(|t| nearest(t, of_kind().map(|e| e.name)));
            let label = near.map_or("not registered".into(), |n| format!("did you mean `{n}`?"));
            self.mistakes.add(&name.at, format!("no {what} is called {}", name.describe()), label, help);
            return None;
        };
        let mut out = Map::new();
        out.insert("type".into(), entry.name.into());
        out.append(&mut self.table(&format!("`{}`", entry.name), &entry.settings, Some(node), &node.at, &["type"]));
        Some(Value::Object(out))
    }

    /// A default; that of a nested strategy is a table (or TOML text of one) and gets its own defaults.
    fn default(&mut self, s: &Setting, at: &At) -> Option<Value> {
        match (&s.ty, &s.default) {
            (SettingType::Strategy(_), Value::Null) => None,
            (SettingType::Strategy(kind), Value::String(text)) => {
                let node = Node::parse(at.source, text).ok()?;
                self.strategy(*kind, &placed(node, at))
            }
            (SettingType::Strategy(kind), table) => self.strategy(*kind, &of_json(table, at)),
            (_, v) => Some(v.clone()),
        }
    }

    fn value(&mut self, s: &Setting, node: &Node) -> Option<Value> {
        let wrong = |this: &mut Self, is: &str| {
            let unit = if s.unit.is_empty() { String::new() } else { format!(" ({})", s.unit) };
            let message = format!("`{}` is {is}{unit}, not {}", s.name, node.describe());
            this.mistakes.add(&node.at, message, format!("not {is}"), (!s.doc.is_empty()).then(|| s.doc.clone()));
            None
        };
        match (&s.ty, &node.what) {
            (SettingType::Boolean, What::Leaf(v @ Value::Bool(_))) => Some(v.clone()),
            (SettingType::Boolean, _) => wrong(self, "true or false"),
            (SettingType::Text, What::Leaf(v @ Value::String(_))) => Some(v.clone()),
            (SettingType::Text, _) => wrong(self, "text"),
            (SettingType::Choice(names), _) => match node.text() {
                Some(t) if names.iter().any(|n| n == t) => Some(Value::from(t)),
                _ => wrong(self, &format!("one of {}", quoted(names.iter().map(String::as_str)))),
            },
            (SettingType::Integer { minimum, maximum }, What::Leaf(Value::Number(n))) if !n.is_f64() => {
                let x = n.as_f64().unwrap_or_default();
                if minimum.is_some_and(|m| x < m) || maximum.is_some_and(|m| x > m) {
                    return wrong(self, &range("a whole number", [*minimum, *maximum], [None; 2]));
                }
                Some(Value::Number(n.clone()))
            }
            (SettingType::Integer { minimum, maximum }, _) => {
                wrong(self, &range("a whole number", [*minimum, *maximum], [None; 2]))
            }
            (SettingType::Number { minimum, maximum, above, below }, What::Leaf(Value::Number(n))) => {
                let x = n.as_f64().unwrap_or_default();
                let low = minimum.is_some_and(|m| x < m) || above.is_some_and(|m| x <= m);
                if low || maximum.is_some_and(|m| x > m) || below.is_some_and(|m| x >= m) {
                    return wrong(self, &range("a number", [*minimum, *maximum], [*above, *below]));
                }
                Some(Value::from(x))
            }
            (SettingType::Number { minimum, maximum, above, below }, _) => {
                wrong(self, &range("a number", [*minimum, *maximum], [*above, *below]))
            }
            (SettingType::Numbers(count), What::List(items)) => {
                let number = |n: &Node| match &n.what {
                    What::Leaf(v @ Value::Number(_)) => Some(v.clone()),
                    _ => None,
                };
                let all: Option<Vec<Value>> = items.iter().map(number).collect();
                match all.filter(|a| count.is_none_or(|c| c == a.len())) {
                    Some(a) => Some(Value::Array(a)),
                    None => wrong(self, &numbers(*count)),
                }
            }
            // One number stands for both ends of a range, and for both sides of a square.
            (SettingType::Numbers(Some(2)), What::Leaf(v @ Value::Number(_))) => Some(Value::Array(vec![v.clone(); 2])),
            (SettingType::Numbers(count), _) => wrong(self, &numbers(*count)),
            (SettingType::Strategy(kind), _) => self.strategy(*kind, node),
        }
    }
}

fn numbers(count: Option<usize>) -> String {
    count.map_or("a list of numbers".into(), |n| format!("a list of {n} numbers"))
}

/// A range in words: its ends, and those that are no part of it.
fn range(what: &str, [minimum, maximum]: [Option<f64>; 2], [above, below]: [Option<f64>; 2]) -> String {
    let low = above.map(|a| format!(" above {a}")).or(minimum.map(|m| format!(" from {m}")));
    let high = below.map(|b| format!(" below {b}")).or(maximum.map(|m| format!(" up to {m}")));
    let join = if above.is_some() && below.is_some() { " and" } else { "" };
    format!("{what}{}{join}{}", low.unwrap_or_default(), high.unwrap_or_default())
}

fn placed(mut node: Node, at: &At) -> Node {
    node.at = at.clone();
    match &mut node.what {
        What::Table(t) => t.iter_mut().for_each(|e| {
            e.at = at.clone();
            e.value = placed(e.value.clone(), at);
        }),
        What::List(l) => l.iter_mut().for_each(|n| *n = placed(n.clone(), at)),
        _ => {}
    }
    node
}

fn of_json(value: &Value, at: &At) -> Node {
    let what = match value {
        Value::Object(o) => What::Table(
            o.iter()
                .filter(|(_, v)| !v.is_null())
                .map(|(k, v)| super::node::Entry { key: k.clone(), at: at.clone(), value: of_json(v, at) })
                .collect(),
        ),
        Value::Array(a) => What::List(a.iter().map(|v| of_json(v, at)).collect()),
        v => What::Leaf(v.clone()),
    };
    Node { at: at.clone(), what }
}
