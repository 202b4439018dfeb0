//! Buffers and images with their memory, destroyed when dropped.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use crate::gpu::Gpu;

/// A buffer with its memory.
pub(crate) struct Buffer {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Buffer,
    pub(crate) bytes: u64,
    memory: Option<Allocation>,
}

/// Where a buffer's memory lies.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// Fast for the device, out of reach for the host.
    Device,
    /// Written by the host.
    Upload,
    /// Read by the host.
    Readback,
}

impl Buffer {
    /// Makes a buffer of `bytes` (at least 4).
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no memory for it.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        bytes: u64,
        usage: vk::BufferUsageFlags,
        place: Place,
    ) -> Result<Self, Fault> {
        let bytes = bytes.max(4);
        let info = vk::BufferCreateInfo::default().size(bytes).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive; the size is not 0.
        let raw =
            unsafe { gpu.raw.create_buffer(&info, None) }.map_err(|e| gpu.fault(&format!("buffer \"{name}\""), e))?;
        let mut buffer = Self { gpu: gpu.clone(), raw, bytes, memory: None };
        // SAFETY: just made from this device.
        let requirements = unsafe { gpu.raw.get_buffer_memory_requirements(raw) };
        let location = match place {
            Place::Device => MemoryLocation::GpuOnly,
            Place::Upload => MemoryLocation::CpuToGpu,
            Place::Readback => MemoryLocation::GpuToCpu,
        };
        let memory = allocate(gpu, name, requirements, location, true)?;
        // SAFETY: the memory meets the buffer's requirements and is bound once.
        let bound = unsafe { gpu.raw.bind_buffer_memory(raw, memory.memory(), memory.offset()) };
        buffer.memory = Some(memory);
        bound.map_err(|e| gpu.fault(&format!("memory of buffer \"{name}\""), e))?;
        Ok(buffer)
    }

    /// The bytes as the host sees them (host-coherent memory); empty for a buffer in device memory.
    pub(crate) fn mapped(&self) -> &[u8] {
        let all = self.memory.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default();
        &all[..all.len().min(self.bytes as usize)]
    }

    /// The same, to write to.
    pub(crate) fn mapped_mut(&mut self) -> &mut [u8] {
        let all = self.memory.as_mut().and_then(Allocation::mapped_slice_mut).unwrap_or_default();
        let n = all.len().min(self.bytes as usize);
        &mut all[..n]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: the backend waits for every submission, so the device no longer uses it; destroyed once.
        unsafe { self.gpu.raw.destroy_buffer(self.raw, None) };
        free(&self.gpu, self.memory.take());
    }
}

/// An image with its memory and one view of all of it.
pub(crate) struct Image {
    gpu: Arc<Gpu>,
    pub(crate) raw: vk::Image,
    pub(crate) view: vk::ImageView,
    pub(crate) aspect: vk::ImageAspectFlags,
    pub(crate) layers: u32,
    /// Bytes of its memory on the device.
    pub(crate) bytes: u64,
    memory: Option<Allocation>,
}

/// What an image is to be.
pub(crate) struct ImageShape {
    pub(crate) format: vk::Format,
    pub(crate) size: [u32; 2],
    pub(crate) layers: u32,
    /// Whether its view is an array even with one layer.
    pub(crate) array: bool,
    pub(crate) usage: vk::ImageUsageFlags,
}

impl Image {
    /// Makes an image of one mip level.
    ///
    /// # Errors
    /// [`Fault::Refused`] where the device has no images as large, [`Fault::Device`] where there is no memory for it.
    pub(crate) fn new(gpu: &Arc<Gpu>, name: &str, shape: &ImageShape) -> Result<Self, Fault> {
        let [w, h] = shape.size;
        let (most, most_layers) = (gpu.caps.limits.max_image_dimension2_d, gpu.caps.limits.max_image_array_layers);
        if w == 0 || h == 0 || w > most || h > most || shape.layers == 0 || shape.layers > most_layers {
            return Err(Fault::Refused(format!(
                "image \"{name}\" of {w} x {h}, {} layers: {} takes 1 to {most} pixels and 1 to {most_layers} layers",
                shape.layers, gpu.caps.name
            )));
        }
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(shape.format)
            .extent(vk::Extent3D { width: w, height: h, depth: 1 })
            .mip_levels(1)
            .array_layers(shape.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(shape.usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        let failed = |e: vk::Result| gpu.fault(&format!("image \"{name}\" of {w} x {h}"), e);
        // SAFETY: the device is alive; sizes and layers are within its limits.
        let raw = unsafe { gpu.raw.create_image(&info, None) }.map_err(failed)?;
        let aspect = match shape.format {
            vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            _ => vk::ImageAspectFlags::COLOR,
        };
        let view = vk::ImageView::null();
        let mut image = Self { gpu: gpu.clone(), raw, view, aspect, layers: shape.layers, bytes: 0, memory: None };
        // SAFETY: just made from this device.
        let requirements = unsafe { gpu.raw.get_image_memory_requirements(raw) };
        let memory = allocate(gpu, name, requirements, MemoryLocation::GpuOnly, false)?;
        image.bytes = memory.size();
        // SAFETY: the memory meets the image's requirements and is bound once.
        let bound = unsafe { gpu.raw.bind_image_memory(raw, memory.memory(), memory.offset()) };
        image.memory = Some(memory);
        bound.map_err(failed)?;
        let kind = if shape.array { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D };
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(kind)
            .format(shape.format)
            .subresource_range(image.range());
        // SAFETY: the image is bound and its range is all of it.
        image.view = unsafe { gpu.raw.create_image_view(&info, None) }.map_err(failed)?;
        Ok(image)
    }

    /// All of it.
    pub(crate) fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange::default().aspect_mask(self.aspect).level_count(1).layer_count(self.layers)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: the backend waits for every submission, so the device no longer uses them; destroyed once (a null view
        // is allowed).
        unsafe {
            self.gpu.raw.destroy_image_view(self.view, None);
            self.gpu.raw.destroy_image(self.raw, None);
        }
        free(&self.gpu, self.memory.take());
    }
}

fn allocate(
    gpu: &Gpu,
    name: &str,
    requirements: vk::MemoryRequirements,
    location: MemoryLocation,
    linear: bool,
) -> Result<Allocation, Fault> {
    let scheme = AllocationScheme::GpuAllocatorManaged;
    let desc = AllocationCreateDesc { name, requirements, location, linear, allocation_scheme: scheme };
    gpu.allocator()
        .allocate(&desc)
        .map_err(|e| gpu.fault(&format!("{} bytes of memory for \"{name}\"", requirements.size), e))
}

fn free(gpu: &Gpu, memory: Option<Allocation>) {
    if let Some(memory) = memory {
        // Freeing fails only for memory of another allocator, which none of this module's is.
        let freed = gpu.allocator().free(memory);
        debug_assert!(freed.is_ok());
    }
}
