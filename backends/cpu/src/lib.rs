//! The reference backend: exact ray casting on the processor.
//!
//! Needs no device. Every picture that another backend draws is held against this one, and bakes capture with it where there
//! is nothing faster. A pixel is the first surface along the ray through its centre: no rasterisation rules, no depth buffer,
//! no level of detail; then points, lines and the samples of layered depth images, which have no surface that a ray could meet, are drawn
//! where they are nearer. Its cost hardly depends on the number of triangles, so its times say nothing about a GPU's.
//!
//! [`CpuBackend`] carries out draw lists, in parallel over the picture; [`CpuCapture`] takes captures for bakes, which are parallel
//! over jobs, each on the thread that asks. Both cast the same rays against the same hierarchies and give the same bytes,
//! for any number of threads.
//!
//! Facing is a matter of the winding *in the local frame*, after placement: a placement that mirrors (negative determinant) turns
//! front faces into back faces, as it does in a rasteriser that is given transformed vertices. Normals of two-sided
//! surfaces are turned to the eye by their own direction (n . ray > 0), not by the winding.

mod backend;
mod block;
mod capture;
mod frame;
mod light;
mod paint;
mod splat;
mod tables;
mod texel;
mod trace;
mod warp;

pub use backend::{CpuBackend, CpuOptions};
pub use capture::CpuCapture;
pub use warp::SplatOrder;
