//! Conformance, parity, golden images, the matrix.

pub mod conformance;
pub mod lab;
pub mod ldi;
pub mod stones;
