//! Layered depth images: what they cover from beside, before and behind their own eye, what hides them and what they hide, smoothing.
//!
//! From its own eye an image's samples cover exactly their pixels, so everything is known there. From elsewhere planes that face the
//! picture are known but for their rims, where a sample ends up to a pixel of the image away from the plane's edge.

use farfield_core::backend::{Backend, BlockData, upload_scene};
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::draw::DrawList;
use farfield_core::id::{Block, TargetId};
use farfield_core::layered::{LayeredPart, normal_of};
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::Scene;
use farfield_core::{Aabb, Camera, Fault};
use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    itself(make);
    planes(make);
    smoothed_among_others(make);
    passes(make);
    refusals(make);
}

/// Where the payloads of these tests stand in world coordinates: not where the scene's origin is.
const PLACE: DVec3 = DVec3::new(10.0, -3.0, 2.0);

/// The camera of an image that stands at `eye`, world coordinates, and looks along -z.
fn image_camera(eye: DVec3, size: [u32; 2]) -> Camera {
    Camera::looking(eye - PLACE, -Vec3::Z, Vec3::Y, 1.0, size, 0.01)
}

fn upload(backend: &mut dyn Backend, scene: &Scene, id: u32, part: LayeredPart) {
    let image = Payload { origin: PLACE - scene.origin, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] };
    backend.upload(Block::Payload(payload(id)), &BlockData::Payload(&image)).expect("an image is uploaded");
}

/// Numbers without a pattern, below `below`.
fn noise(i: u32, below: u32) -> u32 {
    let mut v = i.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    v = (v ^ v >> 15).wrapping_mul(0x85eb_ca6b);
    (v ^ v >> 13) % below
}

/// No, one or two samples a pixel, without a pattern in anything; all normals towards the eye.
fn noisy(camera: Camera, seed: u32, smooth: bool) -> LayeredPart {
    let n = camera.size[0] * camera.size[1];
    let counts: Vec<u8> = (0..n).map(|i| noise(i + seed, 3) as u8).collect();
    let pixels: Vec<(u32, u32)> =
        (0..n).flat_map(|i| (0..u32::from(counts[i as usize])).map(move |k| (i, k))).collect();
    let of = |f: &dyn Fn(u32) -> u32| pixels.iter().map(|&(i, k)| f(7 * i + 100_003 * k + seed)).collect::<Vec<u32>>();
    LayeredPart {
        camera,
        inverse_depth: [1.0 / 2.0, 1.0 / 30.0],
        counts,
        // Front to back: the first of a pixel in the nearer half.
        depth: pixels.iter().map(|&(i, k)| (noise(i ^ seed, 30_000) + 33_000 * k) as u16).collect(),
        albedo: of(&|v| noise(v, 1 << 24)).iter().map(|v| [*v as u8, (v >> 8) as u8, (v >> 16) as u8]).collect(),
        normal: of(&|v| noise(v + 1, 3600)).iter().map(|v| [(v % 60) as i8 - 30, (v / 60) as i8 - 30]).collect(),
        object: of(&|v| noise(v + 2, 5)).iter().map(|&v| v as u16).collect(),
        objects: vec![4_000_000_000, 7, 8, 9, 1 << 20],
        smooth,
    }
}

fn expected(part: &LayeredPart, sample: usize) -> Expected {
    Expected {
        albedo: part.albedo[sample],
        normal: part.normal_at(sample),
        depth: part.depth_at(sample),
        object: part.objects[usize::from(part.object[sample])],
    }
}

fn itself(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::from_translation(DVec3::Z * 90.0)]);
    let mut backend = make(&scene);
    let eye = DVec3::new(0.3, -0.2, 5.0);
    for (id, size) in [(0, [16, 12]), (1, [1, 1]), (2, [7, 130])] {
        let own = noisy(image_camera(eye, size), 5 + id, false);
        upload(&mut *backend, &scene, id, own.clone());
        let (image, counted) = render(&mut *backend, &ahead(&scene, eye, size), vec![part(id, 0, 0)]);
        assert_eq!(counted.samples, own.samples() as u64);
        assert_eq!((counted.near_triangles, counted.far_triangles), (0, 0));
        let first = own.first_samples();
        for ([x, y], _) in pixels(size) {
            let i = (y * size[0] + x) as usize;
            let front = (own.counts[i] > 0).then(|| expected(&own, first[i] as usize));
            check("an image from its own eye", &image, [x, y], front, 1);
        }
    }
    // Released and replaced: by fewer samples, by none.
    backend.release(Block::Payload(payload(0)));
    for counts in [3u8, 0] {
        let mut own = noisy(image_camera(eye, [1, 1]), 5, false);
        let n = usize::from(counts);
        own.counts = vec![counts];
        own.depth = (0..n as u16).collect();
        (own.albedo, own.normal, own.object) = (vec![[9, 8, 7]; n], vec![[0, 0]; n], vec![0; n]);
        upload(&mut *backend, &scene, 1, own.clone());
        let (image, counted) = render(&mut *backend, &ahead(&scene, eye, [1, 1]), vec![part(1, 0, 0)]);
        assert_eq!(counted.samples, n as u64);
        check("an image that was replaced", &image, [0, 0], (n > 0).then(|| expected(&own, 0)), 1);
    }
}

/// Edge of the image of squares, pixels.
const IMAGE_PX: u32 = 128;

/// A square that faces +z.
#[derive(Clone, Copy)]
struct Square {
    z: f32,
    centre: Vec2,
    half: f32,
    albedo: [u8; 3],
    object: u32,
}

/// The image of squares, all of each, also where others hide them.
fn image_of(squares: &[Square], eye: DVec3, size: [u32; 2]) -> LayeredPart {
    let camera = image_camera(eye, size);
    let eye = eye.as_vec3();
    let depths = squares.iter().map(|s| eye.z - s.z);
    let (near, far) = depths.clone().fold((f32::INFINITY, 0f32), |(n, f), d| (n.min(d), f.max(d)));
    let mut part = LayeredPart {
        camera,
        inverse_depth: [near.recip(), far.recip()],
        counts: vec![],
        depth: vec![],
        albedo: vec![],
        normal: vec![],
        object: vec![],
        objects: squares.iter().map(|s| s.object).collect(),
        smooth: false,
    };
    for (_, at) in pixels(size) {
        let ray = camera.ray(at.x, at.y);
        let before = part.samples();
        for (object, (s, depth)) in squares.iter().zip(depths.clone()).enumerate() {
            let point = eye.truncate() + ray.truncate() * depth;
            if (point - s.centre).abs().max_element() < s.half {
                part.depth.push(LayeredPart::quantise(depth, part.inverse_depth));
                part.albedo.push(s.albedo);
                part.normal.push([0, 0]);
                part.object.push(object as u16);
            }
        }
        part.counts.push((part.samples() - before) as u8);
    }
    part
}

fn planes(make: Make<'_>) {
    let square = |z, x: f32, half, albedo, object| Square { z, centre: Vec2::new(x, 0.2), half, albedo, object };
    // From front to back, as an image's samples have to be.
    let layers = [square(0.0, 0.0, 1.0, [200, 30, 60], 77), square(-2.0, 0.3, 2.0, [20, 140, 90], 55)];
    let linear = [0.5f32, 0.25, 0.75];
    let albedo = linear.map(byte_of_linear);
    // Objects 1 and 2: before the image's front layer, and between its two.
    let solid = [square(1.0, -0.6, 0.5, albedo, 1), square(-1.0, 0.5, 1.4, albedo, 2)];
    let places = solid.map(|s| {
        let at = DVec3::new(f64::from(s.centre.x), f64::from(s.centre.y), f64::from(s.z));
        DAffine3::from_scale_rotation_translation(DVec3::splat(f64::from(s.half)), glam::DQuat::IDENTITY, at)
    });
    let scene = scene(quad(), plain(linear, false), &places);
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    let (from, size) = (DVec3::new(0.0, 0.0, 5.0), [IMAGE_PX; 2]);
    upload(&mut *backend, &scene, 0, image_of(&layers, from, size));
    let eyes = [
        ("beside", DVec3::new(0.91, -0.43, 5.0)),
        ("before", DVec3::new(0.13, 0.07, 3.21)),
        ("behind", DVec3::new(-0.31, 0.23, 8.53)),
        ("far beside", DVec3::new(2.17, 0.61, 4.4)),
    ];
    for (what, eye) in eyes {
        let camera = ahead(&scene, eye, [192, 160]);
        for with in [false, true] {
            let mut draws = vec![part(0, 0, 0)];
            let mut squares = layers.to_vec();
            if with {
                draws.extend(everything(&scene));
                squares.extend(solid);
            }
            squares.sort_by(|a, b| b.z.total_cmp(&a.z));
            let (image, _) = render(&mut *backend, &camera, draws);
            let mut known = 0;
            for (p, at) in pixels(camera.size) {
                let Some(e) = seen(&squares, eye.as_vec3(), &camera, at, from.z as f32) else { continue };
                known += u32::from(e.is_some());
                check(&format!("{what}, {}", if with { "with geometry" } else { "alone" }), &image, p, e, 1);
            }
            assert!(known > 1000, "{what}: {known} pixels are known to show something");
        }
    }
    // Turned: what is covered stays, whose it is too.
    let mut camera = ahead(&scene, eyes[0].1, [192, 160]);
    let turn = glam::Quat::from_euler(glam::EulerRot::YXZ, 0.2, -0.1, 0.3);
    for axis in [&mut camera.right, &mut camera.up, &mut camera.forward] {
        *axis = turn * *axis;
    }
    let (image, _) = render(&mut *backend, &camera, vec![part(0, 0, 0)]);
    let mut known = 0;
    for (p, at) in pixels(camera.size) {
        let Some(Some(e)) = seen(&layers, eyes[0].1.as_vec3(), &camera, at, from.z as f32) else { continue };
        known += 1;
        assert_eq!(image.object[image.at(p[0], p[1])], e.object, "turned: {p:?}");
    }
    assert!(known > 1000, "turned: {known} pixels are known");
}

/// What the pixel at `at` shows of squares sorted from front to back; `None` within a pixel and a half, of the image and of the
/// picture together, of a rim.
fn seen(squares: &[Square], eye: Vec3, camera: &Camera, at: Vec2, image_z: f32) -> Option<Option<Expected>> {
    let ray = camera.ray(at.x, at.y);
    for s in squares {
        let t = (s.z - eye.z) / ray.z;
        let point = eye.truncate() + ray.truncate() * t;
        let px = |depth: f32, px: f32| 2.0 * 0.5f32.tan() * depth / px;
        let margin = 1.5 * (px(image_z - s.z, IMAGE_PX as f32) + px(t, camera.size[1] as f32));
        let inside = s.half - (point - s.centre).abs().max_element();
        if inside > margin {
            return Some(Some(Expected { albedo: s.albedo, normal: Vec3::Z, depth: t, object: s.object }));
        }
        if inside > -margin {
            return None;
        }
    }
    Some(None)
}

fn smoothed_among_others(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::from_translation(DVec3::Z * 90.0)]);
    let mut backend = make(&scene);
    let (eye, size) = (DVec3::new(0.1, 0.4, -2.0), [24, 17]);
    let camera = image_camera(eye, size);
    let parts = [noisy(camera, 1, true), noisy(camera, 2, false), noisy(camera, 1, true)];
    for (id, own) in (0..).zip(&parts) {
        upload(&mut *backend, &scene, id, own.clone());
    }
    // The third is the first once more, behind it in the list: of equal depths the one drawn first is seen.
    for order in [&[0usize][..], &[0, 1], &[1, 0], &[0, 1, 2], &[2, 1, 0]] {
        let draws = order.iter().map(|&i| part(i as u32, 0, 0)).collect();
        let (image, counted) = render(&mut *backend, &ahead(&scene, eye, size), draws);
        assert_eq!(counted.samples, order.iter().map(|&i| parts[i].samples() as u64).sum::<u64>());
        let winner = |x: u32, y: u32| {
            let i = (y * size[0] + x) as usize;
            let front = order.iter().enumerate().filter(|(_, o)| parts[**o].counts[i] > 0).map(|(rank, &o)| {
                let sample = parts[o].first_samples()[i] as usize;
                (parts[o].depth_at(sample), rank, o, sample)
            });
            front.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, rank, o, sample)| (rank, o, sample))
        };
        let winners: Vec<_> = pixels(size).map(|([x, y], _)| winner(x, y)).collect();
        for ([x, y], _) in pixels(size) {
            let Some((rank, o, sample)) = winners[(y * size[0] + x) as usize] else {
                check("smoothed images", &image, [x, y], None, 0);
                continue;
            };
            let mut e = expected(&parts[o], sample);
            if parts[o].smooth {
                let (mut albedo, mut normal, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
                for v in y.saturating_sub(1)..(y + 2).min(size[1]) {
                    for u in x.saturating_sub(1)..(x + 2).min(size[0]) {
                        if let Some((_, _, s)) = winners[(v * size[0] + u) as usize].filter(|w| w.0 == rank) {
                            let k = [4.0, 2.0, 1.0][(u.abs_diff(x) + v.abs_diff(y)) as usize];
                            albedo += k * Vec3::from(parts[o].albedo[s].map(linear_of_byte));
                            normal += k * normal_of(parts[o].normal[s]);
                            weight += k;
                        }
                    }
                }
                e.albedo = (albedo / weight).to_array().map(byte_of_linear);
                e.normal = normal.normalize();
            }
            check("smoothed images", &image, [x, y], Some(e), 1);
        }
    }
}

/// Passes of one frame do not see each other's samples, whichever is larger.
fn passes(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::from_translation(DVec3::Z * 90.0)]);
    let mut backend = make(&scene);
    let eye = DVec3::new(0.1, 0.4, -2.0);
    let sizes = [[9, 8], [31, 22], [12, 30]];
    for (id, size) in (0..).zip(sizes) {
        upload(&mut *backend, &scene, id, noisy(image_camera(eye, size), id, id == 1));
    }
    let camera = |id: u32| ahead(&scene, eye, sizes[id as usize]);
    let alone: Vec<_> = (0..3).map(|id| render(&mut *backend, &camera(id), vec![part(id, 0, 0)])).collect();
    let passes = (0..3).map(|id| surface_pass(&camera(id), 10 + id, vec![part(id, 0, 0)])).collect();
    let counted = backend.render(&DrawList { passes }).expect("three passes");
    assert_eq!(counted.samples, alone.iter().map(|(_, c)| c.samples).sum::<u64>());
    for (target, (image, _)) in (10..).zip(&alone) {
        assert!(*image == backend.read_surface(TargetId(target)).expect("a surface"), "target {target}");
    }
}

fn refusals(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let eye = DVec3::Z * 2.0;
    let mut backend = make(&scene);
    let camera = ahead(&scene, eye, [8, 8]);
    let list = |object| DrawList { passes: vec![surface_pass(&camera, 0, vec![part(0, 0, object)])] };
    let refused = |backend: &mut dyn Backend, object| match backend.render(&list(object)) {
        Err(Fault::Refused(cause)) => assert!(!cause.is_empty()),
        other => panic!("{other:?} instead of a refusal"),
    };
    refused(&mut *backend, 0);
    upload(&mut *backend, &scene, 0, noisy(image_camera(eye, [8, 8]), 3, false));
    refused(&mut *backend, 1);
    backend.render(&list(0)).expect("samples have objects of their own");
    let mut bad = noisy(image_camera(eye, [8, 8]), 3, false);
    bad.object[0] = 5;
    let payload_of = |part| Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] };
    let fault = backend.upload(Block::Payload(payload(1)), &BlockData::Payload(&payload_of(bad)));
    assert!(matches!(fault, Err(Fault::Data { .. })), "{fault:?}");
}
