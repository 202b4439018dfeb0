//! Recording: barriers and copies, each a plain call. Draws are recorded in [`crate::draw`], compute in
//! [`crate::compute`].
//!
//! Barriers are explicit (synchronization2), each naming what came before and what comes after.

use ash::vk;

use crate::gpu::Gpu;
use crate::memory::{Buffer, Image};

/// A command buffer that is being recorded.
pub(crate) struct Recorder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) raw: vk::CommandBuffer,
}

/// A use of an image or of memory: pipeline stages, accesses, and the layout that an image has for it.
#[derive(Clone, Copy)]
pub(crate) struct Use {
    pub(crate) stage: vk::PipelineStageFlags2,
    pub(crate) access: vk::AccessFlags2,
    pub(crate) layout: vk::ImageLayout,
}

impl Use {
    const fn new(stage: vk::PipelineStageFlags2, access: vk::AccessFlags2, layout: vk::ImageLayout) -> Self {
        Self { stage, access, layout }
    }
    /// Content that may be thrown away; comes after everything before.
    pub(crate) const DISCARD: Self =
        Self::new(vk::PipelineStageFlags2::ALL_COMMANDS, vk::AccessFlags2::MEMORY_WRITE, vk::ImageLayout::UNDEFINED);
    /// Written by copies.
    pub(crate) const COPY_TO: Self = Self::new(
        vk::PipelineStageFlags2::COPY,
        vk::AccessFlags2::TRANSFER_WRITE,
        vk::ImageLayout::TRANSFER_DST_OPTIMAL,
    );
    /// Read by copies.
    pub(crate) const COPY_FROM: Self = Self::new(
        vk::PipelineStageFlags2::COPY,
        vk::AccessFlags2::TRANSFER_READ,
        vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
    );
    /// Read by fragment shaders.
    pub(crate) const SAMPLED: Self = Self::new(
        vk::PipelineStageFlags2::FRAGMENT_SHADER,
        vk::AccessFlags2::SHADER_SAMPLED_READ,
        vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
    );
    /// A colour attachment that is cleared and drawn to.
    pub(crate) const COLOR: Self = Self::new(
        vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT,
        vk::AccessFlags2::COLOR_ATTACHMENT_WRITE,
        vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
    );
    /// A depth attachment that is cleared, tested and drawn to.
    pub(crate) const DEPTH: Self = Self::new(
        vk::PipelineStageFlags2::from_raw(
            vk::PipelineStageFlags2::EARLY_FRAGMENT_TESTS.as_raw()
                | vk::PipelineStageFlags2::LATE_FRAGMENT_TESTS.as_raw(),
        ),
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_READ.as_raw()
                | vk::AccessFlags2::DEPTH_STENCIL_ATTACHMENT_WRITE.as_raw(),
        ),
        vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
    );
    /// A buffer that is filled.
    pub(crate) const FILLED: Self =
        Self::new(vk::PipelineStageFlags2::ALL_TRANSFER, vk::AccessFlags2::TRANSFER_WRITE, vk::ImageLayout::UNDEFINED);
    /// Buffers that compute shaders read and write.
    pub(crate) const COMPUTED: Self = Self::new(
        vk::PipelineStageFlags2::COMPUTE_SHADER,
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::SHADER_STORAGE_READ.as_raw() | vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw(),
        ),
        vk::ImageLayout::UNDEFINED,
    );
    /// Buffers that fragment shaders read.
    pub(crate) const LOADED: Self = Self::new(
        vk::PipelineStageFlags2::FRAGMENT_SHADER,
        vk::AccessFlags2::SHADER_STORAGE_READ,
        vk::ImageLayout::UNDEFINED,
    );
    /// Buffers as draws and what computes read them: vertices, indices, indirect records, shader data.
    pub(crate) const DRAWN: Self = Self::new(
        vk::PipelineStageFlags2::from_raw(
            vk::PipelineStageFlags2::VERTEX_INPUT.as_raw()
                | vk::PipelineStageFlags2::DRAW_INDIRECT.as_raw()
                | vk::PipelineStageFlags2::VERTEX_SHADER.as_raw()
                | vk::PipelineStageFlags2::FRAGMENT_SHADER.as_raw()
                | vk::PipelineStageFlags2::COMPUTE_SHADER.as_raw(),
        ),
        vk::AccessFlags2::from_raw(
            vk::AccessFlags2::VERTEX_ATTRIBUTE_READ.as_raw()
                | vk::AccessFlags2::INDEX_READ.as_raw()
                | vk::AccessFlags2::INDIRECT_COMMAND_READ.as_raw()
                | vk::AccessFlags2::UNIFORM_READ.as_raw()
                | vk::AccessFlags2::SHADER_STORAGE_READ.as_raw(),
        ),
        vk::ImageLayout::UNDEFINED,
    );
    /// Buffers as the host reads them after the submission.
    pub(crate) const HOST: Self =
        Self::new(vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ, vk::ImageLayout::UNDEFINED);
}

impl Recorder<'_> {
    /// Orders `after` behind `before` for whole images, and gives them `after`'s layout.
    pub(crate) fn images(&self, changes: &[(&Image, Use, Use)]) {
        let barriers: Vec<_> = changes
            .iter()
            .map(|(image, before, after)| {
                vk::ImageMemoryBarrier2::default()
                    .src_stage_mask(before.stage)
                    .src_access_mask(before.access)
                    .dst_stage_mask(after.stage)
                    .dst_access_mask(after.access)
                    .old_layout(before.layout)
                    .new_layout(after.layout)
                    .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                    .image(image.raw)
                    .subresource_range(image.range())
            })
            .collect();
        self.barrier(&vk::DependencyInfo::default().image_memory_barriers(&barriers));
    }

    /// Orders `after` behind `before` for all memory.
    pub(crate) fn memory(&self, before: Use, after: Use) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(before.stage)
            .src_access_mask(before.access)
            .dst_stage_mask(after.stage)
            .dst_access_mask(after.access)];
        self.barrier(&vk::DependencyInfo::default().memory_barriers(&barriers));
    }

    fn barrier(&self, info: &vk::DependencyInfo<'_>) {
        // SAFETY: recording, outside a render pass; `info` and what it points to live until the call returns.
        unsafe { (self.gpu.pipeline_barrier)(self.raw, info) };
    }

    /// Copies runs of bytes from one buffer to another; both must stay until the submission's end.
    pub(crate) fn copy(&self, from: &Buffer, to: vk::Buffer, regions: &[vk::BufferCopy]) {
        if !regions.is_empty() {
            // SAFETY: recording, outside a render pass; callers take regions within both buffers.
            unsafe { self.gpu.raw.cmd_copy_buffer(self.raw, from.raw, to, regions) };
        }
    }

    /// Copies rows `rows` of one layer from `from`, tightly packed at `offset`, into an image in layout COPY_TO.
    pub(crate) fn copy_rows(&self, from: &Buffer, offset: u64, to: &Image, layer: u32, width: u32, rows: [u32; 2]) {
        let region = region(to, offset, layer, [0, rows[0]], [width, rows[1] - rows[0]]);
        // SAFETY: recording, outside a render pass; callers take rows within the image and bytes within the buffer.
        unsafe {
            self.gpu.raw.cmd_copy_buffer_to_image(self.raw, from.raw, to.raw, Use::COPY_TO.layout, &[region]);
        }
    }

    /// Copies a whole image of one layer, in layout COPY_FROM, into `to`, tightly packed at `offset`.
    pub(crate) fn read(&self, from: &Image, size: [u32; 2], to: &Buffer, offset: u64) {
        let region = region(from, offset, 0, [0, 0], size);
        // SAFETY: recording, outside a render pass; callers make the buffer large enough.
        unsafe {
            self.gpu.raw.cmd_copy_image_to_buffer(self.raw, from.raw, Use::COPY_FROM.layout, to.raw, &[region]);
        }
    }
}

fn region(image: &Image, offset: u64, layer: u32, at: [u32; 2], size: [u32; 2]) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .buffer_offset(offset)
        .image_subresource(
            vk::ImageSubresourceLayers::default().aspect_mask(image.aspect).base_array_layer(layer).layer_count(1),
        )
        .image_offset(vk::Offset3D { x: at[0] as i32, y: at[1] as i32, z: 0 })
        .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 })
}
