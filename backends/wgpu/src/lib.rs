//! The wgpu backend: draw lists on any Vulkan driver, software ones included.
//!
//! What decides bytes lives in `farfield-shaders`; this crate keeps pages of buffers, textures and targets, and carries out
//! plans: one multi-draw-indirect a batch where the device can start indirect draws at any instance, draws one by one
//! elsewhere. Features are asked for, never assumed; what is missing stands in [`DeviceInfo::degraded`].
//!
//! Chosen when pictures are wanted fast and everywhere; the cpu backend is the reference, the Vulkan backend shows the same
//! work without a layer between.
//!
//! Limits: a projected part draws from at most four atlases; the records of a frame (128 bytes a placed chunk) fit in one
//! storage binding, as do the samples of a layered depth image, the points and the lines of a part, and the splats of a pass (8 bytes a pixel); pages of buffers are not
//! given back before the backend is dropped.

mod device;
mod encode;
mod pipelines;
mod read;
mod targets;
mod textures;
mod warp;

use std::time::Instant;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData, Counted, DeviceInfo};
use farfield_core::context::Shot;
use farfield_core::draw::DrawList;
use farfield_core::id::{Block, TargetId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::payload::Part;
use farfield_core::scene::Scene;
use farfield_shaders::plan::{Limits, Work, Written, plan};
use farfield_shaders::pool::{PageSizes, Stream};
use farfield_shaders::records::SceneTable;
use farfield_shaders::residency::{Placement, Residency};

pub use device::{Options, Without, available};

use device::Gpu;
use encode::FrameBuffers;
use pipelines::Pipelines;
use targets::{Kept, Shaded, Surface};
use textures::Textures;
use warp::Splats;

/// Bytes on their way to the device before a submission is forced, so that staging memory stays bounded.
const UPLOAD_BATCH_BYTES: u64 = 64 << 20;

/// The wgpu backend.
pub struct WgpuBackend {
    gpu: Gpu,
    pipelines: Pipelines,
    table: SceneTable,
    textures: Textures,
    residency: Residency,
    /// Buffers by stream and page.
    pages: [Vec<wgpu::Buffer>; Stream::ALL.len()],
    frame: FrameBuffers,
    splats: Splats,
    surfaces: Kept<Surface>,
    pictures: Kept<Shaded>,
    /// Targets of captures, by size.
    scratch: Kept<Surface>,
    written: Written,
    on_the_way_bytes: u64,
}

impl WgpuBackend {
    /// A backend for a scene, with its textures and nothing else uploaded.
    ///
    /// # Errors
    /// [`Fault::Device`] where no adapter fits the options or the device fails, [`Fault::Data`] where a texture is unsound.
    pub fn new(scene: &Scene, options: &Options) -> Result<Self, Fault> {
        let gpu = Gpu::open(options)?;
        let pipelines = Pipelines::new(&gpu.device, gpu.atomics);
        gpu.check()?;
        let textures = Textures::new(&gpu, &pipelines, scene)?;
        let frame = FrameBuffers::new(&gpu)?;
        let splats = Splats::new(&gpu)?;
        let sizes = PageSizes::for_device(gpu.limits.max_buffer_size);
        let residency = Residency::new(sizes, gpu.limits.max_storage_buffer_binding_size);
        Ok(Self {
            table: SceneTable::new(scene),
            residency,
            pages: Default::default(),
            surfaces: Kept::default(),
            pictures: Kept::default(),
            scratch: Kept::default(),
            written: Written::default(),
            on_the_way_bytes: 0,
            gpu,
            pipelines,
            textures,
            frame,
            splats,
        })
    }

    /// Surface images of original geometry, many before each reading back. All chunks must be uploaded.
    ///
    /// # Errors
    /// As [`Backend::render`].
    pub fn capture(&mut self, shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        let mut out = Vec::with_capacity(shots.len());
        let mut rest = shots;
        while !rest.is_empty() {
            let (now, later) = rest.split_at(read::batch(rest));
            self.shoot(now, &mut out)?;
            rest = later;
        }
        Ok(out)
    }

    fn limits(&self) -> Limits {
        Limits {
            target_px: self.gpu.limits.max_texture_dimension_2d,
            storage_bytes: self.gpu.limits.max_storage_buffer_binding_size,
        }
    }

    fn carry_out(&mut self, block: Block, data: &BlockData<'_>, placement: &Placement) -> Result<(), Fault> {
        for (page, bytes) in &placement.pages {
            let kind = match page.stream {
                Stream::ChunkVertices | Stream::MeshVertices | Stream::ProjectedVertices => wgpu::BufferUsages::VERTEX,
                Stream::Indices => wgpu::BufferUsages::INDEX,
                Stream::Projectors | Stream::Samples | Stream::Points | Stream::Lines => wgpu::BufferUsages::STORAGE,
            };
            let buffer = self.gpu.buffer("page", *bytes, kind | wgpu::BufferUsages::COPY_DST)?;
            self.pages[page.stream as usize].push(buffer);
        }
        for (page, offset, bytes) in &placement.writes {
            self.gpu.queue.write_buffer(&self.pages[page.stream as usize][page.index as usize], *offset, bytes);
        }
        if let Block::Payload(id) = block {
            match data {
                BlockData::Payload(p) if placement.atlas => {
                    if let Some(Part::Atlas(a)) = p.parts.first() {
                        self.textures.add_atlas(&self.gpu, id, a)?;
                    }
                }
                _ => self.textures.remove_atlas(id),
            }
        }
        self.on_the_way_bytes += placement.bytes;
        if self.on_the_way_bytes > UPLOAD_BATCH_BYTES {
            self.on_the_way_bytes = 0;
            self.gpu.queue.submit([]);
            self.gpu.wait()?;
        }
        self.gpu.check()
    }
}

impl Backend for WgpuBackend {
    fn info(&self) -> &DeviceInfo {
        &self.gpu.info
    }

    fn upload(&mut self, block: Block, data: &BlockData<'_>) -> Result<u64, Fault> {
        let before = self.pages.each_ref().map(Vec::len);
        let placement = self.residency.place(block, data)?;
        if let Err(fault) = self.carry_out(block, data, &placement) {
            let made: usize = self.pages.iter().zip(before).map(|(now, before)| now.len() - before).sum();
            self.residency.undo(block, &placement, made);
            if let Block::Payload(id) = block {
                self.textures.remove_atlas(id);
            }
            return Err(fault);
        }
        Ok(placement.bytes)
    }

    fn settle(&mut self) -> Result<(), Fault> {
        self.on_the_way_bytes = 0;
        self.gpu.queue.submit([]);
        self.gpu.wait()?;
        self.gpu.check()
    }

    fn release(&mut self, block: Block) {
        self.residency.release(block);
        if let Block::Payload(id) = block {
            self.textures.remove_atlas(id);
        }
    }

    fn render(&mut self, list: &DrawList) -> Result<Counted, Fault> {
        let start = Instant::now();
        let plan = plan(list, &self.table, &self.residency, &self.written, self.limits())?;
        for pass in &plan.passes {
            let (gpu, pipelines) = (&self.gpu, &self.pipelines);
            match &pass.work {
                Work::Surface(_) => {
                    self.surfaces.make(pass.target, pass.size, || Surface::new(gpu, pipelines, pass.size))?;
                }
                Work::Shade(_) => self.pictures.make(pass.target, pass.size, || Shaded::new(gpu, pass.size))?,
            }
        }
        self.prepare(&plan)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let queries = self.frame.queries(&self.gpu, &plan)?;
        for (i, pass) in plan.passes.iter().enumerate() {
            match &pass.work {
                Work::Surface(batches) => {
                    if let Some(target) = self.surfaces.get(pass.target, pass.size) {
                        self.surface_pass(&mut encoder, &plan, pass, batches, target, queries.as_ref().map(|q| (q, i)));
                    }
                }
                Work::Shade(surface) => {
                    let read = self.surfaces.get(*surface, pass.size);
                    if let (Some(read), Some(to)) = (read, self.pictures.get(pass.target, pass.size)) {
                        self.shade_pass(&mut encoder, pass, read, to, queries.as_ref().map(|q| (q, i)));
                    }
                }
            }
        }
        if let Some(q) = &queries {
            q.resolve(&mut encoder);
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.on_the_way_bytes = 0;
        self.gpu.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        self.written.note(&plan);
        let (gpu_ms, clipped_primitives) = match &queries {
            Some(q) => q.results(&self.gpu)?,
            None => (None, None),
        };
        Ok(Counted {
            gpu_ms,
            wall_ms,
            near_triangles: plan.near_triangles,
            far_triangles: plan.far_triangles,
            samples: plan.samples,
            points: plan.points,
            lines: plan.lines,
            clipped_primitives,
        })
    }

    fn read_surface(&mut self, target: TargetId) -> Result<SurfaceImage, Fault> {
        let size = self.written.surface(target)?;
        let gone = || Fault::Refused(format!("target {} was not kept", target.0));
        read::surface(&self.gpu, self.surfaces.get(target, size).ok_or_else(gone)?, size)
    }

    fn read_picture(&mut self, target: TargetId) -> Result<Picture, Fault> {
        let size = self.written.picture(target)?;
        let gone = || Fault::Refused(format!("target {} was not kept", target.0));
        read::picture(&self.gpu, &self.pictures.get(target, size).ok_or_else(gone)?.texture, size)
    }
}
