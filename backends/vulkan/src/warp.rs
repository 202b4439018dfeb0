//! Layered depth images: the splats of a pass, the compute before it, the draws at its end.
//!
//! One buffer of splats serves all passes of a frame, one after the other. Every dispatch waits for the one before: phases depend on
//! each other, and images of one phase write the same splats.
//!
//! The validation layer of 2023 takes atomics for reads: it notices where the splats' clearing is not waited for, not where a dispatch
//! is not. That both kinds of atomics and both stacks give the same bytes (`integration-tests/tests/parity`) speaks for those barriers.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_shaders::Shader;
use farfield_shaders::layout::WarpUniform;
use farfield_shaders::plan::{FramePlan, PassPlan};
use farfield_shaders::pool::Stream;
use farfield_shaders::records::Cull;

use crate::blocks::Blocks;
use crate::descriptors::{Bound, Sets};
use crate::gpu::Gpu;
use crate::memory::{Buffer, Place};
use crate::pipelines::Pipelines;
use crate::record::{Recorder, Use};

/// The buffer of splats.
pub(crate) struct Splats {
    gpu: Arc<Gpu>,
    buffer: Buffer,
}

/// A frame's descriptor sets, by page of samples.
pub(crate) type SampleSets = BTreeMap<u32, vk::DescriptorSet>;

fn buffer(gpu: &Arc<Gpu>, bytes: u64) -> Result<Buffer, Fault> {
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
    Buffer::new(gpu, "splats", bytes, usage, Place::Device)
}

impl Splats {
    /// No room yet.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        Ok(Self { gpu: gpu.clone(), buffer: buffer(gpu, 8)? })
    }

    /// Makes room for a plan's splats and binds the pages that it names.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no memory for it.
    pub(crate) fn bind(
        &mut self,
        plan: &FramePlan,
        sets: &mut Sets,
        layout: vk::DescriptorSetLayout,
        uniforms: vk::Buffer,
        blocks: &Blocks,
    ) -> Result<SampleSets, Fault> {
        // Every frame was waited for, so the smaller buffer is in no use.
        if plan.splat_bytes() > self.buffer.bytes {
            self.buffer = buffer(&self.gpu, plan.splat_bytes())?;
        }
        let mut made = SampleSets::new();
        for draw in plan.passes.iter().flat_map(|p| &p.layered) {
            let Some(page) = blocks.page(Stream::Samples, draw.page) else { continue };
            if let Entry::Vacant(free) = made.entry(draw.page) {
                let uniform = Bound::Uniform { buffer: uniforms, bytes: size_of::<WarpUniform>() as u64 };
                let bound = [uniform, Bound::Storage(page.raw), Bound::Storage(self.buffer.raw)];
                free.insert(sets.make(layout, &bound)?);
            }
        }
        Ok(made)
    }

    /// Records the compute before a pass.
    pub(crate) fn warp(&self, record: &Recorder<'_>, pass: &PassPlan, pipelines: &Pipelines, sets: &SampleSets) {
        if pass.layered.is_empty() {
            return;
        }
        let atomics = self.gpu.caps.atomics;
        let layout = pipelines.layout(atomics.shader());
        record.memory(Use::LOADED, Use::FILLED);
        record.zero(&self.buffer, pass.splat_bytes());
        record.memory(Use::FILLED, Use::COMPUTED);
        record.compute(pipelines.get(atomics.shader(), Cull::None));
        for (i, (draw, offset)) in atomics.dispatches(&pass.layered).enumerate() {
            let Some(&set) = sets.get(&draw.page) else { continue };
            if i > 0 {
                record.memory(Use::COMPUTED, Use::COMPUTED);
            }
            record.compute_set(layout, set, offset);
            record.dispatch(draw.workgroups);
        }
        record.memory(Use::COMPUTED, Use::LOADED);
    }

    /// Records the draws that compose a pass's images, within its render pass.
    pub(crate) fn resolve(&self, record: &Recorder<'_>, pass: &PassPlan, pipelines: &Pipelines, sets: &SampleSets) {
        if pass.layered.is_empty() {
            return;
        }
        let layout = pipelines.layout(Shader::Resolve);
        record.pipeline(pipelines.get(Shader::Resolve, Cull::None));
        for draw in &pass.layered {
            if let Some(&set) = sets.get(&draw.page) {
                record.set(layout, 0, set, Some(draw.uniform_offset));
                record.cover();
            }
        }
    }
}
