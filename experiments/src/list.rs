//! What is registered: strategies and backends.

use farfield_core::registry::{Entry, Kind, Setting};

use crate::config::BackendName;

/// Every strategy and backend, by kind and name.
pub fn entries() -> Vec<Entry> {
    let mut all = farfield_strategies::registry();
    all.extend([
        backend(
            BackendName::Cpu,
            "exact ray casting on the processor; needs nothing, and is what pictures are held against",
            "obvhs (bounding volume hierarchies)",
        ),
        backend(BackendName::Vulkan, "Vulkan 1.3 through ash", "Vulkan 1.3 specification"),
        backend(BackendName::Wgpu, "WebGPU through wgpu, on Vulkan", "WebGPU specification"),
    ]);
    all.sort_by(|a, b| (a.kind, a.name).cmp(&(b.kind, b.name)));
    all
}

fn backend(name: BackendName, summary: &'static str, source: &'static str) -> Entry {
    Entry { kind: Kind::Backend, name: name.name(), summary, source, settings: vec![] }
}

/// As text.
pub fn text(entries: &[Entry]) -> String {
    let mut out = String::new();
    for e in entries {
        out += &format!("{} {}\n    {}\n    source: {}\n", e.kind.name(), e.name, e.summary, e.source);
        for s in &e.settings {
            let unit = if s.unit.is_empty() { String::new() } else { format!(" {}", s.unit) };
            let default = match &s.default {
                _ if s.required => "must be given".to_owned(),
                v if v.is_null() => "without".to_owned(),
                v => format!("default {v}{unit}"),
            };
            out += &format!("    {}: {} ({default})\n", s.name, s.doc);
        }
    }
    out
}

/// The book's reference page: the experiment file's tables, then every strategy and backend.
pub fn markdown(entries: &[Entry]) -> String {
    let mut out = String::from(
        "# Reference\n\nThis page is generated from the registry by `cargo xtask book`.\n\n## The experiment file\n\n\
         Beside these tables: `[[pipeline]]` with `name`, `backend`, `partition`, `far_field` and `scheduler`, one each; and \
         `[sweep]` with lists of values by path, such as `\"hybrid.far_field.edge_px\" = [3.0, 4.5]`.\n",
    );
    for (name, settings) in crate::config::tables() {
        out += &format!("\n### `[{name}]`\n\n{}", settings_table(&settings));
    }
    let mut kind = None;
    for e in entries {
        if kind != Some(e.kind) {
            kind = Some(e.kind);
            out += &format!("\n## {}\n", e.kind.name());
        }
        out += &format!(
            "\n### `{}`\n\n{}.\n\nSource: {}.\n",
            e.name,
            e.summary.trim_end_matches('.'),
            e.source.trim_end_matches('.')
        );
        if !e.settings.is_empty() {
            out += &format!("\n{}", settings_table(&e.settings));
        }
    }
    out
}

fn settings_table(settings: &[Setting]) -> String {
    let cell = |s: &str| s.replace('|', "\\|");
    let mut out = String::from("| setting | default | unit | what it is |\n|---|---|---|---|\n");
    for s in settings {
        let default = match &s.default {
            _ if s.required => "must be given".to_owned(),
            v if v.is_null() => String::new(),
            v => format!("`{}`", cell(&v.to_string())),
        };
        out += &format!("| `{}` | {default} | {} | {} |\n", s.name, cell(&s.unit), cell(&s.doc));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_listed_once_in_order_with_its_words() {
        let all = entries();
        assert!(all.windows(2).all(|w| (w[0].kind, w[0].name) < (w[1].kind, w[1].name)));
        assert!(["cpu", "vulkan", "wgpu"].iter().all(|b| all.iter().any(|e| e.kind == Kind::Backend && e.name == *b)));
        assert!(all.iter().all(|e| !e.summary.is_empty() && !e.source.is_empty()));
        assert!(all.iter().flat_map(|e| &e.settings).all(|s| !s.doc.is_empty()), "a setting without a word");
        let (text, page) = (text(&all), markdown(&all));
        for e in &all {
            assert!(text.contains(e.name) && page.contains(&format!("### `{}`", e.name)));
        }
        for s in crate::config::tables().values().flatten() {
            assert!(!s.doc.is_empty() && page.contains(&format!("| `{}` |", s.name)), "{}", s.name);
        }
    }
}
