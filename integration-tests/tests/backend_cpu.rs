//! The reference backend against the conformance suite, on one thread and on several.

use farfield_cpu::{CpuBackend, CpuOptions};
use farfield_integration_tests::conformance::suite;

#[test]
fn the_reference_backend_conforms() {
    for threads in [None, Some(1), Some(3)] {
        suite(&|scene| {
            Box::new(CpuBackend::new(scene, CpuOptions { threads, ..CpuOptions::default() }).expect("a backend"))
        });
    }
}
