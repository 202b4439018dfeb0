//! Layered depth images: the compute passes before a surface pass, the draws at its end, and what they bind.
//!
//! One buffer of splats serves all passes of a frame, one after the other; wgpu orders dispatches, and passes, that write it.

use std::collections::BTreeMap;

use farfield_core::Fault;
use farfield_shaders::layout::WarpUniform;
use farfield_shaders::plan::{FramePlan, PassPlan};
use wgpu::{BindGroupEntry, BufferUsages};

use crate::WgpuBackend;
use crate::device::Gpu;
use crate::encode::Queries;
use crate::pipelines::Pipelines;

/// What warping and resolving bind.
pub(crate) struct Splats {
    buffer: wgpu::Buffer,
    /// By page of samples: for the warp, and for what resolves it. Those of the frame.
    binds: BTreeMap<u32, [wgpu::BindGroup; 2]>,
}

impl Splats {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Fault> {
        Ok(Self { buffer: buffer(gpu, 8)?, binds: BTreeMap::new() })
    }

    /// Makes room for a plan's splats and binds the pages that it names.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        pipelines: &Pipelines,
        uniforms: &wgpu::Buffer,
        pages: &[wgpu::Buffer],
        plan: &FramePlan,
    ) -> Result<(), Fault> {
        self.binds.clear();
        let bytes = plan.splat_bytes();
        if bytes > self.buffer.size() {
            self.buffer = buffer(gpu, bytes)?;
        }
        for draw in plan.passes.iter().flat_map(|p| &p.layered) {
            if self.binds.contains_key(&draw.page) {
                continue;
            }
            let uniform = wgpu::BufferBinding {
                buffer: uniforms,
                offset: 0,
                size: std::num::NonZeroU64::new(size_of::<WarpUniform>() as u64),
            };
            let entries = [
                BindGroupEntry { binding: 0, resource: wgpu::BindingResource::Buffer(uniform) },
                BindGroupEntry { binding: 1, resource: pages[draw.page as usize].as_entire_binding() },
                BindGroupEntry { binding: 2, resource: self.buffer.as_entire_binding() },
            ];
            let group = |layout| {
                gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("samples"),
                    layout,
                    entries: &entries,
                })
            };
            self.binds.insert(draw.page, [group(&pipelines.warped), group(&pipelines.resolved)]);
        }
        Ok(())
    }
}

fn buffer(gpu: &Gpu, bytes: u64) -> Result<wgpu::Buffer, Fault> {
    gpu.buffer("splats", bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST)
}

impl WgpuBackend {
    /// Warps a pass's images; its first timestamp is written here.
    pub(crate) fn warp(&self, encoder: &mut wgpu::CommandEncoder, pass: &PassPlan, queries: Option<(&Queries, usize)>) {
        // Clearing belongs to no pass: an empty one before it takes the time.
        let begin = |encoder: &mut wgpu::CommandEncoder, timestamp_writes| {
            let label = Some("warp");
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes }).forget_lifetime()
        };
        if let Some(start) = queries.and_then(|(q, i)| q.start(i)) {
            drop(begin(encoder, Some(start)));
        }
        encoder.clear_buffer(&self.splats.buffer, 0, Some(pass.splat_bytes()));
        let mut cp = begin(encoder, None);
        cp.set_pipeline(&self.pipelines.warp);
        for (draw, offset) in self.gpu.atomics.dispatches(&pass.layered) {
            if let Some([group, _]) = self.splats.binds.get(&draw.page) {
                cp.set_bind_group(0, group, &[offset]);
                cp.dispatch_workgroups(draw.workgroups[0], draw.workgroups[1], 1);
            }
        }
    }

    /// Composes a pass's images, within its render pass.
    pub(crate) fn resolve(&self, rp: &mut wgpu::RenderPass<'_>, pass: &PassPlan) {
        if pass.layered.is_empty() {
            return;
        }
        rp.set_pipeline(&self.pipelines.resolve);
        for draw in &pass.layered {
            if let Some([_, group]) = self.splats.binds.get(&draw.page) {
                rp.set_bind_group(0, group, &[draw.uniform_offset]);
                rp.draw(0..3, 0..1);
            }
        }
    }
}
