//! wgpu and Vulkan, side by side on one device: every plane of every surface and every picture, byte for byte.
//!
//! Both run the same shaders on the same packed data, so on lavapipe (where both stacks compile the same code) nothing may
//! differ. On other drivers, which may compile the two stacks' pipelines differently, a share of pixels may differ that the
//! assertion caps at [`MAX_SHARE`]. Without a driver each test is a visible skip; with `FARFIELD_EXPECT_DEVICE=1` a skip is
//! a failure.
//!
//! `cargo test --release -p farfield-integration-tests --test parity -- --ignored --nocapture` prints frame times of both.

mod layered;

use std::collections::BTreeSet;

use farfield_core::backend::{Backend, BlockData, Counted, upload_scene};
use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, LocalPayload, MaterialId, PayloadRef, TargetId, TextureId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::scene::{Light, LightKind, Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::{Aabb, Camera};
use farfield_vulkan::VulkanBackend;
use farfield_wgpu::WgpuBackend;
use glam::{DAffine3, DMat3, DQuat, DVec3, Mat4, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The largest share of pixels that may differ on a driver other than lavapipe: silhouettes of small pictures.
const MAX_SHARE: f64 = 0.02;

/// Both backends on one scene, with all its chunks uploaded.
struct Pair {
    wgpu: WgpuBackend,
    vulkan: VulkanBackend,
    /// On lavapipe nothing may differ.
    exact: bool,
}

/// Both backends, or a skip that says why.
fn pair(test: &str, scene: &Scene) -> Option<Pair> {
    pair_of(test, scene, false)
}

/// The same, where asked for without 64-bit atomics.
fn pair_of(test: &str, scene: &Scene, halves: bool) -> Option<Pair> {
    let skip = |why: String| {
        assert!(std::env::var_os("FARFIELD_EXPECT_DEVICE").is_none_or(|v| v != "1"), "{test}: {why}");
        eprintln!("SKIPPED: {test}: {why}");
    };
    let without = farfield_vulkan::Without { atomics_64: halves, ..Default::default() };
    let options = farfield_vulkan::Options { without, ..Default::default() };
    let vulkan = VulkanBackend::new(scene, options).map_err(|e| skip(e.to_string())).ok()?;
    let device = vulkan.info().device.clone();
    // wgpu is to take the very device that Vulkan took; its own name is the part before the driver's.
    let adapter = device.split(',').next().map(str::to_owned);
    let without = farfield_wgpu::Without { atomics_64: halves, ..Default::default() };
    let options = farfield_wgpu::Options { adapter, without, ..Default::default() };
    let wgpu = WgpuBackend::new(scene, &options).map_err(|e| skip(e.to_string())).ok()?;
    let mut pair = Pair { wgpu, vulkan, exact: device.contains("llvmpipe") };
    let bytes = upload_scene(&mut pair.wgpu, scene).unwrap();
    assert_eq!(upload_scene(&mut pair.vulkan, scene).unwrap(), bytes);
    Some(pair)
}

impl Pair {
    fn upload(&mut self, id: PayloadRef, payload: &Payload) {
        let data = BlockData::Payload(payload);
        let bytes = self.wgpu.upload(Block::Payload(id), &data).unwrap();
        assert_eq!(self.vulkan.upload(Block::Payload(id), &data).unwrap(), bytes);
    }

    /// Renders on both and compares counts, the surface of target 0 and the picture of target 1; returns what was seen.
    fn check(&mut self, what: &str, list: &DrawList) -> (SurfaceImage, Picture) {
        let (a, b) = (self.wgpu.render(list).unwrap(), self.vulkan.render(list).unwrap());
        let counts = |c: &Counted| (c.near_triangles, c.far_triangles, c.samples, c.clipped_primitives);
        assert_eq!(counts(&a), counts(&b), "{what}");
        let surface = self.vulkan.read_surface(TargetId(0)).unwrap();
        let other = self.wgpu.read_surface(TargetId(0)).unwrap();
        self.same_surface(what, &other, &surface);
        let picture = self.vulkan.read_picture(TargetId(1)).unwrap();
        let other = self.wgpu.read_picture(TargetId(1)).unwrap();
        assert_eq!(other.size, picture.size, "{what}");
        self.same(what, "picture", &other.rgba, &picture.rgba, picture.size);
        (surface, picture)
    }

    fn same_surface(&self, what: &str, a: &SurfaceImage, b: &SurfaceImage) {
        assert_eq!(a.size, b.size, "{what}");
        self.same(what, "albedo", &a.albedo, &b.albedo, b.size);
        self.same(what, "normal", &a.normal, &b.normal, b.size);
        let bits = |i: &SurfaceImage| i.depth.iter().map(|d| d.to_bits()).collect::<Vec<_>>();
        self.same(what, "depth", &bits(a), &bits(b), b.size);
        self.same(what, "object", &a.object, &b.object, b.size);
    }

    fn same<T: PartialEq + std::fmt::Debug>(&self, what: &str, plane: &str, a: &[T], b: &[T], size: [u32; 2]) {
        assert_eq!(a.len(), b.len(), "{what}, {plane}");
        let differ: Vec<usize> = (0..a.len()).filter(|&i| a[i] != b[i]).collect();
        let allowed = if self.exact { 0.0 } else { MAX_SHARE * a.len() as f64 };
        if !differ.is_empty() {
            eprintln!("{what}, {plane}: {} of {} pixels differ", differ.len(), a.len());
        }
        assert!(
            differ.len() as f64 <= allowed,
            "{what}, {plane}: {} pixels of {size:?} differ, first at {}: {:?} {:?}",
            differ.len(),
            differ[0],
            a[differ[0]],
            b[differ[0]]
        );
    }
}

/// A shape of rings round an axis, 2 (rings - 1) segments triangles, whose radius `radius` gives at height 0..1.
fn turned(rings: u32, segments: u32, colors: bool, material: u32, radius: impl Fn(f32, f32) -> f32) -> TriangleMesh {
    let n = segments + 1;
    let uv = |i: u32| Vec2::new((i % n) as f32 / segments as f32, (i / n) as f32 / (rings - 1) as f32);
    let place = |i: u32| {
        let angle = uv(i).x * std::f32::consts::TAU;
        let r = radius(uv(i).y, angle);
        Vec3::new(r * angle.cos(), uv(i).y * 2.0 - 1.0, -r * angle.sin())
    };
    let indices: Vec<u32> = (0..(rings - 1) * segments)
        .flat_map(|q| {
            let i = q / segments * n + q % segments;
            [i, i + 1, i + n, i + n, i + 1, i + n + 1]
        })
        .collect();
    TriangleMesh {
        positions: (0..rings * n).map(place).collect(),
        uvs: (0..rings * n).map(|i| uv(i) * 3.0 - 1.0).collect(),
        colors: if colors {
            (0..rings * n).map(|i| [(37 * i % 200 + 50) as u8, (91 * i % 200 + 50) as u8, 200, 255]).collect()
        } else {
            vec![]
        },
        sections: vec![(0..indices.len() as u32, MaterialId(material))],
        indices,
        ..TriangleMesh::default()
    }
}

fn texture(name: &str, size: [u32; 2], rng: &mut ChaCha8Rng) -> Texture {
    let rgba = (0..size[0] * size[1]).map(|_| [rng.random(), rng.random(), rng.random(), 255]).collect();
    Texture { name: name.into(), size, rgba }
}

/// Vases, textured and coloured, in `count` placements, some mirrored, sheared by unequal scales, one- and two-sided.
fn vases(count: u32, at: DVec3, seed: u64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut b = SceneBuilder::default();
    b.textures = vec![texture("noise", [16, 16], &mut rng), texture("odd", [7, 5], &mut rng)];
    b.materials = vec![
        Material { texture: Some(TextureId(0)), ..Material::default() },
        Material { base_color: [0.9, 0.4, 0.2, 1.0], two_sided: true, ..Material::default() },
        Material { texture: Some(TextureId(1)), two_sided: true, ..Material::default() },
    ];
    let meshes = [
        b.mesh("vase", turned(60, 90, false, 0, |y, _| 0.35 + 0.2 * (6.0 * y).sin())).unwrap(),
        b.mesh("leaf", turned(12, 9, true, 1, |y, a| 0.1 + 0.6 * y * (2.5 * a).cos().abs())).unwrap(),
        b.mesh("bowl", turned(25, 40, true, 2, |y, a| 0.2 + 0.5 * y + 0.05 * (9.0 * a).sin())).unwrap(),
    ];
    for i in 0..count {
        let mut unit = |lo: f64, hi: f64| rng.random_range(lo..hi);
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, unit(0.0, 6.3), unit(-0.6, 0.6), unit(-0.6, 0.6));
        let mut scale = DVec3::new(unit(0.5, 1.6), unit(0.5, 1.6), unit(0.5, 1.6));
        if i % 3 == 1 {
            scale.x = -scale.x;
        }
        let place = DVec3::new(unit(-7.0, 7.0), unit(-1.0, 3.0), unit(-7.0, 7.0));
        let matrix = DMat3::from_quat(turn) * DMat3::from_diagonal(scale);
        let transform = DAffine3 { matrix3: matrix, translation: at + place };
        b.place(Placement { mesh: meshes[i as usize % 3], transform });
    }
    b.build().unwrap()
}

fn shading(scene: &Scene) -> Shading {
    let light = |kind, color| Light { kind, color, moves: false };
    let sun = LightKind::Directional { to_light: Vec3::new(0.4, 0.8, 0.3).normalize(), angle_rad: 0.0 };
    let lamp = LightKind::Point { position: scene.bounds.centre() + Vec3::Y * 2.0, radius: 0.0 };
    Shading {
        ambient: Vec3::splat(0.15),
        lights: vec![light(sun, Vec3::new(0.9, 0.8, 0.7)), light(lamp, Vec3::new(0.1, 0.2, 0.5))],
        sky: [93, 141, 219],
        ground: [71, 63, 52],
    }
}

fn list(scene: &Scene, camera: Camera, draws: Vec<Draw>) -> DrawList {
    let shade = PassKind::Shade { surface: TargetId(0), shading: shading(scene) };
    DrawList {
        passes: vec![
            Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws },
            Pass { kind: shade, camera, writes: TargetId(1), draws: vec![] },
        ],
    }
}

fn draw(what: DrawWhat) -> Draw {
    Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }
}

fn everything(scene: &Scene, camera: Camera) -> DrawList {
    list(scene, camera, vec![draw(DrawWhat::Chunks(scene.all_chunks()))])
}

/// Cameras around and within the scene, one of them off-axis.
fn cameras(scene: &Scene, size: [u32; 2]) -> [Camera; 3] {
    let centre = scene.bounds.centre().as_dvec3();
    let at = |from: DVec3, fov| Camera::looking(centre + from, -from.as_vec3(), Vec3::Y, fov, size, 0.05);
    let mut off_axis = at(DVec3::new(-6.0, 1.0, 5.0), 0.9);
    (off_axis.left, off_axis.top) = (off_axis.left * 1.4, off_axis.top * 0.6);
    [at(DVec3::new(9.0, 3.0, 9.0), 1.0), at(DVec3::new(0.4, 0.6, 1.0), 1.4), off_axis]
}

fn hits(image: &SurfaceImage) -> usize {
    image.object.iter().filter(|&&o| o != 0).count()
}

#[test]
fn instanced_textured_mirrored_and_two_sided_objects_are_the_same() {
    let scene = vases(60, DVec3::ZERO, 1);
    let Some(mut pair) = pair("instanced_textured_mirrored_and_two_sided_objects_are_the_same", &scene) else { return };
    let mut seen = BTreeSet::new();
    for (i, camera) in cameras(&scene, [512, 384]).into_iter().enumerate() {
        let (surface, picture) = pair.check(&format!("camera {i}"), &everything(&scene, camera));
        assert!(hits(&surface) > 20_000, "camera {i} sees {} pixels", hits(&surface));
        seen.extend(surface.object);
        assert!(picture.rgba.iter().any(|c| c[0] > 100), "camera {i} shows nothing lit");
    }
    assert!(seen.len() > 30, "{} of 60 objects are seen", seen.len());
}

#[test]
fn targets_of_any_size_are_the_same() {
    let scene = vases(20, DVec3::ZERO, 2);
    let Some(mut pair) = pair("targets_of_any_size_are_the_same", &scene) else { return };
    for size in [[1, 1], [2, 3], [257, 129], [63, 900], [1024, 1024], [257, 129]] {
        let (surface, _) = pair.check(&format!("{size:?}"), &everything(&scene, cameras(&scene, size)[1]));
        assert_eq!(surface.size, size);
    }
}

#[test]
fn a_scene_far_away_is_the_same() {
    let scene = vases(30, DVec3::new(1.0e7, -3.0e6, 2.0e7), 3);
    let Some(mut pair) = pair("a_scene_far_away_is_the_same", &scene) else { return };
    for (i, mut camera) in cameras(&scene, [400, 300]).into_iter().enumerate() {
        assert!(hits(&pair.check(&format!("camera {i}"), &everything(&scene, camera)).0) > 5_000);
        // An eye far from the origin of the local frame, and one within the near distance of things.
        camera.eye += DVec3::from(camera.forward) * -3.0e5;
        pair.check(&format!("camera {i}, far back"), &everything(&scene, camera));
        camera.near = 4.0;
        camera.eye = scene.bounds.centre().as_dvec3();
        pair.check(&format!("camera {i}, in the middle"), &everything(&scene, camera));
    }
}

#[test]
fn captures_are_the_same() {
    let scene = vases(24, DVec3::ZERO, 4);
    let Some(mut pair) = pair("captures_are_the_same", &scene) else { return };
    let mut shots = vec![];
    for size in [[64, 64], [100, 37]] {
        for camera in cameras(&scene, size).into_iter().chain(Camera::cube(DVec3::new(0.1, 1.0, 0.2), 48, 0.01)) {
            shots.push(Shot { chunks: scene.cull(&scene.all_chunks(), &camera), camera });
        }
    }
    let (a, b) = (pair.wgpu.capture(&shots).unwrap(), pair.vulkan.capture(&shots).unwrap());
    assert_eq!((a.len(), b.len()), (shots.len(), shots.len()));
    for (i, (a, b)) in a.iter().zip(&b).enumerate() {
        pair.same_surface(&format!("shot {i}"), a, b);
    }
    assert!(b.iter().map(hits).sum::<usize>() > 5_000);
}

/// An atlas of noise.
fn atlas(size: [u32; 2], layers: u32, rng: &mut ChaCha8Rng) -> Payload {
    let n = size[0] * size[1] * layers;
    let mut texels = || (0..n).map(|_| [rng.random(), rng.random(), rng.random(), 255]).collect::<Vec<[u8; 4]>>();
    let part = AtlasPart { size, layers, albedo: texels(), normal: texels() };
    Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Atlas(part)] }
}

/// A bumpy ball as a payload mesh.
fn ball(two_sided: bool) -> MeshPart {
    let m =
        turned(40, 60, true, 0, |y, a| (0.25 - (y - 0.5) * (y - 0.5)).max(0.0).sqrt() * (2.0 + 0.1 * (7.0 * a).sin()));
    let mut smooth = m.clone();
    smooth.smooth_normals();
    MeshPart { positions: m.positions, normals: smooth.normals, albedo: m.colors, indices: m.indices, two_sided }
}

/// Projectors round the origin that throw rectangles of the atlases `atlases` (their layers and sizes) on a ball.
fn projectors(atlases: &[(LocalPayload, [u32; 2], u32)], count: usize) -> Vec<Projector> {
    (0..count)
        .map(|i| {
            let (atlas, size, layers) = atlases[i % atlases.len()];
            let angle = i as f32 * 2.399_963; // the golden angle, radians: directions that never line up
            let eye = Vec3::new(4.0 * angle.cos(), 1.5 * (i as f32 * 0.7).sin(), 4.0 * angle.sin());
            let rect = [i as u32 % 3, 1, size[0] / 2, size[1] / 2];
            let camera = Camera::looking(eye.as_dvec3(), -eye, Vec3::Y, 0.7, [rect[2], rect[3]], 0.1);
            let [w, h, x, y] = [rect[2], rect[3], rect[0], rect[1]].map(|v| v as f32);
            // From clip space to texels: u = x + (ndc.x / 2 + 1/2) w, v = y + (1/2 - ndc.y / 2) h.
            let to_texels = Mat4::from_cols_array_2d(&[
                [w / 2.0, 0.0, 0.0, 0.0],
                [0.0, -h / 2.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [x + w / 2.0, y + h / 2.0, 0.0, 1.0],
            ]);
            let matrix = to_texels * camera.projection() * Mat4::from_translation(-eye);
            Projector { matrix, eye, atlas, layer: i as u32 % layers, rect }
        })
        .collect()
}

#[test]
fn plain_and_projected_payloads_are_the_same() {
    let scene = vases(6, DVec3::ZERO, 5);
    let Some(mut pair) = pair("plain_and_projected_payloads_are_the_same", &scene) else { return };
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let id = |n| PayloadRef { asset: AssetId(7), id: LocalPayload(n) };
    let atlases = [(LocalPayload(1), [64, 64], 3), (LocalPayload(2), [33, 70], 1), (LocalPayload(5), [16, 128], 2)];
    for (local, size, layers) in atlases {
        pair.upload(id(local.0), &atlas(size, layers, &mut rng));
    }
    // No view, one, two, many, and sets of every size over the triangles of one ball.
    type Sets<'a> = (&'a str, usize, &'a dyn Fn(usize) -> u32);
    let sets: [Sets<'_>; 5] = [
        ("no view", 0, &|_| 0),
        ("one view", 1, &|_| 1),
        ("two views", 2, &|_| 3),
        ("all of 32 views", 32, &|_| u32::MAX),
        ("mixed", 12, &|i| (i as u32).wrapping_mul(2_654_435_761) >> 20 & if i % 5 == 0 { 0 } else { 0xfff }),
    ];
    let mut draws = vec![draw(DrawWhat::Chunks(scene.all_chunks()))];
    let mut alone = vec![];
    for (i, (name, count, set)) in sets.iter().enumerate() {
        let mesh = ball(i % 2 == 0);
        let views = (0..mesh.indices.len() / 3).map(set).collect();
        let projected = ProjectedPart { views, projectors: projectors(&atlases, *count), mesh };
        let payload = Payload {
            origin: DVec3::new(2.2 * i as f64 - 4.0, 1.0, 6.0),
            bounds: Aabb::EMPTY,
            parts: vec![Part::Mesh(ball(i % 2 == 1)), Part::Projected(projected)],
        };
        pair.upload(id(10 + i as u32), &payload);
        let part = |part| draw(DrawWhat::Payload { id: id(10 + i as u32), part, object: 100 + i as u32 });
        alone.push((*name, payload.origin, vec![part(0)], vec![part(1)]));
        draws.push(part(1));
    }
    for (name, origin, plain, projected) in alone {
        let camera = |from: Vec3| Camera::looking(origin + from.as_dvec3(), -from, Vec3::Y, 0.9, [320, 256], 0.05);
        for (eye, from) in
            [Vec3::new(0.5, 0.7, 3.0), Vec3::new(-2.0, -0.4, 1.0), Vec3::new(0.0, 0.2, 0.1)].into_iter().enumerate()
        {
            for (kind, draws) in [("plain", &plain), ("projected", &projected)] {
                let what = format!("{name}, {kind}, eye {eye}");
                let (surface, _) = pair.check(&what, &list(&scene, camera(from), draws.clone()));
                assert!(eye == 2 || hits(&surface) > 5_000, "{what}: {} pixels", hits(&surface));
            }
        }
    }
    for camera in cameras(&scene, [512, 384]) {
        pair.check("all together", &list(&scene, camera, draws.clone()));
    }
}

#[test]
fn blocks_that_come_and_go_leave_the_same() {
    let scene = vases(18, DVec3::ZERO, 8);
    let Some(mut pair) = pair("blocks_that_come_and_go_leave_the_same", &scene) else { return };
    let camera = cameras(&scene, [300, 300])[0];
    let before = pair.check("before", &everything(&scene, camera));
    // Every other chunk goes and comes back, behind whatever took its place.
    let some: Vec<_> = scene.mesh_chunk_ids().step_by(2).collect();
    for &id in &some {
        pair.wgpu.release(Block::Chunk(id));
        pair.vulkan.release(Block::Chunk(id));
    }
    let ball = Payload { origin: DVec3::Y, bounds: Aabb::EMPTY, parts: vec![Part::Mesh(ball(false))] };
    let id = PayloadRef { asset: AssetId(0), id: LocalPayload(0) };
    pair.upload(id, &ball);
    for &id in some.iter().rev() {
        let mut both = |c: &farfield_core::mesh::ChunkMesh| {
            pair.wgpu.upload(Block::Chunk(id), &BlockData::Chunk(c)).unwrap();
            pair.vulkan.upload(Block::Chunk(id), &BlockData::Chunk(c)).unwrap();
        };
        scene.geometry.with(id, &mut both).unwrap();
    }
    assert_eq!(pair.check("after", &everything(&scene, camera)), before);
}

/// A scene of about `triangles` triangles, all in view of its camera: tiles of a bumpy sheet.
fn sheets(triangles: u32) -> (Scene, Camera) {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { two_sided: true, ..Material::default() });
    let tiles = 10;
    let side = ((triangles / (2 * tiles * tiles)) as f64).sqrt().round() as u32;
    let mesh = turned(side + 1, side, true, 0, |y, a| 0.6 + 0.2 * (40.0 * y).sin() * (11.0 * a).cos());
    // Each tile is a mesh of its own, so that as many triangles are resident as are drawn.
    for i in 0..tiles * tiles {
        let mesh = b.mesh(&format!("tile {i}"), mesh.clone()).unwrap();
        let place = DVec3::new(f64::from(i % tiles) * 2.0, 0.0, f64::from(i / tiles) * -2.0);
        b.place(Placement { mesh, transform: DAffine3::from_translation(place) });
    }
    let scene = b.build().unwrap();
    let eye = scene.bounds.centre().as_dvec3() + DVec3::new(0.0, 14.0, 18.0);
    let camera = Camera::looking(eye, Vec3::new(0.0, -14.0, -18.0), Vec3::Y, 1.0, [1024, 1024], 0.1);
    (scene, camera)
}

#[test]
#[ignore = "prints frame times of both backends; takes minutes, and gigabytes of memory"]
fn frame_times_side_by_side() {
    for triangles in [100_000, 1_000_000, 8_000_000] {
        let (scene, camera) = sheets(triangles);
        let Some(mut pair) = pair("frame_times_side_by_side", &scene) else { return };
        let list = everything(&scene, camera);
        let (surface, _) = pair.check("first frame", &list);
        // The least and the median, milliseconds.
        let of = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            format!("{:.1} / {:.1} ms", all[0], all[all.len() / 2])
        };
        // Taken in turns, so that whatever else the machine does meets both.
        let (mut a, mut b): (Vec<Counted>, Vec<Counted>) = (vec![], vec![]);
        for _ in 0..9 {
            a.push(pair.wgpu.render(&list).unwrap());
            b.push(pair.vulkan.render(&list).unwrap());
        }
        for (name, all) in [("wgpu", a), ("vulkan", b)] {
            println!(
                "{} triangles in {} chunks, {:.0} % of pixels hit, {name}: wall {}, gpu {} (least / median), {:?} clipped",
                scene.triangles(),
                scene.chunks.len(),
                100.0 * hits(&surface) as f64 / surface.object.len() as f64,
                of(all.iter().map(|c| c.wall_ms).collect()),
                of(all.iter().map(|c| c.gpu_ms.unwrap_or(f64::NAN)).collect()),
                all[0].clipped_primitives,
            );
        }
    }
}
