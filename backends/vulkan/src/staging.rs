//! Uploads: bytes are gathered in a host buffer and copied in one submission when it is full or a frame needs them.

use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;

use crate::gpu::Gpu;
use crate::memory::{Buffer, Image, Place};
use crate::record::Use;
use crate::submit::Submitter;

/// Bytes gathered before a submission: large against the cost of one, small against a scene.
const STAGING_BYTES: u64 = 16 << 20;

/// The host buffer and the copies that wait in it.
pub(crate) struct Staging {
    host: Buffer,
    used: u64,
    pending: Vec<(vk::Buffer, vk::BufferCopy)>,
}

impl Staging {
    /// An empty one.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        let host = Buffer::new(gpu, "staging", STAGING_BYTES, vk::BufferUsageFlags::TRANSFER_SRC, Place::Upload)?;
        Ok(Self { host, used: 0, pending: vec![] })
    }

    /// Queues `bytes` (a multiple of 4) for `to` at `offset`.
    ///
    /// # Errors
    /// What a submission gives, where one was needed to make room.
    pub(crate) fn write(&mut self, by: &mut Submitter, to: vk::Buffer, offset: u64, bytes: &[u8]) -> Result<(), Fault> {
        let end = offset + bytes.len() as u64;
        let overlaps =
            |(b, c): &(vk::Buffer, vk::BufferCopy)| *b == to && c.dst_offset < end && offset < c.dst_offset + c.size;
        if self.pending.iter().any(overlaps) {
            self.flush(by)?;
        }
        let (mut at, mut rest) = (offset, bytes);
        while !rest.is_empty() {
            if self.used == STAGING_BYTES {
                self.flush(by)?;
            }
            let n = rest.len().min((STAGING_BYTES - self.used) as usize);
            self.host.mapped_mut()[self.used as usize..][..n].copy_from_slice(&rest[..n]);
            let copy = vk::BufferCopy { src_offset: self.used, dst_offset: at, size: n as u64 };
            self.pending.push((to, copy));
            (at, rest) = (at + n as u64, &rest[n..]);
            // Whole multiples of 4, so that every copy starts aligned.
            self.used += (n as u64).next_multiple_of(4);
        }
        Ok(())
    }

    /// Carries out what waits, and makes it visible to draws.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn flush(&mut self, by: &mut Submitter) -> Result<(), Fault> {
        if !self.pending.is_empty() {
            by.run(|record| {
                // Ranges that earlier frames read are free to be written: every frame was waited for.
                for run in self.pending.chunk_by(|a, b| a.0 == b.0) {
                    let regions: Vec<_> = run.iter().map(|(_, c)| *c).collect();
                    record.copy(&self.host, run[0].0, &regions);
                }
                record.memory(Use::COPY_TO, Use::DRAWN);
                Ok(())
            })?;
            self.pending.clear();
        }
        self.used = 0;
        Ok(())
    }

    /// Fills an image of 4-byte texels, layer by layer, rows from the top, and makes it ready for sampling. Done when it
    /// returns.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn fill(&mut self, by: &mut Submitter, to: &Image, size: [u32; 2], texels: &[u8]) -> Result<(), Fault> {
        self.flush(by)?;
        let row = 4 * size[0] as usize;
        let rows_at_once = (STAGING_BYTES as usize / row).max(1) as u32;
        let mut fresh = true;
        for (layer, texels) in texels.chunks_exact(row * size[1] as usize).enumerate() {
            let mut first = 0;
            while first < size[1] {
                let last = (first + rows_at_once).min(size[1]);
                let bytes = &texels[first as usize * row..last as usize * row];
                self.host.mapped_mut()[..bytes.len()].copy_from_slice(bytes);
                by.run(|record| {
                    if fresh {
                        record.images(&[(to, Use::DISCARD, Use::COPY_TO)]);
                    }
                    record.copy_rows(&self.host, 0, to, layer as u32, size[0], [first, last]);
                    Ok(())
                })?;
                (fresh, first) = (false, last);
            }
        }
        by.run(|record| {
            record.images(&[(to, if fresh { Use::DISCARD } else { Use::COPY_TO }, Use::SAMPLED)]);
            Ok(())
        })
    }
}
