//! A captured view of a piece, and what its vertices are in it: weighted, seen or hidden.
//!
//! Follows textured LOD meshes (2003, sections 3.1.3.2 and 3.1.4): a vertex whose polygons all turn away weighs as much as the exterior
//! silhouette; one that is seen takes the weight of its pixel; one that is hidden weighs least. Over several views the largest weight
//! counts, and a vertex knows the set of views that see it.
//!
//! *Seen* is a comparison of depths with a tolerance in footprints (p = z / q): a vertex is hidden when it lies more than
//! `visible_px` footprints behind each of the four pixels round its projection. Background hides nothing, so vertices on the outline
//! are seen although their pixel may be a miss; such a pixel counts as exterior silhouette.

use farfield_core::Camera;
use farfield_core::image::SurfaceImage;
use farfield_core::strategy::VertexSeen;
use glam::{DVec3, Vec3};

use crate::category::{Category, Steps, categories};
use crate::object::Welded;

/// A picture of a piece with its camera.
pub(crate) struct Picture {
    /// The camera, local frame.
    pub(crate) camera: Camera,
    /// From the camera's eye to the piece's origin.
    pub(crate) offset: Vec3,
    /// The eye relative to the piece's origin.
    pub(crate) eye: DVec3,
    /// What it saw.
    pub(crate) image: SurfaceImage,
}

/// Weights of the categories.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weights {
    pub(crate) exterior: f32,
    pub(crate) interior_silhouette: f32,
    pub(crate) sharp: f32,
    pub(crate) interior: f32,
    pub(crate) back: f32,
    pub(crate) hidden: f32,
}

impl Picture {
    /// Pixels from the top left and linear depth of a point relative to the piece's origin.
    pub(crate) fn project(&self, p: Vec3) -> Option<Vec3> {
        self.camera.project(p + self.offset)
    }

    /// The index of the pixel at (x, y), where there is one.
    pub(crate) fn pixel(&self, x: f32, y: f32) -> Option<usize> {
        let [w, h] = self.image.size;
        (x >= 0.0 && y >= 0.0 && x < w as f32 && y < h as f32).then(|| self.image.at(x as u32, y as u32))
    }

    /// Whether a point that projects to `at` lies no more than `slack_px` footprints behind what was captured round there.
    pub(crate) fn shows(&self, at: Vec3, slack_px: f32) -> bool {
        let slack = slack_px * at.z / self.camera.px_per_tan();
        [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)].iter().any(|(dx, dy)| {
            self.pixel(at.x + dx, at.y + dy).is_none_or(|i| self.image.depth[i] + slack >= at.z)
        })
    }
}

/// What each vertex of the piece is in one view: its weight and whether it is seen.
pub(crate) fn look(piece: &Welded, view: &Picture, steps: &Steps, weights: &Weights, visible_px: f32) -> Vec<(f32, bool)> {
    let found = categories(&view.image.depth, view.image.size, view.camera.px_per_tan(), steps);
    let mut faces = vec![false; piece.positions.len()];
    for (t, two_sided) in piece.triangles.iter().zip(&piece.two_sided) {
        if *two_sided || piece.facing(*t, view.eye) > 0.0 {
            t.iter().for_each(|&v| faces[v as usize] = true);
        }
    }
    let of = |category: Category| match category {
        // A seen vertex over background stands on the outline.
        Category::ExteriorSilhouette | Category::Background => weights.exterior,
        Category::InteriorSilhouette => weights.interior_silhouette,
        Category::Sharp => weights.sharp,
        Category::Interior => weights.interior,
    };
    piece
        .positions
        .iter()
        .zip(&faces)
        .map(|(&p, &faces)| {
            if !faces {
                return (weights.back, false);
            }
            match view.project(p) {
                Some(at) if view.shows(at, visible_px) => {
                    (of(view.pixel(at.x, at.y).map_or(Category::Background, |i| found[i])), true)
                }
                _ => (weights.hidden, false),
            }
        })
        .collect()
}

/// Weights and view sets over all views, in their order.
pub(crate) fn combine(piece: &Welded, looks: &[Vec<(f32, bool)>]) -> Vec<VertexSeen> {
    let mut out: Vec<VertexSeen> =
        piece.locked.iter().map(|&locked| VertexSeen { weight: 0.0, views: 0, locked }).collect();
    for (i, view) in looks.iter().enumerate() {
        for (vertex, &(weight, seen)) in out.iter_mut().zip(view) {
            vertex.weight = vertex.weight.max(weight);
            vertex.views |= u32::from(seen) << i;
        }
    }
    out
}
