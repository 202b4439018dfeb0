//! Baseline far fields: what others are measured against.
//!
//! [`AllGeometry`] draws the scene as it is; [`StaticLod`] a discrete level of detail of each object.

mod geometry;
mod static_lod;

pub use geometry::AllGeometry;
pub use static_lod::StaticLod;

/// Bytes of a chunk in memory: position, normal, texture coordinate, colour and name a vertex, three indices a triangle.
fn chunk_bytes(vertices: u32, triangles: u32) -> u64 {
    u64::from(vertices) * 40 + u64::from(triangles) * 12
}
