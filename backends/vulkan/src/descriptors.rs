//! Descriptor sets: layouts as the shared shaders bind, and pools that grow.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_shaders::Shader;
use farfield_shaders::layout::ATLAS_SLOTS;

use crate::gpu::Gpu;

/// Sets of a pool; scenes have tens of textures, frames tens of atlas combinations.
const SETS_A_POOL: u32 = 64;

/// What a binding holds; a set's bindings are numbered from 0 in order.
#[derive(Clone, Copy)]
pub(crate) enum Bound {
    /// A uniform of `bytes`, at an offset given when the set is bound.
    Uniform { buffer: vk::Buffer, bytes: u64 },
    /// All of a storage buffer.
    Storage(vk::Buffer),
    /// An image that is read, in layout SHADER_READ_ONLY.
    Image(vk::ImageView),
    /// A sampler.
    Sampler(vk::Sampler),
}

impl Bound {
    fn kind(self) -> vk::DescriptorType {
        match self {
            Self::Uniform { .. } => vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC,
            Self::Storage(_) => vk::DescriptorType::STORAGE_BUFFER,
            Self::Image(_) => vk::DescriptorType::SAMPLED_IMAGE,
            Self::Sampler(_) => vk::DescriptorType::SAMPLER,
        }
    }
}

/// The layouts of the descriptor sets.
pub(crate) struct SetLayouts {
    gpu: Arc<Gpu>,
    /// Surface shaders, group 0: view uniform, records.
    pub(crate) frame: vk::DescriptorSetLayout,
    /// Chunks, group 1: texture, sampler.
    pub(crate) texture: vk::DescriptorSetLayout,
    /// Projected meshes, group 1: projectors, sampler, atlases.
    pub(crate) projection: vk::DescriptorSetLayout,
    /// Points and lines, group 1: what their vertices are pulled out of.
    pub(crate) pulled: vk::DescriptorSetLayout,
    /// The shading shader, group 0: its uniform.
    pub(crate) shade: vk::DescriptorSetLayout,
    /// The shading shader, group 1: four planes.
    pub(crate) planes: vk::DescriptorSetLayout,
    /// The shaders of layered depth images, group 0: their uniform, samples, splats.
    pub(crate) samples: vk::DescriptorSetLayout,
}

impl SetLayouts {
    /// Makes them.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        use vk::DescriptorType as Kind;
        let null = vk::DescriptorSetLayout::null();
        let mut made = Self {
            gpu: gpu.clone(),
            frame: null,
            texture: null,
            projection: null,
            pulled: null,
            shade: null,
            planes: null,
            samples: null,
        };
        let (both, fragment) =
            (vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT, vk::ShaderStageFlags::FRAGMENT);
        let image = Kind::SAMPLED_IMAGE;
        let mut projection = vec![Kind::STORAGE_BUFFER, Kind::SAMPLER];
        projection.extend([image; 2 * ATLAS_SLOTS]);
        made.frame = layout(gpu, &[Kind::UNIFORM_BUFFER_DYNAMIC, Kind::STORAGE_BUFFER], both)?;
        made.texture = layout(gpu, &[image, Kind::SAMPLER], fragment)?;
        made.projection = layout(gpu, &projection, fragment)?;
        made.pulled = layout(gpu, &[Kind::STORAGE_BUFFER], vk::ShaderStageFlags::VERTEX)?;
        made.shade = layout(gpu, &[Kind::UNIFORM_BUFFER_DYNAMIC], fragment)?;
        made.planes = layout(gpu, &[image; 4], fragment)?;
        let samples = [Kind::UNIFORM_BUFFER_DYNAMIC, Kind::STORAGE_BUFFER, Kind::STORAGE_BUFFER];
        made.samples = layout(gpu, &samples, fragment | vk::ShaderStageFlags::COMPUTE)?;
        Ok(made)
    }

    /// The layouts of a shader's groups, in order.
    pub(crate) fn of(&self, shader: Shader) -> Vec<vk::DescriptorSetLayout> {
        match shader {
            Shader::Chunk => vec![self.frame, self.texture],
            Shader::Mesh => vec![self.frame],
            Shader::Projected => vec![self.frame, self.projection],
            Shader::Points | Shader::Lines => vec![self.frame, self.pulled],
            Shader::Shade => vec![self.shade, self.planes],
            Shader::Warp | Shader::WarpHalves | Shader::Resolve => vec![self.samples],
        }
    }
}

impl Drop for SetLayouts {
    fn drop(&mut self) {
        for layout in [self.frame, self.texture, self.projection, self.pulled, self.shade, self.planes, self.samples] {
            // SAFETY: made from this device, destroyed once (null is allowed).
            unsafe { self.gpu.raw.destroy_descriptor_set_layout(layout, None) };
        }
    }
}

fn layout(
    gpu: &Gpu,
    kinds: &[vk::DescriptorType],
    stages: vk::ShaderStageFlags,
) -> Result<vk::DescriptorSetLayout, Fault> {
    let bindings: Vec<_> = (0..)
        .zip(kinds)
        .map(|(i, &kind)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(i)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(stages)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: the device is alive; the bindings live until the call returns.
    unsafe { gpu.raw.create_descriptor_set_layout(&info, None) }.map_err(|e| gpu.fault("descriptor layout", e))
}

/// Pools that grow; all sets are given back at once.
pub(crate) struct Sets {
    gpu: Arc<Gpu>,
    pools: Vec<vk::DescriptorPool>,
    used: u32,
}

impl Sets {
    /// No pools yet.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        Self { gpu: gpu.clone(), pools: vec![], used: 0 }
    }

    /// Gives all sets back; no submission may be using them.
    pub(crate) fn reset(&mut self) -> Result<(), Fault> {
        for &pool in &self.pools {
            // SAFETY: every submission was waited for.
            unsafe { self.gpu.raw.reset_descriptor_pool(pool, vk::DescriptorPoolResetFlags::empty()) }
                .map_err(|e| self.gpu.fault("descriptor pool", e))?;
        }
        self.used = 0;
        Ok(())
    }

    /// A set of `layout` that holds `bound`; what it holds must stay while the set is used.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no memory for it.
    pub(crate) fn make(
        &mut self,
        layout: vk::DescriptorSetLayout,
        bound: &[Bound],
    ) -> Result<vk::DescriptorSet, Fault> {
        let pool = (self.used / SETS_A_POOL) as usize;
        if pool == self.pools.len() {
            self.pools.push(new_pool(&self.gpu)?);
        }
        let layouts = [layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pools[pool]).set_layouts(&layouts);
        // SAFETY: the pool has room: it was made for this many sets of any of the layouts.
        let sets =
            unsafe { self.gpu.raw.allocate_descriptor_sets(&info) }.map_err(|e| self.gpu.fault("descriptor set", e))?;
        self.used += 1;

        let (mut buffers, mut images) = (vec![], vec![]);
        for b in bound {
            let (mut buffer, mut image) = (vk::DescriptorBufferInfo::default(), vk::DescriptorImageInfo::default());
            match *b {
                Bound::Uniform { buffer: raw, bytes } => buffer = buffer.buffer(raw).range(bytes),
                Bound::Storage(raw) => buffer = buffer.buffer(raw).range(vk::WHOLE_SIZE),
                Bound::Image(view) => {
                    image = image.image_view(view).image_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
                }
                Bound::Sampler(sampler) => image = image.sampler(sampler),
            }
            buffers.push([buffer]);
            images.push([image]);
        }
        let writes: Vec<_> = bound
            .iter()
            .enumerate()
            .map(|(i, b)| {
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(sets[0])
                    .dst_binding(i as u32)
                    .descriptor_type(b.kind())
                    .descriptor_count(1);
                match b {
                    Bound::Uniform { .. } | Bound::Storage(_) => write.buffer_info(&buffers[i]),
                    Bound::Image(_) | Bound::Sampler(_) => write.image_info(&images[i]),
                }
            })
            .collect();
        // SAFETY: the set is new and in no use; the infos live until the call returns; kinds agree with the layout,
        // which callers pass together.
        unsafe { self.gpu.raw.update_descriptor_sets(&writes, &[]) };
        Ok(sets[0])
    }
}

impl Drop for Sets {
    fn drop(&mut self) {
        for &pool in &self.pools {
            // SAFETY: no submission is under way; destroyed once.
            unsafe { self.gpu.raw.destroy_descriptor_pool(pool, None) };
        }
    }
}

fn new_pool(gpu: &Gpu) -> Result<vk::DescriptorPool, Fault> {
    let size = |kind, each: u32| vk::DescriptorPoolSize { ty: kind, descriptor_count: each * SETS_A_POOL };
    let sizes = [
        size(vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC, 1),
        size(vk::DescriptorType::STORAGE_BUFFER, 2),
        size(vk::DescriptorType::SAMPLER, 1),
        size(vk::DescriptorType::SAMPLED_IMAGE, (2 * ATLAS_SLOTS as u32).max(4)),
    ];
    let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS_A_POOL).pool_sizes(&sizes);
    // SAFETY: the device is alive; the sizes live until the call returns.
    unsafe { gpu.raw.create_descriptor_pool(&info, None) }.map_err(|e| gpu.fault("descriptor pool", e))
}
