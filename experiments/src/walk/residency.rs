//! What is held of a scene's blocks, under one limit of bytes.
//!
//! The limit counts what is on the device, what was read and waits to be uploaded, what is being read and what is being uploaded, payloads
//! and original chunks alike. What a block will take is known before it is read ([`Cost`]), and nothing is read or uploaded that has no
//! room: the limit is never exceeded, whoever asks.
//!
//! Two askers: the pipeline's scheduler fetches and evicts what the far field wants; the harness needs the near chunks of each
//! frame. The harness's chunks make way, least recently used first; the scheduler's blocks are its own affair. What does not
//! fit is not loaded, and whoever draws counts it as missing. Without a limit everything that is asked for stays.

use std::collections::BTreeMap;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData};
use farfield_core::id::Block;
use farfield_core::mesh::ChunkMesh;
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

    /// Makes a block drawable that was read already, and waits until nothing of it is on its way where `settle`; its bytes on the device.
    fn upload(&mut self, block: Block, data: &BlockData<'_>, settle: bool) -> Result<u64, Fault> {
        let bytes = match self.on_device.get(&block) {
            Some(&bytes) => bytes,
            None => self.backend.upload(block, data)?,
        };
        self.on_device.insert(block, bytes);
        if settle {
            self.backend.settle()?;
        }
        Ok(bytes)
    }

    /// Bytes of all blocks on the device.
    pub fn bytes(&self) -> u64 {
        self.on_device.values().sum()
    }

    /// Frees everything.
    pub fn free_all(&mut self) {
        let all: Vec<Block> = self.on_device.keys().copied().collect();
        all.into_iter().for_each(|b| self.free(b));
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

/// What was read of a block.
pub(super) enum Read {
    /// A chunk.
    Chunk(ChunkMesh),
    /// A payload.
    Payload(Payload),
}

/// What a block takes at each step, bytes; known before it is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// While it is read: its file's bytes, what they unpack to, and the block itself. 0 where nothing is read.
    pub read_bytes: u64,
    /// Read and not uploaded yet.
    pub host_bytes: u64,
    /// On the device.
    pub resident_bytes: u64,
    /// More while it is uploaded.
    pub passing_bytes: u64,
}

impl Cost {
    /// The most that it ever takes at once.
    pub fn most_bytes(&self) -> u64 {
        self.read_bytes.max(self.host_bytes + self.resident_bytes + self.passing_bytes)
    }

    /// What has to be free beside its place on the device, so that it can come.
    pub fn headroom_bytes(&self) -> u64 {
        self.most_bytes() - self.resident_bytes
    }
}

/// A block that is on the device.
#[derive(Clone, Copy, Debug)]
struct Held {
    bytes: u64,
    texture_bytes: u64,
    used: u64,
    by_scheduler: bool,
}

/// A block that was read and waits for the next frame.
struct Waiting {
    block: Block,
    read: Read,
    cost: Cost,
    texture_bytes: u64,
    by_scheduler: bool,
}

/// Everything that one pipeline holds of blocks, under one limit: on the device, read and waiting, being read, being uploaded.
#[derive(Default)]
pub struct Residency {
    held: BTreeMap<Block, Held>,
    waiting: Vec<Waiting>,
    /// Sum of the held blocks' bytes.
    pub bytes: u64,
    /// Sum of the held blocks' texels, bytes.
    pub texture_bytes: u64,
    /// The most bytes held, waiting with the place kept for them, read and uploaded at any moment so far.
    pub peak_bytes: u64,
    /// What a waiting block takes, and what will on the device.
    waiting_bytes: u64,
    limit: Option<u64>,
    clock: u64,
}

impl Residency {
    /// Nothing held yet.
    pub fn new(limit_bytes: Option<u64>) -> Self {
        Self { limit: limit_bytes, ..Self::default() }
    }

    /// Whether a block is on the device.
    pub fn has(&self, block: Block) -> bool {
        self.held.contains_key(&block)
    }

    /// What a block takes on the device, where it is there.
    pub(super) fn bytes_of(&self, block: Block) -> Option<u64> {
        self.held.get(&block).map(|h| h.bytes)
    }

    /// A new frame begins: chunks not needed in it make way.
    pub(super) fn tick(&mut self) {
        self.clock += 1;
    }

    /// Keeps a block that is there for this frame; says whether it is there.
    pub(super) fn touch(&mut self, block: Block, by_scheduler: bool) -> bool {
        self.held.get_mut(&block).is_some_and(|h| {
            (h.used, h.by_scheduler) = (self.clock, h.by_scheduler || by_scheduler);
            true
        })
    }

    /// Makes room for `bytes` beside all that is held and waits: chunks that this frame does not need go, the least recently used
    /// first; says whether there is room now. Counts `bytes` as taken for the moment.
    fn take(&mut self, device: &mut Device, bytes: u64) -> bool {
        while self.limit.is_some_and(|l| self.bytes + self.waiting_bytes + bytes > l) {
            let old = self.held.iter().filter(|(_, h)| !h.by_scheduler && h.used < self.clock);
            match old.min_by_key(|(_, h)| h.used).map(|(&b, _)| b) {
                Some(b) => self.release(device, b),
                None => return false,
            }
        }
        self.peak_bytes = self.peak_bytes.max(self.bytes + self.waiting_bytes + bytes);
        true
    }

    /// Reads a block, where there is room for it, to wait for [`Residency::arrive`]; says whether there was.
    ///
    /// # Errors
    /// What `read` gives.
    pub(super) fn read(
        &mut self,
        device: &mut Device,
        block: Block,
        cost: Cost,
        (by_scheduler, texture_bytes): (bool, u64),
        read: impl FnOnce() -> Result<Read, Fault>,
    ) -> Result<bool, Fault> {
        // Those that wait are uploaded one by one, with this one beside them.
        let passing = self.waiting.iter().map(|w| w.cost.passing_bytes).fold(cost.passing_bytes, u64::max);
        if !self.take(device, cost.read_bytes.max(cost.host_bytes + cost.resident_bytes + passing)) {
            return Ok(false);
        }
        self.waiting.push(Waiting { block, read: read()?, cost, texture_bytes, by_scheduler });
        self.waiting_bytes += cost.host_bytes + cost.resident_bytes;
        Ok(true)
    }

    /// Whether anything was read that is not uploaded yet.
    pub(super) fn waits(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Uploads what waits; the bytes of the scheduler's, and the blocks that turned out to be no sound ones.
    ///
    /// # Errors
    /// What the device gives.
    pub(super) fn arrive(&mut self, device: &mut Device) -> Result<(u64, Vec<(Block, Fault)>), Fault> {
        let (mut uploaded, mut bad) = (0, vec![]);
        for w in std::mem::take(&mut self.waiting) {
            let data = match &w.read {
                Read::Chunk(c) => BlockData::Chunk(c),
                Read::Payload(p) => BlockData::Payload(p),
            };
            let place = w.cost.host_bytes + w.cost.resident_bytes;
            let there = self.take(device, w.cost.passing_bytes);
            debug_assert!(there, "`read` has seen to it");
            self.waiting_bytes -= place;
            match device.upload(w.block, &data, self.limit.is_some()) {
                Ok(bytes) => {
                    self.hold(w.block, bytes, w.texture_bytes, w.by_scheduler);
                    uploaded += if w.by_scheduler { w.cost.resident_bytes } else { 0 };
                }
                Err(fault @ (Fault::Data { .. } | Fault::Refused(_))) => bad.push((w.block, fault)),
                Err(fault) => return Err(fault),
            }
        }
        Ok((uploaded, bad))
    }

    /// Uploads a chunk that lies in memory, where there is room for it; says whether there was.
    ///
    /// # Errors
    /// What the geometry or the device gives.
    pub(super) fn upload_chunk(
        &mut self,
        device: &mut Device,
        block: Block,
        cost: Cost,
        by_scheduler: bool,
        scene: &Scene,
    ) -> Result<bool, Fault> {
        if !self.take(device, cost.most_bytes()) {
            return Ok(false);
        }
        let none = |b: Block| Err(Fault::Refused(format!("{b:?} is no chunk")));
        let bytes = device.load(block, scene, &none)?;
        if self.limit.is_some() {
            device.backend.settle()?;
        }
        self.hold(block, bytes, 0, by_scheduler);
        Ok(true)
    }

    fn hold(&mut self, block: Block, bytes: u64, texture_bytes: u64, by_scheduler: bool) {
        self.held.insert(block, Held { bytes, texture_bytes, used: self.clock, by_scheduler });
        self.bytes += bytes;
        self.texture_bytes += texture_bytes;
        self.peak_bytes = self.peak_bytes.max(self.bytes + self.waiting_bytes);
    }

    /// Lets a block go.
    pub(super) fn release(&mut self, device: &mut Device, block: Block) {
        if let Some(h) = self.held.remove(&block) {
            self.bytes -= h.bytes;
            self.texture_bytes -= h.texture_bytes;
            device.free(block);
        }
    }
}
