//! Render targets: the four planes and the depth buffer of a surface, and pictures.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;

use crate::gpu::Gpu;
use crate::memory::{Image, ImageShape};

/// Formats of the planes of a surface target, in the order of the shaders' locations: albedo, normal, depth, object.
pub(crate) const PLANES: [vk::Format; 4] =
    [vk::Format::R8G8B8A8_SRGB, vk::Format::R32_UINT, vk::Format::R32_SFLOAT, vk::Format::R32_UINT];
/// Format of the depth buffer.
pub(crate) const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
/// Format of a picture.
pub(crate) const PICTURE: vk::Format = vk::Format::R8G8B8A8_UNORM;

const READ: vk::ImageUsageFlags = vk::ImageUsageFlags::from_raw(
    vk::ImageUsageFlags::COLOR_ATTACHMENT.as_raw()
        | vk::ImageUsageFlags::SAMPLED.as_raw()
        | vk::ImageUsageFlags::TRANSFER_SRC.as_raw(),
);

/// A surface target.
pub(crate) struct Surface {
    pub(crate) size: [u32; 2],
    pub(crate) planes: [Image; 4],
    pub(crate) depth: Image,
}

impl Surface {
    /// Makes one, its content undefined.
    ///
    /// # Errors
    /// [`Fault::Refused`] where the device has no images as large, [`Fault::Device`].
    pub(crate) fn new(gpu: &Arc<Gpu>, size: [u32; 2]) -> Result<Self, Fault> {
        let image = |name: &str, format, usage| {
            Image::new(gpu, name, &ImageShape { format, size, layers: 1, array: false, usage })
        };
        let [albedo, normal, depth, object] = PLANES;
        Ok(Self {
            size,
            planes: [
                image("albedo", albedo, READ)?,
                image("normals", normal, READ)?,
                image("linear depth", depth, READ)?,
                image("objects", object, READ)?,
            ],
            depth: image("depth buffer", DEPTH, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?,
        })
    }
}

/// A shaded target.
pub(crate) struct Shaded {
    pub(crate) size: [u32; 2],
    pub(crate) image: Image,
}

impl Shaded {
    /// Makes one, its content undefined.
    ///
    /// # Errors
    /// As [`Surface::new`].
    pub(crate) fn new(gpu: &Arc<Gpu>, size: [u32; 2]) -> Result<Self, Fault> {
        let shape = ImageShape { format: PICTURE, size, layers: 1, array: false, usage: READ };
        Ok(Self { size, image: Image::new(gpu, "picture", &shape)? })
    }
}
