//! Conformance, parity, golden images, the matrix.
