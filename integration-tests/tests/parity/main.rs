//! wgpu and Vulkan, side by side on one device: every plane of every surface and every picture, byte for byte.
//!
//! Both run the same shaders on the same packed data, so on lavapipe (where both stacks compile the same code) nothing may
//! differ. On other drivers, which may compile the two stacks' pipelines differently, a share of pixels may differ that the
//! assertion caps ([`farfield_integration_tests::pair`]). Without a driver each test is a visible skip; with
//! `FARFIELD_EXPECT_DEVICE=1` a skip is a failure.
//!
//! `benches/frame_times.rs` prints frame times of both.

mod layered;
mod primitives;

use std::collections::BTreeSet;

use farfield_core::backend::{Backend, BlockData};
use farfield_core::context::Shot;
use farfield_core::draw::DrawWhat;
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, TextureId};
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::{Aabb, Camera};
use farfield_integration_tests::pair::{draw, everything, hits, list, pair};
use farfield_integration_tests::turned::turned;
use glam::{DAffine3, DMat3, DQuat, DVec3, Mat4, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

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

/// Cameras around and within the scene, one of them off-axis.
fn cameras(scene: &Scene, size: [u32; 2]) -> [Camera; 3] {
    let centre = scene.bounds.centre().as_dvec3();
    let at = |from: DVec3, fov| Camera::looking(centre + from, -from.as_vec3(), Vec3::Y, fov, size, 0.05);
    let mut off_axis = at(DVec3::new(-6.0, 1.0, 5.0), 0.9);
    (off_axis.left, off_axis.top) = (off_axis.left * 1.4, off_axis.top * 0.6);
    [at(DVec3::new(9.0, 3.0, 9.0), 1.0), at(DVec3::new(0.4, 0.6, 1.0), 1.4), off_axis]
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
