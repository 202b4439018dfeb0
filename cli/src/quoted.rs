//! Every `farfield` command that the README, the book and the examples quote is one that the command line takes, and the
//! experiment files that they name are there.

use std::path::{Path, PathBuf};

use clap::Parser;
use pulldown_cmark::{Event, Options, Parser as Markdown};

use crate::args::{Args, Command};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let all = std::fs::read_dir(root().join(folder)).unwrap().map(|e| e.unwrap().path());
    let mut out: Vec<PathBuf> = all.filter(|p| p.extension().is_some_and(|e| e == ending)).collect();
    out.sort();
    out
}

/// The arguments of a quoted command; `None` where the text is something else. What stands for something is given a value: `N` a
/// number, `X,Y,Z` a place, `KIND` a scene's; options in brackets are taken; `...` is left out.
fn arguments(quoted: &str) -> Option<Vec<String>> {
    let command = quoted.split(" #").next().unwrap_or(quoted).trim();
    let rest = ["farfield ", "cargo run --release -- "].iter().find_map(|start| command.strip_prefix(start));
    // An option alone is meant for a command that takes a file.
    let alone = command.starts_with("--set").then(|| format!("run FILE {command}"));
    let mut optional = false;
    let plain = |w: String| {
        optional |= w.starts_with("[-");
        let last = optional && w.ends_with(']');
        let bare = if optional { w.trim_start_matches('[').trim_end_matches(']') } else { &w };
        optional &= !last;
        match bare.trim_end_matches('\u{2026}') {
            "N" => "1".to_owned(),
            "KIND" => "park".to_owned(),
            "X,Y,Z" => "1,2,3".to_owned(),
            other => other.to_owned(),
        }
    };
    let words = shlex::split(&rest.map(str::to_owned).or(alone)?)?.into_iter().map(plain).filter(|w| !w.is_empty());
    Some(std::iter::once("farfield".to_owned()).chain(words).collect())
}

/// The commands that a page quotes, inline and in code blocks.
fn quoted(text: &str) -> Vec<Vec<String>> {
    let (mut out, mut block) = (vec![], false);
    for e in Markdown::new_ext(text, Options::ENABLE_TABLES) {
        match e {
            Event::Start(pulldown_cmark::Tag::CodeBlock(_)) => block = true,
            Event::End(pulldown_cmark::TagEnd::CodeBlock) => block = false,
            Event::Code(t) => out.extend(arguments(&t.replace('\n', " "))),
            Event::Text(t) if block => out.extend(t.lines().filter_map(arguments)),
            _ => {}
        }
    }
    out
}

/// What the command line takes, and whose file, where it names one, is there.
fn taken(words: &[String]) -> Result<(), String> {
    let args = Args::try_parse_from(words).map_err(|e| format!("{words:?}: {e}"))?;
    let input = match args.command {
        Command::Check { input }
        | Command::Plan { input, .. }
        | Command::Build { input, .. }
        | Command::Run { input, .. }
        | Command::Render { input, .. }
        | Command::Sample { input, .. } => input,
        _ => return Ok(()),
    };
    let there = input.file.extension().is_none() || root().join(&input.file).is_file();
    if there { Ok(()) } else { Err(format!("{words:?}: no such file")) }
}

#[test]
fn every_command_that_is_quoted_is_taken() {
    let mut all = vec![];
    for page in files("", "md").into_iter().chain(files("book/src", "md")) {
        all.extend(quoted(&std::fs::read_to_string(page).unwrap()));
    }
    assert!(all.len() >= 12, "{all:?}");
    for example in files("examples", "toml") {
        let text = std::fs::read_to_string(&example).unwrap();
        let comments: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix('#')).map(str::trim).collect();
        let here: Vec<Vec<String>> = comments.iter().filter_map(|c| arguments(c)).collect();
        all.extend(here.into_iter().chain(quoted(&comments.join("\n"))));
    }
    let wrong: Vec<String> = all.iter().filter_map(|words| taken(words).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn commands_are_found_and_wrong_ones_are_not_taken() {
    let text = "The `farfield` command; `farfield plan FILE [--json]`, `--set a.b=[1,2]`.\n\n\
                | `farfield compare DIR\u{2026}` |\n|---|\n\n\
                ```sh\ncargo run --release -- run examples/park.toml   # a comment\nfarfield render FILE --frame N\n```\n\
                `farfield run examples/no.toml` `farfield chek FILE` `farfield run FILE --sett a=1`\n";
    let found = quoted(text);
    assert_eq!(found.len(), 8, "{found:?}");
    assert_eq!(found[3], ["farfield", "run", "examples/park.toml"]);
    let taken: Vec<bool> = found.iter().map(|words| taken(words).is_ok()).collect();
    assert_eq!(taken, [true, true, true, true, false, false, false, false], "{found:?}");
}
