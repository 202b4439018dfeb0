//! farfield's vocabulary, its traits, and the kernels that strategies share.
//!
//! A **cell** is a set of viewpoints with what is near and far from it ([`cell`]); **chunks** are the atoms of culling
//! ([`scene`]); **payloads** and **draw lists** are the closed vocabulary between strategies and backends ([`payload`],
//! [`draw`]); **claims** are bounds that the harness audits ([`claim`]); strategies and backends are the traits of
//! [`strategy`] and [`backend`].
//!
//! This crate does no I/O and owns no GPU, no clock and no thread pool: what a stage needs from outside comes in its
//! [`context::Context`].

pub mod aabb;
pub mod atlas;
pub mod backend;
pub mod bvh;
pub mod camera;
pub mod cell;
pub mod claim;
pub mod collapse;
pub mod color;
pub mod context;
pub mod covered;
pub mod draw;
pub mod extent;
pub mod fault;
pub mod id;
pub mod image;
pub mod layered;
pub mod mesh;
pub mod octahedral;
pub mod octree;
pub mod panorama;
pub mod path;
pub mod payload;
pub mod region;
pub mod registry;
pub mod scene;
pub mod strategy;

pub use aabb::Aabb;
pub use camera::Camera;
pub use fault::Fault;
