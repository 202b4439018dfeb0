//! What a newcomer runs. `cargo xtask demo` renders the example park and says where its report is; `cargo xtask test` runs
//! every test; both install what software rendering needs where that is missing and may be installed. `cargo xtask lint`
//! checks formatting, lints and licences, `cargo xtask book` renews the generated pages of the book and builds it where
//! mdbook is installed.
//!
//! No dependencies: it has to be there at once.

mod book;
mod setup;
mod test;

use std::process::{Command, ExitCode};

const USAGE: &str = "usage: cargo xtask demo | test [CARGO TEST ARGUMENTS] | lint | book [--check]";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    if let Err(e) = std::env::set_current_dir(root) {
        eprintln!("xtask: {root}: {e}");
        return ExitCode::FAILURE;
    }
    let done = match args.first().map(String::as_str) {
        Some("demo") => demo(),
        Some("test") => test::run(&args[1..]),
        Some("lint") => lint(),
        Some("book") => book::run(args.iter().any(|a| a == "--check")),
        _ => Err(USAGE.into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("xtask: {e}");
            ExitCode::FAILURE
        }
    }
}

/// Runs a command with this process's terminal; an exit code other than 0 is an error.
fn run(program: &str, args: &[&str]) -> Result<(), String> {
    println!("$ {program} {}", args.join(" "));
    match setup::without_display(Command::new(program).args(args)).status() {
        Ok(s) if s.success() => Ok(()),
        Ok(s) => Err(format!("{program} {} ended with {s}", args.join(" "))),
        Err(e) => Err(format!("{program}: {e}")),
    }
}

fn demo() -> Result<(), String> {
    setup::compiler();
    setup::driver();
    run("cargo", &["run", "--release", "--", "run", "examples/park.toml", "--out", "out/park"])?;
    println!("The report is out/park/report.html");
    Ok(())
}

fn lint() -> Result<(), String> {
    setup::compiler();
    run("cargo", &["fmt", "--all", "--check"])?;
    run("cargo", &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    if setup::has("cargo-deny") {
        run("cargo", &["deny", "check", "bans", "licenses", "sources"])?;
    } else {
        println!("cargo-deny is not installed: licences are checked by the tests alone");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::USAGE;
    use std::path::Path;

    #[test]
    fn every_task_that_is_quoted_exists() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
        let pages = [root.to_owned(), root.join("book/src")].into_iter().flat_map(|d| d.read_dir().unwrap());
        let mut quoted = 0;
        for page in pages.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "md")) {
            let text = std::fs::read_to_string(&page).unwrap();
            for rest in text.split("cargo xtask ").skip(1) {
                let task = rest.split(|c: char| !c.is_ascii_lowercase()).next().unwrap();
                assert!(USAGE.split([' ', '|']).any(|w| w == task), "{}: cargo xtask {task}", page.display());
                quoted += 1;
            }
        }
        assert!(quoted > 4, "{quoted}");
    }
}
