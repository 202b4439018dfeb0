//! Reading back: planes into one mappable buffer, many captures at a time.

use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::TargetId;
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::{Aabb, Fault};
use farfield_shaders::plan::{Work, plan};
use farfield_shaders::readback::{self, Plane};

use crate::WgpuBackend;
use crate::device::Gpu;
use crate::targets::Surface;

/// Bytes of planes that captures collect before they are read back.
const STAGING_BYTES: u64 = 64 << 20;

/// Capture targets come in sizes of this many pixels, so that shots of like size share one.
const SIZE_CLASS_PX: u32 = 64;

/// From row to row of a plane `width` pixels wide, bytes.
fn row_bytes(width: u32) -> u64 {
    (4 * u64::from(width)).next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT))
}

fn plane_bytes(size: [u32; 2]) -> u64 {
    row_bytes(size[0]) * u64::from(size[1])
}

/// How many of the shots, at least one, fit in one reading back.
pub(crate) fn batch(shots: &[Shot]) -> usize {
    let mut bytes = 0;
    let fits = shots.iter().take_while(|s| {
        bytes += 4 * plane_bytes(s.camera.size);
        bytes <= STAGING_BYTES
    });
    fits.count().max(1)
}

/// Copies the top left of a texture.
fn copy(encoder: &mut wgpu::CommandEncoder, from: &wgpu::Texture, size: [u32; 2], to: &wgpu::Buffer, offset: u64) {
    encoder.copy_texture_to_buffer(
        from.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: to,
            layout: wgpu::TexelCopyBufferLayout {
                offset,
                bytes_per_row: Some(row_bytes(size[0]) as u32),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
    );
}

fn copy_planes(encoder: &mut wgpu::CommandEncoder, from: &Surface, size: [u32; 2], to: &wgpu::Buffer, offset: u64) {
    for (i, plane) in from.planes.iter().enumerate() {
        copy(encoder, plane, size, to, offset + i as u64 * plane_bytes(size));
    }
}

/// The image whose four planes start at `bytes`.
fn image(size: [u32; 2], bytes: &[u8]) -> SurfaceImage {
    let plane = |i: usize| {
        let len = plane_bytes(size) as usize;
        Plane { bytes: &bytes[i * len..][..len], row_bytes: row_bytes(size[0]) as usize }
    };
    readback::surface(size, plane(0), plane(1), plane(2), plane(3))
}

fn staging(gpu: &Gpu, bytes: u64) -> Result<wgpu::Buffer, Fault> {
    gpu.buffer("read", bytes, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ)
}

/// The planes of a surface target.
pub(crate) fn surface(gpu: &Gpu, from: &Surface, size: [u32; 2]) -> Result<SurfaceImage, Fault> {
    let bytes = 4 * plane_bytes(size);
    let to = staging(gpu, bytes)?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    copy_planes(&mut encoder, from, size, &to, 0);
    gpu.queue.submit([encoder.finish()]);
    gpu.read(&to, bytes, |b| image(size, b))
}

/// A picture.
pub(crate) fn picture(gpu: &Gpu, from: &wgpu::Texture, size: [u32; 2]) -> Result<Picture, Fault> {
    let to = staging(gpu, plane_bytes(size))?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    copy(&mut encoder, from, size, &to, 0);
    gpu.queue.submit([encoder.finish()]);
    gpu.read(&to, plane_bytes(size), |bytes| {
        readback::picture(size, Plane { bytes, row_bytes: row_bytes(size[0]) as usize })
    })
}

impl WgpuBackend {
    /// Renders the shots one after the other into shared targets, copying each away, and reads them back at once.
    pub(crate) fn shoot(&mut self, shots: &[Shot], out: &mut Vec<SurfaceImage>) -> Result<(), Fault> {
        let pass = |s: &Shot| Pass {
            kind: PassKind::Surface,
            camera: s.camera,
            writes: TargetId(0),
            draws: vec![Draw { what: DrawWhat::Chunks(s.chunks.clone()), bounds: Aabb::EMPTY, error_px: 0.0 }],
        };
        let list = DrawList { passes: shots.iter().map(pass).collect() };
        let plan = plan(&list, &self.table, &self.residency, &self.written, self.limits())?;
        self.prepare(&plan)?;
        let bytes = plan.passes.iter().map(|p| 4 * plane_bytes(p.size)).sum();
        let to = staging(&self.gpu, bytes)?;
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut offset = 0;
        for pass in &plan.passes {
            let most = self.gpu.limits.max_texture_dimension_2d;
            let class = pass.size.map(|s| s.next_multiple_of(SIZE_CLASS_PX).min(most));
            let (gpu, pipelines) = (&self.gpu, &self.pipelines);
            self.scratch.make(TargetId(0), class, || Surface::new(gpu, pipelines, class))?;
            if let (Work::Surface(batches), Some(target)) = (&pass.work, self.scratch.get(TargetId(0), class)) {
                self.surface_pass(&mut encoder, &plan, pass, batches, target, None);
                copy_planes(&mut encoder, target, pass.size, &to, offset);
            }
            offset += 4 * plane_bytes(pass.size);
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.on_the_way_bytes = 0;
        self.gpu.read(&to, bytes, |b| {
            let mut at = 0;
            for p in &plan.passes {
                out.push(image(p.size, &b[at..]));
                at += 4 * plane_bytes(p.size) as usize;
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Camera;
    use farfield_core::scene::ChunkSet;
    use glam::{DVec3, Vec3};

    fn shots(sizes: &[[u32; 2]]) -> Vec<Shot> {
        let shot = |&size| Shot {
            chunks: ChunkSet::default(),
            camera: Camera::looking(DVec3::ZERO, Vec3::X, Vec3::Y, 1.0, size, 0.1),
        };
        sizes.iter().map(shot).collect()
    }

    #[test]
    fn batches_fill_the_staging_memory_and_never_stall() {
        // 1024 x 1024 x 4 planes x 4 bytes are 16 MiB: four fill 64 MiB.
        assert_eq!(batch(&shots(&[[1024, 1024]; 9])), 4);
        // Rows of one pixel take 256 bytes.
        assert_eq!(plane_bytes([1, 10]), 2560);
        assert_eq!(batch(&shots(&[[8192, 8192], [1, 1]])), 1, "one too large goes alone");
        assert_eq!(batch(&shots(&[[64, 64]; 5])), 5);
    }
}
