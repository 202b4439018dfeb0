//! The reference backend: exact ray casting.
