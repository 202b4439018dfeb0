//! Conformance, parity, golden images, the matrix.

pub mod conformance;
