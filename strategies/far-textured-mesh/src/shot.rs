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
        [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)]
            .iter()
            .any(|(dx, dy)| self.pixel(at.x + dx, at.y + dy).is_none_or(|i| self.image.depth[i] + slack >= at.z))
    }
}

/// What each vertex of the piece is in one view: its weight and whether it is seen.
pub(crate) fn look(
    piece: &Welded,
    view: &Picture,
    steps: &Steps,
    weights: &Weights,
    visible_px: f32,
) -> Vec<(f32, bool)> {
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

/// View sets over all views, in their order, and the largest weights over all of them or those of the first.
pub(crate) fn combine(piece: &Welded, looks: &[Vec<(f32, bool)>], all_weigh: bool) -> Vec<VertexSeen> {
    let mut out: Vec<VertexSeen> =
        piece.locked.iter().map(|&locked| VertexSeen { weight: 0.0, views: 0, locked }).collect();
    for (i, view) in looks.iter().enumerate() {
        for (vertex, &(weight, seen)) in out.iter_mut().zip(view) {
            if i == 0 || all_weigh {
                vertex.weight = vertex.weight.max(weight);
            }
            vertex.views |= u32::from(seen) << i;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::category::DepthMeasure;
    use crate::polygon::{PolygonViews, shown, view_set};

    const STEPS: Steps = Steps { measure: DepthMeasure::Footprint, c0: 4.0, c1: 1.0, near: 0.1 };
    const WEIGHTS: Weights =
        Weights { exterior: 0.5, interior_silhouette: 0.4, sharp: 0.25, interior: 0.125, back: 0.45, hidden: 0.05 };

    /// A view along -z from (x, 0, 10) of a wall at z = 0 for |x|, |y| < 3 and a plate at z = 4 for |x|, |y| < 0.5.
    fn picture(x: f32) -> Picture {
        let eye = Vec3::new(x, 0.0, 10.0);
        let camera = Camera::looking(eye.as_dvec3(), -Vec3::Z, Vec3::Y, 1.0, [200, 200], 0.1);
        let mut image = SurfaceImage { size: [200, 200], ..SurfaceImage::default() };
        for i in 0..200 * 200 {
            let ray = camera.ray((i % 200) as f32 + 0.5, (i / 200) as f32 + 0.5);
            let within = |z: f32, r: f32| {
                let p = eye + ray * (10.0 - z);
                (p.x.abs().max(p.y.abs()) < r).then_some(10.0 - z)
            };
            let depth = within(4.0, 0.5).or(within(0.0, 3.0)).unwrap_or(f32::INFINITY);
            image.depth.push(depth);
            image.object.push(u32::from(depth.is_finite()));
            image.albedo.push([0; 4]);
            image.normal.push(0);
        }
        Picture { camera, offset: -eye, eye: eye.as_dvec3(), image }
    }

    /// One triangle a place, facing +z (or -z), all its corners within a hundredth.
    fn specks(at: &[(Vec3, bool)]) -> Welded {
        let mut out = Welded::default();
        for (i, &(p, front)) in at.iter().enumerate() {
            let n = 3 * i as u32;
            let (a, b) = if front { (n + 1, n + 2) } else { (n + 2, n + 1) };
            out.positions.extend([p, p + Vec3::X * 0.01, p + Vec3::Y * 0.01]);
            out.triangles.push([n, a, b]);
            out.two_sided.push(false);
            out.locked.extend([i == 0; 3]);
        }
        out
    }

    #[test]
    fn vertices_weigh_what_their_pixel_is_or_that_they_are_hidden_or_turned_away() {
        let at = [
            (Vec3::new(1.8, 1.2, 0.0), true),   // in the middle of the wall
            (Vec3::new(0.3, 0.0, 0.0), true),   // behind the plate
            (Vec3::new(0.0, 0.48, 4.0), true),  // at the plate's edge, before the wall
            (Vec3::new(-2.99, 0.0, 0.0), true), // at the wall's edge
            (Vec3::new(1.8, 1.2, 0.0), false),  // turned away
        ];
        let piece = specks(&at);
        let centre = look(&piece, &picture(0.0), &STEPS, &WEIGHTS, 2.0);
        let first: Vec<(f32, bool)> = centre.iter().step_by(3).copied().collect();
        assert_eq!(first, [(0.125, true), (0.05, false), (0.4, true), (0.5, true), (0.45, false)]);

        // From far to the side the spot behind the plate is seen.
        let side = look(&piece, &picture(3.0), &STEPS, &WEIGHTS, 2.0);
        assert!(side[3].1);
        let both = [centre, side];
        let seen = combine(&piece, &both, true);
        assert_eq!((seen[0].views, seen[3].views, seen[12].views), (0b11, 0b10, 0));
        assert_eq!((seen[3].weight, seen[12].weight), (0.125, 0.45));
        assert!(seen[0].locked && !seen[3].locked);
        assert_eq!(combine(&piece, &both, false)[3].weight, 0.05);
    }

    #[test]
    fn a_polygon_has_the_views_that_see_its_corners_and_all_of_what_lies_between() {
        let views = [picture(0.0), picture(3.0)];
        let set = |v: &[Picture], t: [Vec3; 3], seen: [u32; 3]| view_set(v, t, seen, PolygonViews::Vertices);
        let wall = |x0: f32, x1: f32| {
            [Vec3::new(x0, -1.0, 0.0), Vec3::new(x1, -1.0, 0.0), Vec3::new((x0 + x1) / 2.0, 1.6, 0.0)]
        };
        let all = [0b11; 3];
        assert_eq!(set(&views, wall(1.0, 2.5), all), 0b11);
        // Its corners are seen from the centre, but the plate stands before a good part of it.
        let covered = wall(-1.2, 1.2);
        let share = shown(&views[0], covered);
        // By hand: the plate's shadow on the wall is |x|, |y| < 5/6, which takes about 73 % of the triangle.
        assert!((share - 0.27).abs() < 0.05, "{share}");
        // From x = 3 the plate stands before the part of the wall left of x = -1.1.
        assert_eq!(set(&views, wall(-0.9, 1.2), all), 0b10);
        assert_eq!(set(&views, wall(1.0, 2.5), [0b11, 0b01, 0b11]), 0b01);
        assert_eq!(set(&views, wall(1.0, 2.5), [0b10, 0b01, 0b11]), 0);
        let [a, b, c] = wall(1.0, 2.5);
        assert_eq!(set(&views, [a, c, b], all), 0, "it turns away");
        // By pixels the corners' sets do not matter, and half a polygon is better than none.
        let by_pixels = |t: [Vec3; 3]| view_set(&views, t, [0; 3], PolygonViews::Pixels);
        assert_eq!((by_pixels(wall(1.0, 2.5)), by_pixels([a, c, b])), (0b11, 0));
        assert_eq!(by_pixels(wall(-2.7, 0.7)).count_ones(), 1);
        // A single view textures whatever it shows a part of.
        assert_eq!(set(&views[..1], covered, [0; 3]), 1);
        let hidden = [Vec3::new(-0.1, -0.1, 0.0), Vec3::new(0.1, -0.1, 0.0), Vec3::new(0.0, 0.1, 0.0)];
        assert_eq!(set(&views[..1], hidden, [1; 3]), 0);
    }
}
