//! Cells, neighbours and what is near, against brute force on random scenes.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

use farfield_core::context::{Capture, Forget, Serial, Shot};
use farfield_core::id::MaterialId;
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, SceneBuilder};
use glam::{DAffine3, DVec3};
use proptest::prelude::*;

use super::*;

struct Blind;
impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("partitions take no pictures".into()))
    }
}

fn views(eye_height: [f32; 2]) -> ViewModel {
    ViewModel {
        fov_y_rad: 1.0,
        resolution: [64, 64],
        near: 0.01,
        eye_height,
        pitch_rad: [0.0, 0.0],
        max_speed: 1.0,
        max_turn_rad: 1.0,
    }
}

/// Fans of `n` triangles each, a unit across, at these places.
fn scene(at: &[[f32; 3]], n: u32) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let rim = |k: u32| Vec3::from_array([(k as f32 / n as f32).cos(), 0.1 * k as f32 / n as f32, (k as f32).sin()]);
    let shape = TriangleMesh {
        positions: std::iter::once(Vec3::ZERO).chain((0..=n).map(|k| rim(k) * 0.5)).collect(),
        indices: (1..=n).flat_map(|k| [0, k + 1, k]).collect(),
        sections: vec![(0..3 * n, MaterialId(0))],
        ..Default::default()
    };
    let mesh = b.mesh("fan", shape).unwrap();
    for p in at {
        b.place(Placement { mesh, transform: DAffine3::from_translation(Vec3::from(*p).as_dvec3()) });
    }
    b.build().unwrap()
}

fn with<T>(f: impl FnOnce(&Context<'_>) -> T) -> T {
    f(&Context { capture: &Blind, run: &Serial, memo: &Forget, cancel: &AtomicBool::new(false) })
}

fn settings() -> OctreeRegions {
    OctreeRegions { max_triangles: 100, ..OctreeRegions::default() }
}

fn divided(own: &OctreeRegions, s: &Scene, eye_height: [f32; 2]) -> Box<dyn Cells> {
    with(|cx| own.divide(s, &views(eye_height), cx).unwrap())
}

fn inside(cells: &dyn Cells, id: CellId, s: &Scene) -> Cell {
    with(|cx| cells.inside(id, s, cx).unwrap())
}

/// The cube of a cell, read off its windows: the far ends of opposite faces.
fn cube(cell: &Cell) -> Aabb {
    Aabb::of(cell.sectors.iter().flat_map(|s| s.window.corners))
}

fn places() -> impl Strategy<Value = Vec<[f32; 3]>> {
    prop::collection::vec([-30f32..30.0, 0f32..12.0, -20f32..20.0], 1..60)
}

fn own() -> impl Strategy<Value = OctreeRegions> {
    (20u64..400, 1.0f32..4.0, any::<bool>(), prop::option::of(4.0f32..20.0), 0f32..5.0).prop_map(
        |(max_triangles, min_size, three_dimensional, max_size, margin)| OctreeRegions {
            max_triangles,
            min_size,
            max_size,
            three_dimensional,
            margin: Some(margin),
        },
    )
}

fn heights() -> impl Strategy<Value = [f32; 2]> {
    // Narrow, wide, and a single height.
    prop_oneof![(0.5f32..6.0, 0f32..8.0).prop_map(|(l, d)| [l, l + d]), (0.5f32..6.0).prop_map(|l| [l, l])]
}

/// How many cells hold an eye by their own account: half-open cubes, read off the windows.
fn holders(cells: &[Cell], eye: DVec3) -> Vec<CellId> {
    let holds = |c: &&Cell| {
        let b = cube(c);
        eye.cmpge(b.min.as_dvec3()).all() && eye.cmplt(b.max.as_dvec3()).all()
    };
    cells.iter().filter(holds).map(|c| c.outline.id).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn every_eye_of_the_model_space_has_exactly_one_cell_and_its_region_holds_it(
        at in places(), own in own(), h in heights(), us in prop::collection::vec([0f32..=1.0, 0f32..=1.0, 0f32..=1.0], 24)
    ) {
        let s = scene(&at, 12);
        let cells = divided(&own, &s, h);
        let all: Vec<Cell> = (0..cells.outlines().len() as u32).map(|i| inside(&*cells, CellId(i), &s)).collect();
        let m = own.margin.unwrap();
        let (lo, hi) = if own.three_dimensional {
            (s.bounds.min.y.min(h[0]), s.bounds.max.y.max(h[1]))
        } else {
            (h[0], h[1])
        };
        let space = Aabb {
            min: Vec3::new(s.bounds.min.x - m, lo, s.bounds.min.z - m),
            max: Vec3::new(s.bounds.max.x + m, hi, s.bounds.max.z + m),
        };
        let mut eyes: Vec<DVec3> = us.iter().map(|u| (space.min + space.size() * Vec3::from(*u)).as_dvec3()).collect();
        eyes.extend(space.corners().map(|c| c.as_dvec3()));
        // Corners of cells: exactly on borders.
        let corners = all.iter().step_by(1 + all.len() / 40).flat_map(|c| c.outline.region.corners().unwrap());
        eyes.extend(corners.filter(|c| space.contains(*c)).map(|c| c.as_dvec3()));
        for eye in eyes {
            let eye = eye.clamp(space.min.as_dvec3(), space.max.as_dvec3());
            let found = cells.find(&views(h).camera(eye, 0.3, 0.0));
            prop_assert_eq!(holders(&all, eye), found.into_iter().collect::<Vec<_>>(), "{}", eye);
            prop_assert!(found.is_some(), "{} of {:?}", eye, space);
            prop_assert!(cells.outlines()[found.unwrap().index()].region.contains(eye.as_vec3()));
        }
    }

    #[test]
    fn no_region_is_too_full_or_larger_than_it_has_to_be_and_far_chunks_never_meet_it(
        at in places(), own in own(), h in heights()
    ) {
        let s = scene(&at, 12);
        let cells = divided(&own, &s, h);
        for o in cells.outlines() {
            let cell = inside(&*cells, o.id, &s);
            let b = cube(&cell);
            let edge = b.size().x;
            let far = &cell.splits[0].far;
            let near: u64 = s.chunks.iter().enumerate()
                .filter(|(_, c)| c.bounds.min.cmple(b.max).all() && b.min.cmple(c.bounds.max).all())
                .map(|(_, c)| u64::from(c.triangles)).sum();
            prop_assert_eq!(near, s.triangles_of(&far.complement(s.chunks.len() as u32)));
            let smallest = edge < own.min_size * 1.01;
            prop_assert!(smallest || near <= own.max_triangles, "{} triangles in {:?}", near, b);
            prop_assert!(own.max_size.is_none_or(|m| smallest || edge <= m * 1.001), "{}", edge);
            prop_assert!((edge / own.min_size).log2().fract().min(1.0 - (edge / own.min_size).log2().fract()) < 1e-2);
            for c in far.iter() {
                prop_assert!(o.region.distance(&s.chunks[c.index()].bounds) > 0.0);
            }
            prop_assert!(o.region.contains(o.centre) && b.contains(o.centre));
        }
    }

    #[test]
    fn neighbours_are_the_cells_that_share_a_face(at in places(), own in own(), h in heights()) {
        let s = scene(&at, 12);
        let cells = divided(&own, &s, h);
        let cubes: Vec<Aabb> = cells.outlines().iter().map(|o| cube(&inside(&*cells, o.id, &s))).collect();
        for (i, a) in cubes.iter().enumerate().step_by(1 + cubes.len() / 60) {
            let shares = |b: &Aabb| {
                let (lo, hi) = (a.min.max(b.min), a.max.min(b.max));
                let d = (hi - lo).to_array();
                d.iter().filter(|v| **v == 0.0).count() == 1 && d.iter().filter(|v| **v > 0.0).count() == 2
            };
            let want: BTreeSet<u32> = (0..cubes.len()).filter(|&j| shares(&cubes[j])).map(|j| j as u32).collect();
            let told: BTreeSet<u32> = cells.outlines()[i].neighbours.iter().map(|n| n.0).collect();
            prop_assert_eq!(told.len(), cells.outlines()[i].neighbours.len());
            prop_assert_eq!(&told, &want);
            for n in told {
                prop_assert!(cells.outlines()[n as usize].neighbours.contains(&CellId(i as u32)));
            }
        }
    }

    #[test]
    fn a_camera_in_a_region_uses_a_window_that_shows_what_it_looks_at(
        at in places(), own in own(), h in heights(), pick in 0usize..10_000, u in [0f32..=1.0, 0f32..=1.0, 0f32..=1.0]
    ) {
        let s = scene(&at, 12);
        let cells = divided(&own, &s, h);
        let cell = inside(&*cells, CellId((pick % cells.outlines().len()) as u32), &s);
        let corners = cell.outline.region.corners().unwrap();
        for eye in corners.into_iter().chain([cell.outline.region.sample(u).unwrap()]) {
            for c in cell.splits[0].far.iter() {
                for p in s.chunks[c.index()].bounds.corners() {
                    let camera = Camera::looking(eye.as_dvec3(), p - eye, Vec3::Y, 0.01, [8, 8], 0.01);
                    let used = cells.active(&cell, &camera).sectors;
                    prop_assert!(used.iter().any(|k| cell.sectors[k.index()].seen.contains(c)), "{:?} from {}", c, eye);
                }
            }
        }
    }
}

#[test]
fn equal_cells_of_two_metres_as_in_the_papers_house() {
    let s = scene(&[[-9.0, 0.0, -7.0], [9.0, 2.0, 7.0], [0.0, 1.0, 0.0]], 12);
    let own = OctreeRegions { max_size: Some(2.0), ..OctreeRegions::default() };
    let cells = divided(&own, &s, [1.6, 1.6]);
    for o in cells.outlines() {
        let Region::Box(b) = o.region else { panic!("a region that is no box") };
        assert_eq!(b.size(), Vec3::new(2.0, 0.0, 2.0));
        assert_eq!(b.min.y, 1.6);
    }
    // 18 + 1 by 14 + 1 metres and 2 metres around, one layer: a little more than 23 x 19 over four.
    assert!((100..160).contains(&cells.outlines().len()), "{}", cells.outlines().len());
}

#[test]
fn a_dense_corner_is_divided_and_the_rest_is_not() {
    let mut at = vec![[-31.0, 0.0, -31.0], [31.0, 0.0, 31.0]];
    at.extend((0..20).map(|k| [20.0 + 0.3 * k as f32, 1.0, 20.0]));
    let s = scene(&at, 12);
    let cells = divided(&settings(), &s, [1.5, 1.5]);
    let edge = |x: f64, z: f64| {
        let id = cells.find(&views([1.5, 1.5]).camera(DVec3::new(x, 1.5, z), 0.0, 0.0)).unwrap();
        cube(&inside(&*cells, id, &s)).size().x
    };
    assert_eq!(edge(22.0, 20.0), 2.0);
    assert!(edge(-20.0, -20.0) >= 16.0, "{}", edge(-20.0, -20.0));
}

#[test]
fn eyes_beside_the_space_have_no_cell_and_an_empty_scene_has_one() {
    let s = scene(&[[0.0, 0.0, 0.0]], 12);
    let cells = divided(&settings(), &s, [1.5, 2.5]);
    let find = |x: f64, y: f64| cells.find(&views([1.5, 2.5]).camera(DVec3::new(x, y, 0.0), 0.0, 0.0));
    assert!(find(0.0, 1.5).is_some() && find(0.0, 2.5).is_some() && find(0.0, 1.49999).is_some());
    assert_eq!((find(0.0, 1.4), find(0.0, 2.6), find(50.0, 2.0)), (None, None, None));
    let empty = scene(&[], 12);
    let cells = divided(&settings(), &empty, [1.5, 1.5]);
    assert!(cells.find(&views([1.5, 1.5]).camera(DVec3::Y * 1.5, 0.0, 0.0)).is_some());
}

#[test]
fn settings_that_fit_nothing_are_refused_in_words() {
    let s = scene(&[[0.0, 0.0, 0.0], [1000.0, 0.0, 1000.0]], 12);
    let refused =
        |own: OctreeRegions| with(|cx| own.divide(&s, &views([1.5, 1.5]), cx).map(|_| ())).unwrap_err().to_string();
    assert!(refused(OctreeRegions { max_triangles: 0, ..settings() }).contains("max_triangles"));
    assert!(refused(OctreeRegions { min_size: 0.0, ..settings() }).contains("min_size = 0"));
    assert!(refused(OctreeRegions { min_size: f32::NAN, ..settings() }).contains("min_size"));
    assert!(refused(OctreeRegions { min_size: 1e-3, ..settings() }).contains("more than 16 times"));
    assert!(refused(OctreeRegions { max_size: Some(1.0), ..settings() }).contains("max_size = 1"));
    assert!(refused(OctreeRegions { margin: Some(-1.0), ..settings() }).contains("margin"));
    assert!(refused(OctreeRegions { min_size: 0.5, max_size: Some(0.5), ..settings() }).contains("more than 1000000"));
}
