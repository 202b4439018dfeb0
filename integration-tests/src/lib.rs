//! Conformance, parity, golden images, the matrix.

pub mod areas;
#[cfg(doctest)]
mod book;
pub mod conformance;
pub mod lab;
pub mod ldi;
pub mod pair;
pub mod stones;
pub mod turned;
pub mod unseen;
