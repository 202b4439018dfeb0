//! Plans as commands, and the counters around them.

use farfield_core::Fault;
use farfield_shaders::layout::{DrawCommand, ShadeUniform, UNIFORM_ALIGN, ViewUniform};
use farfield_shaders::plan::{Batch, FramePlan, PassPlan, Work};
use farfield_shaders::pool::Stream;
use wgpu::BufferUsages;

use crate::WgpuBackend;
use crate::device::Gpu;
use crate::targets::{Shaded, Surface};

/// The three arrays of a plan on the device; they grow as frames need.
pub(crate) struct FrameBuffers {
    records: wgpu::Buffer,
    commands: wgpu::Buffer,
    uniforms: wgpu::Buffer,
    /// The indices of all points and lines.
    quads: wgpu::Buffer,
    view: Option<wgpu::BindGroup>,
    shade: Option<wgpu::BindGroup>,
}

impl FrameBuffers {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Fault> {
        let pattern = farfield_shaders::quads::indices();
        let bytes: &[u8] = bytemuck::cast_slice(&pattern);
        let quads = gpu.buffer("quads", bytes.len() as u64, BufferUsages::INDEX | BufferUsages::COPY_DST)?;
        gpu.queue.write_buffer(&quads, 0, bytes);
        Ok(Self {
            quads,
            records: gpu.buffer("records", 1 << 12, BufferUsages::STORAGE | BufferUsages::COPY_DST)?,
            commands: gpu.buffer("commands", 1 << 10, BufferUsages::INDIRECT | BufferUsages::COPY_DST)?,
            uniforms: gpu.buffer("uniforms", 1 << 12, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?,
            view: None,
            shade: None,
        })
    }

    /// Writes `data`, into a larger buffer where it does not fit; says whether the buffer is another one now.
    fn fill(gpu: &Gpu, buffer: &mut wgpu::Buffer, label: &str, data: &[u8]) -> Result<bool, Fault> {
        let grows = data.len() as u64 > buffer.size();
        if grows {
            let size = (data.len() as u64).next_power_of_two().min(gpu.limits.max_buffer_size);
            *buffer = gpu.buffer(label, size, buffer.usage())?;
        }
        if !data.is_empty() {
            gpu.queue.write_buffer(buffer, 0, data);
        }
        Ok(grows)
    }

    /// Queries for a plan; `None` where the device has neither kind, or where there are too many passes for a query set.
    pub(crate) fn queries(&self, gpu: &Gpu, plan: &FramePlan) -> Result<Option<Queries>, Fault> {
        let passes = plan.passes.len() as u32;
        if passes == 0 || 2 * passes > wgpu::QUERY_SET_MAX_QUERIES || !(gpu.timestamps || gpu.statistics) {
            return Ok(None);
        }
        Queries::new(gpu, plan).map(Some)
    }
}

/// A frame's counters: two timestamps a pass, one count a surface pass.
pub(crate) struct Queries {
    times: Option<wgpu::QuerySet>,
    counts: Option<wgpu::QuerySet>,
    passes: u32,
    /// For each pass the number of its count.
    count_of: Vec<Option<u32>>,
    surfaces: u32,
    /// For each pass whether it starts with compute.
    started: Vec<bool>,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
}

impl Queries {
    fn new(gpu: &Gpu, plan: &FramePlan) -> Result<Self, Fault> {
        let passes = plan.passes.len() as u32;
        let mut surfaces = 0;
        let count_of = plan
            .passes
            .iter()
            .map(|p| {
                matches!(p.work, Work::Surface(_)).then(|| {
                    surfaces += 1;
                    surfaces - 1
                })
            })
            .collect();
        let set =
            |label, ty, count| gpu.device.create_query_set(&wgpu::QuerySetDescriptor { label: Some(label), ty, count });
        let clipped = wgpu::QueryType::PipelineStatistics(wgpu::PipelineStatisticsTypes::CLIPPER_INVOCATIONS);
        let times = gpu.timestamps.then(|| set("times", wgpu::QueryType::Timestamp, 2 * passes));
        let counts = (gpu.statistics && surfaces > 0).then(|| set("counts", clipped, surfaces));
        let size = Self::counts_at(passes) + 8 * u64::from(surfaces);
        let resolved = gpu.buffer("queries", size, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC)?;
        let readable = gpu.buffer("queries read", size, BufferUsages::COPY_DST | BufferUsages::MAP_READ)?;
        let started = plan.passes.iter().map(|p| !p.layered.is_empty()).collect();
        Ok(Self { times, counts, passes, count_of, surfaces, started, resolved, readable })
    }

    /// Where the counts start, bytes.
    fn counts_at(passes: u32) -> u64 {
        (16 * u64::from(passes)).next_multiple_of(wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT)
    }

    fn timestamps(&self, pass: usize) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.times.as_ref().map(|query_set| wgpu::RenderPassTimestampWrites {
            query_set,
            // Where compute comes before, it took the time.
            beginning_of_pass_write_index: (!self.started[pass]).then_some(2 * pass as u32),
            end_of_pass_write_index: Some(2 * pass as u32 + 1),
        })
    }

    /// The first timestamp of a pass that starts with compute.
    pub(crate) fn start(&self, pass: usize) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.times.as_ref().map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(2 * pass as u32),
            end_of_pass_write_index: None,
        })
    }

    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(set) = &self.times {
            encoder.resolve_query_set(set, 0..2 * self.passes, &self.resolved, 0);
        }
        if let Some(set) = &self.counts {
            encoder.resolve_query_set(set, 0..self.surfaces, &self.resolved, Self::counts_at(self.passes));
        }
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, self.resolved.size());
    }

    /// The sum of the passes' times, milliseconds, and of the primitives that reached the clipper.
    pub(crate) fn results(&self, gpu: &Gpu) -> Result<(Option<f64>, Option<u64>), Fault> {
        let period_ns = f64::from(gpu.queue.get_timestamp_period());
        gpu.read(&self.readable, self.readable.size(), |bytes| {
            let value = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
            let ms = self.times.as_ref().map(|_| {
                (0..self.passes as usize)
                    .map(|p| value(16 * p + 8).saturating_sub(value(16 * p)) as f64 * period_ns * 1e-6)
                    .sum()
            });
            let at = Self::counts_at(self.passes) as usize;
            let clipped = self.counts.as_ref().map(|_| (0..self.surfaces as usize).map(|s| value(at + 8 * s)).sum());
            (ms, clipped)
        })
    }
}

impl WgpuBackend {
    /// Uploads a plan's arrays and makes the bind groups that it needs.
    pub(crate) fn prepare(&mut self, plan: &FramePlan) -> Result<(), Fault> {
        let (gpu, frame) = (&self.gpu, &mut self.frame);
        let records = FrameBuffers::fill(gpu, &mut frame.records, "records", bytemuck::cast_slice(&plan.records))?;
        FrameBuffers::fill(gpu, &mut frame.commands, "commands", bytemuck::cast_slice(&plan.commands))?;
        // Each uniform is bound whole: the last one needs room behind its offset.
        let mut uniforms = plan.uniforms.clone();
        uniforms.resize(uniforms.len() + size_of::<ShadeUniform>().next_multiple_of(UNIFORM_ALIGN), 0);
        let uniforms = FrameBuffers::fill(gpu, &mut frame.uniforms, "uniforms", &uniforms)?;
        if records || uniforms || frame.view.is_none() {
            let uniform = |buffer, size: usize| {
                wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset: 0,
                    size: std::num::NonZeroU64::new(size as u64),
                })
            };
            let group = |label, layout, entries: &[wgpu::BindGroupEntry<'_>]| {
                gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries })
            };
            frame.view = Some(group(
                "view",
                &self.pipelines.view,
                &[
                    wgpu::BindGroupEntry { binding: 0, resource: uniform(&frame.uniforms, size_of::<ViewUniform>()) },
                    wgpu::BindGroupEntry { binding: 1, resource: frame.records.as_entire_binding() },
                ],
            ));
            let entry =
                wgpu::BindGroupEntry { binding: 0, resource: uniform(&frame.uniforms, size_of::<ShadeUniform>()) };
            frame.shade = Some(group("shade", &self.pipelines.shade, &[entry]));
        }
        let samples = &self.pages[Stream::Samples as usize];
        self.splats.prepare(gpu, &self.pipelines, &frame.uniforms, samples, plan)?;
        for pass in &plan.passes {
            if let Work::Surface(batches) = &pass.work {
                for b in batches {
                    self.textures.prepare(gpu, &self.pipelines, &self.pages, b.key.bind)?;
                }
            }
        }
        gpu.check()
    }

    /// A surface pass into the top left of a target that is at least as large, and the compute before it.
    pub(crate) fn surface_pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        plan: &FramePlan,
        pass: &PassPlan,
        batches: &[Batch],
        target: &Surface,
        queries: Option<(&Queries, usize)>,
    ) {
        if !pass.layered.is_empty() {
            self.warp(encoder, pass, queries);
        }
        let attachment = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let mut rp = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surface"),
            color_attachments: &[0, 1, 2, 3].map(|i: usize| attachment(&target.views[i])),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: queries.and_then(|(q, i)| q.timestamps(i)),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        rp.set_viewport(0.0, 0.0, pass.size[0] as f32, pass.size[1] as f32, 0.0, 1.0);
        rp.set_scissor_rect(0, 0, pass.size[0], pass.size[1]);
        let counts = queries.and_then(|(q, i)| Some((q.counts.as_ref()?, q.count_of[i]?)));
        if let Some((set, i)) = counts {
            rp.begin_pipeline_statistics_query(set, i);
        }
        rp.set_bind_group(0, self.frame.view.as_ref(), &[pass.uniform_offset]);
        for b in batches {
            self.batch(&mut rp, plan, b);
        }
        self.resolve(&mut rp, pass);
        if counts.is_some() {
            rp.end_pipeline_statistics_query();
        }
    }

    fn batch(&self, rp: &mut wgpu::RenderPass<'_>, plan: &FramePlan, b: &Batch) {
        let commands = &plan.commands[b.commands.start as usize..b.commands.end as usize];
        let page = |stream: Stream, i: u32| self.pages[stream as usize].get(i as usize);
        let vertices = b.key.shader.vertices().map(|stream| page(stream, b.key.vertex_page));
        let indices = match vertices {
            Some(_) => page(Stream::Indices, b.key.index_page),
            None => Some(&self.frame.quads),
        };
        let (Some(pipeline), Some(indices)) = (self.pipelines.surface(b.key.shader, b.key.cull), indices) else {
            // Only a batch without any triangle has no page.
            return;
        };
        match vertices {
            Some(Some(page)) => rp.set_vertex_buffer(0, page.slice(..)),
            Some(None) => return,
            // Pulled out of group 1.
            None => {}
        }
        rp.set_pipeline(pipeline);
        if let Some(group) = self.textures.bind(&b.key.bind) {
            rp.set_bind_group(1, group, &[]);
        }
        rp.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        if self.gpu.indirect {
            let at = u64::from(b.commands.start) * size_of::<DrawCommand>() as u64;
            rp.multi_draw_indexed_indirect(&self.frame.commands, at, commands.len() as u32);
            return;
        }
        for c in commands {
            let indices = c.first_index..c.first_index + c.index_count;
            rp.draw_indexed(indices, c.base_vertex, c.first_instance..c.first_instance + c.instance_count);
        }
    }

    /// A shading pass.
    pub(crate) fn shade_pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pass: &PassPlan,
        read: &Surface,
        to: &Shaded,
        queries: Option<(&Queries, usize)>,
    ) {
        let mut rp = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shading"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &to.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: queries.and_then(|(q, i)| q.timestamps(i)),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        rp.set_pipeline(&self.pipelines.shading);
        rp.set_bind_group(0, self.frame.shade.as_ref(), &[pass.uniform_offset]);
        rp.set_bind_group(1, &read.bind, &[]);
        rp.draw(0..3, 0..1);
    }
}
