//! Levels against distances that are measured another way, and the choice of levels.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use farfield_core::Camera;
use farfield_core::camera::ViewModel;
use farfield_core::cell::Active;
use farfield_core::claim::Claim;
use farfield_core::context::{Capture, Executor, Forget, Serial, Shot};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{Block, CellId, MaterialId, SplitId, TextureId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, SceneBuilder, Texture};
use farfield_core::strategy::{Candidate, View};
use glam::{DAffine3, DVec3, Vec2, Vec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;

struct Blind;
impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("levels of detail take no pictures".into()))
    }
}

/// Jobs in another order than the serial one: the last third first, each third backwards.
struct Shuffled;
impl Executor for Shuffled {
    fn each(&self, n: usize, job: &(dyn Fn(usize) -> Result<(), Fault> + Sync)) -> Result<(), Fault> {
        (0..3).rev().flat_map(|k| (k * n / 3..(k + 1) * n / 3).rev()).try_for_each(job)
    }
}

#[derive(Default)]
struct Keep(Mutex<BTreeMap<LocalPayload, Payload>>);
impl Sink for Keep {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        assert!(self.0.lock().unwrap().insert(id, payload.clone()).is_none(), "{id:?} put twice");
        Ok(())
    }
    fn claim(&self, claim: Claim) {
        panic!("{claim:?} is claimed");
    }
    fn left_out(&self, _what: LeftOut) {}
}

struct Baked {
    payloads: BTreeMap<LocalPayload, Payload>,
    bytes: Vec<u8>,
    index: Index,
}

fn baked(own: &StaticLod, scene: &Scene, run: &dyn Executor) -> Baked {
    let (sink, go) = (Keep::default(), AtomicBool::new(false));
    let cx = Context { capture: &Blind, run, memo: &Forget, cancel: &go };
    let bytes = own.bake_scene(&SceneJob { scene, views: &views() }, &sink, &cx).unwrap();
    let index = Index::decode("test", &bytes).unwrap();
    Baked { payloads: sink.0.into_inner().unwrap(), bytes, index }
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

/// A ball of radius about 1 with hills, closed, 2 n (2 n - 2) triangles; one colour.
fn hills(n: u32) -> TriangleMesh {
    let at = |r: u32, s: u32| {
        let (polar, azimuth) = (PI * r as f32 / n as f32, TAU * (s % (2 * n)) as f32 / (2 * n) as f32);
        let d = Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
        d * (1.0 + 0.1 * (7.0 * d.x).sin() * (5.0 * d.y).cos() + 0.05 * (11.0 * d.z).sin())
    };
    let mut m = TriangleMesh::default();
    m.positions.push(at(0, 0));
    (1..n).for_each(|r| m.positions.extend((0..2 * n).map(|s| at(r, s))));
    m.positions.push(at(n, 0));
    let (last, id) = (m.positions.len() as u32 - 1, |r: u32, s: u32| 1 + (r - 1) * 2 * n + s % (2 * n));
    for s in 0..2 * n {
        m.indices.extend([0, id(1, s + 1), id(1, s)]);
        for r in 1..n - 1 {
            let [a, b, c, d] = [id(r, s), id(r, s + 1), id(r + 1, s + 1), id(r + 1, s)];
            m.indices.extend([a, b, c, a, c, d]);
        }
        m.indices.extend([id(n - 1, s), id(n - 1, s + 1), last]);
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// A flat square of 2 n n triangles and edge 2, upright, facing +z; texture coordinates 0 to 1.
fn wall(n: u32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for (x, y) in (0..=n).flat_map(|y| (0..=n).map(move |x| (x, y))) {
        let uv = Vec2::new(x as f32, y as f32) / n as f32;
        m.positions.push(Vec3::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.0));
        m.uvs.push(uv);
    }
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(u, v)| x + u + (y + v) * (n + 1));
        m.indices.extend([a, d, c, a, c, b]);
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

fn placed(meshes: Vec<TriangleMesh>, at: &[(usize, DAffine3)], texture: Option<Texture>) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [0.8, 0.7, 0.6, 1.0], ..Material::default() });
    if let Some(t) = texture {
        b.textures.push(t);
        b.materials[0] = Material { base_color: [1.0; 4], texture: Some(TextureId(0)), ..Material::default() };
    }
    let ids: Vec<_> = meshes.into_iter().map(|m| b.mesh("shape", m).unwrap()).collect();
    at.iter().for_each(|&(m, transform)| b.place(Placement { mesh: ids[m], transform }));
    b.build().unwrap()
}

fn one(mesh: TriangleMesh) -> Scene {
    placed(vec![mesh], &[(0, DAffine3::IDENTITY)], None)
}

/// Distance from a point to a triangle by regions of the plane (Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5).
fn distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let (ab, ac, ap, bp, cp) = (b - a, c - a, p - a, p - b, p - c);
    let (d1, d2, d3, d4) = (ab.dot(ap), ac.dot(ap), ab.dot(bp), ac.dot(bp));
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    let (vc, vb, va) = (d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4);
    let q = if d1 <= 0.0 && d2 <= 0.0 {
        a
    } else if d3 >= 0.0 && d4 <= d3 {
        b
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        a + ab * (d1 / (d1 - d3))
    } else if d6 >= 0.0 && d5 <= d6 {
        c
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        a + ac * (d2 / (d2 - d6))
    } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)))
    } else {
        let n = 1.0 / (va + vb + vc);
        a + ab * (vb * n) + ac * (vc * n)
    };
    q.distance(p)
}

type Triangles = Vec<[Vec3; 3]>;

/// The largest distance of `n` random points of one surface from another, by brute force.
fn sampled(from: &Triangles, to: &Triangles, n: usize, rng: &mut ChaCha8Rng) -> f32 {
    let mut unit = || rng.next_u32() as f32 / u32::MAX as f32;
    let point = |_| {
        let [a, b, c] = from[((unit() * from.len() as f32) as usize).min(from.len() - 1)];
        let (s, t) = (unit().sqrt(), unit());
        a * (1.0 - s) + (b * (1.0 - t) + c * t) * s
    };
    let nearest = |p: Vec3| to.iter().map(|&t| distance(p, t)).fold(f32::INFINITY, f32::min);
    (0..n).map(point).map(nearest).fold(0.0, f32::max)
}

fn original(scene: &Scene, object: u32) -> Triangles {
    let o = &scene.objects[object as usize];
    let source = gather(scene, o.chunks.clone().map(ChunkId), o.bounds.centre().as_dvec3()).unwrap();
    source.corners.iter().map(|&c| source.places(c)).collect()
}

fn triangles_of(p: &Payload) -> Triangles {
    let of = |part: &Part| {
        let Part::Mesh(m) = part else { panic!("a level that is no mesh") };
        m.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| m.positions[t[k] as usize])).collect::<Vec<_>>()
    };
    p.parts.iter().flat_map(of).collect()
}

#[test]
fn levels_fall_by_the_ratio_and_their_errors_rise_and_are_no_less_than_what_is_sampled() {
    let scene = one(hills(40));
    for ratio in [0.5, 0.3] {
        let own = StaticLod { ratio, ..StaticLod::default() };
        let b = baked(&own, &scene, &Serial);
        let chain = &b.index.chains[0].levels;
        let mut before = scene.triangles() as f32;
        let whole = original(&scene, 0);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for l in chain {
            assert!((l.triangles as f32 / before - ratio).abs() < 0.03, "{} of {before}", l.triangles);
            before = l.triangles as f32;
            let level = triangles_of(&b.payloads[&LocalPayload(l.payload)]);
            assert_eq!(level.len(), l.triangles as usize);
            let found = sampled(&whole, &level, 3000, &mut rng).max(sampled(&level, &whole, 700, &mut rng));
            assert!(l.error >= found && l.error < 2.0 * found + 1e-3, "{} against {found}", l.error);
        }
        assert!(chain.windows(2).all(|w| w[0].error <= w[1].error && w[0].error > 0.0));
        assert!(before * ratio < 32.5 && before >= 31.0, "the last level has {before}");
    }
}

#[test]
fn the_order_of_jobs_changes_nothing() {
    let at: Vec<(usize, DAffine3)> =
        (0..7).map(|k| (k % 2, DAffine3::from_translation(DVec3::new(4.0 * k as f64, 0.0, 0.0)))).collect();
    let scene = placed(vec![hills(12), wall(10)], &at, None);
    let (a, b) = (baked(&StaticLod::default(), &scene, &Serial), baked(&StaticLod::default(), &scene, &Shuffled));
    assert_eq!(a.bytes, b.bytes);
    assert_eq!(a.payloads, b.payloads);
    assert_eq!(a.index.chains.len(), 7);
}

#[test]
fn nothing_one_triangle_and_degenerate_triangles_are_served() {
    let empty = placed(vec![], &[], None);
    assert!(baked(&StaticLod::default(), &empty, &Serial).index.chains.is_empty());
    let flat = |indices: Vec<u32>| TriangleMesh {
        positions: (0..100).map(|k| Vec3::new(k as f32, 0.0, 0.0)).chain([Vec3::Y]).collect(),
        sections: vec![(0..indices.len() as u32, MaterialId(0))],
        indices,
        ..TriangleMesh::default()
    };
    let least = StaticLod { least_triangles: 1, ..StaticLod::default() };
    assert!(baked(&StaticLod::default(), &one(flat(vec![0, 1, 100])), &Serial).index.chains.is_empty());
    // All on one line, and all the same triangle.
    for indices in [(0..98).flat_map(|k| [k, k + 1, k + 2]).collect(), [0, 1, 100].repeat(80)] {
        let b = baked(&least, &one(flat(indices)), &Serial);
        for l in b.index.chains.iter().flat_map(|c| &c.levels) {
            assert!(l.error.is_finite() && l.triangles > 0);
        }
    }
}

#[test]
fn corners_stay_on_their_side_of_a_seam() {
    // Six walls of one mesh, each with a normal and a colour of its own.
    let mut m = TriangleMesh::default();
    for (k, n) in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].into_iter().enumerate() {
        let up = if n.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let (side, w, first) = (up.cross(n), wall(16), m.positions.len() as u32);
        m.positions.extend(w.positions.iter().map(|p| (side * p.x + up * p.y + n) * 0.5));
        m.normals.extend(vec![n; w.positions.len()]);
        m.colors.extend(vec![[40 * k as u8, 255 - 40 * k as u8, 90, 255]; w.positions.len()]);
        m.indices.extend(w.indices.iter().map(|i| first + i));
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    let b = baked(&StaticLod { least_triangles: 12, ..StaticLod::default() }, &one(m), &Serial);
    assert!(b.index.chains[0].levels.len() >= 5);
    for p in b.payloads.values() {
        let Part::Mesh(m) = &p.parts[0] else { panic!("a level that is no mesh") };
        for t in m.indices.chunks_exact(3) {
            let at = |k: usize| m.positions[t[k] as usize];
            let n = (at(1) - at(0)).cross(at(2) - at(0)).normalize();
            assert!((0..3).all(|k| m.normals[t[k] as usize].distance(n) < 1e-3), "a normal of another side");
            assert!((0..3).all(|k| m.albedo[t[k] as usize] == m.albedo[t[0] as usize]), "a colour of another side");
        }
    }
    let errors: Vec<f32> = b.index.chains[0].levels.iter().map(|l| l.error).collect();
    assert!(errors.iter().all(|e| *e < 2f32.sqrt() / 16.0 / 64.0 * 1.01), "a cube loses nothing: {errors:?}");
}

#[test]
fn colours_that_a_level_cannot_show_count_as_far_as_its_vertices_are() {
    let check = |x: u32, y: u32| [if (x + y).is_multiple_of(2) { 230 } else { 30 }, 80, 80, 255];
    let rgba = (0..16 * 16).map(|i| check(i % 16, i / 16)).collect();
    let texture = Texture { name: "squares".into(), size: [16, 16], rgba };
    let scene = placed(vec![wall(24)], &[(0, DAffine3::IDENTITY)], Some(texture));
    let errors = |max_albedo_off: u8| -> Vec<f32> {
        let own = StaticLod { max_albedo_off, ..StaticLod::default() };
        baked(&own, &scene, &Serial).index.chains[0].levels.iter().map(|l| l.error).collect()
    };
    let (kept, lost) = (errors(16), errors(255));
    // What the bound leaves: 1/64 of an original edge.
    let left = 8f32.sqrt() / 24.0 / 64.0 * 1.01;
    assert!(lost.iter().all(|e| *e < left), "a flat wall loses no shape: {lost:?}");
    // An edge of the original is 2 / 24 long, and a wrong colour lies nearer to a vertex than that; never farther than across the wall.
    assert!(kept.iter().all(|e| *e >= 0.5 / 24.0 && *e <= 8f32.sqrt()), "{kept:?}");
    assert!(kept.last() > Some(&0.15), "{kept:?}");
    // In one colour there is nothing to lose.
    let plain = one(wall(24));
    assert!(baked(&StaticLod::default(), &plain, &Serial).index.chains[0].levels.iter().all(|l| l.error < left));
}

struct Frame {
    draws: Vec<Draw>,
    achieved: farfield_core::strategy::Achieved,
    wanted: Vec<Candidate>,
}

fn frame(own: &StaticLod, b: &Baked, scene: &Scene, camera: &Camera, resident: &dyn Fn(Block) -> bool) -> Frame {
    let open = own.open(Some((AssetId(0), &b.bytes)), (AssetId(1), &[])).unwrap();
    let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
    let half_px = |b: &Aabb| 0.5 * b.distance(camera.eye.as_vec3()) / camera.px_per_tan();
    let view = View { scene, camera, at: &at, tolerance: &half_px, budget: Default::default(), cell: None };
    let (mut draws, mut wanted) = (vec![], vec![]);
    let achieved = open.draw(resident, &view, &mut draws);
    open.wanted(&view, &mut wanted);
    Frame { draws, achieved, wanted }
}

/// The payload that is drawn, if it is not the original.
fn drawn(f: &Frame) -> Option<u32> {
    match &f.draws[0].what {
        DrawWhat::Payload { id, .. } => Some(id.id.0),
        DrawWhat::Chunks(_) => None,
    }
}

#[test]
fn the_coarsest_level_within_the_tolerance_is_drawn() {
    let scene = one(hills(40));
    let b = baked(&StaticLod::default(), &scene, &Serial);
    let chain = &b.index.chains[0].levels;
    let middle = scene.objects[0].bounds.centre();
    let mut seen = std::collections::BTreeSet::new();
    for max_px in [0.0, 0.5, 1.0, 4.0] {
        let own = StaticLod { max_px, ..StaticLod::default() };
        for k in 0..500 {
            let eye = (middle + Vec3::Z * 1.5 * 1.02f32.powi(k)).as_dvec3();
            let camera = Camera::looking(eye, -Vec3::Z, Vec3::Y, 1.0, [256, 256], 0.01);
            let f = frame(&own, &b, &scene, &camera, &|_| true);
            // A length s at distance d covers s px_per_tan / d pixels.
            let px = |e: &Entry| e.error * camera.px_per_tan() / scene.objects[0].bounds.distance(camera.eye.as_vec3());
            let allowed = chain.iter().rev().find(|e| px(e) <= max_px).map(|e| e.payload);
            assert_eq!(drawn(&f), allowed, "{max_px} px at {eye}");
            assert!(f.achieved.error_px <= max_px * 1.001 && f.achieved.missing == 0);
            seen.insert(drawn(&f));
            // What is drawn is wanted, and so are its neighbours in the chain.
            let blocks = |seen: bool| f.wanted.iter().filter(|c| c.in_view == seen).count();
            assert_eq!(blocks(true), 1.max(if drawn(&f).is_none() { scene.chunks.len() } else { 1 }));
            assert!(blocks(false) >= 1);
        }
    }
    assert_eq!(seen.len(), chain.len() + 1, "some level is never drawn");
}

#[test]
fn what_is_not_there_is_stood_in_for_and_counted_when_nothing_is() {
    let scene = one(hills(20));
    let (own, b) = (StaticLod::default(), baked(&StaticLod::default(), &scene, &Serial));
    let eye = scene.objects[0].bounds.centre() + Vec3::Z * 60.0;
    let camera = Camera::looking(eye.as_dvec3(), -Vec3::Z, Vec3::Y, 1.0, [512, 512], 0.01);
    let best = drawn(&frame(&own, &b, &scene, &camera, &|_| true)).unwrap();
    assert!(best > 0 && (best as usize) < b.index.chains[0].levels.len() - 1, "level {best} has no neighbours");
    let without = |gone: &dyn Fn(u32) -> bool, chunks: bool| {
        let there = |block: Block| match block {
            Block::Payload(p) => !gone(p.id.0),
            Block::Chunk(_) => chunks,
        };
        frame(&own, &b, &scene, &camera, &there)
    };
    assert_eq!(drawn(&without(&|p| p == best, true)), Some(best + 1));
    assert!(without(&|p| p == best, true).achieved.error_px > 1.0);
    assert_eq!(drawn(&without(&|p| p >= best, true)), Some(best - 1));
    assert_eq!(drawn(&without(&|_| true, true)), None);
    let nothing = without(&|_| true, false);
    assert!(nothing.draws.is_empty() && nothing.achieved.missing as usize == scene.chunks.len());
    // Behind the eye nothing is drawn and nothing is missing.
    let away = Camera { forward: -camera.forward, right: -camera.right, ..camera };
    let f = frame(&own, &b, &scene, &away, &|_| false);
    assert!(f.draws.is_empty() && f.achieved.missing == 0 && f.wanted.iter().all(|c| !c.in_view));
}

#[test]
fn an_index_that_it_did_not_write_and_settings_that_make_no_sense_are_refused() {
    let own = StaticLod::default();
    let b = baked(&own, &one(hills(12)), &Serial);
    assert!(own.open(Some((AssetId(0), &b.bytes[1..])), (AssetId(1), &[])).is_err());
    assert!(own.open(Some((AssetId(0), &b.bytes)), (AssetId(1), &[0])).is_err());
    assert!(own.open(None, (AssetId(1), &[])).is_err());
    let mut swapped = b.index.clone();
    swapped.chains[0].levels.swap(0, 1);
    assert!(own.open(Some((AssetId(0), &swapped.encode().unwrap())), (AssetId(1), &[])).is_err());
    let scene = one(wall(2));
    for (bad, word) in [
        (StaticLod { ratio: 1.0, ..StaticLod::default() }, "ratio"),
        (StaticLod { least_triangles: 0, ..StaticLod::default() }, "least_triangles"),
        (StaticLod { max_px: f32::NAN, ..StaticLod::default() }, "max_px"),
    ] {
        assert!(bad.needs(&scene, None).unwrap_err().to_string().contains(word));
    }
    assert_eq!(own.needs(&scene, None).unwrap().left_out.len(), 1);
}
