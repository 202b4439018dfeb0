//! Scenes larger than memory: a file of chunks, read block by block while they are used.
//!
//! [`Writer`] writes a file streaming, chunk after chunk; it appears whole or not at all. [`ChunkFile`] is the way to its
//! triangles for everything that works on a scene, with a hard limit on the bytes held ([`Cache`]). [`identity`] tells whether
//! a file was made of the inputs at hand without reading them again.

mod cache;
mod file;
mod format;
pub mod identity;
#[cfg(test)]
mod tests;
mod writer;

pub use cache::{Cache, CacheError, Pin};
pub use file::{ChunkFile, ReadAt};
pub use format::{Block, Kept};
pub use writer::Writer;
