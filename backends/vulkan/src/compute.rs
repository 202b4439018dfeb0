//! Recording of compute: clearing, bindings, dispatches.

use ash::vk;

use crate::memory::Buffer;
use crate::record::Recorder;

impl Recorder<'_> {
    /// Writes zeros over the first `bytes` (a multiple of 4) of a buffer.
    pub(crate) fn zero(&self, buffer: &Buffer, bytes: u64) {
        // SAFETY: recording, outside a render pass; callers make the buffer large enough, and to be copied to.
        unsafe { self.gpu.raw.cmd_fill_buffer(self.raw, buffer.raw, 0, bytes, 0) };
    }

    /// Computes with `pipeline` from now on.
    pub(crate) fn compute(&self, pipeline: vk::Pipeline) {
        // SAFETY: recording; the pipeline lives as long as the backend.
        unsafe { self.gpu.raw.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::COMPUTE, pipeline) };
    }

    /// Binds group 0 of what computes, its dynamic uniform at `offset`.
    pub(crate) fn compute_set(&self, layout: vk::PipelineLayout, set: vk::DescriptorSet, offset: u32) {
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: recording; the set was made with this layout's set layout, holds live objects, and the offset is one that
        // the plan wrote a uniform at.
        unsafe { self.gpu.raw.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set], &[offset]) };
    }

    /// Runs so many workgroups, across and down.
    pub(crate) fn dispatch(&self, [x, y]: [u32; 2]) {
        // SAFETY: recording, outside a render pass, with pipeline and set bound; plans stay within the limits of any device.
        unsafe { self.gpu.raw.cmd_dispatch(self.raw, x, y, 1) };
    }
}
