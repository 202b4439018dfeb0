//! The promise against independent counts, on random scenes; refusals; what `find` means.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use farfield_core::camera::ViewModel;
use farfield_core::cell::Cell;
use farfield_core::context::{Capture, Context, Executor, Forget, Serial, Shot};
use farfield_core::id::{CellId, MaterialId, SplitId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::region::Region;
use farfield_core::scene::{Material, PlacedChunk, Placement, Scene, SceneBuilder};
use farfield_core::strategy::Partition;
use farfield_core::{Camera, Fault};
use farfield_partition_adaptive_grid::{AdaptiveGrid, Directions};
use glam::{DAffine3, DVec3, Vec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The views that the partition budgets for are this much wider, relatively, than the view model's.
const TAN_SLACK: f64 = 1e-6;

struct Blind;

impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("partitions take no pictures".into()))
    }
}

/// Three threads that take jobs from the end.
struct Backwards;

impl Executor for Backwards {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        let (taken, fault) = (AtomicUsize::new(0), Mutex::new(None));
        let work = || {
            while let Some(i) = n.checked_sub(taken.fetch_add(1, Ordering::Relaxed) + 1) {
                if let Err(f) = job(i) {
                    *fault.lock().unwrap() = Some(f);
                }
            }
        };
        std::thread::scope(|s| (0..3).for_each(|_| drop(s.spawn(work))));
        fault.into_inner().unwrap().map_or(Ok(()), Err)
    }
}

fn with<T>(run: &dyn Executor, f: impl FnOnce(&Context<'_>) -> T) -> T {
    f(&Context { capture: &Blind, run, memo: &Forget, cancel: &AtomicBool::new(false) })
}

struct Dice(ChaCha8Rng);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }
    fn unit(&mut self) -> f32 {
        self.0.next_u32() as f32 / u32::MAX as f32
    }
    fn within(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.unit()
    }
}

/// `n` clouds of 20 to 200 triangles, up to `size` wide, in a box of these edges.
fn clouds(n: usize, size: f32, edges: [f32; 3], seed: u64) -> Scene {
    crowd(n, size, edges, 1, seed)
}

/// The same, the smaller and the nearer together towards the lowest corner, the higher the power.
fn crowd(n: usize, size: f32, edges: [f32; 3], power: i32, seed: u64) -> Scene {
    let mut dice = Dice::new(seed);
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let meshes: Vec<_> = [20u32, 60, 200]
        .iter()
        .map(|&triangles| {
            let mut point = || Vec3::new(dice.unit(), dice.unit(), dice.unit()) - 0.5;
            let shape = TriangleMesh {
                positions: (0..3 * triangles).map(|_| point()).collect(),
                indices: (0..3 * triangles).collect(),
                sections: vec![(0..3 * triangles, MaterialId(0))],
                ..Default::default()
            };
            b.mesh("cloud", shape).unwrap()
        })
        .collect();
    for i in 0..n {
        let near = dice.unit();
        let pull = near.powi(power - 1);
        let at = edges.map(|e| f64::from(dice.within(0.0, e) * pull));
        let scale = [(); 3].map(|()| f64::from(dice.within(0.1, 1.0) * size * pull.max(0.02)));
        let transform = DAffine3::from_translation(at.into()) * DAffine3::from_scale(scale.into());
        b.place(Placement { mesh: meshes[i % 3], transform });
    }
    b.build().unwrap()
}

fn views(fov_deg: f32, size: [u32; 2], heights: [f32; 2], pitch_deg: [f32; 2]) -> ViewModel {
    ViewModel {
        fov_y_rad: fov_deg.to_radians(),
        resolution: size,
        near: 0.01,
        eye_height: heights,
        pitch_rad: pitch_deg.map(f32::to_radians),
        max_speed: 1.0,
        max_turn_rad: 1.0,
    }
}

/// Views from anywhere in the model space.
fn some_view(dice: &mut Dice, s: &Scene, v: &ViewModel) -> Camera {
    let eye = Vec3::new(
        dice.within(s.bounds.min.x, s.bounds.max.x),
        dice.within(v.eye_height[0], v.eye_height[1]),
        dice.within(s.bounds.min.z, s.bounds.max.z),
    );
    let pitch = dice.within(v.pitch_rad[0], v.pitch_rad[1]);
    v.camera(eye.as_dvec3(), dice.unit() * std::f32::consts::TAU, pitch)
}

/// A camera's coordinates of a place: right, up and ahead.
fn in_camera(c: &Camera, p: DVec3) -> DVec3 {
    let d = p - c.eye;
    DVec3::new(d.dot(c.right.as_dvec3()), d.dot(c.up.as_dvec3()), d.dot(c.forward.as_dvec3()))
}

/// Whether a chunk is drawn, by its corners in the camera: not all of them beyond one edge of the picture.
fn drawn(c: &Camera, chunk: &PlacedChunk) -> bool {
    let at = chunk.bounds.corners().map(|p| in_camera(c, p.as_dvec3()));
    let [l, r, b, t] = [c.left, c.right_tan, c.bottom, c.top].map(f64::from);
    at.iter().any(|p| p.x >= l * p.z)
        && at.iter().any(|p| p.x <= r * p.z)
        && at.iter().any(|p| p.y >= b * p.z)
        && at.iter().any(|p| p.y <= t * p.z)
}

struct Seen {
    most: u64,
    with_image: usize,
    cells: usize,
    images: usize,
}

/// Divides, walks, and checks at every view: a cell is found, its star-shape holds the eye where there are images, the image in use
/// is in front of the eye, and what is drawn stays within the budget.
fn walk(s: &Scene, v: &ViewModel, settings: &AdaptiveGrid, count: usize) -> Seen {
    let cells = with(&Backwards, |cx| settings.divide(s, v, cx)).unwrap();
    let mut insides: BTreeMap<CellId, Cell> = BTreeMap::new();
    let mut dice = Dice::new(99);
    let mut seen = Seen { most: 0, with_image: 0, cells: cells.outlines().len(), images: 0 };
    for i in 0..count {
        let camera = some_view(&mut dice, s, v);
        let id = cells.find(&camera).unwrap_or_else(|| panic!("view {i} at {} finds no cell", camera.eye));
        let cell = insides.entry(id).or_insert_with(|| with(&Serial, |cx| cells.inside(id, s, cx)).unwrap());
        let active = cells.active(cell, &camera);
        let split = &cell.splits[active.split.index()];
        assert_eq!(split.near_budget, Some(settings.budget));
        if !cell.sectors.is_empty() {
            let Region::Sphere { centre, radius } = cell.outline.region else { panic!("no sphere") };
            assert!((camera.eye - centre.as_dvec3()).length() <= f64::from(radius) * (1.0 + 1e-5), "view {i}");
        }
        assert_eq!(active.sectors.len(), usize::from(active.split != SplitId(0)));
        for k in &active.sectors {
            let sector = &cell.sectors[k.index()];
            assert_eq!((sector.split, &sector.seen), (active.split, &split.far));
            let (axis, corner) = (sector.window.axis.as_dvec3(), sector.window.corners[0].as_dvec3());
            assert!(axis.dot(corner - camera.eye) > 0.0, "view {i}: the image is behind the eye");
            seen.with_image += 1;
        }
        let near =
            s.chunks.iter().enumerate().filter(|(c, _)| !split.far.contains(farfield_core::id::ChunkId(*c as u32)));
        let triangles = near.filter(|(_, c)| drawn(&camera, c)).map(|(_, c)| u64::from(c.triangles)).sum();
        assert!(triangles <= settings.budget, "view {i}: {triangles} of {}", settings.budget);
        seen.most = seen.most.max(triangles);
    }
    seen.images = insides.values().map(|c| c.sectors.len()).sum();
    println!("{} cells, {} images in those met, at most {} triangles", seen.cells, seen.images, seen.most);
    seen
}

#[test]
fn twenty_thousand_views_turned_about_the_vertical_stay_within_the_budget() {
    let s = clouds(500, 6.0, [100.0, 60.0, 80.0], 1);
    let seen = walk(&s, &views(60.0, [64, 64], [5.0, 50.0], [0.0; 2]), &AdaptiveGrid::new(9_000), 20_000);
    // The bound is met, not undercut by far, and it took images to meet it.
    assert!(seen.most > 8_000 && seen.with_image > 1_000, "{} {}", seen.most, seen.with_image);
}

#[test]
fn views_of_a_fixed_pitch_stay_within_the_budget() {
    let s = clouds(400, 6.0, [80.0, 40.0, 80.0], 2);
    let seen = walk(&s, &views(50.0, [96, 64], [5.0, 50.0], [-25.0; 2]), &AdaptiveGrid::new(7_000), 5_000);
    assert!(seen.with_image > 100, "{}", seen.with_image);
}

#[test]
fn views_of_any_yaw_and_pitch_stay_within_the_budget() {
    let s = clouds(400, 5.0, [80.0, 50.0, 80.0], 3);
    let seen = walk(&s, &views(60.0, [80, 64], [5.0, 45.0], [-40.0, 30.0]), &AdaptiveGrid::new(13_000), 20_000);
    assert!(seen.with_image > 500, "{}", seen.with_image);
}

#[test]
fn eyes_of_one_height_are_served() {
    let s = clouds(400, 5.0, [120.0, 10.0, 90.0], 4);
    let seen = walk(&s, &views(60.0, [80, 64], [1.7; 2], [0.0; 2]), &AdaptiveGrid::new(8_000), 10_000);
    assert!(seen.with_image > 500, "{}", seen.with_image);
    let seen = walk(&s, &views(60.0, [80, 64], [1.7; 2], [-20.0, 20.0]), &AdaptiveGrid::new(10_000), 5_000);
    assert!(seen.with_image > 100, "{}", seen.with_image);
}

#[test]
fn views_of_all_pitches_stay_within_the_budget() {
    let s = clouds(400, 5.0, [60.0, 60.0, 60.0], 17);
    let seen = walk(&s, &views(70.0, [64, 64], [5.0, 55.0], [-90.0, 90.0]), &AdaptiveGrid::new(18_000), 10_000);
    assert!(seen.with_image > 100, "{}", seen.with_image);
    let seen = walk(&s, &views(70.0, [64, 64], [0.0, 60.0], [90.0; 2]), &AdaptiveGrid::new(12_000), 3_000);
    assert!(seen.with_image > 30, "{}", seen.with_image);
}

#[test]
fn a_crowded_corner_has_its_own_points_and_stays_within_the_budget() {
    let s = crowd(600, 5.0, [100.0, 60.0, 80.0], 4, 18);
    let v = views(60.0, [64, 64], [1.0, 40.0], [0.0; 2]);
    let settings = AdaptiveGrid { leaf_depth: 9, ..AdaptiveGrid::new(16_000) };
    walk(&s, &v, &settings, 5_000);
    // Once more, from the crowd alone.
    let cells = with(&Backwards, |cx| settings.divide(&s, &v, cx)).unwrap();
    let mut dice = Dice::new(19);
    let (mut insides, mut with_image) = (BTreeMap::new(), 0);
    for i in 0..5_000 {
        let [x, z] = [s.bounds.min.x, s.bounds.min.z].map(|low| low + 15.0 * dice.unit());
        let camera = v.camera(DVec3::new(x.into(), dice.within(1.0, 8.0).into(), z.into()), 6.3 * dice.unit(), 0.0);
        let id = cells.find(&camera).unwrap();
        let cell = insides.entry(id).or_insert_with(|| with(&Serial, |cx| cells.inside(id, &s, cx)).unwrap());
        let active = cells.active(cell, &camera);
        let far = &cell.splits[active.split.index()].far;
        let near = s.chunks.iter().enumerate().filter(|(c, _)| !far.contains(farfield_core::id::ChunkId(*c as u32)));
        let triangles: u64 = near.filter(|(_, c)| drawn(&camera, c)).map(|(_, c)| u64::from(c.triangles)).sum();
        assert!(triangles <= settings.budget, "view {i}: {triangles}");
        with_image += active.sectors.len();
    }
    assert!(with_image > 300, "{with_image}");
    let o = cells.outlines();
    let apart = |a: usize| o[a].neighbours.iter().map(move |n| o[n.index()].centre.distance(o[a].centre));
    let spacings: Vec<f32> = (0..o.len()).filter_map(|a| apart(a).min_by(f32::total_cmp)).collect();
    let (least, most) = spacings.iter().fold((f32::INFINITY, 0f32), |s, &d| (s.0.min(d), s.1.max(d)));
    println!("{} cells, {least} to {most} apart", o.len());
    assert!(least < 0.3 * most, "{least} {most}");
}

#[test]
fn images_stand_beyond_their_star_shape_and_cover_what_they_replace() {
    let s = clouds(500, 6.0, [100.0, 60.0, 80.0], 5);
    let v = views(60.0, [64, 64], [5.0, 50.0], [0.0; 2]);
    let settings = AdaptiveGrid::new(9_000);
    with(&Backwards, |cx| {
        let cells = settings.divide(&s, &v, cx).unwrap();
        let mut images = 0;
        for o in cells.outlines() {
            let cell = cells.inside(o.id, &s, cx).unwrap();
            let Region::Sphere { centre, radius } = o.region else { panic!("no sphere") };
            let own = Directions::of(&cell).unwrap();
            assert_eq!(own.left.len(), cell.sectors.len());
            for (sector, left) in cell.sectors.iter().zip(own.left) {
                images += 1;
                assert!(left <= settings.budget);
                assert!(!sector.seen.is_empty());
                let w = &sector.window;
                let camera = Camera::around(centre.as_dvec3(), w.axis, w.corners, 1e4, 0, 1e-3).unwrap();
                let depth = in_camera(&camera, w.corners[0].as_dvec3()).z;
                assert!(depth > f64::from(radius));
                for c in sector.seen.iter() {
                    for p in s.chunks[c.index()].bounds.corners() {
                        let q = in_camera(&camera, p.as_dvec3());
                        assert!(q.z >= depth);
                        assert!(q.x >= f64::from(camera.left) * q.z && q.x <= f64::from(camera.right_tan) * q.z);
                        assert!(q.y >= f64::from(camera.bottom) * q.z && q.y <= f64::from(camera.top) * q.z);
                    }
                }
            }
        }
        assert!(images > 20, "{images}");
    });
}

#[test]
fn find_takes_the_closest_point_behind_whose_star_shape_holds_the_eye() {
    let s = clouds(300, 6.0, [100.0, 60.0, 80.0], 6);
    let v = views(50.0, [80, 64], [5.0, 50.0], [-10.0, 10.0]);
    with(&Backwards, |cx| {
        let cells = AdaptiveGrid::new(6_000).divide(&s, &v, cx).unwrap();
        let bare: Vec<bool> =
            cells.outlines().iter().map(|o| cells.inside(o.id, &s, cx).unwrap().sectors.is_empty()).collect();
        assert!(bare.contains(&true) && bare.contains(&false));
        let mut dice = Dice::new(7);
        for _ in 0..3_000 {
            let camera = some_view(&mut dice, &s, &v);
            let [tx, ty] = [camera.right_tan, camera.top].map(|t| f64::from(t) * (1.0 + TAN_SLACK));
            let found = cells
                .outlines()
                .iter()
                .filter(|o| {
                    // The point behind the eye as the eye ahead of the point.
                    let p = -in_camera(&camera, o.centre.as_dvec3());
                    p.x.abs() <= tx * p.z && p.y.abs() <= ty * p.z
                })
                .filter(|o| bare[o.id.index()] || o.region.contains(camera.eye.as_vec3()))
                .map(|o| (o.centre.distance(camera.eye.as_vec3()), o.id))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(cells.find(&camera), found.map(|f| f.1));
        }
        let inside = some_view(&mut dice, &s, &v);
        assert!(cells.find(&inside).is_some());
        let with = |change: &dyn Fn(&mut Camera)| {
            let mut c = inside;
            change(&mut c);
            cells.find(&c)
        };
        assert_eq!(with(&|c| c.right_tan *= 1.01), None, "a wider view");
        assert_eq!(with(&|c| c.eye.x += 1e4), None, "outside the grid");
        assert_eq!(with(&|c| c.eye.y = f64::NAN), None);
        assert_eq!(with(&|c| *c = v.camera(c.eye, 1.0, 0.3)), None, "a pitch outside the range");
        assert_eq!(with(&|c| (c.right, c.up) = (c.up, -c.right)), None, "a tilted view");
        assert!(with(&|c| c.top *= 0.5).is_some(), "a narrower view");
    });
}

#[test]
fn every_star_shape_holds_the_eyes_that_come_closest_to_its_point() {
    let s = clouds(400, 6.0, [100.0, 60.0, 80.0], 8);
    for (v, budget) in [
        (views(45.0, [64, 64], [5.0, 50.0], [0.0; 2]), 6_000),
        (views(60.0, [64, 64], [5.0, 50.0], [0.0; 2]), 7_000),
        (views(46.8, [82, 64], [20.0, 30.0], [-30.0, 30.0]), 13_000),
    ] {
        let cells = with(&Backwards, |cx| AdaptiveGrid::new(budget).divide(&s, &v, cx)).unwrap();
        let mut dice = Dice::new(9);
        let (mut most, mut past) = (0f32, 0);
        for _ in 0..40_000 {
            let camera = some_view(&mut dice, &s, &v);
            let [tx, ty] = [camera.right_tan, camera.top].map(f64::from);
            let closest = cells
                .outlines()
                .iter()
                .map(|o| (o, o.centre.distance_squared(camera.eye.as_vec3())))
                .filter(|(o, _)| {
                    let p = -in_camera(&camera, o.centre.as_dvec3());
                    p.x.abs() <= tx * p.z && p.y.abs() <= ty * p.z
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let (o, d) = closest.expect("a point behind every eye");
            let Region::Sphere { radius, .. } = o.region else { panic!("no sphere") };
            most = most.max(d.sqrt() / radius);
            past += usize::from(d.sqrt() > radius);
        }
        println!("the farthest eye is at {most:.3} of its star-shape's radius, {past} are past it");
        assert!(most < 1.0 && most > 0.8, "{most}");
    }
}

#[test]
fn threads_change_nothing() {
    let s = clouds(300, 6.0, [100.0, 60.0, 80.0], 10);
    let v = views(60.0, [64, 64], [5.0, 50.0], [0.0; 2]);
    let all = |run: &dyn Executor| {
        with(run, |cx| {
            let cells = AdaptiveGrid::new(6_000).divide(&s, &v, cx).unwrap();
            let ids: Vec<CellId> = cells.outlines().iter().map(|o| o.id).collect();
            ids.into_iter().map(|id| cells.inside(id, &s, cx).unwrap()).collect::<Vec<Cell>>()
        })
    };
    assert!(all(&Serial) == all(&Backwards));
}

fn refused(s: &Scene, v: &ViewModel, settings: &AdaptiveGrid) -> String {
    with(&Serial, |cx| settings.divide(s, v, cx)).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn a_budget_under_what_meets_at_a_place_is_refused_with_the_least() {
    let s = clouds(500, 6.0, [40.0, 40.0, 40.0], 11);
    let v = views(60.0, [64, 64], [0.0, 40.0], [0.0; 2]);
    let least = |said: &str| -> u64 {
        let words = said.split("leaves of ").nth(1).unwrap_or_else(|| panic!("{said}"));
        words.split(' ').next().unwrap().parse().unwrap()
    };
    let fine = refused(&s, &v, &AdaptiveGrid { leaf_depth: 16, ..AdaptiveGrid::new(100) });
    let said = refused(&s, &v, &AdaptiveGrid { leaf_depth: 2, ..AdaptiveGrid::new(100) });
    assert!(least(&said) > least(&fine));
    assert!(said.contains(&format!("brings it down to {}", least(&fine))), "{said}");
    assert!(!fine.contains("larger leaf_depth"), "{fine}");
    // The place that is named holds that much, and no sampled place holds more.
    let holding = |p: Vec3| -> u64 {
        s.chunks.iter().filter(|c| c.bounds.distance(p) < 2e-3).map(|c| u64::from(c.triangles)).sum()
    };
    let named = fine.split("at (").nth(1).unwrap().split(')').next().unwrap();
    let at: Vec<f32> = named.split(", ").map(|n| n.parse().unwrap()).collect();
    assert_eq!(holding(Vec3::new(at[0], at[1], at[2])), least(&fine));
    let mut dice = Dice::new(12);
    for _ in 0..2_000 {
        let c = some_view(&mut dice, &s, &v);
        assert!(holding(c.eye.as_vec3()) <= least(&fine));
    }
}

#[test]
fn a_scene_within_the_budget_has_no_images_and_an_empty_one_is_served() {
    let v = views(60.0, [64, 64], [1.0, 2.0], [0.0; 2]);
    for s in [clouds(50, 3.0, [30.0, 10.0, 30.0], 13), SceneBuilder::default().build().unwrap()] {
        with(&Serial, |cx| {
            let cells = AdaptiveGrid::new(1_000_000).divide(&s, &v, cx).unwrap();
            let mut dice = Dice::new(14);
            for _ in 0..500 {
                let camera = some_view(&mut dice, &s, &v);
                let cell = cells.inside(cells.find(&camera).unwrap(), &s, cx).unwrap();
                assert!(cell.sectors.is_empty() && cell.splits.len() == 1 && cell.splits[0].far.is_empty());
                assert_eq!(cells.active(&cell, &camera).split, SplitId(0));
            }
        });
    }
}

#[test]
fn what_cannot_be_served_is_refused_with_its_cause() {
    let s = clouds(50, 3.0, [30.0, 10.0, 30.0], 15);
    let good = views(60.0, [64, 64], [1.0, 2.0], [0.0; 2]);
    let base = AdaptiveGrid::new(1_000);
    let says = |v: &ViewModel, settings: AdaptiveGrid, what: &str| {
        let said = refused(&s, v, &settings);
        assert!(said.starts_with("adaptive-grid: ") && said.contains(what), "{said}");
    };
    says(&views(44.0, [64, 64], [1.0, 2.0], [0.0; 2]), base.clone(), "44.00 x 44.00 degrees");
    says(&views(60.0, [40, 64], [1.0, 2.0], [0.0; 2]), base.clone(), "60.00 degrees; with less than 45");
    says(&views(f32::NAN, [64, 64], [1.0, 2.0], [0.0; 2]), base.clone(), "NaN");
    says(&views(60.0, [64, 64], [2.0, 1.0], [0.0; 2]), base.clone(), "eye heights");
    says(&views(60.0, [64, 64], [1.0, f32::NAN], [0.0; 2]), base.clone(), "eye heights");
    says(&views(60.0, [64, 64], [1.0, 2.0], [0.0, 100.0]), base.clone(), "pitches");
    says(&good, AdaptiveGrid::new(0), "budget = 0");
    says(&good, AdaptiveGrid { opt_budget: Some(1_001), ..base.clone() }, "opt_budget = 1001");
    says(&good, AdaptiveGrid { points: 2, ..base.clone() }, "points = 2");
    says(&good, AdaptiveGrid { leaf_depth: 17, ..base.clone() }, "leaf_depth = 17");
    says(&good, AdaptiveGrid { cost_benefit: [0.4, f64::NAN, 0.1, 0.9], ..base.clone() }, "cost_benefit");
    says(&good, AdaptiveGrid { look_ahead: 5, ..base.clone() }, "look_ahead = 5");
    says(&good, AdaptiveGrid { max_level: 17, ..base.clone() }, "max_level = 17");
    says(&good, AdaptiveGrid { pitch_bin_deg: 0.0, ..base.clone() }, "pitch_bin_deg = 0");
    let crowd = clouds(500, 6.0, [100.0, 60.0, 80.0], 1);
    let said = refused(
        &crowd,
        &views(60.0, [64, 64], [5.0, 50.0], [0.0; 2]),
        &AdaptiveGrid { max_level: 0, ..AdaptiveGrid::new(5_000) },
    );
    assert!(said.contains("by level 0") || said.contains("viewer's side"), "{said}");
}

#[test]
fn the_work_stops_when_asked() {
    let s = clouds(50, 3.0, [30.0, 10.0, 30.0], 16);
    let cx = Context { capture: &Blind, run: &Serial, memo: &Forget, cancel: &AtomicBool::new(true) };
    let stopped = AdaptiveGrid::new(1_000).divide(&s, &views(60.0, [64, 64], [1.0, 2.0], [0.0; 2]), &cx);
    assert!(matches!(stopped, Err(Fault::Cancelled)));
}
