//! What is this backend's own: captures in batches, validation without a word, clean ends, clear faults.

use farfield_core::backend::{Backend, BlockData, upload_scene};
use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, LocalPayload, MaterialId, PayloadRef, TargetId, TextureId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::{AtlasPart, Part, Payload};
use farfield_core::scene::{ChunkSet, Light, LightKind, Material, Placement, Scene, SceneBuilder, Texture};
use farfield_core::{Aabb, Camera, Fault};
use farfield_vulkan::{Options, VulkanBackend, Without, available};
use glam::{DAffine3, DVec3, Vec2, Vec3};

/// A backend under validation, or a skip that says why.
fn opened(test: &str, scene: &Scene) -> Option<VulkanBackend> {
    opened_without(test, scene, Without::default())
}

fn opened_without(test: &str, scene: &Scene, without: Without) -> Option<VulkanBackend> {
    match VulkanBackend::new(scene, Options { validation: true, without, ..Options::default() }) {
        Ok(backend) => Some(backend),
        Err(why) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{test}: {why}"),
        Err(why) => {
            eprintln!("SKIPPED: {test}: {why}");
            None
        }
    }
}

/// Drops the backend and checks that validation had nothing to say from its first call to its last.
fn ends_silently(backend: VulkanBackend) {
    let journal = backend.journal();
    drop(backend);
    assert_eq!(journal.messages(), Vec::<String>::new());
}

/// A wavy sheet of 2 n^2 triangles over the unit square, textured, in objects on a row.
fn scene(n: u32, objects: u32) -> Scene {
    let mut b = SceneBuilder::default();
    b.textures.push(Texture {
        name: "checks".into(),
        size: [8, 8],
        rgba: (0..64).map(|i| if (i + i / 8) % 2 == 0 { [220, 180, 90, 255] } else { [40, 60, 120, 255] }).collect(),
    });
    b.materials.push(Material { texture: Some(TextureId(0)), two_sided: true, ..Material::default() });
    let at = |x: u32, z: u32| x + z * (n + 1);
    let uv = |i: u32| Vec2::new((i % (n + 1)) as f32, (i / (n + 1)) as f32) / n as f32;
    let indices: Vec<u32> = (0..n * n)
        .flat_map(|i| {
            let (x, z) = (i % n, i / n);
            [at(x, z), at(x, z + 1), at(x + 1, z), at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]
        })
        .collect();
    let mesh = TriangleMesh {
        positions: (0..(n + 1) * (n + 1))
            .map(|i| Vec3::new(uv(i).x, 0.1 * (9.0 * uv(i).x).sin() * (7.0 * uv(i).y).cos(), uv(i).y))
            .collect(),
        uvs: (0..(n + 1) * (n + 1)).map(uv).collect(),
        sections: vec![(0..indices.len() as u32, MaterialId(0))],
        indices,
        ..TriangleMesh::default()
    };
    let mesh = b.mesh("sheet", mesh).unwrap();
    for i in 0..objects {
        b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::X * 1.2 * f64::from(i)) });
    }
    b.build().unwrap()
}

fn camera(scene: &Scene, size: [u32; 2]) -> Camera {
    let eye = scene.bounds.centre().as_dvec3() + DVec3::new(0.3, 1.5, 2.5);
    Camera::looking(eye, Vec3::new(-0.1, -0.5, -1.0), Vec3::Y, 1.0, size, 0.05)
}

fn frame(scene: &Scene, chunks: ChunkSet, camera: Camera) -> DrawList {
    let sun = Light {
        kind: LightKind::Directional { to_light: Vec3::new(0.3, 0.9, 0.3).normalize(), angle_rad: 0.0 },
        color: Vec3::splat(0.8),
        moves: false,
    };
    let shading = Shading { ambient: Vec3::splat(0.2), lights: vec![sun], sky: [90, 140, 220], ground: [70, 60, 50] };
    let draws = vec![Draw { what: DrawWhat::Chunks(chunks), bounds: scene.bounds, error_px: 0.0 }];
    let kind = PassKind::Shade { surface: TargetId(0), shading };
    DrawList {
        passes: vec![
            Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws },
            Pass { kind, camera, writes: TargetId(1), draws: vec![] },
        ],
    }
}

#[test]
fn captures_in_a_batch_are_what_single_frames_show() {
    let scene = scene(60, 5);
    let Some(mut backend) = opened("captures_in_a_batch_are_what_single_frames_show", &scene) else { return };
    upload_scene(&mut backend, &scene).unwrap();
    let (all, one) = (scene.all_chunks(), ChunkSet::from_range(scene.objects[2].chunks.clone()));
    let shots: Vec<Shot> = [([64, 48], &all), ([33, 17], &one), ([64, 48], &one), ([1, 1], &all), ([64, 48], &all)]
        .into_iter()
        .map(|(size, chunks)| Shot { chunks: chunks.clone(), camera: camera(&scene, size) })
        .collect();
    let together = backend.capture(&shots).unwrap();
    assert_eq!(together.len(), shots.len());
    for (shot, image) in shots.iter().zip(&together) {
        backend.render(&frame(&scene, shot.chunks.clone(), shot.camera)).unwrap();
        assert_eq!(&backend.read_surface(TargetId(0)).unwrap(), image);
    }
    let hits = |i: usize| together[i].object.iter().filter(|&&o| o != 0).count();
    assert!(hits(0) > hits(2) && hits(2) > 50, "{} and {}", hits(0), hits(2));
    assert!(together[2].object.iter().all(|&o| o == 0 || o == 3));
    ends_silently(backend);
}

#[test]
fn a_frame_is_counted_and_timed() {
    let scene = scene(60, 5);
    let Some(mut backend) = opened("a_frame_is_counted_and_timed", &scene) else { return };
    upload_scene(&mut backend, &scene).unwrap();
    let counted = backend.render(&frame(&scene, scene.all_chunks(), camera(&scene, [64, 64]))).unwrap();
    assert_eq!((counted.near_triangles, counted.far_triangles), (scene.triangles(), 0));
    // Every triangle submitted reaches the clipper: nothing before it discards.
    assert!(counted.clipped_primitives.is_none_or(|n| n == scene.triangles()), "{counted:?}");
    assert!(counted.gpu_ms.is_none_or(|ms| ms > 0.0 && ms <= counted.wall_ms * 1.5), "{counted:?}");
    let degraded = &backend.info().degraded;
    assert_eq!(counted.gpu_ms.is_none(), degraded.iter().any(|d| d.contains("timestamps")), "{degraded:?}");
    assert_eq!(counted.clipped_primitives.is_none(), degraded.iter().any(|d| d.contains("statistics")), "{degraded:?}");
    ends_silently(backend);
}

#[test]
fn a_device_that_lacks_something_does_the_same_and_says_so() {
    const TEST: &str = "a_device_that_lacks_something_does_the_same_and_says_so";
    let scene = scene(60, 5);
    let list = frame(&scene, scene.all_chunks(), camera(&scene, [200, 150]));
    let shown = |backend: &mut VulkanBackend| {
        upload_scene(backend, &scene).unwrap();
        let counted = backend.render(&list).unwrap();
        (counted, backend.read_surface(TargetId(0)).unwrap(), backend.read_picture(TargetId(1)).unwrap())
    };
    let Some(mut whole) = opened(TEST, &scene) else { return };
    let without = Without { indirect: true, timestamps: true, statistics: true, atomics_64: true };
    let Some(mut bare) = opened_without(TEST, &scene, without) else { return };
    let (a, b) = (shown(&mut whole), shown(&mut bare));
    assert_eq!((&a.1, &a.2), (&b.1, &b.2));
    assert_eq!((b.0.gpu_ms, b.0.clipped_primitives, b.0.near_triangles), (None, None, a.0.near_triangles));
    for what in ["timestamps", "statistics", "multi-draw-indirect", "64-bit atomics"] {
        assert!(bare.info().degraded.iter().any(|d| d.contains(what)), "{what}: {:?}", bare.info().degraded);
    }
    ends_silently(whole);
    ends_silently(bare);
}

#[test]
fn targets_change_their_size_within_a_frame_and_between_frames() {
    let scene = scene(20, 2);
    let Some(mut backend) = opened("targets_change_their_size_within_a_frame_and_between_frames", &scene) else {
        return;
    };
    upload_scene(&mut backend, &scene).unwrap();
    let list = |size| frame(&scene, scene.all_chunks(), camera(&scene, size));
    let mut both = list([40, 30]);
    both.passes.extend(list([16, 24]).passes);
    for (list, size) in [(list([40, 30]), [40, 30]), (both, [16, 24]), (list([40, 30]), [40, 30])] {
        backend.render(&list).unwrap();
        assert_eq!(backend.read_picture(TargetId(1)).unwrap().size, size);
        assert_eq!(backend.read_surface(TargetId(0)).unwrap().size, size);
    }
    ends_silently(backend);
}

#[test]
fn what_the_device_cannot_hold_is_refused_and_leaves_it_working() {
    let scene = scene(20, 2);
    let Some(mut backend) = opened("what_the_device_cannot_hold_is_refused_and_leaves_it_working", &scene) else {
        return;
    };
    upload_scene(&mut backend, &scene).unwrap();
    let id = PayloadRef { asset: AssetId(0), id: LocalPayload(0) };
    let wide = 1 << 20;
    let texels = vec![[0; 4]; wide as usize];
    let atlas = AtlasPart { size: [wide, 1], layers: 1, albedo: texels.clone(), normal: texels };
    let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Atlas(atlas)] };
    let refused = backend.upload(Block::Payload(id), &BlockData::Payload(&payload));
    assert!(matches!(&refused, Err(Fault::Refused(why)) if why.contains("1048576 x 1")), "{refused:?}");
    let refused = backend.render(&frame(&scene, scene.all_chunks(), camera(&scene, [1 << 20, 1])));
    assert!(matches!(&refused, Err(Fault::Refused(_))), "{refused:?}");
    backend.render(&frame(&scene, scene.all_chunks(), camera(&scene, [16, 16]))).unwrap();
    ends_silently(backend);
}

#[test]
fn a_device_that_is_not_there_is_named_with_those_that_are() {
    let scene = scene(4, 1);
    let Ok(name) = available() else { return drop(opened("a_device_that_is_not_there_is_named", &scene)) };
    let options = Options { device: Some("abacus".into()), ..Options::default() };
    let Err(fault) = VulkanBackend::new(&scene, options) else { panic!("an abacus was found") };
    let text = fault.to_string();
    assert!(text.contains("abacus") && text.contains(&name), "{text}");
}

#[test]
fn the_backend_can_be_moved_to_another_thread() {
    fn movable<T: Send>() {}
    movable::<VulkanBackend>();
}
