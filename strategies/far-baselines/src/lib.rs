//! Baseline far fields: what others are measured against.
//!
//! [`AllGeometry`] draws the scene as it is; [`StaticLod`] a discrete level of detail of each object.

mod geometry;
mod static_lod;

pub use geometry::AllGeometry;
pub use static_lod::StaticLod;
