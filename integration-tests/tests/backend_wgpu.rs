//! The wgpu backend against the conformance suite, with every optional feature and with none, under validation; its pictures
//! against the reference's; its captures against its own frames.
//!
//! Rasterisers and ray casters differ where an edge passes a pixel's centre: [`MAX_SHARE`] of the pixels may show another
//! triangle. All others agree: the object exactly, depth within a thousandth, albedo and lit colours within [`MAX_LEVELS`].
//!
//! Without a driver this is a visible skip; with `FARFIELD_EXPECT_DEVICE=1` a skip is a failure.

use std::sync::{Mutex, PoisonError};

use farfield_core::backend::{Backend, BlockData, upload_scene};
use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, LocalPayload, MaterialId, PayloadRef, TargetId, TextureId};
use farfield_core::image::{Picture, SurfaceImage, from_octahedral};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::scene::{Light, LightKind, Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::{Aabb, Camera};
use farfield_cpu::{CpuBackend, CpuOptions};
use farfield_integration_tests::conformance::suite;
use farfield_wgpu::{Options, WgpuBackend, Without, available};
use glam::{DAffine3, DQuat, DVec3, Mat4, Vec2, Vec3};

/// The largest share of pixels that may show another triangle than the reference does.
const MAX_SHARE: f64 = 0.0005;

/// The most that albedo and lit colours may differ in all other pixels, of 255.
const MAX_LEVELS: u8 = 2;

/// Collects what wgpu and the validation layers log as warnings and errors.
struct Journal(Mutex<Vec<String>>);

static JOURNAL: Journal = Journal(Mutex::new(Vec::new()));

impl Journal {
    fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl log::Log for Journal {
    fn enabled(&self, about: &log::Metadata<'_>) -> bool {
        about.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let message = format!("{} {}: {}", record.level(), record.target(), record.args());
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(message);
        }
    }

    fn flush(&self) {}
}

/// Whether there is a device; says so where there is none.
fn device(test: &str) -> bool {
    match available() {
        Ok(device) => {
            eprintln!("on {device}");
            true
        }
        Err(why) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{why}"),
        Err(why) => {
            eprintln!("SKIPPED: {test}: {why}");
            false
        }
    }
}

#[test]
fn the_wgpu_backend_conforms_without_a_word_from_validation() {
    if !device("the_wgpu_backend_conforms_without_a_word_from_validation") {
        return;
    }
    log::set_logger(&JOURNAL).expect("no other logger");
    log::set_max_level(log::LevelFilter::Warn);
    let options = Options { validation: true, ..Options::default() };
    suite(&|scene| Box::new(WgpuBackend::new(scene, &options).expect("a backend")));
    let said = JOURNAL.messages();
    assert!(said.is_empty(), "validation says:\n{}", said.join("\n"));
}

#[test]
fn the_fallbacks_conform_too() {
    if !device("the_fallbacks_conform_too") {
        return;
    }
    let options = Options {
        without: Without { indirect: true, timestamps: true, statistics: true, atomics_64: true },
        ..Options::default()
    };
    suite(&|scene| Box::new(WgpuBackend::new(scene, &options).expect("a backend")));
}

/// A ball of 2 x 48 x 24 triangles with texture coordinates and colours.
fn ball() -> TriangleMesh {
    let (rings, segments) = (24u32, 48u32);
    let n = segments + 1;
    let mut m = TriangleMesh::default();
    for i in 0..=rings {
        for j in 0..n {
            let (v, u) = (i as f32 / rings as f32, j as f32 / segments as f32);
            let (polar, around) = (v * std::f32::consts::PI, u * std::f32::consts::TAU);
            let p = Vec3::new(polar.sin() * around.cos(), polar.cos(), -polar.sin() * around.sin());
            m.positions.push(p);
            m.normals.push(p);
            m.uvs.push(Vec2::new(2.0 * u, v) * 1.5 - 0.2);
            m.colors.push([200 + (i * 2) as u8, 255 - (j % 40) as u8, 230, 255]);
        }
    }
    for q in 0..rings * segments {
        let i = q / segments * n + q % segments;
        m.indices.extend([i, i + n, i + 1, i + 1, i + n, i + n + 1]);
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

/// Balls, turned and stretched, textured.
fn balls() -> Scene {
    let mut b = SceneBuilder::default();
    let size = [16u32, 8];
    let texel = |i: u32| {
        let wave = |f: f32| (190.0 + 50.0 * (i as f32 * f).sin()) as u8;
        [wave(0.4), wave(0.9), wave(0.2), 255]
    };
    b.textures = vec![Texture { name: "waves".into(), size, rgba: (0..size[0] * size[1]).map(texel).collect() }];
    b.materials =
        vec![Material { texture: Some(TextureId(0)), base_color: [0.8, 0.7, 0.9, 1.0], ..Material::default() }];
    let mesh = b.mesh("ball", ball()).expect("a sound mesh");
    for i in 0..14 {
        let t = f64::from(i);
        let place = DVec3::new(3.0 * (2.4 * t).cos(), 0.7 * (1.3 * t).sin(), 3.0 * (2.4 * t).sin());
        let scale = DVec3::new(0.5 + 0.04 * t, 0.7, 1.0 - 0.03 * t);
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, t, 0.3 * t, 0.1 * t);
        b.place(Placement { mesh, transform: DAffine3::from_scale_rotation_translation(scale, turn, place) });
    }
    b.build().expect("a sound scene")
}

/// The ball as a projected part under three projectors, whose atlas is smooth; the last sixth of the triangles sees none.
fn projected(origin: DVec3) -> [Payload; 2] {
    let (size, layers) = ([64u32, 48], 3);
    let texel = |i: u32| {
        let (x, y) = ((i % size[0]) as f32, (i / size[0]) as f32);
        let wave = |f: f32| (180.0 + 60.0 * (x * f).sin() * (y * 0.13).cos()) as u8;
        [wave(0.11), wave(0.23), wave(0.17), 255]
    };
    let n = size[0] * size[1] * layers;
    let normal = (0..n).map(|i| [100 + (i % 64) as u8, 130, 220, 255]).collect();
    let atlas = AtlasPart { size, layers, albedo: (0..n).map(texel).collect(), normal };
    let projectors: Vec<Projector> = (0..layers)
        .map(|layer| {
            let angle = 0.8 * layer as f32;
            let eye = Vec3::new(4.0 * angle.sin(), 0.5, 4.0 * angle.cos());
            let c = Camera::looking(eye.as_dvec3(), -eye, Vec3::Y, 0.6, [60, 44], 0.1);
            // u = 2 + (ndc.x / 2 + 1/2) 60, v = 3 + (1/2 - ndc.y / 2) 44, both times w.
            let to_texels = Mat4::from_cols_array_2d(&[
                [30.0, 0.0, 0.0, 0.0],
                [0.0, -22.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [32.0, 25.0, 0.0, 1.0],
            ]);
            let matrix = to_texels * c.projection() * Mat4::from_translation(-eye);
            Projector { matrix, eye, atlas: LocalPayload(0), layer, rect: [2, 3, 60, 44] }
        })
        .collect();
    let m = ball();
    let triangles = m.triangles();
    let mesh =
        MeshPart { positions: m.positions, normals: m.normals, albedo: m.colors, indices: m.indices, two_sided: false };
    let views = (0..triangles).map(|t| if t * 6 > 5 * triangles { 0 } else { 1 + t as u32 / 48 % 7 }).collect();
    let payload = |part| Payload { origin, bounds: Aabb::EMPTY, parts: vec![part] };
    [payload(Part::Atlas(atlas)), payload(Part::Projected(ProjectedPart { mesh, views, projectors }))]
}

fn frame(backend: &mut dyn Backend, scene: &Scene, camera: Camera) -> (SurfaceImage, Picture) {
    upload_scene(backend, scene).expect("the scene");
    let id = |n| PayloadRef { asset: AssetId(0), id: LocalPayload(n) };
    let origin = scene.bounds.centre().as_dvec3() + DVec3::Y * 1.8;
    for (n, payload) in projected(origin).iter().enumerate() {
        backend.upload(Block::Payload(id(n as u32)), &BlockData::Payload(payload)).expect("a payload");
    }
    let draw = |what| Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 };
    let draws =
        vec![draw(DrawWhat::Chunks(scene.all_chunks())), draw(DrawWhat::Payload { id: id(1), part: 0, object: 99 })];
    let sun = LightKind::Directional { to_light: Vec3::new(0.4, 0.8, 0.3).normalize(), angle_rad: 0.0 };
    let lamp = LightKind::Point { position: Vec3::new(2.0, 4.0, 1.0), radius: 0.0 };
    let light = |kind, color| Light { kind, color, moves: false };
    let lights = vec![light(sun, Vec3::new(0.7, 0.6, 0.5)), light(lamp, Vec3::new(0.2, 0.3, 0.4))];
    let shading = Shading { ambient: Vec3::splat(0.2), lights, sky: [93, 141, 219], ground: [71, 63, 52] };
    let shade = PassKind::Shade { surface: TargetId(0), shading };
    let list = DrawList {
        passes: vec![
            Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws },
            Pass { kind: shade, camera, writes: TargetId(1), draws: vec![] },
        ],
    };
    backend.render(&list).expect("a frame");
    (backend.read_surface(TargetId(0)).expect("planes"), backend.read_picture(TargetId(1)).expect("a picture"))
}

#[test]
fn pictures_agree_with_the_reference() {
    if !device("pictures_agree_with_the_reference") {
        return;
    }
    let scene = balls();
    let centre = scene.bounds.centre().as_dvec3();
    let levels = |a: [u8; 4], b: [u8; 4]| (0..4).map(|k| a[k].abs_diff(b[k])).max().unwrap_or(0);
    for (i, from) in [DVec3::new(1.0, 2.0, 7.0), DVec3::new(-5.0, 0.5, 4.0)].into_iter().enumerate() {
        let camera = Camera::looking(centre + from, -from.as_vec3(), Vec3::Y, 0.9, [320, 240], 0.05);
        let mut cpu = CpuBackend::new(&scene, CpuOptions::default()).expect("the reference");
        let mut gpu = WgpuBackend::new(&scene, &Options::default()).expect("a backend");
        let (a, a_lit) = frame(&mut cpu, &scene, camera);
        let (b, b_lit) = frame(&mut gpu, &scene, camera);
        let n = a.depth.len();
        let (mut other, mut projected) = (0, 0);
        for p in 0..n {
            let same = a.object[p] == b.object[p]
                && (!a.hit(p) || (a.depth[p] - b.depth[p]).abs() <= 1e-3 * a.depth[p])
                && levels(a.albedo[p], b.albedo[p]) <= MAX_LEVELS
                && levels(a_lit.rgba[p], b_lit.rgba[p]) <= MAX_LEVELS
                && from_octahedral(a.normal[p]).distance(from_octahedral(b.normal[p])) < 0.01;
            other += usize::from(!same);
            projected += usize::from(same && a.object[p] == 99);
        }
        eprintln!("camera {i}: {other} of {n} pixels differ from the reference; {projected} projected ones agree");
        assert!(projected > 1000, "camera {i}: {projected} pixels of the projected part");
        assert!(a.object.iter().filter(|&&o| o != 0).count() * 4 > n, "camera {i} sees little");
        assert!(other as f64 <= MAX_SHARE * n as f64, "camera {i}: {other} of {n} pixels differ");
    }
}

#[test]
fn captures_are_what_frames_show() {
    if !device("captures_are_what_frames_show") {
        return;
    }
    let scene = balls();
    let mut gpu = WgpuBackend::new(&scene, &Options::default()).expect("a backend");
    upload_scene(&mut gpu, &scene).expect("the scene");
    let mut shots = vec![];
    for (i, size) in [[64, 64], [65, 33], [300, 7], [64, 64], [1, 1]].into_iter().enumerate() {
        let eye = scene.bounds.centre().as_dvec3() + DVec3::new(i as f64, 1.0, 6.0);
        let camera = Camera::looking(eye, Vec3::new(-0.2 * i as f32, -0.2, -1.0), Vec3::Y, 0.9, size, 0.05);
        shots.push(Shot { chunks: scene.all_chunks(), camera });
    }
    let captured = gpu.capture(&shots).expect("captures");
    assert_eq!(captured.len(), shots.len());
    for (shot, image) in shots.iter().zip(&captured) {
        let what = DrawWhat::Chunks(shot.chunks.clone());
        let draws = vec![Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }];
        let pass = Pass { kind: PassKind::Surface, camera: shot.camera, writes: TargetId(4), draws };
        gpu.render(&DrawList { passes: vec![pass] }).expect("a frame");
        let planes = gpu.read_surface(TargetId(4)).expect("planes");
        assert!(planes == *image, "a capture of {:?} pixels differs from its frame", shot.camera.size);
    }
    assert!(captured[0].object.iter().any(|&o| o != 0), "the first capture shows nothing");
}

#[test]
fn an_adapter_that_is_not_there_is_named_with_those_that_are() {
    if !device("an_adapter_that_is_not_there_is_named_with_those_that_are") {
        return;
    }
    let options = Options { adapter: Some("no such adapter".into()), ..Options::default() };
    let fault = WgpuBackend::new(&balls(), &options).err().expect("a refusal").to_string();
    assert!(fault.contains("no such adapter") && fault.contains("there are: "), "{fault}");
}
