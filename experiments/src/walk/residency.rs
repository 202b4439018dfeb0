//! What is on the device, under a budget of bytes.
//!
//! Two askers: the pipeline's scheduler fetches and evicts what the far field wants; the harness needs the near chunks of each
//! frame. The harness's chunks make way, least recently used first; the scheduler's blocks are its own affair. What does not
//! fit is not loaded, and whoever draws counts it as missing. Without a budget everything that is asked for stays.

use std::collections::BTreeMap;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData};
use farfield_core::id::Block;
use farfield_core::payload::Payload;
use farfield_core::scene::Scene;

/// A backend with its blocks. Chunks may stay on the device when a pipeline ends, for the next one.
pub struct Device {
    /// The backend.
    pub backend: Box<dyn Backend>,
    /// Blocks on the device.
    on_device: BTreeMap<Block, u64>,
}

/// Gets a payload from wherever it is stored.
pub(super) type Fetch<'a> = dyn Fn(Block) -> Result<Payload, Fault> + 'a;

impl Device {
    /// A backend with nothing uploaded.
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self { backend, on_device: BTreeMap::new() }
    }

    /// Makes a block drawable and returns its bytes on the device.
    ///
    /// # Errors
    /// What reading it or the device gives.
    pub fn load(&mut self, block: Block, scene: &Scene, fetch: &Fetch<'_>) -> Result<u64, Fault> {
        if let Some(&bytes) = self.on_device.get(&block) {
            return Ok(bytes);
        }
        let bytes = match block {
            Block::Chunk(id) => {
                let mut done = Ok(0);
                scene.geometry.with(id, &mut |c| done = self.backend.upload(block, &BlockData::Chunk(c)))?;
                done?
            }
            Block::Payload(_) => self.backend.upload(block, &BlockData::Payload(&fetch(block)?))?,
        };
        self.on_device.insert(block, bytes);
        Ok(bytes)
    }

    /// Frees a block.
    pub fn free(&mut self, block: Block) {
        if self.on_device.remove(&block).is_some() {
            self.backend.release(block);
        }
    }

    /// Frees all payloads: the next pipeline has its own.
    pub fn free_payloads(&mut self) {
        let payloads: Vec<Block> = self.on_device.keys().copied().filter(|b| matches!(b, Block::Payload(_))).collect();
        payloads.into_iter().for_each(|b| self.free(b));
    }
}

/// A block that counts against the budget.
#[derive(Clone, Copy, Debug)]
struct Held {
    bytes: u64,
    texture_bytes: u64,
    used: u64,
    by_scheduler: bool,
}

/// What one pipeline holds on a device.
#[derive(Debug, Default)]
pub struct Residency {
    held: BTreeMap<Block, Held>,
    /// Sum of the held blocks' bytes.
    pub bytes: u64,
    /// Sum of the held blocks' texels, bytes.
    pub texture_bytes: u64,
    budget: Option<u64>,
    clock: u64,
}

impl Residency {
    /// Nothing held yet.
    pub fn new(budget_bytes: Option<u64>) -> Self {
        Self { budget: budget_bytes, ..Self::default() }
    }

    /// Whether a block is held.
    pub fn has(&self, block: Block) -> bool {
        self.held.contains_key(&block)
    }

    /// What the scheduler may hold: the budget but for what this frame's near chunks take.
    pub fn left_for_scheduler(&self) -> u64 {
        let near: u64 = self.held.values().filter(|h| !h.by_scheduler && h.used == self.clock).map(|h| h.bytes).sum();
        self.budget.map_or(u64::MAX, |b| b.saturating_sub(near))
    }

    /// A new frame begins: chunks not needed in it make way.
    pub fn tick(&mut self) {
        self.clock += 1;
    }

    /// Holds a block if it fits; says whether it is held. `texture_bytes` are those of its texels.
    ///
    /// # Errors
    /// What loading gives.
    pub fn hold(
        &mut self,
        device: &mut Device,
        block: Block,
        by_scheduler: bool,
        texture_bytes: u64,
        scene: &Scene,
        fetch: &Fetch<'_>,
    ) -> Result<bool, Fault> {
        if let Some(h) = self.held.get_mut(&block) {
            h.used = self.clock;
            h.by_scheduler |= by_scheduler;
            return Ok(true);
        }
        let bytes = device.load(block, scene, fetch)?;
        while self.budget.is_some_and(|b| self.bytes + bytes > b) {
            let old = self.held.iter().filter(|(_, h)| !h.by_scheduler && h.used < self.clock);
            match old.min_by_key(|(_, h)| h.used).map(|(&b, _)| b) {
                Some(b) => self.release(device, b),
                None => {
                    device.free(block);
                    return Ok(false);
                }
            }
        }
        self.held.insert(block, Held { bytes, texture_bytes, used: self.clock, by_scheduler });
        self.bytes += bytes;
        self.texture_bytes += texture_bytes;
        Ok(true)
    }

    /// Lets a block go.
    pub fn release(&mut self, device: &mut Device, block: Block) {
        if let Some(h) = self.held.remove(&block) {
            self.bytes -= h.bytes;
            self.texture_bytes -= h.texture_bytes;
            device.free(block);
        }
    }
}
