//! What a frame asks for, and how it comes: planned, read, uploaded, all under the limit of [`Residency`].
//!
//! Without a limit all that a frame asks for is there when it is drawn. Under a limit no frame waits for a disk: a frame draws what
//! has come, and what it asks for is read when it is drawn, to be uploaded before the next one. Only the first frame has all that
//! it asks for: a walk starts when that is there.

use std::cell::RefCell;
use std::collections::BTreeSet;

use farfield_core::backend::Backend;
use farfield_core::extent::Extent;
use farfield_core::id::{Block, CellId};
use farfield_core::scene::Scene;
use farfield_core::strategy::Motion;
use farfield_core::{Camera, Fault};

use super::Walker;
use super::opened::{Opened, Wants};
use super::residency::{Cost, Read};
use super::trouble::named;

/// A block that a frame asks for, and whether the scheduler does.
pub(super) type Asked = (Block, bool);

/// What a block takes at each step; `None` where nothing is known of it.
pub fn cost(opened: &Opened<'_>, scene: &Scene, backend: &dyn Backend, block: Block) -> Option<Cost> {
    let (extent, read_bytes, host_bytes) = match block {
        Block::Payload(_) => {
            let s = opened.stored(block)?;
            // The file and what it unpacks to; then that, the coded parts in it, the payload, and at most twice as much while its
            // arrays grow and are decoded; the places of samples while they are put in order.
            let host = s.extent.host_bytes();
            let decoding = 2 * s.raw_bytes + 3 * host + 48 * s.extent.samples;
            (s.extent, (s.bytes + s.raw_bytes).max(decoding), host)
        }
        Block::Chunk(id) => {
            let extent = Extent::of_chunk(scene.meshes.get(id.mesh.index())?.chunks.get(id.chunk as usize)?);
            // What is in memory is read from nowhere.
            let (read, host) = (scene.geometry.read_bytes(id), extent.host_bytes());
            (extent, if read > 0 { read + host } else { 0 }, if read > 0 { host } else { 0 })
        }
    };
    let takes = backend.takes(&extent);
    Some(Cost { read_bytes, host_bytes, resident_bytes: takes.resident_bytes, passing_bytes: takes.passing_bytes })
}

impl Walker<'_> {
    fn cost(&self, block: Block) -> Option<Cost> {
        cost(&self.opened, self.tour.scene, &*self.device.backend, block)
    }

    /// Looks through all blocks: what the smallest and the largest take, how much has to stay free so that any that fits can come, and
    /// how many never fit, which is told once.
    pub(super) fn size_up(&mut self) {
        let payloads = self.opened.all_payloads().count();
        if payloads == self.sized && self.sized > 0 {
            return;
        }
        self.sized = payloads;
        let chunks = self.tour.scene.mesh_chunk_ids().map(Block::Chunk);
        let all: Vec<Cost> = self.opened.all_payloads().chain(chunks).filter_map(|b| self.cost(b)).collect();
        let most = || all.iter().map(Cost::most_bytes);
        (self.smallest, self.largest) = (most().min().unwrap_or(0), most().max().unwrap_or(0));
        let Some(limit) = self.limit else { return };
        let fits = |c: &&Cost| c.most_bytes() <= limit;
        self.headroom = all.iter().filter(fits).map(Cost::headroom_bytes).max().unwrap_or(0);
        let too_large = all.iter().filter(|c| !fits(c)).count() as u64;
        if too_large > self.too_large {
            self.trouble.line(format!(
                "{too_large} of {} blocks never fit [budget] memory_bytes = {limit}: while they are loaded blocks take {} to {} bytes",
                all.len(),
                self.smallest,
                self.largest
            ));
        }
        self.too_large = too_large;
    }

    /// Plans a frame: lets go what the scheduler evicts; what the frame asks for and is not there, first to last: its near chunks, then
    /// what the scheduler fetches. Also the cells that are to be built.
    pub(super) fn plan(&mut self, camera: &Camera, cell: Option<CellId>) -> (Vec<Asked>, Vec<CellId>) {
        self.residency.tick();
        let (scene, opened) = (self.tour.scene, &self.opened);
        let mut near: Vec<Block> = vec![];
        let mut known = BTreeSet::new();
        let mut left = self.limit.map_or(u64::MAX, |l| l.saturating_sub(self.headroom));
        for c in opened.near(cell, camera).iter() {
            let block = Block::Chunk(scene.chunks[c.index()].source);
            if !known.insert(block) {
                continue;
            }
            // What the frame needs of the scene itself has precedence; what of it does not fit is missing.
            let here = self.residency.bytes_of(block);
            let bytes = here.or_else(|| self.cost(block).map(|c| c.resident_bytes)).unwrap_or(0);
            if bytes <= left && !self.trouble.given_up.contains(&block) {
                left -= if self.limit.is_some() { bytes } else { 0 };
                near.push(block);
            }
        }
        near.retain(|&b| !self.residency.touch(b, false));
        let before = self.last.unwrap_or(*camera);
        let motion = Motion {
            time_s: self.frames as f64 / f64::from(self.tour.frames_per_s),
            moved: before.eye.distance(camera.eye) as f32,
            turned_rad: before.forward.angle_between(camera.forward),
            eye: camera,
            lights: &[],
            future: self.tour.cameras.get(self.frames + 1..),
        };
        let asked = self.on_demand.as_ref().map(|_| RefCell::default());
        let wants = Wants {
            opened: &self.opened,
            residency: &self.residency,
            backend: &*self.device.backend,
            limit: self.limit,
            given_up: &self.trouble.given_up,
            asked,
        };
        let plan = self.planner.plan(&motion, &wants, left);
        let cells = wants.asked.map(RefCell::into_inner).unwrap_or_default();
        plan.evict.into_iter().for_each(|b| self.residency.release(self.device, b));
        let fetch = plan.fetch.into_iter().map(|b| (b, true));
        (near.into_iter().map(|b| (b, false)).chain(fetch).collect(), cells)
    }

    /// Uploads the chunks among `asked` that lie in memory and takes them out; the bytes that the scheduler asked for.
    pub(super) fn upload_from_memory(&mut self, asked: &mut Vec<Asked>) -> Result<u64, Fault> {
        let mut uploaded = 0;
        let mut rest = vec![];
        for (i, &(block, by_scheduler)) in asked.iter().enumerate() {
            let cost = self.cost(block).filter(|c| c.read_bytes == 0);
            let Some(cost) = cost.filter(|_| matches!(block, Block::Chunk(_))) else {
                rest.push((block, by_scheduler));
                continue;
            };
            if by_scheduler && self.over_upload_budget(uploaded, cost) {
                rest.extend(&asked[i..]);
                break;
            }
            let there = self.residency.touch(block, by_scheduler)
                || self.residency.upload_chunk(self.device, block, cost, by_scheduler, self.tour.scene)?;
            uploaded += if there && by_scheduler { cost.resident_bytes } else { 0 };
        }
        *asked = rest;
        Ok(uploaded)
    }

    /// At least one block a frame, or one that is larger than the budget would never come.
    fn over_upload_budget(&self, uploaded: u64, next: Cost) -> bool {
        let over = |most| uploaded > 0 && uploaded + next.resident_bytes > most;
        self.upload_bytes_per_frame.is_some_and(over)
    }

    /// Reads what is `asked` for, in its order, as far as there is room and the upload budget allows, beside `uploaded` bytes; each block is
    /// uploaded at once, where `now`. The bytes uploaded of what the scheduler asked for.
    ///
    /// # Errors
    /// What the device gives; where nothing may be missing, what reading gives.
    pub(super) fn fetch(&mut self, asked: &[Asked], mut uploaded: u64, now: bool) -> Result<u64, Fault> {
        for &(block, by_scheduler) in asked {
            if self.residency.touch(block, by_scheduler) || self.trouble.given_up.contains(&block) {
                continue;
            }
            let Some(cost) = self.cost(block) else {
                let gone = Fault::Data { place: named(block), cause: "it is not in the store".into() };
                self.failed(block, gone)?;
                continue;
            };
            // What is left waits, in its order: a later, smaller block may be useless without it.
            if by_scheduler && self.over_upload_budget(uploaded, cost) {
                break;
            }
            let texture_bytes = self.opened.stored(block).map_or(0, |s| s.texture_bytes);
            let (opened, scene) = (&self.opened, self.tour.scene);
            let read = || read(opened, scene, block);
            match self.residency.read(self.device, block, cost, (by_scheduler, texture_bytes), read) {
                Ok(true) => self.trouble.came(block),
                // There will be room when what waits is uploaded.
                Ok(false) if self.residency.waits() => break,
                Ok(false) => continue,
                Err(fault) => {
                    self.failed(block, fault)?;
                    continue;
                }
            }
            uploaded += if by_scheduler { cost.resident_bytes } else { 0 };
            if now {
                self.arrive()?;
            }
        }
        if self.limit.is_some() {
            self.tour.scene.geometry.let_go();
        }
        Ok(uploaded)
    }

    /// Uploads what was read; the bytes of the scheduler's.
    pub(super) fn arrive(&mut self) -> Result<u64, Fault> {
        let (uploaded, bad) = self.residency.arrive(self.device)?;
        bad.into_iter().try_for_each(|(block, fault)| self.failed(block, fault))?;
        Ok(uploaded)
    }

    /// Notes that a block could not be had.
    ///
    /// # Errors
    /// The fault itself where nothing may be missing, or where it is none of the block's.
    fn failed(&mut self, block: Block, fault: Fault) -> Result<(), Fault> {
        if self.strict || !matches!(fault, Fault::Data { .. } | Fault::Refused(_)) {
            return Err(fault);
        }
        self.trouble.failed(block, &fault);
        Ok(())
    }
}

/// A block from where it is stored.
fn read(opened: &Opened<'_>, scene: &Scene, block: Block) -> Result<Read, Fault> {
    match block {
        Block::Payload(_) => opened.read(block).map(Read::Payload),
        Block::Chunk(id) => {
            let mut out = None;
            scene.geometry.with(id, &mut |c| out = Some(c.clone()))?;
            let none = || Fault::Data { place: named(block), cause: "it was not read".into() };
            let read = out.map(Read::Chunk).ok_or_else(none);
            scene.geometry.let_go();
            read
        }
    }
}
