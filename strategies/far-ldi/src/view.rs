//! Run time: the images of the active split whose frustum meets the camera's, each warped as a whole. O(images) a frame.
//!
//! An image holds what the centre sees through its window. A viewer beside the centre may see the same thing through
//! another window of the split, so that windows do not decide what is drawn.

use farfield_core::Camera;
use farfield_core::cell::Cell;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, SplitId};
use farfield_core::strategy::{Achieved, Candidate, FarView, View};
use glam::{DVec3, Vec3};

use crate::index::{Index, Picture};

/// An opened cell.
pub(crate) struct Warped {
    pub(crate) asset: AssetId,
    pub(crate) index: Index,
}

impl Warped {
    fn payload(&self, p: &Picture) -> PayloadRef {
        PayloadRef { asset: self.asset, id: LocalPayload(p.payload) }
    }
}

fn in_view(p: &Picture, view: &View<'_>) -> bool {
    p.split == view.at.split.0 && meets(view.camera, &p.corners)
}

/// False only where a convex body lies wholly behind the eye or outside one side plane of the camera.
fn meets(camera: &Camera, corners: &[Vec3; 8]) -> bool {
    let seen = corners.map(|c| (c.as_dvec3() - camera.eye).as_vec3());
    camera.side_planes().iter().chain([&camera.forward]).all(|n| seen.iter().any(|c| n.dot(*c) >= 0.0))
}

impl FarView for Warped {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        out.extend(self.index.pictures.iter().map(|p| Candidate {
            block: Block::Payload(self.payload(p)),
            bytes: p.bytes,
            bounds: p.bounds,
            error_px_without: p.coarse * p.size[0].max(p.size[1]) as f32,
            in_view: in_view(p, view),
            after: None,
        }));
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let mut achieved = Achieved::default();
        for p in self.index.pictures.iter().filter(|p| in_view(p, view)) {
            let id = self.payload(p);
            if !resident(Block::Payload(id)) {
                achieved.missing += 1;
                continue;
            }
            let error_px = p.error_px();
            achieved.error_px = achieved.error_px.max(error_px);
            let what = DrawWhat::Payload { id, part: 0, object: 0 };
            out.push(Draw { what, bounds: p.bounds, error_px });
        }
        achieved
    }

    /// The cell's centre, which every image stands for; construction images are taken around it.
    fn viewpoints(&self, cell: &Cell, split: SplitId) -> Vec<DVec3> {
        let any = self.index.pictures.iter().any(|p| p.split == split.0);
        any.then_some(cell.outline.centre.as_dvec3()).into_iter().collect()
    }
}
