//! A TOML document as a tree that remembers where everything stands: in the experiment file or in a `--set` argument.

use std::ops::Range;

use serde_json::Value;

/// A place in one of the texts that an experiment is read from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct At {
    /// Which text: 0 is the file, then the `--set` arguments.
    pub(super) source: usize,
    /// The bytes.
    pub(super) span: Range<usize>,
}

/// A value and its place.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Where it stands.
    pub(super) at: At,
    /// What it is.
    pub(super) what: What,
}

/// Kinds of values.
#[derive(Clone, Debug)]
pub(super) enum What {
    /// A table, an inline table or a dotted one.
    Table(Vec<Entry>),
    /// An array, or an array of tables.
    List(Vec<Node>),
    /// Text, a number or a truth value.
    Leaf(Value),
    /// A date or a time, which no setting takes.
    Date,
}

/// A key with its value.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// The key.
    pub(super) key: String,
    /// Where the key stands.
    pub(super) at: At,
    /// Its value.
    pub(super) value: Node,
}

impl Node {
    /// Reads a text.
    ///
    /// # Errors
    /// The parser's message and its place.
    pub(super) fn parse(source: usize, text: &str) -> Result<Self, (String, At)> {
        let document = toml_edit::Document::parse(text).map_err(|e| {
            let span = e.span().unwrap_or_default();
            (e.message().trim().replace('\n', ", "), At { source, span })
        })?;
        let mut root = of_item(source, document.as_item(), &At { source, span: 0..0 });
        root.at = At { source, span: 0..0 };
        Ok(root)
    }

    /// Its entries, if it is a table.
    pub(super) fn entries(&self) -> Option<&[Entry]> {
        match &self.what {
            What::Table(t) => Some(t),
            _ => None,
        }
    }

    /// The value of a key, if it is a table and has it.
    pub(super) fn get(&self, key: &str) -> Option<&Node> {
        self.entries()?.iter().find(|e| e.key == key).map(|e| &e.value)
    }

    /// Its text, if it is text.
    pub(super) fn text(&self) -> Option<&str> {
        match &self.what {
            What::Leaf(Value::String(s)) => Some(s),
            _ => None,
        }
    }

    /// Puts a value at a path of keys, making tables on the way. A value in the way that is no table is replaced.
    pub(super) fn set(&mut self, path: &[String], key_at: &At, value: Node) {
        let Some((first, rest)) = path.split_first() else {
            *self = value;
            return;
        };
        if self.entries().is_none() {
            *self = Node { at: key_at.clone(), what: What::Table(vec![]) };
        }
        let What::Table(entries) = &mut self.what else { return };
        let i = entries.iter().position(|e| e.key == *first).unwrap_or_else(|| {
            let value = Node { at: key_at.clone(), what: What::Table(vec![]) };
            entries.push(Entry { key: first.clone(), at: key_at.clone(), value });
            entries.len() - 1
        });
        if rest.is_empty() {
            entries[i].at = key_at.clone();
        }
        entries[i].value.set(rest, key_at, value);
    }

    /// In words, for messages.
    pub(super) fn describe(&self) -> String {
        match &self.what {
            What::Table(_) => "a table".into(),
            What::List(_) => "a list".into(),
            What::Date => "a date".into(),
            What::Leaf(Value::String(s)) => format!("the text \"{s}\""),
            What::Leaf(v) => v.to_string(),
        }
    }
}

fn of_item(source: usize, item: &toml_edit::Item, parent: &At) -> Node {
    let at = item.span().map_or_else(|| parent.clone(), |span| At { source, span });
    let what = match item {
        toml_edit::Item::None => What::Table(vec![]),
        toml_edit::Item::Value(v) => return of_value(source, v, parent),
        toml_edit::Item::Table(t) => {
            let keys = t.iter().filter_map(|(k, v)| Some((t.key(k)?, v)));
            What::Table(keys.map(|(k, v)| entry(source, k, &at, |at| of_item(source, v, at))).collect())
        }
        toml_edit::Item::ArrayOfTables(a) => {
            let one = |t: &toml_edit::Table| of_item(source, &toml_edit::Item::Table(t.clone()), &at);
            What::List(a.iter().map(one).collect())
        }
    };
    Node { at, what }
}

fn of_value(source: usize, value: &toml_edit::Value, parent: &At) -> Node {
    use toml_edit::Value as V;
    let at = value.span().map_or_else(|| parent.clone(), |span| At { source, span });
    let what = match value {
        V::String(s) => What::Leaf(Value::from(s.value().as_str())),
        V::Integer(i) => What::Leaf(Value::from(*i.value())),
        V::Float(f) if f.value().is_finite() => What::Leaf(Value::from(*f.value())),
        // JSON has no such number; the text makes the walk say so at its place.
        V::Float(f) => What::Leaf(Value::from(f.value().to_string())),
        V::Boolean(b) => What::Leaf(Value::from(*b.value())),
        V::Datetime(_) => What::Date,
        V::Array(a) => What::List(a.iter().map(|v| of_value(source, v, &at)).collect()),
        V::InlineTable(t) => {
            let keys = t.iter().filter_map(|(k, v)| Some((t.get_key_value(k)?.0, v)));
            What::Table(keys.map(|(k, v)| entry(source, k, &at, |at| of_value(source, v, at))).collect())
        }
    };
    Node { at, what }
}

fn entry(source: usize, key: &toml_edit::Key, parent: &At, value: impl Fn(&At) -> Node) -> Entry {
    let at = key.span().map_or_else(|| parent.clone(), |span| At { source, span });
    Entry { key: key.get().to_owned(), value: value(&at), at }
}
