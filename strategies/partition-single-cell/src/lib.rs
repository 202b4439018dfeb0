//! `single-cell`: one cell for every viewpoint, or for a box of them.
//!
//! Without a region everything is far from everywhere: for far fields that serve any viewpoint (hierarchies, plain geometry). With
//! one, far is what does not meet the box: the way to try an image-based far field on one set of viewpoints.
//!
//! Six windows, the faces of the region's box (without a region, of the box of scene and eyes): together they close it, so a ray
//! leaves through one of them, and what it then meets lies beyond that face's plane; a window's `seen` holds the far chunks
//! that reach there. O(chunks).

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Cell, Outline, Sector, Split, Window, leaves_at_once, sees};
use farfield_core::context::Context;
use farfield_core::id::{CellId, ChunkId, SectorId, SplitId};
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Cells, Partition};
use farfield_core::{Aabb, Camera, Fault};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An eye nearer to a window's plane than this share of the box's longest edge stands in the window.
const IN_WINDOW: f32 = 1e-4;

/// One cell.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SingleCell {
    /// The box of viewpoints as lowest x, y, z and highest x, y, z, relative to the middle of the scene's footprint at the height
    /// of its lowest point; without it every viewpoint.
    #[serde(default)]
    #[schemars(extend("unit" = "scene units"))]
    pub region: Option<[f32; 6]>,
}

struct One {
    outline: [Outline; 1],
    window_box: Aabb,
    px_per_tan: f32,
}

#[typetag::serde(name = "single-cell")]
impl Partition for SingleCell {
    fn divide(&self, scene: &Scene, views: &ViewModel, _cx: &Context<'_>) -> Result<Box<dyn Cells>, Fault> {
        let (region, window_box) = match self.region {
            Some(r) => {
                let b = Aabb { min: Vec3::new(r[0], r[1], r[2]), max: Vec3::new(r[3], r[4], r[5]) };
                if b.is_empty() || !(b.min.is_finite() && b.max.is_finite()) {
                    return Err(Fault::Refused(format!("single-cell: region = {r:?} is no box of viewpoints")));
                }
                (Region::Box(b), b)
            }
            None => {
                let eyes = |y: f32| scene.bounds.centre().with_y(y);
                (Region::Everywhere, scene.bounds.union(Aabb::of(views.eye_height.map(eyes))))
            }
        };
        let outline = Outline { id: CellId(0), region, centre: window_box.centre(), neighbours: vec![] };
        Ok(Box::new(One { outline: [outline], window_box, px_per_tan: views.px_per_tan() }))
    }

    /// 2: windows have the box's own corners.
    fn version(&self) -> u32 {
        2
    }
}

impl Cells for One {
    fn outlines(&self) -> &[Outline] {
        &self.outline
    }

    fn find(&self, camera: &Camera) -> Option<CellId> {
        self.outline[0].region.contains(camera.eye.as_vec3()).then_some(CellId(0))
    }

    fn inside(&self, id: CellId, scene: &Scene, cx: &Context<'_>) -> Result<Cell, Fault> {
        cx.check()?;
        if id != CellId(0) {
            return Err(Fault::Refused(format!("single-cell: cell {} of 1", id.0)));
        }
        let outline = self.outline[0].clone();
        let far: ChunkSet = match &outline.region {
            Region::Everywhere => scene.all_chunks(),
            region => (0..scene.chunks.len() as u32)
                .map(ChunkId)
                .filter(|c| region.distance(&scene.chunks[c.index()].bounds) > 0.0)
                .collect(),
        };
        let everywhere = outline.region == Region::Everywhere;
        let sectors = Window::faces(&self.window_box, self.px_per_tan)
            .map(|window| {
                let beyond = |c: &ChunkId| everywhere || window.is_before(&scene.chunks[c.index()].bounds);
                let seen = far.iter().filter(beyond).collect();
                Sector { split: SplitId(0), window, seen }
            })
            .to_vec();
        Ok(Cell { outline, splits: vec![Split { far, near_budget: None }], sectors, own: vec![], claims: vec![] })
    }

    /// Without a region an eye may stand outside the windows' box, where none of them need be in its frustum: all are used.
    fn active(&self, cell: &Cell, camera: &Camera) -> Active {
        let all = cell.outline.region == Region::Everywhere;
        let slack = f64::from(IN_WINDOW * self.window_box.size().max_element());
        let meets = |s: &u32| {
            let window = &cell.sectors[*s as usize].window;
            all || sees(camera, window) || leaves_at_once(camera, window, slack)
        };
        let sectors = (0..cell.sectors.len() as u32).filter(meets).map(SectorId).collect();
        Active { cell: cell.outline.id, split: SplitId(0), sectors }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::context::{Capture, Forget, Serial, Shot};
    use farfield_core::id::MaterialId;
    use farfield_core::image::SurfaceImage;
    use farfield_core::mesh::TriangleMesh;
    use farfield_core::scene::{Material, Placement, SceneBuilder};
    use glam::{DAffine3, DVec3};
    use std::sync::atomic::AtomicBool;

    struct Blind;
    impl Capture for Blind {
        fn identity(&self) -> &str {
            "none"
        }
        fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
            Err(Fault::Refused("partitions take no pictures".into()))
        }
    }

    fn scene() -> Scene {
        let mut b = SceneBuilder::default();
        b.materials.push(Material::default());
        let shape = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![0, 1, 2],
            sections: vec![(0..3, MaterialId(0))],
            ..Default::default()
        };
        let mesh = b.mesh("speck", shape).unwrap();
        for x in -5i32..=5 {
            for z in -5..=5 {
                let at = DVec3::new(f64::from(x), f64::from((x * z).rem_euclid(3)), f64::from(z)) * 4.0;
                b.place(Placement { mesh, transform: DAffine3::from_translation(at) });
            }
        }
        b.build().unwrap()
    }

    fn cell(region: Option<[f32; 6]>) -> Result<(Scene, Box<dyn Cells>, Cell), Fault> {
        let (s, go) = (scene(), AtomicBool::new(false));
        let cx = Context { capture: &Blind, run: &Serial, memo: &Forget, cancel: &go };
        let cells = SingleCell { region }.divide(&s, &views(), &cx)?;
        let inside = cells.inside(CellId(0), &s, &cx)?;
        Ok((s, cells, inside))
    }

    fn views() -> ViewModel {
        ViewModel {
            fov_y_rad: 1.0,
            resolution: [64, 64],
            near: 0.01,
            eye_height: [1.0, 2.0],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        }
    }

    #[test]
    fn without_a_region_everything_is_far_from_anywhere() {
        let (s, cells, inside) = cell(None).unwrap();
        assert_eq!(inside.splits[0].far, s.all_chunks());
        let away = views().camera(DVec3::new(1e5, 3e4, 0.0), 0.3, 0.1);
        assert_eq!(cells.find(&away), Some(CellId(0)));
        assert_eq!(cells.active(&inside, &away).sectors.len(), 6);
    }

    #[test]
    fn with_a_region_what_does_not_meet_it_is_far_and_seen_through_its_faces() {
        let (s, cells, inside) = cell(Some([-3.0, 0.5, -3.0, 3.0, 2.5, 3.0])).unwrap();
        let far = &inside.splits[0].far;
        assert!(!far.is_empty() && far.len() < s.chunks.len());
        assert_eq!(cells.find(&views().camera(DVec3::new(0.0, 3.0, 0.0), 0.0, 0.0)), None);
        for c in far.iter() {
            for eye in inside.outline.region.corners().unwrap() {
                let p = s.chunks[c.index()].bounds.centre();
                let camera = Camera::looking(eye.as_dvec3(), p - eye, Vec3::Y, 0.02, [8, 8], 0.01);
                let sectors = cells.active(&inside, &camera).sectors;
                assert!(sectors.iter().any(|k| inside.sectors[k.index()].seen.contains(c)), "{c:?} from {eye}");
            }
        }
    }

    #[test]
    fn a_region_that_is_no_box_is_refused() {
        let refused = cell(Some([1.0, 0.0, 0.0, -1.0, 1.0, 1.0])).map(|_| ()).unwrap_err();
        assert!(refused.to_string().contains("no box of viewpoints"), "{refused}");
    }
}
