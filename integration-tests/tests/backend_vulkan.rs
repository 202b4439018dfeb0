//! The Vulkan backend against the conformance suite, under validation and synchronisation validation: every message of either
//! is a failure, from the first call to the last object destroyed.
//!
//! Without a driver, or on one that rasterises too coarsely for the suite (SwiftShader), this is a visible skip; with `FARFIELD_EXPECT_DEVICE=1` a skip is a failure.

use std::cell::RefCell;

use farfield_core::backend::Backend;
use farfield_core::scene::SceneBuilder;
use farfield_integration_tests::conformance::suite;
use farfield_vulkan::{Journal, Options, VulkanBackend, Without};

/// What keeps the suite from being run: no device, or one too coarse for it.
fn unfit() -> Result<(), String> {
    let empty = SceneBuilder::default().build().expect("an empty scene");
    let backend = VulkanBackend::new(&empty, Options::default()).map_err(|why| why.to_string())?;
    let info = backend.info();
    eprintln!("on {}; degraded: {:?}", info.device, info.degraded);
    // The suite holds pixels against exact geometry, at steep slopes too.
    match info.degraded.iter().find(|d| d.contains("sub-pixel precision")) {
        Some(coarse) => Err(format!("{}: {coarse}", info.device)),
        None => Ok(()),
    }
}

/// Runs the suite under validation, without some features.
fn conforms(test: &str, without: Without) {
    if let Err(why) = unfit() {
        assert!(std::env::var_os("FARFIELD_EXPECT_DEVICE").is_none_or(|v| v != "1"), "{why}");
        eprintln!("SKIPPED: {test}: {why}");
        return;
    }
    let journals: RefCell<Vec<Journal>> = RefCell::default();
    suite(&|scene| {
        let options = Options { validation: true, without, ..Options::default() };
        let backend = VulkanBackend::new(scene, options).expect("a backend");
        journals.borrow_mut().push(backend.journal());
        Box::new(backend)
    });
    let journals = journals.into_inner();
    assert!(!journals.is_empty(), "the suite made no backend");
    let said: Vec<String> = journals.iter().flat_map(Journal::messages).collect();
    assert!(said.is_empty(), "validation says:\n{}", said.join("\n"));
}

#[test]
fn the_vulkan_backend_conforms_without_a_word_from_validation() {
    conforms("the_vulkan_backend_conforms_without_a_word_from_validation", Without::default());
}

#[test]
fn the_fallbacks_conform_too() {
    let without = Without { indirect: true, timestamps: true, statistics: true, atomics_64: true };
    conforms("the_fallbacks_conform_too", without);
}
