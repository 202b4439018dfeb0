//! The `farfield` command: a thin layer over `farfield-experiments`.
//!
//! Exit codes: 0 done; 1 the work failed; 2 the input is wrong, and nothing was written. Results go to standard output,
//! everything else to standard error.

mod args;
mod commands;
#[cfg(test)]
mod quoted;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser;

/// Set by Ctrl-C: work stops at the next safe place.
static CANCEL: AtomicBool = AtomicBool::new(false);

fn main() -> ExitCode {
    let args = args::Args::parse();
    // A second Ctrl-C does not wait.
    let handler = ctrlc::set_handler(|| {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
    });
    if let Err(e) = handler {
        eprintln!("Ctrl-C will stop at once: {e}");
    }
    match commands::run(args, &CANCEL) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let code = failure.exit_code();
            eprintln!("{:?}", miette::Report::new(failure));
            ExitCode::from(code)
        }
    }
}
