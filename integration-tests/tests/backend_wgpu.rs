//! The wgpu backend against the conformance suite, with every optional feature and with none, under validation.
//!
//! Without a driver this is a visible skip; with `FARFIELD_EXPECT_DEVICE=1` a skip is a failure.

use std::sync::{Mutex, PoisonError};

use farfield_integration_tests::conformance::suite;
use farfield_wgpu::{Options, WgpuBackend, Without, available};

/// Collects what wgpu and the validation layers log as warnings and errors.
struct Journal(Mutex<Vec<String>>);

static JOURNAL: Journal = Journal(Mutex::new(Vec::new()));

impl Journal {
    fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl log::Log for Journal {
    fn enabled(&self, about: &log::Metadata<'_>) -> bool {
        about.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let message = format!("{} {}: {}", record.level(), record.target(), record.args());
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(message);
        }
    }

    fn flush(&self) {}
}

/// Whether there is a device; says so where there is none.
fn device(test: &str) -> bool {
    match available() {
        Ok(device) => {
            eprintln!("on {device}");
            true
        }
        Err(why) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{why}"),
        Err(why) => {
            eprintln!("SKIPPED: {test}: {why}");
            false
        }
    }
}

#[test]
fn the_wgpu_backend_conforms_without_a_word_from_validation() {
    if !device("the_wgpu_backend_conforms_without_a_word_from_validation") {
        return;
    }
    log::set_logger(&JOURNAL).expect("no other logger");
    log::set_max_level(log::LevelFilter::Warn);
    let options = Options { validation: true, ..Options::default() };
    suite(&|scene| Box::new(WgpuBackend::new(scene, &options).expect("a backend")));
    let said = JOURNAL.messages();
    assert!(said.is_empty(), "validation says:\n{}", said.join("\n"));
}

#[test]
fn the_fallbacks_conform_too() {
    if !device("the_fallbacks_conform_too") {
        return;
    }
    let options =
        Options { without: Without { indirect: true, timestamps: true, statistics: true }, ..Options::default() };
    suite(&|scene| Box::new(WgpuBackend::new(scene, &options).expect("a backend")));
}
