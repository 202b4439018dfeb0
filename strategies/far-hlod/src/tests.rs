use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use farfield_core::bvh::TriangleBvh;
use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Outline};
use farfield_core::claim::Claim;
use farfield_core::context::{Capture, Executor, Forget, Memo, Serial, Shot};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{Block, CellId, LocalPayload, MaterialId, PayloadRef, SplitId, TextureId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::{Part, Payload};
use farfield_core::region::Region;
use farfield_core::scene::{Material, Placement, SceneBuilder, Texture};
use farfield_core::strategy::{Achieved, DrawBudget, View};
use farfield_core::{Aabb, Camera};
// Links the metrics, which are found by name.
use farfield_strategies as _;
use glam::{DAffine3, DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

struct Blind;
impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("no pictures here".into()))
    }
}

/// Runs the jobs last to first.
struct Backwards;
impl Executor for Backwards {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        (0..n).rev().try_for_each(job)
    }
}

#[derive(Default)]
struct Keep(Mutex<BTreeMap<LocalPayload, Payload>>);
impl Sink for Keep {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        assert!(self.0.lock().unwrap().insert(id, payload.clone()).is_none());
        Ok(())
    }
    fn claim(&self, _: Claim) {}
    fn left_out(&self, _: LeftOut) {}
}

struct Baked {
    scene: Scene,
    index: Vec<u8>,
    skeleton: Skeleton,
    payloads: BTreeMap<LocalPayload, Payload>,
    far: PointPolygonHlod,
}

fn settings(metric: &str) -> PointPolygonHlod {
    let text = format!(r#"{{"node_triangles": 600, "resolution": 48, "metric": {{"type": "{metric}"}}}}"#);
    serde_json::from_str(&text).unwrap()
}

const VIEWS: ViewModel = ViewModel {
    fov_y_rad: 1.0,
    resolution: [640, 480],
    near: 0.01,
    eye_height: [0.0, 1.0],
    pitch_rad: [0.0, 0.0],
    max_speed: 1.0,
    max_turn_rad: 1.0,
};

fn baked(scene: Scene, far: PointPolygonHlod, run: &dyn Executor) -> Baked {
    let (keep, go) = (Keep::default(), AtomicBool::new(false));
    let cx = Context { capture: &Blind, run, memo: &Forget, cancel: &go };
    let index = far.bake_scene(&SceneJob { scene: &scene, views: &VIEWS }, &keep, &cx).unwrap();
    let skeleton = Skeleton::decode("test", &index).unwrap();
    Baked { scene, index, skeleton, payloads: keep.0.into_inner().unwrap(), far }
}

/// A rough ball of 8 n^2 triangles, closed.
fn ball(n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut known: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut at = |octant: Vec3, i: u32, j: u32| {
        let k = n - i - j;
        let cell = [i64::from(i), i64::from(j), i64::from(k)];
        let cell = [0, 1, 2].map(|a| cell[a] * octant[a] as i64);
        *known.entry(cell).or_insert_with(|| {
            let d = Vec3::new(cell[0] as f32, cell[1] as f32, cell[2] as f32).normalize();
            let rough =
                0.03 * (9.0 * d.x + 4.0 * d.y).sin() * (7.0 * d.z).cos() + 0.004 * (70.0 * d.y + 50.0 * d.x).sin();
            mesh.positions.push(d * (1.0 + rough));
            mesh.positions.len() as u32 - 1
        })
    };
    let mut indices = vec![];
    for o in 0..8 {
        let octant = Vec3::new([1.0, -1.0][o & 1], [1.0, -1.0][o >> 1 & 1], [1.0, -1.0][o >> 2 & 1]);
        let mut add = |c: [u32; 3]| {
            let turned = octant.x * octant.y * octant.z < 0.0;
            indices.extend(if turned { [c[0], c[2], c[1]] } else { c });
        };
        for i in 0..n {
            for j in 0..n - i {
                add([at(octant, i, j), at(octant, i + 1, j), at(octant, i, j + 1)]);
                if i + j + 1 < n {
                    add([at(octant, i + 1, j), at(octant, i + 1, j + 1), at(octant, i, j + 1)]);
                }
            }
        }
    }
    mesh.sections = vec![(0..indices.len() as u32, MaterialId(0))];
    mesh.indices = indices;
    mesh.smooth_normals();
    mesh
}

/// Two balls, beside each other. From both sides no cone culls.
fn balls(two_sided: bool) -> Scene {
    placed(48, &[-1.5, 1.5], two_sided)
}

fn placed(n: u32, at: &[f64], two_sided: bool) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { two_sided, ..Material::default() });
    let mesh = b.mesh("ball", ball(n)).unwrap();
    for &x in at {
        b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)) });
    }
    b.build().unwrap()
}

impl Baked {
    fn open(&self) -> Box<dyn FarView> {
        self.far.open(Some((AssetId(0), &self.index)), (AssetId(1), &[])).unwrap()
    }

    /// The triangles of a draw list, in places.
    fn triangles(&self, draws: &[Draw]) -> Vec<[Vec3; 3]> {
        let mut out = vec![];
        for d in draws {
            match &d.what {
                DrawWhat::Payload { id, part, .. } => {
                    let p = &self.payloads[&id.id];
                    let Part::Mesh(m) = &p.parts[usize::from(*part)] else { panic!("no mesh") };
                    let at = |i: u32| (p.origin + m.positions[i as usize].as_dvec3()).as_vec3();
                    out.extend(m.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
                }
                DrawWhat::Chunks(set) => out.extend(originals(&self.scene, set.iter())),
            }
        }
        out
    }
}

fn originals(scene: &Scene, chunks: impl Iterator<Item = farfield_core::id::ChunkId>) -> Vec<[Vec3; 3]> {
    let mut out = vec![];
    for c in chunks {
        let placed = &scene.chunks[c.index()];
        let place = scene.objects[placed.object.index()].placement;
        scene
            .geometry
            .with(placed.source, &mut |m| {
                let at = |i: u32| place.transform_point3(m.positions[i as usize].as_dvec3()).as_vec3();
                out.extend(m.indices.chunks_exact(3).map(|t| [at(t[0]), at(t[1]), at(t[2])]));
            })
            .unwrap();
    }
    out
}

/// What is drawn from far enough away to see all, at levels as for an eye elsewhere whose picture is 40 pixels high.
fn with_view<R>(scene: &Scene, eye: Vec3, f: impl FnOnce(&View<'_>) -> R) -> R {
    let camera = Camera::looking(DVec3::Z * 100.0, -Vec3::Z, Vec3::Y, 1.0, [400, 400], 0.01);
    let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
    let half_px = |b: &Aabb| 0.5 * b.distance(eye) / (0.1 * camera.px_per_tan());
    let budget = DrawBudget::default();
    f(&View { scene, camera: &camera, at: &at, tolerance: &half_px, budget, cell: None })
}

/// Eyes in all directions, near and far.
fn eyes(seed: u64, n: usize) -> Vec<Vec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut eye = || {
        let d = [0; 3].map(|_| rng.random_range(-1f32..1.0));
        Vec3::from(d).normalize() * 1.5 * 10f32.powf(rng.random_range(0.0..1.7))
    };
    (0..n).map(|_| eye()).collect()
}

/// Edges with another number of triangles than two, or that run twice the same way; vertices are one where they are equal bit by bit.
fn open_edges(triangles: &[[Vec3; 3]]) -> usize {
    let key = |v: Vec3| (v + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut runs: BTreeMap<_, i32> = BTreeMap::new();
    for t in triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (key(a), key(b));
            if a != b {
                *runs.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    runs.values().filter(|n| **n != 0).count()
}

#[test]
fn every_cut_is_closed_whatever_levels_meet() {
    for metric in ["hausdorff", "appearance"] {
        let b = baked(balls(true), settings(metric), &Serial);
        let (open, mut mixed) = (b.open(), 0);
        for eye in eyes(7, 40) {
            let mut draws = vec![];
            let achieved = with_view(&b.scene, eye, |v| open.draw(&|_| true, v, &mut draws));
            assert!(achieved.missing == 0 && achieved.error_px <= 0.5);
            let depth = |d: &Draw| match d.what {
                DrawWhat::Payload { id, .. } => Some(b.skeleton.nodes[id.id.index()].depth),
                DrawWhat::Chunks(_) => None,
            };
            // Original chunks are not rounded: payloads alone are closed bit by bit.
            let levels: BTreeSet<_> = draws.iter().map(depth).collect();
            if !levels.contains(&None) {
                assert_eq!(open_edges(&b.triangles(&draws)), 0, "{metric}, eye at {eye}, {levels:?}");
                mixed += usize::from(levels.len() > 1);
            }
        }
        assert!(mixed > 10, "{metric}: {mixed} cuts of several levels");
    }
}

#[test]
fn no_sampled_point_refutes_a_nodes_error() {
    for metric in ["hausdorff", "appearance"] {
        let b = baked(balls(false), settings(metric), &Serial);
        let all = originals(&b.scene, b.scene.all_chunks().iter());
        let bvh = |t: &[[Vec3; 3]]| {
            let places: Vec<Vec3> = t.iter().flatten().copied().collect();
            TriangleBvh::build(&places, &(0..places.len() as u32).collect::<Vec<_>>())
        };
        let original = bvh(&all);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut point = |t: &[[Vec3; 3]]| {
            let [a, b, c] = t[rng.random_range(0..t.len())];
            let (u, v): (f32, f32) = (rng.random_range(0.0..1f32).sqrt(), rng.random_range(0.0..1.0));
            a * (1.0 - u) + (b * (1.0 - v) + c * v) * u
        };
        let mut least = f32::INFINITY;
        for (i, n) in (0u32..).zip(&b.skeleton.nodes) {
            let below = (i..n.end).flat_map(|k| b.skeleton.nodes[k as usize].chunks.iter().copied());
            let own = originals(&b.scene, below);
            let payload = &b.payloads[&LocalPayload(i)];
            let draw = |part| Draw {
                what: DrawWhat::Payload { id: PayloadRef { asset: AssetId(0), id: LocalPayload(i) }, part, object: 1 },
                bounds: n.bounds,
                error_px: 0.0,
            };
            let simple = b.triangles(&(0..payload.parts.len() as u16).map(draw).collect::<Vec<_>>());
            assert_eq!(simple.len(), n.triangles as usize);
            let there = bvh(&simple);
            for _ in 0..1000 {
                let (from, to) = (point(&own), point(&simple));
                let out = there.closest_point(from, f32::INFINITY).unwrap().distance;
                let back = original.closest_point(to, f32::INFINITY).unwrap().distance;
                assert!(out.max(back) <= n.error, "{metric}, node {i}: {out}, {back} > {}", n.error);
            }
            // An inner node may be off by the edge of its cube over the resolution.
            let allowance = 5.06 / 48.0 / f32::from(n.depth).exp2();
            assert!(n.error <= allowance, "{metric}, node {i} at {}: {} > {allowance}", n.depth, n.error);
            if !b.skeleton.is_leaf(i) {
                least = least.min(n.error / allowance);
                assert!(simple.len() < own.len() * 3 / 4);
            }
        }
        // The paper's range: between three quarters and all of it.
        assert!(least > 0.7, "{metric}: {least}");
    }
}

#[test]
fn whatever_is_there_covers_every_leaf_once() {
    let b = baked(balls(true), settings("hausdorff"), &Serial);
    let (open, mut rng) = (b.open(), ChaCha8Rng::seed_from_u64(11));
    for eye in eyes(5, 60) {
        let mut wanted = vec![];
        with_view(&b.scene, eye, |v| open.wanted(v, &mut wanted));
        let mut there: BTreeSet<Block> = BTreeSet::new();
        for c in &wanted {
            if c.after.is_none_or(|a| there.contains(&a)) && (there.is_empty() || rng.random_bool(0.8)) {
                there.insert(c.block);
            }
        }
        let mut draws = vec![];
        let achieved = with_view(&b.scene, eye, |v| open.draw(&|b| there.contains(&b), v, &mut draws));
        let mut covered = vec![0; b.scene.chunks.len()];
        for d in &draws {
            match &d.what {
                DrawWhat::Payload { id, .. } => {
                    assert!(there.contains(&Block::Payload(*id)));
                    let n = &b.skeleton.nodes[id.id.index()];
                    let below = (id.id.0..n.end).flat_map(|k| &b.skeleton.nodes[k as usize].chunks);
                    below.for_each(|c| covered[c.index()] += 1);
                }
                DrawWhat::Chunks(set) => set.iter().for_each(|c| covered[c.index()] += 1),
            }
        }
        assert!(covered.iter().all(|n| *n == 1) && achieved.missing == 0, "{eye}");
        // Everything that is wanted makes it as good as asked for.
        let all: BTreeSet<Block> = wanted.iter().map(|c| c.block).collect();
        let full = with_view(&b.scene, eye, |v| open.draw(&|b| all.contains(&b), v, &mut vec![]));
        assert!(full.error_px <= 0.5 && full.missing == 0 && full.error_px <= achieved.error_px.max(0.5));
    }
}

#[test]
fn without_the_root_all_is_missing_and_told() {
    let b = baked(balls(true), settings("hausdorff"), &Serial);
    let mut draws = vec![];
    let achieved = with_view(&b.scene, Vec3::Z * 5.0, |v| b.open().draw(&|_| false, v, &mut draws));
    assert!(draws.is_empty() && achieved.missing as usize == b.scene.chunks.len());
}

#[test]
fn backs_are_culled_and_nothing_that_faces_the_eye() {
    let b = baked(placed(100, &[0.0], false), settings("hausdorff"), &Serial);
    let mut skeleton = b.skeleton.clone();
    skeleton.nodes.iter_mut().for_each(|n| n.cone = cone::Cone::ALL);
    let whole = view::Hierarchy { asset: AssetId(0), skeleton, max_px: 0.5 };
    // The camera stands at z = 100; levels are chosen for an eye in the ball's middle, so that both sides are equally fine.
    let drawn = |far: &dyn FarView| {
        let mut draws = vec![];
        with_view(&b.scene, Vec3::ZERO, |v| far.draw(&|_| true, v, &mut draws));
        b.triangles(&draws)
    };
    let (culled, whole) = (drawn(&*b.open()), drawn(&whole));
    let facing = |t: &&[Vec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).dot(Vec3::Z * 100.0 - t[0]) > 0.0;
    assert!(culled.len() < whole.len() * 9 / 10, "{} of {}", culled.len(), whole.len());
    assert_eq!(culled.iter().filter(facing).count(), whole.iter().filter(facing).count());
}

#[test]
fn the_same_bytes_in_any_order_of_jobs() {
    let (a, b) =
        (baked(balls(false), settings("appearance"), &Serial), baked(balls(false), settings("appearance"), &Backwards));
    assert!(a.index == b.index && a.payloads == b.payloads && a.payloads.len() > 20);
}

#[test]
fn the_census_counts_every_node_once_before_and_after() {
    let b = baked(balls(false), settings("hausdorff"), &Serial);
    let (planned, built) = (b.far.census(&b.scene, None).unwrap(), b.far.census(&b.scene, Some(&b.index)).unwrap());
    let counts = |c: &[Level]| c.iter().map(|l| (l.level, l.nodes)).collect::<Vec<_>>();
    assert_eq!(counts(&planned), counts(&built));
    assert_eq!(planned.iter().map(|l| l.nodes).sum::<u64>(), b.skeleton.nodes.len() as u64);
    assert!(planned.iter().all(|l| l.triangles.is_none()));
    let triangles: u64 = b.payloads.values().map(Payload::triangles).sum();
    assert_eq!(built.iter().map(|l| l.triangles.unwrap()).sum::<u64>(), triangles);
    assert!(b.far.census(&b.scene, Some(&b.index[1..])).is_err());
}

#[test]
fn textures_that_vertices_do_not_show_count_and_can_be_let_go() {
    let scene = || {
        let mut b = SceneBuilder::default();
        b.textures.push(Texture {
            name: "stripes".into(),
            size: [8, 1],
            rgba: (0..8).map(|i| if i % 2 == 0 { [250, 250, 250, 255] } else { [5, 5, 5, 255] }).collect(),
        });
        b.materials.push(Material { texture: Some(TextureId(0)), ..Material::default() });
        let wall = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
            indices: vec![0, 1, 2, 0, 2, 3],
            sections: vec![(0..6, MaterialId(0))],
            ..Default::default()
        };
        let mesh = b.mesh("wall", wall).unwrap();
        b.place(Placement { mesh, transform: DAffine3::IDENTITY });
        b.build().unwrap()
    };
    let error = |far| baked(scene(), far, &Serial).skeleton.nodes[0].error;
    // The place of a half and half again in a right triangle is the farthest from its corners.
    let off = error(settings("hausdorff"));
    assert!(off > 0.5 && off < 0.75, "{off}");
    assert!(error(PointPolygonHlod { max_albedo_off: 255, ..settings("hausdorff") }) < 0.01);
}

#[test]
fn seams_keep_both_sides_looks() {
    // A folded sheet: one vertex row with two normals.
    let (mut positions, mut normals, mut indices) = (vec![], vec![], vec![]);
    for (side, out) in [(Vec3::X, Vec3::Y), (-Vec3::Y, Vec3::X)] {
        let first = positions.len() as u32;
        for i in 0..=60 {
            for j in 0..=60 {
                positions.push(side * (i as f32 * 0.1) + Vec3::Z * (j as f32 * 0.1));
                normals.push(out);
            }
        }
        for (i, j) in (0..60).flat_map(|i| (0..60).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| first + i * 61 + j;
            let quad = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
            indices.extend(quad);
        }
    }
    let count = indices.len() as u32;
    let mesh =
        TriangleMesh { positions, normals, indices, sections: vec![(0..count, MaterialId(0))], ..Default::default() };
    let mut b = SceneBuilder::default();
    b.materials.push(Material { two_sided: true, ..Material::default() });
    let mesh = b.mesh("fold", mesh).unwrap();
    b.place(Placement { mesh, transform: DAffine3::IDENTITY });
    let b = baked(b.build().unwrap(), settings("appearance"), &Serial);
    let Part::Mesh(root) = &b.payloads[&LocalPayload(0)].parts[0] else { panic!("no mesh") };
    assert!(root.indices.len() < indices_of(&b.scene) / 4, "{}", root.indices.len());
    for t in root.indices.chunks_exact(3) {
        let n = [t[0], t[1], t[2]].map(|i| root.normals[i as usize]);
        assert!(n.iter().all(|m| m.distance(n[0]) < 0.01), "looks bleed over the fold: {n:?}");
    }
}

fn indices_of(scene: &Scene) -> usize {
    scene.triangles() as usize * 3
}

#[test]
fn what_is_no_skeleton_is_refused() {
    let b = baked(balls(false), settings("hausdorff"), &Serial);
    for cut in [0, 1, b.index.len() / 2, b.index.len() - 1] {
        assert!(Skeleton::decode("test", &b.index[..cut]).is_err() || cut == 0, "{cut}");
    }
    let broken = |f: &dyn Fn(&mut Skeleton)| {
        let mut s = b.skeleton.clone();
        f(&mut s);
        Skeleton::decode("test", &s.encode().unwrap()).is_err()
    };
    assert!(broken(&|s| s.nodes[1].end = 0) && broken(&|s| s.nodes[1].end = 10_000));
    assert!(broken(&|s| s.nodes[2].error = f32::NAN) && broken(&|s| s.nodes[0].end -= 1));
    assert!(!broken(&|_| ()));
    let other = b.far.open(None, (AssetId(1), &[]));
    assert!(other.is_err() && b.far.open(Some((AssetId(0), &b.index)), (AssetId(1), &[1])).is_err());
}

#[test]
fn an_empty_scene_and_settings_that_contradict_each_other() {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let empty = baked(b.build().unwrap(), settings("hausdorff"), &Serial);
    let mut draws = vec![];
    let achieved = with_view(&empty.scene, Vec3::Z, |v| empty.open().draw(&|_| true, v, &mut draws));
    assert!(draws.is_empty() && achieved == Achieved::default());
    for bad in [
        r#"{"node_triangles": 0}"#,
        r#"{"resolution": 0}"#,
        r#"{"max_px": -1}"#,
        r#"{"metric": {"type": "quadric"}}"#,
        r#"{"grid_steps": 0}"#,
    ] {
        let far: PointPolygonHlod = serde_json::from_str(bad).unwrap();
        assert!(far.needs(&empty.scene, None).is_err(), "{bad}");
    }
}

#[test]
fn for_a_cell_nothing_finer_is_wanted_than_its_viewpoints_need() {
    let b = baked(balls(true), settings("hausdorff"), &Serial);
    let region = |x: f32| Region::Box(Aabb { min: Vec3::new(x, -1.0, -1.0), max: Vec3::new(x + 2.0, 1.0, 1.0) });
    let wants = |x: f32, eye: Vec3| {
        let outline =
            Outline { id: CellId(0), region: region(x), centre: Vec3::new(x + 1.0, 0.0, 0.0), neighbours: vec![] };
        let cell = Cell { outline, splits: vec![], sectors: vec![], own: vec![], claims: vec![] };
        let mut out = vec![];
        with_view(&b.scene, eye, |v| {
            let camera = Camera { eye: eye.as_dvec3(), ..*v.camera };
            b.open().wanted(&View { cell: Some(&cell), camera: &camera, ..*v }, &mut out);
        });
        out.iter().map(|c| c.block).collect::<BTreeSet<_>>()
    };
    // A far cell, loaded in advance by an eye that stands close to the balls, wants little; a close cell, by an eye far away, much.
    let (close_eye, far_eye) = (Vec3::new(3.0, 0.0, 0.0), Vec3::new(60.0, 0.0, 0.0));
    assert_eq!(wants(50.0, close_eye).len(), 1);
    assert!(wants(3.0, close_eye).len() > 5 && wants(3.0, far_eye).len() > 5);
    // What any viewpoint of the cell wants is among what is wanted in advance.
    let ahead = wants(3.0, far_eye);
    for eye in [Vec3::new(3.0, 0.0, 0.0), Vec3::new(4.0, 0.9, -0.9), Vec3::new(5.0, 1.0, 1.0)] {
        assert!(wants(3.0, eye).is_subset(&ahead));
    }
}

/// Holds what was remembered and put over several bakes; the one that puts its `stop`th payload is interrupted there.
#[derive(Default)]
struct Interrupted<'a> {
    memory: Mutex<BTreeMap<Vec<u8>, Vec<u8>>>,
    stored: Mutex<BTreeMap<LocalPayload, Payload>>,
    /// Of this bake: made, and taken from the one before.
    counted: Mutex<[BTreeSet<LocalPayload>; 2]>,
    stop: Option<(usize, &'a AtomicBool)>,
}

impl Memo for Interrupted<'_> {
    fn get(&self, key: &[u8]) -> Option<Vec<u8>> {
        self.memory.lock().unwrap().get(key).cloned()
    }
    fn put(&self, key: &[u8], bytes: &[u8]) {
        let before = self.memory.lock().unwrap().insert(key.to_vec(), bytes.to_vec());
        assert!(before.is_none_or(|b| b == bytes), "another piece of the same name");
    }
}

impl Sink for Interrupted<'_> {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        self.stored.lock().unwrap().insert(id, payload.clone());
        let mut counted = self.counted.lock().unwrap();
        assert!(counted[0].insert(id) && !counted[1].contains(&id), "{id:?} put twice");
        self.stop.iter().filter(|s| counted[0].len() == s.0).for_each(|s| s.1.store(true, Ordering::Relaxed));
        Ok(())
    }
    fn kept(&self, ids: &[LocalPayload]) -> Result<bool, Fault> {
        let stored = self.stored.lock().unwrap();
        let whole = ids.iter().all(|i| stored.contains_key(i));
        let mut counted = self.counted.lock().unwrap();
        assert!(!whole || ids.iter().all(|i| counted[1].insert(*i) && !counted[0].contains(i)), "counted twice");
        Ok(whole)
    }
    fn claim(&self, _: Claim) {}
    fn left_out(&self, _: LeftOut) {}
}

#[test]
fn an_interrupted_bake_goes_on_where_it_was() {
    let whole = baked(balls(false), settings("hausdorff"), &Serial);
    let all: BTreeSet<LocalPayload> = whole.payloads.keys().copied().collect();
    let mut held = Interrupted::default();
    let bake = |held: &Interrupted<'_>, go: &AtomicBool| {
        let cx = Context { capture: &Blind, run: &Serial, memo: held, cancel: go };
        whole.far.bake_scene(&SceneJob { scene: &whole.scene, views: &VIEWS }, held, &cx)
    };
    let go = AtomicBool::new(false);
    held.stop = Some((all.len() / 2, &go));
    assert!(matches!(bake(&held, &go), Err(Fault::Cancelled)));
    // One of the payloads that a piece needs is lost meanwhile.
    let lost = *held.stored.get_mut().unwrap().keys().next().unwrap();
    held.stored.get_mut().unwrap().remove(&lost);
    let first = std::mem::take(held.counted.get_mut().unwrap());
    assert!(first[1].is_empty());
    held.stop = None;
    let index = bake(&held, &AtomicBool::new(false)).unwrap();
    assert_eq!(index, whole.index);
    assert_eq!(held.stored.into_inner().unwrap(), whole.payloads);
    let [made, kept] = held.counted.into_inner().unwrap();
    assert!(made.is_disjoint(&kept) && &made | &kept == all);
    assert!(kept.len() * 2 > first[0].len(), "{} of {}", kept.len(), first[0].len());
}
