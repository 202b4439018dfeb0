//! Pictures of levels of detail beside those of the scene itself.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use farfield_core::backend::{Backend, BlockData};
use farfield_core::camera::ViewModel;
use farfield_core::cell::Active;
use farfield_core::claim::Claim;
use farfield_core::color::luma;
use farfield_core::context::{Context, Forget, Serial};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, CellId, LocalPayload, MaterialId, PayloadRef, SplitId, TargetId, TextureId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::Payload;
use farfield_core::scene::{Light, LightKind, Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::strategy::{FarField, LeftOut, SceneJob, Sink, View};
use farfield_core::{Aabb, Camera, Fault};
use farfield_cpu::{CpuBackend, CpuCapture, CpuOptions};
use farfield_far_baselines::StaticLod;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};

#[derive(Default)]
struct Keep(Mutex<BTreeMap<LocalPayload, Payload>>);
impl Sink for Keep {
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault> {
        self.0.lock().unwrap().insert(id, payload.clone());
        Ok(())
    }
    fn claim(&self, claim: Claim) {
        panic!("{claim:?} is claimed");
    }
    fn left_out(&self, _what: LeftOut) {}
}

/// A torus with bumps, coloured all round, with texture coordinates; 2 n n triangles, radius 1.4.
fn ring(n: u32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let turn = |k: u32| std::f32::consts::TAU * k as f32 / n as f32;
        let (a, b) = (turn(i), turn(j));
        let r = 0.4 + 0.05 * (6.0 * a).sin() * (3.0 * b).cos();
        m.positions.push(Vec3::new((1.0 + r * b.cos()) * a.cos(), r * b.sin(), (1.0 + r * b.cos()) * a.sin()));
        m.colors.push([(128.0 + 90.0 * a.sin()) as u8, (128.0 + 90.0 * b.sin()) as u8, 160, 255]);
        m.uvs.push(Vec2::new((2.0 * i as f32 / n as f32 - 1.0).abs(), (2.0 * j as f32 / n as f32 - 1.0).abs()));
        let at = |i: u32, j: u32| (i % n) * n + j % n;
        let [p, q, s, t] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        m.indices.extend([p, s, q, p, t, s]);
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// Rings at distances from 4 to 120, one mirrored, one stretched, some textured.
fn scene() -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [1.0; 4], ..Material::default() });
    let stripes = (0..64 * 64).map(|i| if i % 64 / 4 % 2 == 0 { [220, 200, 90, 255] } else { [60, 70, 120, 255] });
    b.textures.push(Texture { name: "stripes".into(), size: [64, 64], rgba: stripes.collect() });
    b.materials.push(Material { texture: Some(TextureId(0)), ..b.materials[0].clone() });
    let (plain, mut worn) = (ring(64), ring(64));
    worn.colors.clear();
    worn.sections[0].1 = MaterialId(1);
    let meshes = [b.mesh("ring", plain).unwrap(), b.mesh("worn ring", worn).unwrap()];
    for k in 0..14u32 {
        let far = 4.0 * 1.3f64.powi(k as i32);
        let side = if k % 2 == 0 { -0.25 } else { 0.22 };
        let size = if k == 3 { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::new(1.0, 1.0 + 0.2 * f64::from(k % 3), 1.0) };
        let turn = DQuat::from_rotation_x(0.4 + f64::from(k));
        let at = DVec3::new(side * far, 0.1 * far * f64::from(k % 3) - 0.1 * far, -far);
        let transform = DAffine3::from_scale_rotation_translation(size, turn, at);
        b.place(Placement { mesh: meshes[usize::from(k % 4 == 2)], transform });
    }
    b.build().unwrap()
}

struct Rig {
    scene: Scene,
    backend: CpuBackend,
    index: Vec<u8>,
    camera: Camera,
}

impl Rig {
    fn new(own: &StaticLod, scene: Scene) -> Self {
        let sink = Keep::default();
        let (capture, go) = (CpuCapture::new(&scene).unwrap(), AtomicBool::new(false));
        let views = ViewModel {
            fov_y_rad: 1.0,
            resolution: [320, 240],
            near: 0.05,
            eye_height: [0.0; 2],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        };
        let cx = Context { capture: &capture, run: &Serial, memo: &Forget, cancel: &go };
        let index = own.bake_scene(&SceneJob { scene: &scene, views: &views }, &sink, &cx).unwrap();
        let mut backend = CpuBackend::new(&scene, CpuOptions::default()).unwrap();
        for id in scene.mesh_chunk_ids() {
            let up = &mut |c: &farfield_core::mesh::ChunkMesh| {
                backend.upload(Block::Chunk(id), &BlockData::Chunk(c)).unwrap();
            };
            scene.geometry.with(id, up).unwrap();
        }
        for (id, payload) in sink.0.into_inner().unwrap() {
            let block = Block::Payload(PayloadRef { asset: AssetId(0), id });
            farfield_core::backend::validate(block, &BlockData::Payload(&payload)).unwrap();
            backend.upload(block, &BlockData::Payload(&payload)).unwrap();
        }
        // The local frame's origin is not the world's.
        let camera = views.camera(-scene.origin, 0.0, 0.0);
        Self { scene, backend, index, camera }
    }

    fn levels(&self, own: &StaticLod) -> Vec<Draw> {
        let open = own.open(Some((AssetId(0), &self.index)), (AssetId(1), &[])).unwrap();
        let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
        let half_px = |b: &Aabb| 0.5 * b.distance(self.camera.eye.as_vec3()) / self.camera.px_per_tan();
        let (scene, camera) = (&self.scene, &self.camera);
        let view = View { scene, camera, at: &at, tolerance: &half_px, budget: Default::default(), cell: None };
        let mut draws = vec![];
        assert_eq!(open.draw(&|_| true, &view, &mut draws).missing, 0);
        draws
    }

    /// Luminance of the lit picture, the object of each pixel, triangles drawn.
    fn picture(&mut self, draws: Vec<Draw>) -> (Vec<f32>, Vec<u32>, u64) {
        let (surface, lit) = (TargetId(0), TargetId(1));
        let sun = LightKind::Directional { to_light: Vec3::new(0.5, 0.7, 0.5).normalize(), angle_rad: 0.0 };
        let shading = Shading {
            ambient: Vec3::splat(0.3),
            lights: vec![Light { kind: sun, color: Vec3::splat(0.7), moves: false }],
            sky: [120; 3],
            ground: [60; 3],
        };
        let camera = self.camera;
        let list = DrawList {
            passes: vec![
                Pass { kind: PassKind::Surface, camera, writes: surface, draws },
                Pass { kind: PassKind::Shade { surface, shading }, camera, writes: lit, draws: vec![] },
            ],
        };
        let counted = self.backend.render(&list).unwrap();
        let picture = self.backend.read_picture(lit).unwrap();
        let objects = self.backend.read_surface(surface).unwrap().object;
        (picture.rgba.into_iter().map(luma).collect(), objects, counted.near_triangles + counted.far_triangles)
    }
}

fn psnr_db(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    10.0 * (255.0 * 255.0 * a.len() as f64 / sum).log10()
}

#[test]
fn at_one_pixel_pictures_are_near_the_scenes_with_far_fewer_triangles() {
    let own = StaticLod::default();
    let mut rig = Rig::new(&own, scene());
    let all = vec![Draw {
        what: DrawWhat::Chunks(rig.scene.cull(&rig.scene.all_chunks(), &rig.camera)),
        bounds: rig.scene.bounds,
        error_px: 0.0,
    }];
    let (reference, objects, original) = rig.picture(all);
    let mut counts = vec![];
    for (max_px, least_db) in [(0.0, 99.0), (1.0, 40.0), (8.0, 30.0)] {
        let own = StaticLod { max_px, ..StaticLod::default() };
        let draws = rig.levels(&own);
        let (picture, drawn, triangles) = rig.picture(draws);
        let (db, other) = (psnr_db(&reference, &picture), objects.iter().zip(&drawn).filter(|(a, b)| a != b).count());
        println!("{max_px} px: {db:.1} dB, {triangles} of {original} triangles, {other} pixels of another object");
        assert!(db >= least_db, "{max_px} px: {db} dB");
        counts.push(triangles);
    }
    assert_eq!(counts[0], original);
    assert!(counts[1] * 3 < original * 2 && counts[2] * 2 < counts[1], "{counts:?} of {original}");
    let seen: std::collections::BTreeSet<u32> = objects.into_iter().filter(|o| *o > 0).collect();
    assert!(seen.len() > 10, "only {} objects show", seen.len());
}
