//! Cells: sets of viewpoints with what is near and far from them.
//!
//! Two halves. The [`Outline`] is cheap and known of every cell, so that a camera finds its cell before anything is built.
//! The inside ([`Cell`]) is a pure job of its own: *splits* (which chunks are far; exactly one is active in a frame) and
//! *sectors* (planar windows through which far chunks are seen; any number are active).

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::claim::Claim;
use crate::id::{CellId, SectorId, SplitId};
use crate::region::Region;
use crate::scene::{ChunkSet, Scene};
use crate::{Camera, Fault};

/// What is known of a cell before it is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outline {
    /// Its name.
    pub id: CellId,
    /// Its viewpoints.
    pub region: Region,
    /// Its centre of projection, one of its viewpoints.
    pub centre: Vec3,
    /// The cells that a viewer may enter from it.
    pub neighbours: Vec<CellId>,
}

/// A cell with its inside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// What was known before.
    pub outline: Outline,
    /// Divisions into near and far, at least one.
    pub splits: Vec<Split>,
    /// Windows.
    pub sectors: Vec<Sector>,
    /// The partition's own data, for [`crate::strategy::Cells::active`].
    pub own: Vec<u8>,
    /// What the partition claims of frames in this cell.
    pub claims: Vec<Claim>,
}

impl Cell {
    /// Whether some split has far chunks, for far fields that serve viewpoints beside what they show.
    ///
    /// # Errors
    /// [`Fault::Refused`], in the name of the far field `who`, where a far chunk meets the cell's viewpoints.
    pub fn has_far(&self, scene: &Scene, who: &str) -> Result<bool, Fault> {
        let region = &self.outline.region;
        for c in self.splits.iter().flat_map(|s| s.far.iter()) {
            let chunk = &scene.chunks[c.index()];
            let distance = region.distance(&chunk.bounds);
            if distance.is_nan() || distance <= 0.0 {
                return Err(Fault::Refused(format!(
                    "{who}: a far part of object {} meets the viewpoints of cell {}: give the partition a region (or cells) \
                     that the far geometry lies outside of, or take a far field that serves any viewpoint",
                    chunk.object.0, self.outline.id.0
                )));
            }
        }
        Ok(self.splits.iter().any(|s| !s.far.is_empty()))
    }
}

/// Which chunks are far; near is the rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// The far chunks.
    pub far: ChunkSet,
    /// The most near triangles of any frame, where the partition promises one: nothing may then fall back on geometry.
    pub near_budget: Option<u64>,
}

/// A window and what may be seen through it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sector {
    /// Whose far chunks.
    pub split: SplitId,
    /// The window.
    pub window: Window,
    /// The far chunks that some viewpoint of the cell may see through it.
    pub seen: ChunkSet,
}

/// A planar convex quadrilateral, local frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// The outward axis from the centre of projection, unit length.
    pub axis: Vec3,
    /// Its corners in order.
    pub corners: [Vec3; 4],
    /// Pixels a unit of tangent: turns world sizes into pixels in every error formula.
    pub px_per_tan: f32,
}

/// What a camera uses of a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Active {
    /// The cell.
    pub cell: CellId,
    /// The one active split.
    pub split: SplitId,
    /// The windows it looks through.
    pub sectors: Vec<SectorId>,
}

/// Whether a camera's four side planes leave anything of a window: the quadrilateral is clipped against them.
pub fn sees(camera: &Camera, window: &Window) -> bool {
    let mut polygon: Vec<Vec3> = window.corners.iter().map(|c| (c.as_dvec3() - camera.eye).as_vec3()).collect();
    for n in camera.side_planes() {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (n.dot(a), n.dot(b));
            if da >= 0.0 {
                kept.push(a);
            }
            if (da < 0.0) != (db < 0.0) {
                kept.push(a + (b - a) * (da / (da - db)));
            }
        }
        if kept.is_empty() {
            return false;
        }
        polygon = kept;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_window_is_seen_ahead_and_not_behind_or_beside() {
        let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [100, 100], 0.1);
        let window = |at: Vec3| Window {
            axis: at.normalize(),
            corners: [at - Vec3::X - Vec3::Y, at + Vec3::X - Vec3::Y, at + Vec3::X + Vec3::Y, at - Vec3::X + Vec3::Y],
            px_per_tan: 100.0,
        };
        assert!(sees(&camera, &window(Vec3::new(0.0, 0.0, -5.0))));
        assert!(sees(&camera, &window(Vec3::new(3.5, 0.0, -5.0))));
        assert!(!sees(&camera, &window(Vec3::new(4.0, 0.0, -5.0))));
        assert!(!sees(&camera, &window(Vec3::new(0.0, 0.0, 5.0))));
    }
}
