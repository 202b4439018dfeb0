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
use crate::{Aabb, Camera, Fault};

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

impl Window {
    /// The six faces of a box with their outward normals, in the order +x -x +y -y +z -z; corners are the box's own, counter-clockwise
    /// seen from outside.
    pub fn faces(b: &Aabb, px_per_tan: f32) -> [Self; 6] {
        [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].map(|axis| {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            let side = up.cross(axis);
            let at = |(s, u): (f32, f32)| Vec3::select((axis + side * s + up * u).cmpgt(Vec3::ZERO), b.max, b.min);
            Self { axis, corners: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(at), px_per_tan }
        })
    }

    /// Whether a box has a point beyond the window's plane: what a ray that leaves through the window can meet.
    pub fn is_before(&self, b: &Aabb) -> bool {
        let out = Vec3::select(self.axis.cmpge(Vec3::ZERO), b.max, b.min);
        (out - self.corners[0]).as_dvec3().dot(self.axis.as_dvec3()) > 0.0
    }
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

/// Whether a camera's eye stands in a window's plane (nearer to it than `slack`, scene units) or past it, and some ray of the
/// picture leads outwards: the window is looked through there, although clipping it against the frustum decides nothing.
pub fn leaves_at_once(camera: &Camera, window: &Window, slack: f64) -> bool {
    let inside = window.axis.as_dvec3().dot(window.corners[0].as_dvec3() - camera.eye);
    let [w, h] = camera.size.map(|n| n as f32);
    // A linear function is largest over a picture in one of its corners.
    inside <= slack
        && [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].iter().any(|&(x, y)| camera.ray(x, y).dot(window.axis) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_faces_of_a_box_look_outwards_and_close_it() {
        let b = Aabb { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(3.0, 1.0, 7.0) };
        let faces = Window::faces(&b, 50.0);
        for w in &faces {
            let [p, q, r, _] = w.corners;
            assert!((q - p).cross(r - q).normalize().distance(w.axis) < 1e-6);
            assert!(w.corners.iter().all(|c| b.contains(*c) && w.axis.dot(*c) >= w.axis.dot(b.centre())));
            assert!(!w.is_before(&b));
            assert!(w.is_before(&Aabb { min: b.min + w.axis * 0.1, max: b.max + w.axis * 0.1 }));
        }
        let area = |w: &Window| (w.corners[1] - w.corners[0]).length() * (w.corners[2] - w.corners[1]).length();
        assert_eq!(faces.iter().map(area).sum::<f32>(), 2.0 * (4.0 + 5.0 + 20.0));
    }

    #[test]
    fn an_eye_in_a_window_looks_through_it_exactly_when_it_looks_outwards() {
        let face = &Window::faces(&Aabb { min: -Vec3::ONE, max: Vec3::ONE }, 50.0)[0];
        let at = |x: f64, forward: Vec3| {
            leaves_at_once(&Camera::looking(DVec3::X * x, forward, Vec3::Y, 1.0, [9, 9], 0.1), face, 1e-4)
        };
        assert!(at(1.0, Vec3::X) && at(1.0, Vec3::new(0.1, 0.0, 1.0)) && at(1.001, Vec3::X));
        assert!(!at(1.0, -Vec3::X) && !at(0.9, Vec3::X));
    }

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
