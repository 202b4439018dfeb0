//! Where the construction images are taken from, and how.
//!
//! Follows image placement (Aliaga and Lastra 1999, section 4.1, figure 11): the centre; the middles of the vectors from the centre to
//! the mid-points of the window's four edges; those four mirrored behind the centre. All are moved into the cell's region.
//! Every picture has the layered image's axes and about as many pixels, and holds all that it can hold, from
//! the window (or the nearest box) to the farthest box. The paper asks only that it holds the window: from behind the centre less
//! of the periphery would then be seen, for which those pictures are there.

use farfield_core::Camera;
use farfield_core::cell::{Cell, Window};
use farfield_core::region::Region;
use glam::{Vec2, Vec3};

use crate::frame::Framed;

/// A picture begins at least this share of the window's distance ahead of its eye.
const LEAST_AHEAD: f32 = 0.25;

/// The first `n` viewpoints besides the centre, relative to it: four in front, four behind. Equal ones are left out.
pub(crate) fn around(cell: &Cell, window: &Window, n: usize) -> Vec<Vec3> {
    let centre = cell.outline.centre;
    let middle = |i: usize| 0.5 * (0.5 * (window.corners[i] + window.corners[(i + 1) % 4]) - centre);
    let front = [0, 1, 2, 3].map(middle);
    let ahead = |v: Vec3| v.dot(window.axis) * window.axis;
    let behind = front.map(|v| v - 2.0 * ahead(v));
    let mut out: Vec<Vec3> = vec![];
    for offset in front.into_iter().chain(behind).take(n) {
        let v = keep(&cell.outline.region, centre, offset);
        let apart = 1e-3 * offset.length();
        if v.length() > apart && out.iter().all(|o| o.distance(v) > apart) {
            out.push(v);
        }
    }
    out
}

/// An offset from a viewpoint `centre` moved so that it ends in the region: into its range of heights first, then towards the
/// centre.
fn keep(region: &Region, centre: Vec3, offset: Vec3) -> Vec3 {
    let mut v = offset;
    if let Region::Prism { y, .. } = region {
        v.y = (centre.y + v.y).clamp(y[0], y[1]) - centre.y;
    }
    if region.contains(centre + v) {
        return v;
    }
    // The region is convex and holds the centre.
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..24 {
        let t = 0.5 * (inside + outside);
        if region.contains(centre + v * t) { inside = t } else { outside = t }
    }
    v * inside
}

/// The camera of a construction image `offset` from the layered image's eye.
pub(crate) fn camera(framed: &Framed, offset: Vec3, max_px: u32) -> Camera {
    let own = &framed.camera;
    let e = Vec3::new(offset.dot(own.right), offset.dot(own.up), offset.dot(own.forward));
    let near = framed.window.min(framed.reach[0]).max(e.z + LEAST_AHEAD * framed.window);
    let (mut lo, mut hi) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for z in [near, framed.reach[1].max(near)] {
        for t in [Vec2::new(own.left, own.bottom), Vec2::new(own.right_tan, own.top)] {
            let seen = (t * z - e.truncate()) / (z - e.z);
            (lo, hi) = (lo.min(seen), hi.max(seen));
        }
    }
    // As many pixels as the layered image, of the same shape.
    let pixels = own.size[0] as f32 * own.size[1] as f32;
    let extent = hi - lo;
    let px = (pixels / (extent.x * extent.y)).sqrt().min((max_px - 2) as f32 / extent.max_element());
    let (first, last) = ((lo * px).floor(), (hi * px).ceil());
    let size = (last - first).max(Vec2::ONE);
    Camera {
        eye: own.eye + offset.as_dvec3(),
        left: first.x / px,
        bottom: first.y / px,
        right_tan: (first.x + size.x) / px,
        top: (first.y + size.y) / px,
        size: size.as_uvec2().into(),
        ..*own
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Aabb;
    use farfield_core::cell::Outline;
    use farfield_core::id::CellId;
    use glam::DVec3;

    fn cell(region: Region) -> Cell {
        let outline = Outline { id: CellId(0), region, centre: Vec3::ZERO, neighbours: vec![] };
        Cell { outline, splits: vec![], sectors: vec![], own: vec![], claims: vec![] }
    }

    fn window() -> Window {
        let corner = |s: f32, u: f32| Vec3::new(s * 6.0, u * 2.0, -8.0);
        let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        Window { axis: -Vec3::Z, corners, px_per_tan: 100.0 }
    }

    #[test]
    fn four_places_half_way_to_the_windows_edges_and_four_behind() {
        let ball = cell(Region::Sphere { centre: Vec3::ZERO, radius: 8.0 });
        let found = around(&ball, &window(), 8);
        let front = [(0.0, -1.0), (3.0, 0.0), (0.0, 1.0), (-3.0, 0.0)];
        let expected = front.map(|(x, y)| Vec3::new(x, y, -4.0)).into_iter();
        let expected: Vec<Vec3> = expected.chain(front.map(|(x, y)| Vec3::new(x, y, 4.0))).collect();
        assert!(found.iter().zip(&expected).all(|(a, b)| a.distance(*b) < 1e-5), "{found:?}");
        assert_eq!(around(&ball, &window(), 3), found[..3]);
    }

    #[test]
    fn places_are_moved_into_the_region_and_are_then_fewer() {
        let flat = vec![[9.0, 9.0], [-9.0, 9.0], [-9.0, -9.0], [9.0, -9.0]];
        let prism = cell(Region::Prism { polygon: flat, y: [0.0, 0.0] });
        // Up and down fall together.
        let found = around(&prism, &window(), 8);
        assert_eq!(found.len(), 6);
        assert!(found.iter().all(|v| v.y == 0.0));
        let small = cell(Region::Box(Aabb { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) }));
        for v in around(&small, &window(), 8) {
            assert!(small.outline.region.contains(v) && v.abs().max_element() > 1.999, "{v}");
        }
    }

    #[test]
    fn a_picture_holds_what_the_layered_image_holds_with_as_many_pixels() {
        let mut own = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [300, 200], 0.1);
        (own.left, own.right_tan, own.bottom, own.top) = (-0.75, 0.75, -0.5, 0.5);
        let framed = Framed { camera: own, window: 8.0, reach: [9.0, 100.0], coarse: 1.0 };
        for v in [Vec3::new(3.0, 0.0, -4.0), Vec3::new(0.0, -1.0, 4.0)] {
            let c = camera(&framed, v, 4096);
            for z in [8.0, 30.0, 100.0] {
                for (x, y) in [(0.0, 0.0), (300.0, 0.0), (0.0, 200.0), (300.0, 200.0)] {
                    let p = c.project(own.ray(x, y) * z - v).unwrap().truncate();
                    let size = Vec2::new(c.size[0] as f32, c.size[1] as f32);
                    assert!(p.cmpge(Vec2::splat(-0.01)).all() && p.cmple(size + 0.01).all(), "{p} of {size}");
                }
            }
            let pixels = c.size[0] * c.size[1];
            assert!((59_000..62_000).contains(&pixels), "{pixels}");
        }
    }
}
