//! Blocks on the device: pages of vertices, indices, projectors, samples, points and lines, and atlases. Where things lie is decided by the shared
//! [`Residency`]; here are the buffers.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_core::backend::BlockData;
use farfield_core::id::{Block, PayloadRef};
use farfield_core::payload::Part;
use farfield_shaders::pool::{PageId, PageSizes, Stream};
use farfield_shaders::residency::{Placement, Residency};

use crate::gpu::Gpu;
use crate::memory::{Buffer, Place};
use crate::staging::Staging;
use crate::submit::Submitter;
use crate::textures::Atlas;

/// What is resident.
pub(crate) struct Blocks {
    gpu: Arc<Gpu>,
    pub(crate) residency: Residency,
    pages: BTreeMap<PageId, Buffer>,
    atlases: HashMap<PayloadRef, Atlas>,
    pub(crate) staging: Staging,
}

impl Blocks {
    /// Nothing is.
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Result<Self, Fault> {
        let sizes = PageSizes::for_device(gpu.caps.max_buffer);
        let storage = u64::from(gpu.caps.limits.max_storage_buffer_range);
        Ok(Self {
            gpu: gpu.clone(),
            residency: Residency::new(sizes, storage),
            pages: BTreeMap::new(),
            atlases: HashMap::new(),
            staging: Staging::new(gpu)?,
        })
    }

    /// As [`farfield_core::backend::Backend::upload`].
    pub(crate) fn upload(&mut self, by: &mut Submitter, block: Block, data: &BlockData<'_>) -> Result<u64, Fault> {
        let placed = self.residency.place(block, data).and_then(|placement| {
            self.make_pages(block, &placement)?;
            self.write(by, block, data, &placement).inspect_err(|_| {
                self.residency.release(block);
            })?;
            Ok(placement.bytes)
        });
        // Texels go with their payload, also where replacing it failed.
        if let Block::Payload(id) = block
            && self.residency.payload_slot(id).is_none()
        {
            self.atlases.remove(&id);
        }
        placed
    }

    fn make_pages(&mut self, block: Block, placement: &Placement) -> Result<(), Fault> {
        for (made, &(page, bytes)) in placement.pages.iter().enumerate() {
            let usage = match page.stream {
                Stream::ChunkVertices | Stream::MeshVertices | Stream::ProjectedVertices => {
                    vk::BufferUsageFlags::VERTEX_BUFFER
                }
                Stream::Indices => vk::BufferUsageFlags::INDEX_BUFFER,
                Stream::Projectors | Stream::Samples | Stream::Points | Stream::Lines => {
                    vk::BufferUsageFlags::STORAGE_BUFFER
                }
            };
            let usage = usage | vk::BufferUsageFlags::TRANSFER_DST;
            let name = format!("{:?} page {}", page.stream, page.index);
            match Buffer::new(&self.gpu, &name, bytes, usage, Place::Device) {
                Ok(buffer) => self.pages.insert(page, buffer),
                Err(fault) => {
                    self.residency.undo(block, placement, made);
                    return Err(fault);
                }
            };
        }
        Ok(())
    }

    fn write(
        &mut self,
        by: &mut Submitter,
        block: Block,
        data: &BlockData<'_>,
        placement: &Placement,
    ) -> Result<(), Fault> {
        for (page, offset, bytes) in &placement.writes {
            if let Some(buffer) = self.pages.get(page) {
                self.staging.write(by, buffer.raw, *offset, bytes)?;
            }
        }
        if let (Block::Payload(id), BlockData::Payload(payload)) = (block, data) {
            self.atlases.remove(&id);
            if let (true, Some(Part::Atlas(part))) = (placement.atlas, payload.parts.first()) {
                self.atlases.insert(id, Atlas::new(&self.gpu, &mut self.staging, by, part)?);
            }
        }
        Ok(())
    }

    /// As [`farfield_core::backend::Backend::release`].
    pub(crate) fn release(&mut self, block: Block) {
        self.residency.release(block);
        if let Block::Payload(id) = block {
            self.atlases.remove(&id);
        }
    }

    /// The buffer of a page; none where nothing was ever put on it.
    pub(crate) fn page(&self, stream: Stream, index: u32) -> Option<&Buffer> {
        self.pages.get(&PageId { stream, index })
    }

    /// The texels of a payload whose first part is an atlas.
    pub(crate) fn atlas(&self, id: PayloadRef) -> Option<&Atlas> {
        self.atlases.get(&id)
    }
}
