//! Windows, neighbours and what is near, on small scenes.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;

use farfield_core::context::{Capture, Forget, Serial, Shot};
use farfield_core::id::MaterialId;
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, SceneBuilder};
use glam::{DAffine3, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

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

fn views(fov_deg: f32) -> ViewModel {
    ViewModel {
        fov_y_rad: fov_deg.to_radians(),
        resolution: [64, 64],
        near: 0.01,
        eye_height: [1.5, 2.0],
        pitch_rad: [0.0, 0.0],
        max_speed: 1.0,
        max_turn_rad: 1.0,
    }
}

/// Little triangles at these places (the first and last span the scene).
fn scene(at: &[[f64; 3]]) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let shape = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::new(0.2, 0.0, 0.0), Vec3::new(0.0, 0.2, 0.1)],
        indices: vec![0, 1, 2],
        sections: vec![(0..3, MaterialId(0))],
        ..Default::default()
    };
    let mesh = b.mesh("speck", shape).unwrap();
    at.iter().for_each(|p| b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::from(*p)) }));
    b.build().unwrap()
}

fn with<T>(f: impl FnOnce(&Context<'_>) -> T) -> T {
    f(&Context { capture: &Blind, run: &Serial, memo: &Forget, cancel: &AtomicBool::new(false) })
}

fn unit(rng: &mut ChaCha8Rng) -> f32 {
    rng.next_u32() as f32 / u32::MAX as f32
}

fn divided(s: &Scene, edge: f32, fov_deg: f32) -> Box<dyn Cells> {
    with(|cx| HexCells { edge, margin: None }.divide(s, &views(fov_deg), cx).unwrap())
}

#[test]
fn a_view_meets_as_many_windows_as_the_papers_table_says() {
    let s = scene(&[[-30.0, 0.0, -30.0], [30.0, 5.0, 30.0]]);
    for (fov, most) in [(120.0, 5), (90.0, 4), (60.0, 3), (45.0, 3), (30.0, 2)] {
        let cells = divided(&s, 10.0, fov);
        let middle = views(fov).camera(DVec3::new(0.0, 1.7, 0.0), 0.0, 0.0);
        let cell = with(|cx| cells.inside(cells.find(&middle).unwrap(), &s, cx).unwrap());
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut found = 0;
        for _ in 0..20_000 {
            let eye = cell.outline.region.sample([unit(&mut rng), unit(&mut rng), unit(&mut rng)]).unwrap();
            let camera = views(fov).camera(eye.as_dvec3(), unit(&mut rng) * std::f32::consts::TAU, 0.0);
            found = found.max(cells.active(&cell, &camera).sectors.len());
        }
        assert_eq!(found, most, "{fov} degrees");
    }
}

#[test]
fn neighbours_are_mutual_and_a_step_needs_three_new_ones_at_most() {
    let cells = divided(&scene(&[[-60.0, 0.0, -40.0], [50.0, 0.0, 70.0]]), 10.0, 60.0);
    let of = |id: CellId| -> BTreeSet<u32> { cells.outlines()[id.index()].neighbours.iter().map(|n| n.0).collect() };
    assert!(cells.outlines().len() > 40);
    for o in cells.outlines() {
        for n in &o.neighbours {
            assert!(of(*n).contains(&o.id.0));
            let new = of(*n).difference(&of(o.id)).filter(|c| **c != o.id.0).count();
            assert!(new <= 3);
            let apart = cells.outlines()[n.index()].centre.distance(o.centre);
            assert!((apart - 10.0 * 3f32.sqrt()).abs() < 1e-3);
        }
    }
}

#[test]
fn a_camera_finds_the_cell_whose_region_holds_it_and_none_at_other_heights() {
    let cells = divided(&scene(&[[-60.0, 0.0, -40.0], [50.0, 0.0, 70.0]]), 10.0, 60.0);
    for o in cells.outlines() {
        for u in [[0.1, 0.2, 0.0], [0.9, 0.8, 1.0], [0.4, 0.5, 0.5]] {
            let eye = o.region.sample(u).unwrap();
            assert_eq!(cells.find(&views(60.0).camera(eye.as_dvec3(), 0.0, 0.0)), Some(o.id));
        }
        let high = o.centre.with_y(3.0).as_dvec3();
        assert_eq!(cells.find(&views(60.0).camera(high, 0.0, 0.0)), None);
    }
    assert_eq!(cells.find(&views(60.0).camera(DVec3::new(1e4, 1.7, 0.0), 0.0, 0.0)), None);
}

#[test]
fn what_meets_the_column_is_near_and_every_far_chunk_is_seen_where_rays_leave() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut places = vec![[-40.0, 0.0, -40.0], [40.0, 30.0, 40.0], [0.0, 25.0, 0.0]];
    places.extend((0..400).map(|_| [0; 3].map(|_| f64::from(unit(&mut rng)) * 40.0 - 20.0)));
    let s = scene(&places);
    let cells = divided(&s, 8.0, 60.0);
    let here = cells.find(&views(60.0).camera(DVec3::new(0.0, 1.7, 0.0), 0.0, 0.0)).unwrap();
    let cell = with(|cx| cells.inside(here, &s, cx).unwrap());
    let far = &cell.splits[0].far;
    // The speck high above the cell is near: no window shows it.
    assert!(!far.contains(ChunkId(2)));
    assert!(far.len() > 100 && far.len() < s.chunks.len());
    for c in far.iter() {
        let b = s.chunks[c.index()].bounds;
        for u in [[0.0, 0.3, 0.0], [0.4, 0.9, 1.0], [0.99, 0.1, 0.5]] {
            let eye = cell.outline.region.sample(u).unwrap();
            for p in b.corners() {
                // A camera aimed at the point has an active window that shows its chunk.
                let camera = Camera::looking(eye.as_dvec3(), p - eye, Vec3::Y, 0.01, [8, 8], 0.01);
                let active = cells.active(&cell, &camera).sectors;
                assert!(active.iter().any(|k| cell.sectors[k.index()].seen.contains(c)), "{c:?} from {eye} at {p}");
            }
        }
    }
}

#[test]
fn settings_that_fit_nothing_are_refused_in_words() {
    let s = scene(&[[0.0, 0.0, 0.0], [100.0, 0.0, 100.0]]);
    let refused = |edge: f32, margin: Option<f32>| {
        let divided = with(|cx| HexCells { edge, margin }.divide(&s, &views(60.0), cx).map(|_| ()));
        divided.unwrap_err().to_string()
    };
    assert!(refused(0.0, None).contains("edge = 0"));
    assert!(refused(f32::NAN, None).contains("edge"));
    assert!(refused(0.01, None).contains("more than"));
    assert!(refused(5.0, Some(-1.0)).contains("margin"));
}
