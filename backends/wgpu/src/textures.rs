//! Scene textures and atlases on the device, and the bind groups of group 1.

use std::collections::HashMap;

use farfield_core::Fault;
use farfield_core::id::{PayloadRef, TextureId};
use farfield_core::payload::AtlasPart;
use farfield_core::scene::Scene;
use farfield_shaders::layout::ATLAS_SLOTS;
use farfield_shaders::plan::Bind;
use farfield_shaders::pool::Stream;
use wgpu::{BindGroupEntry, BindingResource, TextureFormat};

use crate::device::Gpu;
use crate::pipelines::Pipelines;

pub(crate) struct Textures {
    /// One a scene texture, then the white one.
    scene: Vec<wgpu::BindGroup>,
    atlases: HashMap<PayloadRef, [wgpu::TextureView; 2]>,
    /// Stands in for slots that no projector names.
    empty: wgpu::TextureView,
    clamp: wgpu::Sampler,
    /// Of projected batches, points and lines; emptied whenever an atlas changes.
    binds: HashMap<Bind, wgpu::BindGroup>,
}

fn texels(gpu: &Gpu, label: &str, size: [u32; 3], format: TextureFormat, data: &[[u8; 4]]) -> wgpu::Texture {
    let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: size[2] };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(data),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: Some(size[1]) },
        extent,
    );
    texture
}

fn layered(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

fn linear(gpu: &Gpu, address: wgpu::AddressMode) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("linear"),
        address_mode_u: address,
        address_mode_v: address,
        address_mode_w: wgpu::AddressMode::ClampToEdge,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    })
}

impl Textures {
    pub(crate) fn new(gpu: &Gpu, pipelines: &Pipelines, scene: &Scene) -> Result<Self, Fault> {
        farfield_shaders::records::check_textures(scene, gpu.limits.max_texture_dimension_2d)?;
        let repeat = linear(gpu, wgpu::AddressMode::Repeat);
        let bind = |texture: wgpu::Texture| {
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("texture"),
                layout: &pipelines.texture,
                entries: &[
                    BindGroupEntry { binding: 0, resource: BindingResource::TextureView(&view) },
                    BindGroupEntry { binding: 1, resource: BindingResource::Sampler(&repeat) },
                ],
            })
        };
        let srgb = TextureFormat::Rgba8UnormSrgb;
        let mut binds = vec![];
        for t in &scene.textures {
            binds.push(bind(texels(gpu, &t.name, [t.size[0], t.size[1], 1], srgb, &t.rgba)));
            gpu.check()?;
        }
        let white = texels(gpu, "white", [1, 1, 1], srgb, &[[255; 4]]);
        let empty = layered(&white);
        binds.push(bind(white));
        gpu.queue.submit([]);
        gpu.wait()?;
        let clamp = linear(gpu, wgpu::AddressMode::ClampToEdge);
        Ok(Self { scene: binds, atlases: HashMap::new(), empty, clamp, binds: HashMap::new() })
    }

    pub(crate) fn add_atlas(&mut self, gpu: &Gpu, id: PayloadRef, a: &AtlasPart) -> Result<(), Fault> {
        let (most_px, most_layers) = (gpu.limits.max_texture_dimension_2d, gpu.limits.max_texture_array_layers);
        if a.size.iter().any(|&s| s > most_px) || a.layers > most_layers {
            return Err(gpu.fault(format!(
                "{id:?}: an atlas of {} layers of {} x {} texels; this device takes {most_layers} of {most_px} x {most_px}",
                a.layers, a.size[0], a.size[1]
            )));
        }
        let size = [a.size[0], a.size[1], a.layers];
        let albedo = layered(&texels(gpu, "atlas albedo", size, TextureFormat::Rgba8UnormSrgb, &a.albedo));
        let normal = layered(&texels(gpu, "atlas normals", size, TextureFormat::Rgba8Unorm, &a.normal));
        gpu.check()?;
        self.binds.clear();
        self.atlases.insert(id, [albedo, normal]);
        Ok(())
    }

    pub(crate) fn remove_atlas(&mut self, id: PayloadRef) {
        if self.atlases.remove(&id).is_some() {
            self.binds.clear();
        }
    }

    /// Makes the bind group of a projected batch, of points or of lines where it is not there; `pages` are those of all streams.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        pages: &[Vec<wgpu::Buffer>; Stream::ALL.len()],
        bind: Bind,
    ) -> Result<(), Fault> {
        if self.binds.contains_key(&bind) {
            return Ok(());
        }
        if let Bind::Pulled { stream, page } = bind {
            let page = pages[stream as usize][page as usize].as_entire_binding();
            let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("pulled"),
                layout: &pipelines.pulled,
                entries: &[BindGroupEntry { binding: 0, resource: page }],
            });
            self.binds.insert(bind, group);
        }
        let Bind::Atlases { asset, atlases, projector_page } = bind else { return Ok(()) };
        let spare;
        let projectors = match projector_page {
            Some(p) => &pages[Stream::Projectors as usize][p as usize],
            None => {
                let size = Stream::Projectors.stride();
                spare = gpu.buffer("no projectors", size, wgpu::BufferUsages::STORAGE)?;
                &spare
            }
        };
        let mut entries = vec![
            BindGroupEntry { binding: 0, resource: projectors.as_entire_binding() },
            BindGroupEntry { binding: 1, resource: BindingResource::Sampler(&self.clamp) },
        ];
        for (i, slot) in atlases.iter().enumerate().take(ATLAS_SLOTS) {
            let views = slot.and_then(|id| self.atlases.get(&PayloadRef { asset, id }));
            for plane in 0..2 {
                let view = views.map_or(&self.empty, |v| &v[plane]);
                let binding = (2 + 2 * i + plane) as u32;
                entries.push(BindGroupEntry { binding, resource: BindingResource::TextureView(view) });
            }
        }
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("atlases"),
            layout: &pipelines.atlases,
            entries: &entries,
        });
        self.binds.insert(bind, group);
        Ok(())
    }

    /// The group 1 of a batch; `None` where it has none.
    pub(crate) fn bind(&self, bind: &Bind) -> Option<&wgpu::BindGroup> {
        match bind {
            Bind::Nothing => None,
            Bind::Texture(t) => self.scene.get(t.map_or(self.scene.len() - 1, TextureId::index)),
            Bind::Atlases { .. } | Bind::Pulled { .. } => self.binds.get(bind),
        }
    }
}
