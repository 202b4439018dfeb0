//! The logical device: queue, allocator, and the entry points that are core in 1.3 and extensions before.
//!
//! Everything made from the device holds it through an `Arc`, so it is destroyed last; a fault of it carries its name.

use std::mem::ManuallyDrop;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::{ext, khr, vk};
use farfield_core::Fault;
use farfield_shaders::warp::Atomics;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

use crate::choose::{Caps, Without, choose};
use crate::instance::{Instance, no_device};

/// Owns the device and its instance.
pub(crate) struct Gpu {
    allocator: ManuallyDrop<Mutex<Allocator>>,
    pub(crate) raw: ash::Device,
    pub(crate) queue: vk::Queue,
    pub(crate) caps: Caps,
    pub(crate) begin_rendering: vk::PFN_vkCmdBeginRendering,
    pub(crate) end_rendering: vk::PFN_vkCmdEndRendering,
    pub(crate) pipeline_barrier: vk::PFN_vkCmdPipelineBarrier2,
    pub(crate) write_timestamp: vk::PFN_vkCmdWriteTimestamp2,
    pub(crate) submit: vk::PFN_vkQueueSubmit2,
    pub(crate) instance: Instance,
}

impl Gpu {
    /// Makes an instance, chooses a device and opens it.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is none that serves, or it refuses.
    pub(crate) fn open(validation: bool, filter: Option<&str>, without: Without) -> Result<Self, Fault> {
        let instance = Instance::new(validation)?;
        let caps = choose(&instance, filter, without)?;
        let refused = |e: vk::Result| Fault::Device { device: caps.name.clone(), cause: format!("does not open: {e}") };

        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(caps.family).queue_priorities(&[1.0])];
        let whole = caps.atomics == Atomics::Whole;
        let features = vk::PhysicalDeviceFeatures::default()
            .shader_int64(whole)
            .pipeline_statistics_query(caps.statistics)
            .multi_draw_indirect(caps.multi_draw)
            .draw_indirect_first_instance(caps.multi_draw)
            .robust_buffer_access(caps.robustness.buffer);
        let mut rendering = vk::PhysicalDeviceDynamicRenderingFeatures::default().dynamic_rendering(true);
        let mut sync = vk::PhysicalDeviceSynchronization2Features::default().synchronization2(true);
        let mut names = vec![];
        if !caps.core_1_3 {
            names.extend([khr::dynamic_rendering::NAME.as_ptr(), khr::synchronization2::NAME.as_ptr()]);
            // VK_KHR_dynamic_rendering needs these two, which became core in 1.2.
            names.extend([khr::depth_stencil_resolve::NAME.as_ptr(), khr::create_renderpass2::NAME.as_ptr()]);
        }
        let [buffer, image] = caps.robustness.two.unwrap_or_default();
        let mut two = vk::PhysicalDeviceRobustness2FeaturesEXT::default()
            .robust_buffer_access2(buffer)
            .robust_image_access2(image);
        let mut image = vk::PhysicalDeviceImageRobustnessFeatures::default().robust_image_access(true);
        let mut atomics = vk::PhysicalDeviceShaderAtomicInt64Features::default().shader_buffer_int64_atomics(true);
        if caps.robustness.two.is_some() {
            names.push(ext::robustness2::NAME.as_ptr());
        }
        if caps.robustness.image == Some(true) {
            names.push(ext::image_robustness::NAME.as_ptr());
        }
        if whole && !caps.core_1_2 {
            names.push(khr::shader_atomic_int64::NAME.as_ptr());
        }
        let mut info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .enabled_extension_names(&names)
            .push_next(&mut rendering)
            .push_next(&mut sync);
        if caps.robustness.two.is_some() {
            info = info.push_next(&mut two);
        }
        if caps.robustness.image.is_some() {
            info = info.push_next(&mut image);
        }
        if whole {
            info = info.push_next(&mut atomics);
        }
        // SAFETY: all that `info` names was found on this physical device, and lives until the call returns.
        let raw = unsafe { instance.raw.create_device(caps.physical, &info, None) }.map_err(refused)?;
        // SAFETY: one queue of this family was asked for.
        let queue = unsafe { raw.get_device_queue(caps.family, 0) };

        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: caps.physical,
            debug_settings: gpu_allocator::AllocatorDebugSettings::default(),
            buffer_device_address: false,
            allocation_sizes: gpu_allocator::AllocationSizes::default(),
        });
        let allocator = match allocator {
            Ok(a) => ManuallyDrop::new(Mutex::new(a)),
            Err(e) => {
                // SAFETY: nothing was made from the device yet.
                unsafe { raw.destroy_device(None) };
                return Err(no_device(format!("no memory allocator for {}: {e}", caps.name)));
            }
        };
        let (begin_rendering, end_rendering, pipeline_barrier, write_timestamp, submit) = if caps.core_1_3 {
            let f = raw.fp_v1_3();
            (
                f.cmd_begin_rendering,
                f.cmd_end_rendering,
                f.cmd_pipeline_barrier2,
                f.cmd_write_timestamp2,
                f.queue_submit2,
            )
        } else {
            let rendering = khr::dynamic_rendering::Device::new(&instance.raw, &raw);
            let sync = khr::synchronization2::Device::new(&instance.raw, &raw);
            (
                rendering.fp().cmd_begin_rendering_khr,
                rendering.fp().cmd_end_rendering_khr,
                sync.fp().cmd_pipeline_barrier2_khr,
                sync.fp().cmd_write_timestamp2_khr,
                sync.fp().queue_submit2_khr,
            )
        };
        Ok(Self {
            allocator,
            raw,
            queue,
            caps,
            begin_rendering,
            end_rendering,
            pipeline_barrier,
            write_timestamp,
            submit,
            instance,
        })
    }

    /// The allocator, for one call.
    pub(crate) fn allocator(&self) -> MutexGuard<'_, Allocator> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A fault of this device.
    pub(crate) fn fault(&self, what: &str, e: impl std::fmt::Display) -> Fault {
        Fault::Device { device: self.caps.name.clone(), cause: format!("{what}: {e}") }
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        // SAFETY: everything made from the device held this struct and is gone, with its work done; the allocator goes
        // before the device that its memory belongs to, and neither is used again.
        unsafe {
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_device(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::memory::{Buffer, Place};
    use crate::record::Use;
    use crate::submit::Submitter;

    /// What validation says of `misuse`; `None` (a visible skip) without a device or the layer.
    fn said_of(misuse: impl FnOnce(&Arc<Gpu>)) -> Option<Vec<String>> {
        match Gpu::open(true, None, Without::default()) {
            Ok(gpu) => {
                let (journal, gpu) = (gpu.instance.journal.clone(), Arc::new(gpu));
                misuse(&gpu);
                drop(gpu);
                Some(journal.messages())
            }
            Err(why) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{why}"),
            Err(why) => {
                eprintln!("SKIPPED: validation listens: {why}");
                None
            }
        }
    }

    #[test]
    fn validation_tells_of_a_leak() {
        let said = said_of(|gpu| {
            // SAFETY: the device is alive; the fence is leaked on purpose, which the layer is to notice.
            unsafe { gpu.raw.create_fence(&vk::FenceCreateInfo::default(), None) }.unwrap();
        });
        assert!(said.is_none_or(|s| s.iter().any(|m| m.contains("has not been destroyed"))));
    }

    #[test]
    fn validation_tells_of_a_missing_barrier() {
        let copy_twice = |barrier: bool| {
            said_of(|gpu| {
                let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
                let from = Buffer::new(gpu, "from", 64, usage, Place::Upload).unwrap();
                let to = Buffer::new(gpu, "to", 64, usage, Place::Device).unwrap();
                let copy = [vk::BufferCopy { src_offset: 0, dst_offset: 0, size: 64 }];
                let mut by = Submitter::new(gpu).unwrap();
                by.run(|record| {
                    record.copy(&from, to.raw, &copy);
                    if barrier {
                        record.memory(Use::COPY_TO, Use::COPY_TO);
                    }
                    record.copy(&from, to.raw, &copy);
                    Ok(())
                })
                .unwrap();
            })
        };
        assert!(copy_twice(false).is_none_or(|s| s.iter().any(|m| m.contains("SYNC-HAZARD-WRITE-AFTER-WRITE"))));
        assert!(copy_twice(true).is_none_or(|s| s.is_empty()));
    }
}
