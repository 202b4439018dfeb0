//! Building while walking: the cells that a scheduler asks for, in its order, within a time budget a frame.
//!
//! The inside of the cell that the eye is in is made at once, since without it nothing tells near from far; far fields wait for
//! their turn and are counted as missing until they are there. A cell that takes longer than the budget is paid for by later frames,
//! so that the mean over a walk holds. What is built goes into the store: the next walk finds it.

use std::time::Instant;

use farfield_core::id::CellId;
use farfield_core::{Camera, Fault};

use super::opened::Opened;
use crate::build::{Site, peak_rss_bytes};

/// See the module.
pub struct OnDemand<'a> {
    site: &'a Site<'a>,
    ms_per_frame: f64,
    /// What may be spent now, milliseconds; below zero, later frames pay.
    account_ms: f64,
}

impl<'a> OnDemand<'a> {
    /// Nothing spent.
    pub fn new(site: &'a Site<'a>, ms_per_frame: f64) -> Self {
        Self { site, ms_per_frame, account_ms: 0.0 }
    }

    /// Makes the inside of the cell that serves a camera; where its far field has nothing to build, all of it.
    ///
    /// # Errors
    /// What the partition gives.
    pub(super) fn enter(&mut self, opened: &mut Opened<'_>, camera: &Camera) -> Result<(), Fault> {
        opened.division.cells.find(camera).map_or(Ok(()), |id| self.enter_cell(opened, id))
    }

    fn enter_cell(&mut self, opened: &mut Opened<'_>, id: CellId) -> Result<(), Fault> {
        if opened.built.cells.contains_key(&id) {
            return Ok(());
        }
        let start = Instant::now();
        let (cell, needs) = self.site.inside_of(opened.pipeline, opened.division, id)?;
        self.charge(opened, start, true);
        opened.built.covers = needs.covers;
        opened.note(&needs.left_out);
        opened.add(id, cell)
    }

    /// Takes the time since `start` from the account; what was not in the store counts as building.
    fn charge(&mut self, opened: &mut Opened<'_>, start: Instant, new: bool) {
        let seconds = start.elapsed().as_secs_f64();
        self.account_ms -= 1e3 * seconds;
        let p = &mut opened.built.preprocess;
        p.seconds += if new { seconds } else { 0.0 };
        p.peak_rss_bytes = peak_rss_bytes();
    }

    /// Builds the cell that serves a camera, whatever time it takes.
    ///
    /// # Errors
    /// What building gives.
    pub fn serve(self, opened: &mut Opened<'_>, camera: &Camera) -> Result<(), Fault> {
        opened.division.cells.find(camera).map_or(Ok(()), |id| self.serve_cell(opened, id))
    }

    /// Builds a cell, whatever time it takes.
    ///
    /// # Errors
    /// What building gives.
    pub fn serve_cell(mut self, opened: &mut Opened<'_>, id: CellId) -> Result<(), Fault> {
        self.enter_cell(opened, id)?;
        self.build(opened, &[id])
    }

    /// Builds the cells that were `asked` for, first to last, as long as there is time.
    ///
    /// # Errors
    /// What building gives.
    pub(super) fn build(&mut self, opened: &mut Opened<'_>, asked: &[CellId]) -> Result<(), Fault> {
        self.account_ms = (self.account_ms + self.ms_per_frame).min(self.ms_per_frame);
        for &id in asked {
            if self.account_ms <= 0.0 {
                break;
            }
            if opened.built.cells.get(&id).is_some_and(|c| c.manifest.is_some()) {
                continue;
            }
            let start = Instant::now();
            let shared = opened.built.shared.as_ref().map(|s| (s.0, &s.1));
            let (id, cell, needs, new) = self.site.cell(opened.pipeline, opened.division, id, shared)?;
            self.charge(opened, start, new);
            opened.built.covers = needs.covers;
            opened.built.preprocess.cells_built += usize::from(new);
            if let Some(m) = &cell.manifest {
                opened.built.preprocess.bytes_stored += m.bytes() + m.index.len() as u64;
                opened.note(&m.left_out);
            }
            opened.note(&needs.left_out);
            opened.add(id, cell)?;
        }
        Ok(())
    }
}
