//! The Vulkan backend, through ash: the draw lists of farfield-core on a Vulkan 1.3 device (or 1.1 with dynamic rendering and
//! synchronization2), without a layer in between.
//!
//! One would choose it to measure what a driver does with as little in between as can be, to count what wgpu does not
//! count, and to run under validation. What decides bytes (shaders, packing, order of draws) is shared with the wgpu backend,
//! so that both give the same pictures on the same device.
//!
//! The arrows inside: `backend` on top; `frame`, `warp`, `blocks`, `readback` carry out; `draw`, `compute`, `record`, `staging`, `submit`,
//! `queries`, `descriptors`, `pipelines`, `textures`, `targets` wrap one Vulkan concept each; `memory`, `gpu`, `choose`,
//! `instance` are the device. Everything made from the device holds it, so it is destroyed last; every submission is waited
//! for, so what one used may be destroyed once the call returns.
//!
//! Limits: one queue, one frame at a time; no windows.

mod backend;
mod blocks;
mod choose;
mod compute;
mod descriptors;
mod draw;
mod frame;
mod gpu;
mod instance;
mod memory;
mod pipelines;
mod queries;
mod readback;
mod record;
mod staging;
mod submit;
mod targets;
mod textures;
mod warp;

pub use backend::{Options, VulkanBackend, available};
pub use choose::Without;
pub use instance::Journal;
