//! `cargo xtask book`: the pages that are generated from the registry, and the book itself.

use std::process::Command;

const PAGE: &str = "book/src/reference.md";

pub(crate) fn run(check: bool) -> Result<(), String> {
    crate::setup::compiler();
    let out = Command::new("cargo")
        .args(["run", "--quiet", "--release", "--", "list", "--markdown"])
        .output()
        .map_err(|e| format!("cargo: {e}"))?;
    if !out.status.success() {
        return Err(String::from_utf8_lossy(&out.stderr).into_owned());
    }
    if check {
        let held = std::fs::read(PAGE).map_err(|e| format!("{PAGE}: {e}"))?;
        return if held == out.stdout { Ok(()) } else { Err(format!("{PAGE} is stale: run cargo xtask book")) };
    }
    std::fs::write(PAGE, &out.stdout).map_err(|e| format!("{PAGE}: {e}"))?;
    if crate::setup::has("mdbook") {
        crate::run("mdbook", &["build", "book"])?;
    } else {
        println!("{PAGE} is renewed; mdbook is not installed, so the book is not built");
    }
    Ok(())
}
