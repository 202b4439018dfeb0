//! Scene textures, atlases and samplers.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_core::payload::AtlasPart;
use farfield_core::scene::Scene;
use farfield_shaders::records::check_textures;

use crate::descriptors::{Bound, SetLayouts, Sets};
use crate::gpu::Gpu;
use crate::memory::{Image, ImageShape};
use crate::staging::Staging;
use crate::submit::Submitter;

/// A sampler, bilinear.
pub(crate) struct Sampler {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Sampler,
}

impl Sampler {
    /// Makes one that treats coordinates outside 0..1 by `address`.
    pub(crate) fn new(gpu: &Arc<Gpu>, address: vk::SamplerAddressMode) -> Result<Self, Fault> {
        // The limits of detail are those that wgpu gives its samplers; images have one level.
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(address)
            .address_mode_v(address)
            .address_mode_w(address)
            .max_lod(32.0);
        // SAFETY: the device is alive.
        let raw = unsafe { gpu.raw.create_sampler(&info, None) }.map_err(|e| gpu.fault("sampler", e))?;
        Ok(Self { gpu: gpu.clone(), raw })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        // SAFETY: no submission is under way; destroyed once.
        unsafe { self.gpu.raw.destroy_sampler(self.raw, None) };
    }
}

/// The textures of the scene, each with a descriptor set for chunks; the last one is white, for materials without one.
pub(crate) struct SceneTextures {
    sets: Vec<vk::DescriptorSet>,
    _pool: Sets,
    _images: Vec<Image>,
    _repeat: Sampler,
}

impl SceneTextures {
    /// Uploads them.
    ///
    /// # Errors
    /// [`Fault::Data`] naming a texture that is unsound or too large for the device, [`Fault::Device`].
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        layouts: &SetLayouts,
        staging: &mut Staging,
        by: &mut Submitter,
        scene: &Scene,
    ) -> Result<Self, Fault> {
        check_textures(scene, gpu.caps.limits.max_image_dimension2_d)?;
        let repeat = Sampler::new(gpu, vk::SamplerAddressMode::REPEAT)?;
        let (mut pool, mut sets, mut images) = (Sets::new(gpu), vec![], vec![]);
        let white = ("white", [1, 1], &[[255u8; 4]][..]);
        let all = scene.textures.iter().map(|t| (t.name.as_str(), t.size, &t.rgba[..])).chain([white]);
        for (name, size, texels) in all {
            let shape = texels_of(vk::Format::R8G8B8A8_SRGB, size, 1, false);
            let image = Image::new(gpu, name, &shape)?;
            staging.fill(by, &image, size, bytemuck::cast_slice(texels))?;
            sets.push(pool.make(layouts.texture, &[Bound::Image(image.view), Bound::Sampler(repeat.raw)])?);
            images.push(image);
        }
        Ok(Self { sets, _pool: pool, _images: images, _repeat: repeat })
    }

    /// The set of a texture, or of plain white.
    pub(crate) fn set(&self, texture: Option<usize>) -> vk::DescriptorSet {
        let white = self.sets.len() - 1;
        self.sets[texture.unwrap_or(white).min(white)]
    }
}

/// An atlas on the device.
pub(crate) struct Atlas {
    pub(crate) albedo: Image,
    pub(crate) normal: Image,
}

impl Atlas {
    /// Uploads one.
    ///
    /// # Errors
    /// [`Fault::Refused`] where it is too large for the device, [`Fault::Device`].
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        staging: &mut Staging,
        by: &mut Submitter,
        part: &AtlasPart,
    ) -> Result<Self, Fault> {
        let mut plane = |name, format, texels: &[[u8; 4]]| {
            let image = Image::new(gpu, name, &texels_of(format, part.size, part.layers, true))?;
            staging.fill(by, &image, part.size, bytemuck::cast_slice(texels))?;
            Ok::<_, Fault>(image)
        };
        Ok(Self {
            albedo: plane("atlas albedo", vk::Format::R8G8B8A8_SRGB, &part.albedo)?,
            normal: plane("atlas normals", vk::Format::R8G8B8A8_UNORM, &part.normal)?,
        })
    }

    /// One white texel and no direction: what unused slots are bound to.
    pub(crate) fn blank(gpu: &Arc<Gpu>, staging: &mut Staging, by: &mut Submitter) -> Result<Self, Fault> {
        let part = AtlasPart { size: [1, 1], layers: 1, albedo: vec![[255; 4]], normal: vec![[128; 4]] };
        Self::new(gpu, staging, by, &part)
    }
}

fn texels_of(format: vk::Format, size: [u32; 2], layers: u32, array: bool) -> ImageShape {
    let usage = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST;
    ImageShape { format, size, layers, array, usage }
}
