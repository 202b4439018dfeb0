//! Reading back: images to a host buffer that grows, bytes to pictures.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_core::image::{Picture, SurfaceImage};
use farfield_shaders::readback::{Plane, picture, surface};

use crate::gpu::Gpu;
use crate::memory::{Buffer, Place};
use crate::record::{Recorder, Use};
use crate::submit::Submitter;
use crate::targets::{Shaded, Surface};

/// The host buffer.
pub(crate) struct Readback {
    gpu: Arc<Gpu>,
    buffer: Option<Buffer>,
}

/// Bytes that a surface of `size` takes, read back.
pub(crate) fn surface_bytes(size: [u32; 2]) -> u64 {
    4 * plane_bytes(size)
}

fn plane_bytes(size: [u32; 2]) -> u64 {
    4 * u64::from(size[0]) * u64::from(size[1])
}

impl Readback {
    /// An empty one.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        Self { gpu: gpu.clone(), buffer: None }
    }

    /// The buffer, with room for `bytes`.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no memory for it.
    pub(crate) fn room(&mut self, bytes: u64) -> Result<&Buffer, Fault> {
        let large_enough = self.buffer.take().filter(|b| b.bytes >= bytes);
        let buffer = match large_enough {
            Some(buffer) => buffer,
            None => Buffer::new(&self.gpu, "readback", bytes, vk::BufferUsageFlags::TRANSFER_DST, Place::Readback)?,
        };
        Ok(self.buffer.insert(buffer))
    }

    /// The planes of a surface.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn surface(&mut self, by: &mut Submitter, from: &Surface) -> Result<SurfaceImage, Fault> {
        let buffer = self.room(surface_bytes(from.size))?;
        by.run(|record| {
            copy_surface(record, from, buffer, 0);
            record.memory(Use::COPY_TO, Use::HOST);
            Ok(())
        })?;
        Ok(surface_at(buffer, from.size, 0))
    }

    /// A picture.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn picture(&mut self, by: &mut Submitter, from: &Shaded) -> Result<Picture, Fault> {
        let bytes = plane_bytes(from.size);
        let buffer = self.room(bytes)?;
        by.run(|record| {
            record.read(&from.image, from.size, buffer, 0);
            record.memory(Use::COPY_TO, Use::HOST);
            Ok(())
        })?;
        let bytes = &buffer.mapped()[..bytes as usize];
        Ok(picture(from.size, Plane { bytes, row_bytes: 4 * from.size[0] as usize }))
    }
}

/// Records the copy of a surface's planes to `buffer`, one after the other from `offset`.
pub(crate) fn copy_surface(record: &Recorder<'_>, from: &Surface, buffer: &Buffer, offset: u64) {
    record.images(&from.planes.each_ref().map(|p| (p, Use::SAMPLED, Use::COPY_FROM)));
    for (plane, i) in from.planes.iter().zip(0..) {
        record.read(plane, from.size, buffer, offset + i * plane_bytes(from.size));
    }
    record.images(&from.planes.each_ref().map(|p| (p, Use::COPY_FROM, Use::SAMPLED)));
}

/// The surface that [`copy_surface`] put at `offset`.
pub(crate) fn surface_at(buffer: &Buffer, size: [u32; 2], offset: u64) -> SurfaceImage {
    let bytes = plane_bytes(size) as usize;
    let row_bytes = 4 * size[0] as usize;
    let plane = |i: usize| Plane { bytes: &buffer.mapped()[offset as usize + i * bytes..][..bytes], row_bytes };
    surface(size, plane(0), plane(1), plane(2), plane(3))
}
