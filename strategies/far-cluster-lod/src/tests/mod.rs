//! Hierarchies of closed surfaces, held to what can be counted on them: a cut without cracks has no border edge.

mod bake;
mod closed;
mod residency;

use std::collections::{BTreeMap, HashMap};
use std::f32::consts::{PI, TAU};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use farfield_core::Camera;
use farfield_core::camera::ViewModel;
use farfield_core::cell::Active;
use farfield_core::claim::Claim;
use farfield_core::context::{Capture, Forget, Shot};
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{Block, CellId, MaterialId, SplitId, TextureId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, SceneBuilder, Texture};
use farfield_core::strategy::{Achieved, View};
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};

use super::*;

struct Blind;
impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("clusters take no pictures".into()))
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
    fn left_out(&self, what: LeftOut) {
        panic!("{what:?} while building");
    }
}

struct Baked {
    scene: Scene,
    payloads: BTreeMap<LocalPayload, Payload>,
    bytes: Vec<u8>,
    index: Index,
}

const VIEWS: ViewModel = ViewModel {
    fov_y_rad: 1.0,
    resolution: [64, 64],
    near: 0.01,
    eye_height: [1.0, 2.0],
    pitch_rad: [0.0; 2],
    max_speed: 1.0,
    max_turn_rad: 1.0,
};

fn baked(own: &ClusterLod, scene: Scene, run: &dyn Executor) -> Baked {
    let (sink, go) = (Keep::default(), AtomicBool::new(false));
    let cx = Context { capture: &Blind, run, memo: &Forget, cancel: &go };
    let bytes = own.bake_scene(&SceneJob { scene: &scene, views: &VIEWS }, &sink, &cx).unwrap();
    let index = Index::decode("test", &bytes).unwrap();
    let payloads = sink.0.into_inner().unwrap();
    for (&id, payload) in &payloads {
        let block = Block::Payload(farfield_core::id::PayloadRef { asset: AssetId(0), id });
        farfield_core::backend::validate(block, &farfield_core::backend::BlockData::Payload(payload)).unwrap();
    }
    Baked { scene, payloads, bytes, index }
}

/// Small clusters, so that small meshes have many.
fn fine() -> ClusterLod {
    ClusterLod { cluster_triangles: 32, group_clusters: 6, ..ClusterLod::default() }
}

/// A ball of radius about 1 with hills, closed, 2 n (2 n - 2) triangles; coloured.
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
    m.colors = m.positions.iter().map(|p| [(128.0 + 90.0 * (3.0 * p.x).sin()) as u8, 140, 90, 255]).collect();
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// The same surface with three vertices a triangle: every edge is a seam.
fn faceted(mut m: TriangleMesh) -> TriangleMesh {
    let corner = |all: &[Vec3], i: &u32| all[*i as usize];
    m.positions = m.indices.iter().map(|i| corner(&m.positions, i)).collect();
    m.normals =
        m.positions.chunks_exact(3).flat_map(|t| [(t[1] - t[0]).cross(t[2] - t[0]).normalize_or(Vec3::Y); 3]).collect();
    m.colors.clear();
    m.indices = (0..m.positions.len() as u32).collect();
    m
}

/// The same surface, its upper half of a two-sided material.
fn two_sided_above(mut m: TriangleMesh) -> TriangleMesh {
    let high = |t: &&[u32]| t.iter().map(|&i| m.positions[i as usize].y).sum::<f32>() > 0.0;
    let (above, below): (Vec<&[u32]>, Vec<&[u32]>) = m.indices.chunks_exact(3).partition(high);
    let (first, second) = (above.concat(), below.concat());
    let (middle, end) = (first.len() as u32, m.indices.len() as u32);
    m.indices = [first, second].concat();
    m.sections = vec![(0..middle, MaterialId(1)), (middle..end, MaterialId(0))];
    m
}

/// Of one material, of another that is two-sided, of a third with a texture.
fn placed(meshes: Vec<TriangleMesh>, at: &[(usize, DAffine3)]) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [0.8, 0.7, 0.6, 1.0], ..Material::default() });
    b.materials.push(Material { two_sided: true, ..Material::default() });
    b.textures.push(Texture { name: "grey".into(), size: [1, 1], rgba: vec![[90, 90, 90, 255]] });
    b.materials.push(Material { texture: Some(TextureId(0)), ..Material::default() });
    let ids: Vec<_> = meshes.into_iter().map(|m| b.mesh("shape", m).unwrap()).collect();
    at.iter().for_each(|&(m, transform)| b.place(Placement { mesh: ids[m], transform }));
    b.build().unwrap()
}

fn one(mesh: TriangleMesh) -> Scene {
    let turn = DQuat::from_rotation_y(0.3);
    placed(vec![mesh], &[(0, DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 1.2, 0.9), turn, DVec3::ONE))])
}

/// Far away, so that it sees all of a small scene.
fn far_camera() -> Camera {
    Camera::looking(DVec3::new(0.0, 0.0, 1e3), -Vec3::Z, Vec3::Y, 1.0, [64, 64], 0.1)
}

/// Draws with a tolerance that has nothing to do with the camera.
fn draw(
    own: &ClusterLod,
    baked: &Baked,
    tolerance: &(dyn Fn(&Aabb) -> f32 + Sync),
    resident: &dyn Fn(Block) -> bool,
) -> (Vec<Draw>, Achieved) {
    let open = own.open(Some((AssetId(0), &baked.bytes)), (AssetId(1), &[])).unwrap();
    let (camera, at) = (far_camera(), Active { cell: CellId(0), split: SplitId(0), sectors: vec![] });
    let view =
        View { scene: &baked.scene, camera: &camera, at: &at, tolerance, budget: Default::default(), cell: None };
    let mut draws = vec![];
    let achieved = open.draw(resident, &view, &mut draws);
    (draws, achieved)
}

/// The triangles of what is drawn of the first object, all in the frame of its payloads.
fn triangles(baked: &Baked, draws: &[Draw]) -> Vec<[Vec3; 3]> {
    let origin = baked.scene.objects[0].bounds.centre().as_dvec3();
    let mut out = vec![];
    for d in draws {
        match &d.what {
            DrawWhat::Chunks(set) => {
                let source = gather(&baked.scene, set.iter(), origin).unwrap();
                out.extend(source.corners.iter().map(|&c| source.places(c)));
            }
            DrawWhat::Payload { id, part, object: 1 } => {
                let payload = &baked.payloads[&id.id];
                assert_eq!(payload.origin, origin);
                let Part::Mesh(m) = &payload.parts[usize::from(*part)] else { panic!("no mesh") };
                let corner = |i: &u32| m.positions[*i as usize];
                out.extend(m.indices.chunks_exact(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]));
            }
            DrawWhat::Payload { .. } => panic!("another object"),
        }
    }
    out
}

/// Edges that are not passed as often in one direction as in the other: none on a surface without border.
fn border_edges(triangles: &[[Vec3; 3]]) -> usize {
    let mut passed: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    for t in triangles {
        let name = |k: usize| (t[k % 3] + Vec3::ZERO).to_array().map(f32::to_bits);
        for k in 0..3 {
            let (a, b) = (name(k), name(k + 1));
            if a != b {
                *passed.entry(if a < b { [a, b] } else { [b, a] }).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    passed.values().filter(|&&n| n != 0).count()
}

/// How often a closed surface goes around a point: the sum of its triangles' solid angles over 4 pi (Van Oosterom and Strackee 1983).
fn winding(triangles: &[[Vec3; 3]], around: Vec3) -> f64 {
    let solid = |t: &[Vec3; 3]| {
        let [a, b, c] = t.map(|p| (p - around).as_dvec3());
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    triangles.iter().map(solid).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
