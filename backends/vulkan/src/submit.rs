//! One command buffer, submitted and waited for.
//!
//! The backend has one queue and waits for each submission's end, so a single command buffer and fence serve, and what a
//! submission uses may be changed or destroyed once [`Submitter::run`] returns.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;

use crate::gpu::Gpu;
use crate::record::Recorder;

/// Records and submits.
pub(crate) struct Submitter {
    gpu: Arc<Gpu>,
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    fence: vk::Fence,
}

impl Submitter {
    /// Makes the pool, the command buffer and the fence.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        let mut made = Self {
            gpu: gpu.clone(),
            pool: vk::CommandPool::null(),
            buffer: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
        };
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.caps.family);
        // SAFETY: the device is alive and has the family.
        made.pool = unsafe { gpu.raw.create_command_pool(&info, None) }.map_err(|e| gpu.fault("command pool", e))?;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(made.pool).command_buffer_count(1);
        // SAFETY: the pool was just made.
        let buffers = unsafe { gpu.raw.allocate_command_buffers(&info) }.map_err(|e| gpu.fault("command buffer", e))?;
        made.buffer = buffers[0];
        // SAFETY: the device is alive.
        made.fence = unsafe { gpu.raw.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(|e| gpu.fault("fence", e))?;
        Ok(made)
    }

    /// Records with `record`, submits, waits for the end.
    ///
    /// # Errors
    /// What `record` gives (nothing is submitted then), or [`Fault::Device`].
    pub(crate) fn run(&mut self, record: impl FnOnce(&Recorder<'_>) -> Result<(), Fault>) -> Result<(), Fault> {
        let gpu = &*self.gpu;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the last submission was waited for, so the pool's only buffer is not in use.
        unsafe {
            gpu.raw
                .reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())
                .and_then(|()| gpu.raw.begin_command_buffer(self.buffer, &info))
        }
        .map_err(|e| gpu.fault("recording", e))?;
        record(&Recorder { gpu, raw: self.buffer })?;
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.buffer)];
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
        let fences = [self.fence];
        // A driver ends the wait for a device that hangs by calling it lost; to give up sooner would leave work under way.
        // SAFETY: the buffer is recording and is ended before it is submitted; the fence is unsignalled and waited for
        // before its next use; all the buffer refers to is held by the caller of this function until it returns.
        let done = unsafe {
            gpu.raw
                .end_command_buffer(self.buffer)
                .and_then(|()| gpu.raw.reset_fences(&fences))
                .and_then(|()| (gpu.submit)(gpu.queue, 1, submits.as_ptr(), self.fence).result())
                .and_then(|()| gpu.raw.wait_for_fences(&fences, true, u64::MAX))
        };
        done.map_err(|e| gpu.fault("submitting", e))
    }
}

impl Drop for Submitter {
    fn drop(&mut self) {
        // SAFETY: the device is idle afterwards, so nothing is in use; each is destroyed once (null is allowed).
        unsafe {
            // A lost device is idle too.
            let _ = self.gpu.raw.device_wait_idle();
            self.gpu.raw.destroy_fence(self.fence, None);
            self.gpu.raw.destroy_command_pool(self.pool, None);
        }
    }
}
