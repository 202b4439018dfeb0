//! `cargo xtask test`: every test, with every skip counted and printed.
//!
//! A test that cannot run here prints `SKIPPED: name: reason`. In CI (the variable `CI` is set, and not to false) a skip is a
//! failure, but for one: tests on third-party models may be skipped where `FARFIELD_MODELS` is not set, since the models do not
//! belong to the project.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

pub(crate) fn run(more: &[String]) -> Result<(), String> {
    crate::setup::compiler();
    crate::setup::driver();
    crate::setup::validation();
    let ci = std::env::var("CI").is_ok_and(|v| !["", "0", "false"].contains(&v.as_str()));
    let models = std::env::var_os("FARFIELD_MODELS").is_some();
    let mut cargo = Command::new("cargo");
    cargo.args(["test", "--workspace", "--no-fail-fast"]).args(more);
    if !more.iter().any(|a| a == "--") {
        cargo.arg("--");
    }
    crate::setup::without_display(&mut cargo).arg("--show-output").stdout(Stdio::piped());
    if ci {
        cargo.env("FARFIELD_EXPECT_DEVICE", "1");
        // In CI a commit passes or fails for what it changes; at home property tests look elsewhere each time.
        if std::env::var_os("PROPTEST_RNG_SEED").is_none() {
            cargo.env("PROPTEST_RNG_SEED", "20031");
        }
        if models {
            cargo.env("FARFIELD_EXPECT_MODELS", "1");
        }
    }
    let mut child = cargo.spawn().map_err(|e| format!("cargo: {e}"))?;
    let mut skipped: Vec<String> = vec![];
    if let Some(out) = child.stdout.take() {
        for line in BufReader::new(out).lines() {
            let line = line.map_err(|e| format!("reading the tests' output: {e}"))?;
            skipped.extend(skip(&line));
            println!("{line}");
        }
    }
    let status = child.wait().map_err(|e| format!("cargo: {e}"))?;
    skipped.sort();
    skipped.dedup();
    println!("\n{} tests had to be skipped", skipped.len());
    skipped.iter().for_each(|s| println!("  skipped: {s}"));
    if !status.success() {
        return Err(format!("tests failed ({status})"));
    }
    match skipped.iter().find(|s| !allowed(s, models)) {
        Some(s) if ci => Err(format!("a skip is a failure in CI: {s}")),
        _ => Ok(()),
    }
}

/// What was skipped, where a line says so.
fn skip(line: &str) -> Option<String> {
    line.split_once("SKIPPED:").map(|(_, what)| what.trim().to_owned())
}

/// Whether a skip is no failure in CI; `models`: whether `FARFIELD_MODELS` is set.
fn allowed(skip: &str, models: bool) -> bool {
    !models && skip.contains("FARFIELD_MODELS")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skips_are_found_and_only_those_for_want_of_models_are_allowed() {
        assert_eq!(skip("test a ... ok"), None);
        let models = skip("SKIPPED: bounds: FARFIELD_MODELS names no folder").unwrap();
        let device = skip("  stderr: SKIPPED: parity: no Vulkan driver ").unwrap();
        assert_eq!(device, "parity: no Vulkan driver");
        assert!(allowed(&models, false) && !allowed(&models, true) && !allowed(&device, false));
    }
}
