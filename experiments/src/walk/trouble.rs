//! Blocks that could not be had while walking: told, tried again, given up in the end.
//!
//! A block that cannot be read, or that is not sound, is left out of the frame and asked for again by later ones, [`TRIES`] times in all;
//! then nobody asks for it any more, nor for what is useless without it. What is drawn in its place is what the far field draws for any
//! block that is not there yet: something coarser, or nothing, which is counted as missing.

use std::collections::{BTreeMap, BTreeSet};

use farfield_core::Fault;
use farfield_core::id::{Block, CellId};

use super::opened::SHARED;

/// How often a block is tried, each time in a frame of its own.
pub const TRIES: u32 = 3;
/// Lines kept of what went wrong; more are counted only.
const MOST_LINES: usize = 100;

/// See the module.
#[derive(Debug, Default)]
pub struct Trouble {
    /// Reads that failed.
    pub failed_reads: u64,
    /// Blocks that are not asked for any more.
    pub given_up: BTreeSet<Block>,
    /// What went wrong, with file and block: each block when it fails first and when it is given up. At most a hundred.
    pub lines: Vec<String>,
    tries: BTreeMap<Block, u32>,
}

impl Trouble {
    /// Notes that a block could not be had.
    pub(super) fn failed(&mut self, block: Block, fault: &Fault) {
        self.failed_reads += 1;
        let tries = self.tries.entry(block).or_default();
        *tries += 1;
        let what = match *tries {
            1 => "tried again",
            TRIES => "given up; the next build makes it anew",
            _ => return,
        };
        if *tries == TRIES {
            self.given_up.insert(block);
        }
        self.line(format!("{}: {fault}: {what}", named(block)));
    }

    /// Notes that a block came, whatever happened before.
    pub(super) fn came(&mut self, block: Block) {
        self.tries.remove(&block);
    }

    /// Forgets all about blocks that are made anew; says whether there were any.
    pub(super) fn made_anew(&mut self, which: impl Fn(&Block) -> bool) -> bool {
        let before = self.given_up.len();
        self.given_up.retain(|b| !which(b));
        self.tries.retain(|b, _| !which(b));
        before > self.given_up.len()
    }

    pub(super) fn line(&mut self, line: String) {
        if self.lines.len() < MOST_LINES {
            self.lines.push(line);
        }
    }
}

/// A block in words.
pub(super) fn named(block: Block) -> String {
    match block {
        Block::Chunk(c) => format!("chunk {} of mesh {}", c.chunk, c.mesh.0),
        Block::Payload(p) if p.asset == SHARED => format!("payload {} of the scene", p.id.0),
        Block::Payload(p) => format!("payload {} of cell {}", p.id.0, p.asset.0 - 1),
    }
}

/// The cell whose payload it is.
pub(super) fn cell_of(block: Block) -> Option<CellId> {
    match block {
        Block::Payload(p) if p.asset != SHARED => Some(CellId(p.asset.0 - 1)),
        _ => None,
    }
}
