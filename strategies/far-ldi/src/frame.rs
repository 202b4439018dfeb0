//! The layered image's camera: from the cell's centre through a window, cut to where there is something to see.

use farfield_core::cell::{Cell, Sector};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::{Aabb, Camera, Fault};
use glam::{Vec2, Vec3};

/// Pixels around: neighbouring images overlap by as much.
const BORDER_PX: f32 = 1.0;

/// A camera with what it is known to hold.
#[derive(Clone, Debug)]
pub(crate) struct Framed {
    /// From the cell's centre.
    pub(crate) camera: Camera,
    /// From the centre to the window along the camera's axis.
    pub(crate) window: f32,
    /// The nearest and the farthest that boxes reach, along the axis.
    pub(crate) reach: [f32; 2],
    /// Pixels of the window a pixel of the image.
    pub(crate) coarse: f32,
}

/// How a window is taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grain {
    /// Pixels of the image a pixel of the window.
    pub(crate) density: f32,
    /// The largest edge.
    pub(crate) max_px: u32,
}

/// The camera for a window and the chunks seen through it; `None` where their boxes leave nothing in it.
///
/// The window is cut to the boxes' tangents. Of a box only what lies ahead counts: beyond half of the window's distance, or of
/// the region's reach where that is less; nearer than the region's border along the axis no eye sees anything far in the
/// window's direction.
pub(crate) fn frame(
    cell: &Cell,
    sector: &Sector,
    seen: &ChunkSet,
    scene: &Scene,
    near: f32,
    grain: Grain,
) -> Result<Option<Framed>, Fault> {
    let (centre, window) = (cell.outline.centre, &sector.window);
    let mut camera = Camera::looking(centre.as_dvec3(), window.axis, Vec3::Y, 1.0, [1, 1], near);
    let place = |p: Vec3| {
        let v = p - centre;
        Vec3::new(v.dot(camera.right), v.dot(camera.up), v.dot(camera.forward))
    };
    let tangents = |points: &[Vec3]| {
        let t = points.iter().map(|p| p.truncate() / p.z);
        t.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(lo, hi), t| (lo.min(t), hi.max(t)))
    };
    let corners = window.corners.map(place);
    let distance = corners.iter().map(|c| c.z).fold(f32::INFINITY, f32::min);
    if !(distance > 0.0 && corners.iter().all(|c| c.is_finite())) {
        return Err(Fault::Refused(format!(
            "layered-depth-image: a window of cell {} does not lie ahead of the cell's centre",
            cell.outline.id.0
        )));
    }
    let border = cell.outline.region.support(camera.forward) - centre.dot(camera.forward);
    let from = 0.5 * if border > 0.0 { distance.min(border) } else { distance };
    let boxes: Vec<Vec3> = seen.iter().flat_map(|c| ahead(&scene.chunks[c.index()].bounds, from, &place)).collect();
    let (mut lo, mut hi) = tangents(&corners);
    let (least, most) = tangents(&boxes);
    (lo, hi) = (lo.max(least), hi.min(most));
    if !lo.cmple(hi).all() {
        return Ok(None);
    }
    let mut px = window.px_per_tan * grain.density;
    let edge = ((hi - lo) * px).max_element() + 2.0 * BORDER_PX + 2.0;
    if edge > grain.max_px as f32 {
        px *= (grain.max_px as f32 - 2.0 * BORDER_PX - 2.0) / (edge - 2.0 * BORDER_PX - 2.0);
    }
    let (first, last) = ((lo * px - BORDER_PX).floor(), (hi * px + BORDER_PX).ceil());
    (camera.left, camera.bottom) = (first / px).into();
    (camera.right_tan, camera.top) = (last / px).into();
    camera.size = (last - first).as_uvec2().max(glam::UVec2::ONE).into();
    let reach = boxes.iter().map(|p| p.z).fold([f32::INFINITY, 0.0], |[a, b], z| [f32::min(a, z), f32::max(b, z)]);
    camera.near = near.min(1e-3 * from);
    Ok(Some(Framed { camera, window: distance, reach, coarse: window.px_per_tan / px }))
}

/// The corners of what a box keeps at least `from` ahead, in the camera's axes.
fn ahead(b: &Aabb, from: f32, place: &dyn Fn(Vec3) -> Vec3) -> Vec<Vec3> {
    let corners = b.corners().map(place);
    let mut out: Vec<Vec3> = corners.iter().copied().filter(|c| c.z >= from).collect();
    if out.is_empty() || out.len() == 8 {
        return out;
    }
    for i in 0..8usize {
        for j in [i | 1, i | 2, i | 4] {
            let (a, b) = (corners[i], corners[j]);
            if (a.z < from) != (b.z < from) {
                out.push((a + (b - a) * ((from - a.z) / (b.z - a.z))).with_z(from));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::cell::{Outline, Split, Window};
    use farfield_core::id::{CellId, ChunkId, MaterialId, SplitId};
    use farfield_core::mesh::TriangleMesh;
    use farfield_core::region::Region;
    use farfield_core::scene::{Material, Placement, SceneBuilder};
    use glam::{DAffine3, DVec3};

    /// A speck of 2 x 2 at (x, y, -10), another at (20, 0, -10) that keeps the frame's footprint fixed.
    fn framed(x: f64, y: f64, half: f32, max_px: u32) -> Option<Framed> {
        let mut b = SceneBuilder::default();
        b.materials.push(Material::default());
        let shape = TriangleMesh {
            positions: vec![Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)],
            indices: vec![0, 1, 2],
            sections: vec![(0..3, MaterialId(0))],
            ..Default::default()
        };
        let mesh = b.mesh("speck", shape).unwrap();
        b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::new(x, y, -10.0)) });
        let scene = b.build().unwrap();
        // The scene's local frame starts under the speck.
        let centre = Vec3::new(-x as f32, 1.0 - y as f32, 10.0);
        let corner = |s: f32, u: f32| centre + Vec3::new(s * half, u * half, -5.0);
        let window = Window {
            axis: -Vec3::Z,
            corners: [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            px_per_tan: 100.0,
        };
        let far: ChunkSet = [ChunkId(0)].into_iter().collect();
        let sector = Sector { split: SplitId(0), window, seen: far.clone() };
        let outline =
            Outline { id: CellId(0), region: Region::Sphere { centre, radius: 1.0 }, centre, neighbours: vec![] };
        let splits = vec![Split { far: far.clone(), near_budget: None }];
        let cell = Cell { outline, splits, sectors: vec![sector.clone()], own: vec![], claims: vec![] };
        frame(&cell, &sector, &far, &scene, 0.1, Grain { density: 2.0, max_px }).unwrap()
    }

    #[test]
    fn the_picture_is_the_window_cut_to_what_there_is() {
        // The window spans tangents -1..1, the speck 0.101..0.301 and -0.1..0.1: 20 pixels a tenth, and a border.
        let f = framed(2.01, 0.0, 5.0, 4096).unwrap();
        assert_eq!(f.camera.size[0], 43);
        assert!((f.camera.left - 0.095).abs() < 1e-5 && (f.camera.right_tan - 0.31).abs() < 1e-5, "{f:?}");
        assert!((f.camera.px_per_tan() - 200.0).abs() < 0.01 && f.window == 5.0 && f.coarse == 0.5);
        assert_eq!(f.reach, [10.0, 10.0]);
        // A small window cuts the speck, and one beside it shows nothing.
        assert_eq!(framed(0.0, 0.0, 0.251, 4096).unwrap().camera.size, [24, 24]);
        assert!(framed(8.0, 0.0, 1.0, 4096).is_none());
    }

    #[test]
    fn what_is_too_large_is_taken_with_fewer_pixels() {
        let f = framed(0.0, 0.0, 5.0, 24).unwrap();
        assert!(f.camera.size.iter().all(|&s| s <= 24) && f.coarse > 0.9, "{f:?}");
    }

    #[test]
    fn of_a_box_around_the_eye_only_what_lies_ahead_counts() {
        let b = Aabb { min: Vec3::splat(-3.0), max: Vec3::splat(4.0) };
        let points = ahead(&b, 2.0, &|p| p);
        assert_eq!(points.len(), 8);
        let z: Vec<f32> = points.iter().map(|p| p.z).collect();
        assert_eq!((z.iter().filter(|z| **z == 2.0).count(), z.iter().filter(|z| **z == 4.0).count()), (4, 4));
        assert!(ahead(&b, 5.0, &|p| p).is_empty());
    }
}
