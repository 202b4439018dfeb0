//! Layered depth images: the same bytes on both backends, by whole atomics and by halves, under any viewer; and what the reference
//! backend, in either of its orders, shows of the same images.

use farfield_core::backend::{Backend, BlockData, upload_scene};
use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, TargetId};
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::Scene;
use farfield_core::{Aabb, Camera};
use farfield_cpu::{CpuBackend, CpuOptions, SplatOrder};
use farfield_integration_tests::ldi::gathered;
use glam::{DVec3, Vec3};

use super::{cameras, vases};
use farfield_integration_tests::pair::{Pair, draw, everything, hits, list, pair, pair_of};

/// The largest share of pixels in which the reference, comparing depths as the GPU does, may show something else.
const MAX_SHARE_NEAREST: f64 = 0.001;

/// The largest share in which the reference in occlusion-compatible order, without comparing, may show something else: where several
/// samples cover a pixel, most often neighbours on one surface, another of them.
const MAX_SHARE_ORDERED: f64 = 0.2;

/// The largest share in which it may show another object.
const MAX_SHARE_OTHER: f64 = 0.002;

const SIZE: [u32; 2] = [320, 240];

fn id(n: u32) -> PayloadRef {
    PayloadRef { asset: AssetId(3), id: LocalPayload(n) }
}

fn image(n: u32) -> Draw {
    draw(DrawWhat::Payload { id: id(n), part: 0, object: 0 })
}

/// Two images of a scene, each of its own captures and of those from beside; the second is smoothed.
fn images(pair: &mut Pair, scene: &Scene) -> [Payload; 2] {
    let [a, _, b] = cameras(scene, SIZE);
    let around = |c: Camera| {
        let beside = |x: f32, y: f32| Camera { eye: c.eye + (c.right * x + c.up * y).as_dvec3(), ..c };
        [c, beside(-1.5, 0.3), beside(1.2, 0.8)]
    };
    [(a, false), (b, true)].map(|(camera, smooth)| {
        let of = around(camera);
        let shots = of.map(|camera| Shot { chunks: scene.all_chunks(), camera });
        let captured = pair.vulkan.capture(&shots).unwrap();
        let captures: Vec<(Camera, SurfaceImage)> = of.into_iter().zip(captured).collect();
        let part = gathered(&camera, &captures, smooth);
        assert!(part.samples() > 10_000, "{} samples", part.samples());
        assert!(part.counts.iter().any(|&n| n > 1), "one layer only");
        Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Layered(part)] }
    })
}

/// Viewers at, beside, before, behind and turned against a camera, and one of another size.
fn viewers(c: Camera) -> Vec<(&'static str, Camera)> {
    let moved = |right: f32, up: f32, ahead: f32| Camera {
        eye: c.eye + (c.right * right + c.up * up + c.forward * ahead).as_dvec3(),
        ..c
    };
    let turned = Camera::looking(moved(0.5, 0.2, 0.4).eye, c.forward + 0.3 * c.right, Vec3::Y, 0.8, SIZE, 0.05);
    vec![
        ("itself", c),
        ("beside", moved(0.8, 0.1, 0.0)),
        ("before", moved(0.1, 0.05, 4.0)),
        ("behind", moved(-0.3, 0.2, -3.0)),
        ("among the samples", moved(0.0, 0.0, 9.0)),
        ("turned", turned),
        ("odd", Camera { size: [201, 333], ..moved(-0.4, -0.1, 0.2) }),
    ]
}

#[test]
fn layered_depth_images_are_the_same_by_whole_atomics_and_by_halves() {
    const TEST: &str = "layered_depth_images_are_the_same_by_whole_atomics_and_by_halves";
    let scene = vases(60, DVec3::ZERO, 1);
    let (Some(mut whole), Some(mut halves)) = (pair(TEST, &scene), pair_of(TEST, &scene, true)) else { return };
    for backend in [&halves.wgpu as &dyn Backend, &halves.vulkan] {
        assert!(backend.info().degraded.iter().any(|d| d.contains("64-bit atomics")), "{:?}", backend.info());
    }
    let payloads = images(&mut whole, &scene);
    for (n, payload) in (0..).zip(&payloads) {
        whole.upload(id(n), payload);
        halves.upload(id(n), payload);
    }
    let some = draw(DrawWhat::Chunks(scene.cull(&scene.all_chunks(), &cameras(&scene, SIZE)[1])));
    let mixes = [
        ("one", vec![image(0)]),
        ("smoothed", vec![image(1)]),
        ("two", vec![image(0), image(1)]),
        ("two, the other way round", vec![image(1), image(0)]),
        ("among geometry", vec![image(1), some, image(0)]),
    ];
    for (n, c) in [(0, cameras(&scene, SIZE)[0]), (1, cameras(&scene, SIZE)[2])] {
        for (who, camera) in viewers(c) {
            for (which, draws) in &mixes {
                let what = format!("{which}, camera {n}, {who}");
                let list = list(&scene, camera, draws.clone());
                let a = whole.check(&what, &list);
                let b = halves.check(&what, &list);
                whole.same_surface(&format!("{what}, halves"), &b.0, &a.0);
                assert!(who == "among the samples" || hits(&a.0) > 2_000, "{what}: {} pixels", hits(&a.0));
            }
        }
    }
}

#[test]
fn passes_of_one_frame_share_their_splats() {
    let scene = vases(20, DVec3::ZERO, 2);
    let Some(mut pair) = pair("passes_of_one_frame_share_their_splats", &scene) else { return };
    let payloads = images(&mut pair, &scene);
    (0..).zip(&payloads).for_each(|(n, p)| pair.upload(id(n), p));
    let lists: Vec<DrawList> = [([320, 240], 0), ([64, 48], 1), ([400, 300], 0)]
        .into_iter()
        .map(|(size, n)| list(&scene, Camera { size, ..cameras(&scene, SIZE)[2 * n as usize] }, vec![image(n)]))
        .collect();
    let alone: Vec<_> = lists.iter().map(|l| pair.check("alone", l)).collect();
    // The same passes in one frame: what is read is what the last ones wrote.
    let mut together = DrawList::default();
    lists.iter().for_each(|l| together.passes.extend(l.passes.clone()));
    assert_eq!(pair.check("together", &together), alone[2]);
    for (pass, target) in together.passes.iter_mut().filter(|p| p.draws.len() == 1).zip([5, 6, 0]) {
        pass.writes = TargetId(target);
    }
    together.passes.retain(|p| p.draws.len() == 1);
    pair.wgpu.render(&together).unwrap();
    for (target, alone) in [5, 6, 0].into_iter().zip(&alone) {
        assert_eq!(pair.wgpu.read_surface(TargetId(target)).unwrap(), alone.0);
    }
    let counted = pair.vulkan.render(&together).unwrap();
    assert_eq!(counted.samples, 2 * payloads[0].samples() + payloads[1].samples());
}

/// How many pixels two surfaces show something else in.
fn differ(a: &SurfaceImage, b: &SurfaceImage) -> usize {
    let same = |p: usize| {
        a.object[p] == b.object[p]
            && (!a.hit(p) || (a.depth[p] - b.depth[p]).abs() <= 1e-3 * a.depth[p])
            && (0..3).all(|k| a.albedo[p][k].abs_diff(b.albedo[p][k]) <= 2)
            && from_octahedral(a.normal[p]).distance(from_octahedral(b.normal[p])) < 0.01
    };
    (0..a.depth.len()).filter(|&p| !same(p)).count()
}

/// In how many pixels two surfaces show another object.
fn others(a: &SurfaceImage, b: &SurfaceImage) -> usize {
    a.object.iter().zip(&b.object).filter(|(a, b)| a != b).count()
}

#[test]
fn the_reference_shows_the_same_but_for_a_few_pixels() {
    let scene = vases(60, DVec3::ZERO, 1);
    let Some(mut pair) = pair("the_reference_shows_the_same_but_for_a_few_pixels", &scene) else { return };
    let payloads = images(&mut pair, &scene);
    let orders = [(SplatOrder::Nearest, MAX_SHARE_NEAREST), (SplatOrder::OcclusionCompatible, MAX_SHARE_ORDERED)];
    let mut references = orders.map(|(splats, most)| {
        let mut cpu = CpuBackend::new(&scene, CpuOptions { splats, ..CpuOptions::default() }).unwrap();
        upload_scene(&mut cpu, &scene).unwrap();
        (splats, most, cpu, [0; 3])
    });
    for (n, payload) in (0..).zip(&payloads) {
        pair.upload(id(n), payload);
        for r in &mut references {
            r.2.upload(Block::Payload(id(n)), &BlockData::Payload(payload)).unwrap();
        }
    }
    for n in [0, 1] {
        for (who, camera) in viewers(cameras(&scene, SIZE)[2 * n as usize]) {
            let list = list(&scene, camera, vec![image(n)]);
            pair.vulkan.render(&list).unwrap();
            let shown = pair.vulkan.read_surface(TargetId(0)).unwrap();
            for (order, _, cpu, sums) in &mut references {
                cpu.render(&list).unwrap();
                let reference = cpu.read_surface(TargetId(0)).unwrap();
                let counts = [hits(&shown), differ(&reference, &shown), others(&reference, &shown)];
                eprintln!(
                    "image {n}, {who}, {order:?}: covered pixels, of these different, with another object {counts:?}"
                );
                (0..3).for_each(|i| sums[i] += counts[i]);
            }
        }
    }
    for (order, most, _, sums) in &references {
        let [different, other] = [1, 2].map(|i| sums[i] as f64 / sums[0] as f64);
        eprintln!("{order:?}: {different:.5} of the covered pixels differ, {other:.5} show another object");
        assert!(different <= *most && other <= MAX_SHARE_OTHER, "{order:?}: {sums:?}");
    }
    // What an image shows from its own eye is what was captured there.
    let camera = cameras(&scene, SIZE)[0];
    pair.vulkan.render(&everything(&scene, camera)).unwrap();
    let original = pair.vulkan.read_surface(TargetId(0)).unwrap();
    pair.vulkan.render(&list(&scene, camera, vec![image(0)])).unwrap();
    let warped = pair.vulkan.read_surface(TargetId(0)).unwrap();
    let lost = (0..original.depth.len()).filter(|&p| original.hit(p) && original.object[p] != warped.object[p]).count();
    eprintln!("from its own eye {lost} of {} pixels show another object", hits(&original));
    assert!(lost * 50 < hits(&original), "{lost} of {}", hits(&original));
}
