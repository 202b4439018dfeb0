//! The invariants of ARCHITECTURE.md, each held by a test.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_owned()
}

/// Every workspace crate with its folder and the workspace crates that it builds on (tests and benchmarks left out).
fn crates() -> BTreeMap<String, (String, BTreeSet<String>)> {
    let out = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo metadata runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let all: serde_json::Value = serde_json::from_slice(&out.stdout).expect("cargo metadata is JSON");
    let text = |v: &serde_json::Value| v.as_str().expect("a string").to_owned();
    let packages = all["packages"].as_array().expect("packages");
    let names: BTreeSet<String> = packages.iter().map(|p| text(&p["name"])).collect();
    let of = |p: &serde_json::Value| {
        let folder = text(&p["manifest_path"]);
        let folder = folder.strip_prefix(root().to_str().expect("a path in UTF-8")).expect("inside").to_owned();
        let normal = p["dependencies"].as_array().expect("dependencies").iter().filter(|d| d["kind"].is_null());
        let used = normal.map(|d| text(&d["name"])).filter(|n| names.contains(n)).collect();
        (text(&p["name"]), (folder, used))
    };
    packages.iter().map(of).collect()
}

fn layer(folder: &str) -> &'static str {
    let starts = |p: &str| folder.starts_with(p);
    match () {
        () if starts("/core/") => "core",
        () if starts("/backends/shaders/") => "shaders",
        () if starts("/backends/") => "backend",
        () if starts("/strategies/all/") => "all",
        () if starts("/strategies/") => "strategy",
        () if starts("/experiments/") => "experiments",
        () if starts("/cli/") => "cli",
        () if starts("/integration-tests/") => "tests",
        () if starts("/examples/") => "examples",
        () if starts("/xtask/") => "xtask",
        () => panic!("{folder} has no place in the layout"),
    }
}

#[test]
fn arrows_go_one_way() {
    let allowed: BTreeMap<&str, &[&str]> = BTreeMap::from([
        ("core", &[][..]),
        ("shaders", &["core"]),
        ("backend", &["core", "shaders"]),
        ("strategy", &["core"]),
        ("all", &["core", "strategy"]),
        ("experiments", &["core", "backend", "all"]),
        ("cli", &["core", "experiments"]),
        ("tests", &["core", "backend", "shaders", "strategy", "all", "experiments"]),
        ("examples", &["core", "backend", "strategy", "all", "experiments"]),
        ("xtask", &[]),
    ]);
    let crates = crates();
    assert!(crates.len() > 12, "cargo metadata lists the workspace");
    for (name, (folder, used)) in &crates {
        for other in used {
            let (from, to) = (layer(folder), layer(&crates[other].0));
            assert!(allowed[from].contains(&to), "{name} ({from}) builds on {other} ({to})");
        }
    }
}

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for p in entries {
        if p.is_dir() {
            sources(&p, out);
        } else if p.extension().is_some_and(|e| e == "rs") {
            out.push(p);
        }
    }
}

/// Lines of a crate's sources, tests and comments left out, that contain one of `words`.
fn uses(folder: &str, words: &[&str]) -> Vec<String> {
    let mut files = vec![];
    sources(&root().join(folder), &mut files);
    let mut found = vec![];
    for f in files {
        let text = std::fs::read_to_string(&f).expect("a source file");
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for line in code.lines().map(str::trim).filter(|l| !l.starts_with("//")) {
            if words.iter().any(|w| line.contains(w)) {
                found.push(format!("{}: {line}", f.display()));
            }
        }
    }
    found
}

#[test]
fn the_core_has_no_files_no_clock_and_no_threads() {
    let words = ["std::fs", "std::net", "Instant", "SystemTime", "std::thread", "rayon", "std::env", "println!"];
    assert_eq!(uses("core/src", &words), Vec::<String>::new());
}

#[test]
fn strategies_have_no_files_no_clock_and_no_threads() {
    let words = ["std::fs", "std::net", "Instant", "SystemTime", "std::thread", "rayon", "std::env", "println!"];
    let mut folders: Vec<_> = std::fs::read_dir(root().join("strategies")).expect("strategies").collect();
    folders.sort_by_key(|f| f.as_ref().expect("an entry").path());
    for f in folders {
        let name = f.expect("an entry").file_name().into_string().expect("UTF-8");
        assert_eq!(uses(&format!("strategies/{name}/src"), &words), Vec::<String>::new());
    }
}

#[test]
fn unsafe_code_lives_in_the_vulkan_backend_only() {
    let words = ["unsafe {", "unsafe fn", "unsafe impl"];
    for folder in [
        "core/src",
        "strategies",
        "backends/cpu/src",
        "backends/shaders/src",
        "backends/wgpu/src",
        "cli/src",
        "experiments/src",
        "xtask/src",
    ] {
        assert_eq!(uses(folder, &words), Vec::<String>::new());
    }
    assert!(!uses("backends/vulkan/src", &words).is_empty(), "the search itself works");
}
