//! The book and the README, held to the code: every link leads somewhere, every page is in the summary and among the doc-tests,
//! and every experiment that they show is one that `farfield check` takes. What they say on command lines is held to the command
//! itself (`cli/src/quoted.rs`).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use farfield_experiments::config;
use farfield_experiments::list::entries;
use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_owned()
}

fn files(folder: &Path, ending: &str) -> BTreeSet<PathBuf> {
    let all = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    all.filter(|p| p.extension().is_some_and(|e| e == ending)).collect()
}

/// The pages of the book and those at the root.
fn pages() -> BTreeSet<PathBuf> {
    files(&root().join("book/src"), "md").into_iter().chain(files(&root(), "md")).collect()
}

fn read(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// Where links and images of a page lead, those to other sites left out.
fn links(text: &str) -> Vec<String> {
    let to = |e| match e {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => Some(dest_url.to_string()),
        _ => None,
    };
    let all = Parser::new_ext(text, Options::ENABLE_TABLES).filter_map(to);
    all.filter(|l| !l.contains("://") && !l.starts_with("mailto:")).collect()
}

/// How a heading is named in links, as mdbook does it: letters and digits in lower case, spaces as hyphens.
fn slug(heading: &str) -> String {
    let known = |c: &char| c.is_alphanumeric() || matches!(c, '_' | '-' | ' ');
    heading.chars().filter(known).map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

fn headings(text: &str) -> BTreeSet<String> {
    let (mut out, mut now) = (BTreeSet::new(), None::<String>);
    for e in Parser::new_ext(text, Options::ENABLE_TABLES) {
        match e {
            Event::Start(Tag::Heading { .. }) => now = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => out.extend(now.take().map(|h| slug(&h))),
            Event::Text(t) | Event::Code(t) => now.iter_mut().for_each(|h| h.push_str(&t)),
            _ => {}
        }
    }
    out
}

/// The links of a page that lead nowhere.
fn broken(page: &Path, text: &str) -> Vec<String> {
    let nowhere = |link: &String| {
        let (path, heading) = link.split_once('#').map_or((link.as_str(), None), |(p, h)| (p, Some(h)));
        let file = if path.is_empty() { page.to_owned() } else { page.parent().unwrap().join(path) };
        !file.exists() || heading.is_some_and(|h| !headings(&read(&file)).contains(h))
    };
    links(text).into_iter().filter(nowhere).collect()
}

#[test]
fn every_link_and_image_leads_somewhere() {
    let mut found = 0;
    for page in pages() {
        let text = read(&page);
        let broken = broken(&page, &text);
        assert!(broken.is_empty(), "{}: these lead nowhere: {broken:?}", page.display());
        found += links(&text).len();
    }
    assert!(found > 10, "{found} links");
}

#[test]
fn links_that_lead_nowhere_are_found() {
    let page = root().join("book/src/measuring.md");
    let text = "[a](scenes.md) [b](scenes.md#the-park) [c](https://example.org) [d](#time) ![e](images/no.png) [f](no.md) \
                [g](scenes.md#no)\n\n| a |\n|---|\n| [h](../no) |\n\n## Time\n\n```text\n[i](code.md)\n```\n";
    assert_eq!(broken(&page, text), ["images/no.png", "no.md", "scenes.md#no", "../no"]);
}

#[test]
fn every_page_is_in_the_summary_and_among_the_doc_tests() {
    let folder = root().join("book/src");
    let summary: BTreeSet<PathBuf> = links(&read(&folder.join("SUMMARY.md"))).iter().map(|l| folder.join(l)).collect();
    let mut there = files(&folder, "md");
    there.remove(&folder.join("SUMMARY.md"));
    assert_eq!(summary, there);
    let tested = read(&root().join("integration-tests/src/book.rs"));
    for page in there {
        let line = format!("include_str!(\"../../{}\")", page.strip_prefix(root()).unwrap().display());
        assert!(tested.contains(&line), "integration-tests/src/book.rs lacks {line}");
    }
}

/// The code blocks in a language, `{{#include}}` carried out.
fn blocks(page: &Path, language: &str) -> Vec<String> {
    let (mut out, mut within) = (vec![], false);
    for e in Parser::new_ext(&read(page), Options::ENABLE_TABLES) {
        match e {
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(l))) if &*l == language => {
                within = true;
                out.push(String::new());
            }
            Event::End(TagEnd::CodeBlock) => within = false,
            Event::Text(t) if within => out.last_mut().unwrap().push_str(&t),
            _ => {}
        }
    }
    let included = |line: &str| match line.trim().strip_prefix("{{#include ").and_then(|l| l.strip_suffix("}}")) {
        Some(file) => read(&page.parent().unwrap().join(file)),
        None => format!("{line}\n"),
    };
    out.iter().map(|b| b.lines().map(included).collect()).collect()
}

/// A part of an experiment, made whole by what it does not speak of.
fn whole(part: &str) -> String {
    let tables: toml::Table = part.parse().unwrap_or_else(|e| panic!("{e}: {part}"));
    let mut out = part.to_owned();
    if !tables.contains_key("scene") {
        out += "\n[scene]\nsource = \"park\"\n";
    }
    if !tables.contains_key("pipeline") {
        out += "\n[[pipeline]]\nname = \"any\"\nfar_field = { type = \"geometry\" }\n";
    }
    out
}

#[test]
fn every_experiment_that_is_shown_is_taken() {
    let mut shown = 0;
    for page in pages() {
        for (i, block) in blocks(&page, "toml").iter().enumerate() {
            let (text, folder) = (whole(block), tempfile::tempdir().unwrap());
            // Files that the text names need only be there.
            let scene = text.parse::<toml::Table>().unwrap()["scene"].clone();
            if let Some(path) = scene.get("path").and_then(|p| p.as_str()) {
                std::fs::write(folder.path().join(path), "").unwrap();
            }
            let name = format!("{}, block {}", page.display(), i + 1);
            if let Err(mistakes) = config::parse(&name, &text, &[], folder.path(), &entries()) {
                panic!("{mistakes:?}");
            }
            shown += 1;
        }
    }
    assert!(shown >= 3, "{shown} experiments");
}
