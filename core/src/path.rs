//! Seeded camera paths.
