//! Recording of draws: render passes, bindings, and the draw calls.

use ash::vk;
use farfield_shaders::layout::DrawCommand;

use crate::memory::{Buffer, Image};
use crate::record::{Recorder, Use};

impl Recorder<'_> {
    /// A render pass over `colors` (in layout COLOR) and `depth` (in layout DEPTH), all cleared to 0, with a viewport of
    /// negative height over all of them, so that clip-space y points up. `draw` records within it.
    pub(crate) fn pass(&self, colors: &[Image], depth: Option<&Image>, size: [u32; 2], draw: impl FnOnce()) {
        // All zero bits: 0 for float, integer and depth planes alike.
        let zero = vk::ClearValue::default();
        let attachments: Vec<_> = colors
            .iter()
            .map(|image| {
                vk::RenderingAttachmentInfo::default()
                    .image_view(image.view)
                    .image_layout(Use::COLOR.layout)
                    .load_op(vk::AttachmentLoadOp::CLEAR)
                    .store_op(vk::AttachmentStoreOp::STORE)
                    .clear_value(zero)
            })
            .collect();
        let depth = depth.map(|image| {
            vk::RenderingAttachmentInfo::default()
                .image_view(image.view)
                .image_layout(Use::DEPTH.layout)
                .load_op(vk::AttachmentLoadOp::CLEAR)
                .store_op(vk::AttachmentStoreOp::DONT_CARE)
                .clear_value(zero)
        });
        let area =
            vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width: size[0], height: size[1] } };
        let mut info = vk::RenderingInfo::default().render_area(area).layer_count(1).color_attachments(&attachments);
        if let Some(depth) = &depth {
            info = info.depth_attachment(depth);
        }
        let [w, h] = size.map(|s| s as f32);
        let viewport = vk::Viewport { x: 0.0, y: h, width: w, height: -h, min_depth: 0.0, max_depth: 1.0 };
        // SAFETY: recording, outside a render pass, and ended below; the images are as large as the area, in the layouts
        // named, and kept by the caller until the submission's end.
        unsafe {
            (self.gpu.begin_rendering)(self.raw, &info);
            self.gpu.raw.cmd_set_viewport(self.raw, 0, &[viewport]);
            self.gpu.raw.cmd_set_scissor(self.raw, 0, &[area]);
        }
        draw();
        // SAFETY: begun above.
        unsafe { (self.gpu.end_rendering)(self.raw) };
    }

    /// Draws with `pipeline` from now on.
    pub(crate) fn pipeline(&self, pipeline: vk::Pipeline) {
        // SAFETY: recording; the pipeline lives as long as the backend.
        unsafe { self.gpu.raw.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::GRAPHICS, pipeline) };
    }

    /// Binds a descriptor set as group `group`, its dynamic uniform (if it has one) at `offset`.
    pub(crate) fn set(&self, layout: vk::PipelineLayout, group: u32, set: vk::DescriptorSet, offset: Option<u32>) {
        let point = vk::PipelineBindPoint::GRAPHICS;
        // SAFETY: recording; the set was made with this layout's set layout, holds live objects, and the offset is one that
        // the plan wrote a uniform at.
        unsafe { self.gpu.raw.cmd_bind_descriptor_sets(self.raw, point, layout, group, &[set], offset.as_slice()) };
    }

    /// Binds a page of vertices.
    pub(crate) fn vertices(&self, page: &Buffer) {
        // SAFETY: recording; pages live as long as the backend.
        unsafe { self.gpu.raw.cmd_bind_vertex_buffers(self.raw, 0, &[page.raw], &[0]) };
    }

    /// Binds a page of 32-bit indices.
    pub(crate) fn indices(&self, page: &Buffer) {
        // SAFETY: recording; pages live as long as the backend.
        unsafe { self.gpu.raw.cmd_bind_index_buffer(self.raw, page.raw, 0, vk::IndexType::UINT32) };
    }

    /// Draws commands `first..first + commands.len()` of `buffer`, which holds the same commands: in as few calls as the
    /// device allows, or one by one where it has no multi-draw-indirect with first instances.
    pub(crate) fn draws(&self, buffer: &Buffer, first: u32, commands: &[DrawCommand]) {
        const STRIDE: usize = size_of::<DrawCommand>();
        if !self.gpu.caps.multi_draw {
            for c in commands.iter().filter(|c| c.index_count > 0) {
                // SAFETY: recording, within a render pass, with pipeline, sets and pages bound; the plan's commands lie
                // within their pages.
                unsafe {
                    self.gpu.raw.cmd_draw_indexed(
                        self.raw,
                        c.index_count,
                        c.instance_count,
                        c.first_index,
                        c.base_vertex,
                        c.first_instance,
                    );
                }
            }
            return;
        }
        let at_once = self.gpu.caps.limits.max_draw_indirect_count.max(1) as usize;
        let mut offset = u64::from(first) * STRIDE as u64;
        for run in commands.chunks(at_once) {
            // SAFETY: as above; the buffer holds these commands at this offset.
            unsafe {
                self.gpu.raw.cmd_draw_indexed_indirect(self.raw, buffer.raw, offset, run.len() as u32, STRIDE as u32);
            }
            offset += (run.len() * STRIDE) as u64;
        }
    }

    /// Draws the one triangle that covers the picture.
    pub(crate) fn cover(&self) {
        // SAFETY: recording, within a render pass, with pipeline and sets bound; the shader reads no vertices.
        unsafe { self.gpu.raw.cmd_draw(self.raw, 3, 1, 0, 0) };
    }
}
