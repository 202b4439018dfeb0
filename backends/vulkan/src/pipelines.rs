//! Pipelines: the shared shaders as SPIR-V, dynamic rendering, one pipeline a shader and way of culling. Of the two shaders that
//! warp layered depth images only the one that the device is to use is made.
//!
//! State as wgpu-hal sets it: front faces counter-clockwise under a viewport of negative height, reversed depth that passes
//! where greater, no blending.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_shaders::layout::{AttributeFormat, vertex_layout};
use farfield_shaders::records::Cull;
use farfield_shaders::spirv::{Stage, compile};
use farfield_shaders::warp::Atomics;
use farfield_shaders::{COMPUTE_ENTRY, FRAGMENT_ENTRY, Shader, VERTEX_ENTRY};

use crate::descriptors::SetLayouts;
use crate::gpu::Gpu;
use crate::targets::{DEPTH, PICTURE, PLANES};

/// All pipelines.
pub(crate) struct Pipelines {
    gpu: Arc<Gpu>,
    layouts: BTreeMap<Shader, vk::PipelineLayout>,
    made: BTreeMap<(Shader, Cull), vk::Pipeline>,
    /// The layouts of the sets that the pipelines bind.
    pub(crate) sets: SetLayouts,
}

impl Pipelines {
    /// Compiles the shaders and makes every pipeline.
    ///
    /// # Errors
    /// [`Fault::Data`] where a shader is wrong, [`Fault::Device`].
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        let sets = SetLayouts::new(gpu)?;
        let mut all = Self { gpu: gpu.clone(), layouts: BTreeMap::new(), made: BTreeMap::new(), sets };
        let other = match gpu.caps.atomics {
            Atomics::Whole => Atomics::Halves,
            Atomics::Halves => Atomics::Whole,
        };
        for shader in Shader::ALL.into_iter().filter(|&s| s != other.shader()) {
            let set_layouts = all.sets.of(shader);
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts);
            // SAFETY: the set layouts are of this device and live.
            let layout =
                unsafe { gpu.raw.create_pipeline_layout(&info, None) }.map_err(|e| gpu.fault("pipeline layout", e))?;
            all.layouts.insert(shader, layout);
            if shader.stages() == [Stage::Compute] {
                let pipeline = compute(gpu, shader, layout)?;
                all.made.insert((shader, Cull::None), pipeline);
                continue;
            }
            let vertex = Module::new(gpu, shader, Stage::Vertex)?;
            let fragment = Module::new(gpu, shader, Stage::Fragment)?;
            let ways: &[Cull] = if shader.vertices().is_some() { &[Cull::None, Cull::Back] } else { &[Cull::None] };
            for &cull in ways {
                let pipeline = pipeline(gpu, shader, cull, layout, &vertex, &fragment)?;
                all.made.insert((shader, cull), pipeline);
            }
        }
        Ok(all)
    }

    /// The pipeline of a shader and a way of culling; null where there is none.
    pub(crate) fn get(&self, shader: Shader, cull: Cull) -> vk::Pipeline {
        self.made.get(&(shader, cull)).copied().unwrap_or_default()
    }

    /// The layout of a shader's pipelines.
    pub(crate) fn layout(&self, shader: Shader) -> vk::PipelineLayout {
        self.layouts.get(&shader).copied().unwrap_or_default()
    }
}

impl Drop for Pipelines {
    fn drop(&mut self) {
        // SAFETY: no submission is under way; each is destroyed once.
        unsafe {
            self.made.values().for_each(|&p| self.gpu.raw.destroy_pipeline(p, None));
            self.layouts.values().for_each(|&l| self.gpu.raw.destroy_pipeline_layout(l, None));
        }
    }
}

/// A shader module, needed only until its pipelines are made.
struct Module<'a> {
    gpu: &'a Gpu,
    raw: vk::ShaderModule,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, shader: Shader, stage: Stage) -> Result<Self, Fault> {
        let words = compile(shader, stage, gpu.caps.spirv, gpu.caps.robustness.promised())?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the words are SPIR-V that naga validated, of a version that the device speaks.
        let raw = unsafe { gpu.raw.create_shader_module(&info, None) }
            .map_err(|e| gpu.fault(&format!("the shader for {}", shader.label()), e))?;
        Ok(Self { gpu, raw })
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: made from this device, destroyed once; pipelines do not need their modules.
        unsafe { self.gpu.raw.destroy_shader_module(self.raw, None) };
    }
}

fn compute(gpu: &Gpu, shader: Shader, layout: vk::PipelineLayout) -> Result<vk::Pipeline, Fault> {
    let module = Module::new(gpu, shader, Stage::Compute)?;
    let name = std::ffi::CString::new(COMPUTE_ENTRY).map_err(|e| gpu.fault("entry point", e))?;
    let stage = vk::PipelineShaderStageCreateInfo::default()
        .stage(vk::ShaderStageFlags::COMPUTE)
        .module(module.raw)
        .name(&name);
    let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout);
    // SAFETY: all that `info` points to lives until the call returns.
    let made = unsafe { gpu.raw.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
    one(gpu, shader, made)
}

/// The pipeline of a call that makes one.
fn one(
    gpu: &Gpu,
    shader: Shader,
    made: Result<Vec<vk::Pipeline>, (Vec<vk::Pipeline>, vk::Result)>,
) -> Result<vk::Pipeline, Fault> {
    made.map(|p| p[0]).map_err(|(partial, e)| {
        // SAFETY: a pipeline of a failed call is null, which is allowed, or unused.
        partial.into_iter().for_each(|p| unsafe { gpu.raw.destroy_pipeline(p, None) });
        gpu.fault(&format!("the pipeline for {}", shader.label()), e)
    })
}

fn pipeline(
    gpu: &Gpu,
    shader: Shader,
    cull: Cull,
    layout: vk::PipelineLayout,
    vertex: &Module<'_>,
    fragment: &Module<'_>,
) -> Result<vk::Pipeline, Fault> {
    let name = |s: &str| std::ffi::CString::new(s).map_err(|e| gpu.fault("entry point", e));
    let names = [name(VERTEX_ENTRY)?, name(FRAGMENT_ENTRY)?];
    let stage = |stage, module: &Module<'_>, i: usize| {
        vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module.raw).name(&names[i])
    };
    let stages = [stage(vk::ShaderStageFlags::VERTEX, vertex, 0), stage(vk::ShaderStageFlags::FRAGMENT, fragment, 1)];

    let (stride, attributes) = vertex_layout(shader);
    let bindings = [vk::VertexInputBindingDescription { binding: 0, stride, input_rate: vk::VertexInputRate::VERTEX }];
    let attributes: Vec<_> = attributes
        .iter()
        .map(|a| vk::VertexInputAttributeDescription {
            location: a.location,
            binding: 0,
            format: match a.format {
                AttributeFormat::Float32x2 => vk::Format::R32G32_SFLOAT,
                AttributeFormat::Float32x3 => vk::Format::R32G32B32_SFLOAT,
                AttributeFormat::Uint32 => vk::Format::R32_UINT,
                AttributeFormat::Unorm8x4 => vk::Format::R8G8B8A8_UNORM,
            },
            offset: a.offset,
        })
        .collect();
    let input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_binding_descriptions(if attributes.is_empty() { &[] } else { &bindings })
        .vertex_attribute_descriptions(&attributes);
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
    let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .cull_mode(match cull {
            Cull::None => vk::CullModeFlags::NONE,
            Cull::Back => vk::CullModeFlags::BACK,
        })
        .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
        .line_width(1.0);
    let samples = vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
    let surface = shader != Shader::Shade;
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(surface)
        .depth_write_enable(surface)
        .depth_compare_op(vk::CompareOp::GREATER);
    let formats: &[vk::Format] = if surface { &PLANES } else { &[PICTURE] };
    let all = vk::PipelineColorBlendAttachmentState::default().color_write_mask(vk::ColorComponentFlags::RGBA);
    let blends = vec![all; formats.len()];
    let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends);
    let dynamic = vk::PipelineDynamicStateCreateInfo::default()
        .dynamic_states(&[vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR]);
    let mut rendering = vk::PipelineRenderingCreateInfo::default()
        .color_attachment_formats(formats)
        .depth_attachment_format(if surface { DEPTH } else { vk::Format::UNDEFINED });
    let info = vk::GraphicsPipelineCreateInfo::default()
        .stages(&stages)
        .vertex_input_state(&input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout)
        .push_next(&mut rendering);
    // SAFETY: all that `info` points to lives until the call returns; the device has dynamic rendering, so no render pass is
    // named.
    let made = unsafe { gpu.raw.create_graphics_pipelines(vk::PipelineCache::null(), &[info], None) };
    one(gpu, shader, made)
}
