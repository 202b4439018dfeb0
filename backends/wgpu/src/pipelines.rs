//! Pipelines and bind group layouts, as the shared shaders want them.

use farfield_shaders::layout::{
    ATLAS_SLOTS, AttributeFormat, GpuLine, GpuProjector, GpuSample, Record, ShadeUniform, ViewUniform, WarpUniform,
    vertex_layout,
};
use farfield_shaders::records::Cull;
use farfield_shaders::warp::{Atomics, SPLAT_BYTES};
use farfield_shaders::{COMPUTE_ENTRY, FRAGMENT_ENTRY, Shader, VERTEX_ENTRY};
use wgpu::{BindingType, BufferBindingType, ShaderStages, TextureFormat, TextureSampleType, TextureViewDimension};

/// The colour planes of a surface target: albedo, normal, linear depth, object.
pub(crate) const PLANES: [TextureFormat; 4] =
    [TextureFormat::Rgba8UnormSrgb, TextureFormat::R32Uint, TextureFormat::R32Float, TextureFormat::R32Uint];

/// The reversed depth buffer.
pub(crate) const DEPTH: TextureFormat = TextureFormat::Depth32Float;

/// A picture: the shader encodes sRGB itself.
pub(crate) const PICTURE: TextureFormat = TextureFormat::Rgba8Unorm;

pub(crate) struct Pipelines {
    /// Group 0 of surface passes.
    pub(crate) view: wgpu::BindGroupLayout,
    /// Group 1 of chunks.
    pub(crate) texture: wgpu::BindGroupLayout,
    /// Group 1 of projected parts.
    pub(crate) atlases: wgpu::BindGroupLayout,
    /// Group 1 of points and lines.
    pub(crate) pulled: wgpu::BindGroupLayout,
    /// Group 0 of shading passes.
    pub(crate) shade: wgpu::BindGroupLayout,
    /// Group 1 of shading passes.
    pub(crate) planes: wgpu::BindGroupLayout,
    /// Group 0 of the warp.
    pub(crate) warped: wgpu::BindGroupLayout,
    /// Group 0 of what resolves it.
    pub(crate) resolved: wgpu::BindGroupLayout,
    surfaces: Vec<((Shader, Cull), wgpu::RenderPipeline)>,
    /// The shading pass.
    pub(crate) shading: wgpu::RenderPipeline,
    /// Throws the samples of layered depth images.
    pub(crate) warp: wgpu::ComputePipeline,
    /// Composes them.
    pub(crate) resolve: wgpu::RenderPipeline,
}

fn entry(binding: u32, visibility: ShaderStages, ty: BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn uniform(size: usize) -> BindingType {
    let min_binding_size = std::num::NonZeroU64::new(size as u64);
    BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: true, min_binding_size }
}

fn storage(size: usize) -> BindingType {
    buffer(size, true)
}

fn buffer(size: usize, read_only: bool) -> BindingType {
    let min_binding_size = std::num::NonZeroU64::new(size as u64);
    BindingType::Buffer { ty: BufferBindingType::Storage { read_only }, has_dynamic_offset: false, min_binding_size }
}

fn sampled(sample_type: TextureSampleType, view_dimension: TextureViewDimension) -> BindingType {
    BindingType::Texture { sample_type, view_dimension, multisampled: false }
}

impl Pipelines {
    pub(crate) fn new(device: &wgpu::Device, atomics: Atomics) -> Self {
        let both = ShaderStages::VERTEX | ShaderStages::FRAGMENT;
        let fragment = ShaderStages::FRAGMENT;
        let group = |label: &str, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
        };
        let filtered = TextureSampleType::Float { filterable: true };
        let filtering = BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let view = group(
            "view",
            &[entry(0, both, uniform(size_of::<ViewUniform>())), entry(1, both, storage(size_of::<Record>()))],
        );
        let texture = group(
            "texture",
            &[entry(0, fragment, sampled(filtered, TextureViewDimension::D2)), entry(1, fragment, filtering)],
        );
        let projectors = storage(size_of::<GpuProjector>());
        let mut entries = vec![entry(0, fragment, projectors), entry(1, fragment, filtering)];
        let layers = sampled(filtered, TextureViewDimension::D2Array);
        entries.extend((0..2 * ATLAS_SLOTS as u32).map(|i| entry(2 + i, fragment, layers)));
        let atlases = group("atlases", &entries);
        // The larger element; pages hold thousands of either.
        let pulled = group("pulled", &[entry(0, ShaderStages::VERTEX, storage(size_of::<GpuLine>()))]);
        let shade = group("shade", &[entry(0, fragment, uniform(size_of::<ShadeUniform>()))]);
        let unfiltered = TextureSampleType::Float { filterable: false };
        let kinds = [filtered, TextureSampleType::Uint, unfiltered, TextureSampleType::Uint];
        let planes = group(
            "planes",
            &[0, 1, 2, 3].map(|i| entry(i, fragment, sampled(kinds[i as usize], TextureViewDimension::D2))),
        );

        let samples = |label, stage, read_only| {
            let entries = [
                entry(0, stage, uniform(size_of::<WarpUniform>())),
                entry(1, stage, storage(size_of::<GpuSample>())),
                entry(2, stage, buffer(SPLAT_BYTES as usize, read_only)),
            ];
            group(label, &entries)
        };
        let warped = samples("warped samples", ShaderStages::COMPUTE, false);
        let resolved = samples("resolved samples", fragment, true);

        let mut surfaces = vec![];
        for (shader, group_1) in
            [(Shader::Chunk, Some(&texture)), (Shader::Mesh, None), (Shader::Projected, Some(&atlases))]
        {
            let groups: Vec<_> = std::iter::once(Some(&view)).chain(group_1.map(Some)).collect();
            for cull in [Cull::None, Cull::Back] {
                surfaces.push(((shader, cull), pipeline(device, shader, cull, &groups, &PLANES)));
            }
        }
        for shader in [Shader::Points, Shader::Lines] {
            let made = pipeline(device, shader, Cull::None, &[Some(&view), Some(&pulled)], &PLANES);
            surfaces.push(((shader, Cull::None), made));
        }
        let shading = pipeline(device, Shader::Shade, Cull::None, &[Some(&shade), Some(&planes)], &[PICTURE]);
        let warp = compute(device, atomics.shader(), &warped);
        let resolve = pipeline(device, Shader::Resolve, Cull::None, &[Some(&resolved)], &PLANES);
        Self { view, texture, atlases, pulled, shade, planes, warped, resolved, surfaces, shading, warp, resolve }
    }

    /// The pipeline of a surface batch.
    pub(crate) fn surface(&self, shader: Shader, cull: Cull) -> Option<&wgpu::RenderPipeline> {
        self.surfaces.iter().find(|(k, _)| *k == (shader, cull)).map(|(_, p)| p)
    }
}

fn module(device: &wgpu::Device, shader: Shader) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(shader.label()),
        source: wgpu::ShaderSource::Wgsl(shader.wgsl().into()),
    })
}

fn layout(device: &wgpu::Device, shader: Shader, groups: &[Option<&wgpu::BindGroupLayout>]) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(shader.label()),
        bind_group_layouts: groups,
        immediate_size: 0,
    })
}

fn compute(device: &wgpu::Device, shader: Shader, group: &wgpu::BindGroupLayout) -> wgpu::ComputePipeline {
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(shader.label()),
        layout: Some(&layout(device, shader, &[Some(group)])),
        module: &module(device, shader),
        entry_point: Some(COMPUTE_ENTRY),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn pipeline(
    device: &wgpu::Device,
    shader: Shader,
    cull: Cull,
    groups: &[Option<&wgpu::BindGroupLayout>],
    targets: &[TextureFormat],
) -> wgpu::RenderPipeline {
    let label = Some(shader.label());
    let (module, layout) = (module(device, shader), layout(device, shader, groups));
    let (stride, attributes) = vertex_layout(shader);
    let attributes: Vec<wgpu::VertexAttribute> = attributes
        .iter()
        .map(|a| wgpu::VertexAttribute {
            shader_location: a.location,
            offset: u64::from(a.offset),
            format: match a.format {
                AttributeFormat::Float32x2 => wgpu::VertexFormat::Float32x2,
                AttributeFormat::Float32x3 => wgpu::VertexFormat::Float32x3,
                AttributeFormat::Uint32 => wgpu::VertexFormat::Uint32,
                AttributeFormat::Unorm8x4 => wgpu::VertexFormat::Unorm8x4,
            },
        })
        .collect();
    let buffer = wgpu::VertexBufferLayout {
        array_stride: u64::from(stride),
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &attributes,
    };
    let buffers = [Some(buffer)];
    let targets: Vec<_> = targets.iter().map(|&format| Some(format.into())).collect();
    let depth = wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(true),
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    };
    let surface = shader != Shader::Shade;
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(VERTEX_ENTRY),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: if shader.vertices().is_some() { &buffers } else { &[] },
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: (cull == Cull::Back).then_some(wgpu::Face::Back),
            ..Default::default()
        },
        depth_stencil: surface.then_some(depth),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(FRAGMENT_ENTRY),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
