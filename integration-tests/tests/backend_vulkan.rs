//! The Vulkan backend against the conformance suite, under validation and synchronisation validation: every message of either
//! is a failure, from the first call to the last object destroyed.
//!
//! Without a driver this is a visible skip; with `FARFIELD_EXPECT_DEVICE=1` a skip is a failure.

use std::cell::RefCell;

use farfield_integration_tests::conformance::suite;
use farfield_vulkan::{Journal, Options, VulkanBackend, available};

#[test]
fn the_vulkan_backend_conforms_without_a_word_from_validation() {
    match available() {
        Ok(device) => eprintln!("on {device}"),
        Err(why) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{why}"),
        Err(why) => {
            eprintln!("SKIPPED: the_vulkan_backend_conforms_without_a_word_from_validation: {why}");
            return;
        }
    }
    let journals: RefCell<Vec<Journal>> = RefCell::default();
    suite(&|scene| {
        let backend = VulkanBackend::new(scene, Options { validation: true, device: None }).expect("a backend");
        journals.borrow_mut().push(backend.journal());
        Box::new(backend)
    });
    let journals = journals.into_inner();
    assert!(!journals.is_empty(), "the suite made no backend");
    let said: Vec<String> = journals.iter().flat_map(Journal::messages).collect();
    assert!(said.is_empty(), "validation says:\n{}", said.join("\n"));
}
