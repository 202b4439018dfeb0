//! Points and lines on both GPU backends: byte for byte the same on lavapipe, alone, among triangles and layered with each other.

use farfield_core::draw::DrawWhat;
use farfield_core::id::{AssetId, LocalPayload, PayloadRef};
use farfield_core::payload::{LinesPart, Part, Payload, PointsPart};
use farfield_core::{Aabb, Camera};
use farfield_integration_tests::pair::{draw, hits, list, pair};
use glam::{DVec3, Vec3, Vec3Swizzles};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{cameras, vases};

/// Points on spheres and lines between them, more than a draw takes.
fn stars(count: usize, radius: f32, two_sided: bool, seed: u64) -> Payload {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut positions = vec![];
    let mut normals = vec![];
    let mut albedo = vec![];
    for i in 0..count {
        let mut unit = || rng.random_range(-1f32..1.0);
        let normal = Vec3::new(unit(), unit(), unit()).normalize_or(Vec3::Y);
        positions.push(normal * (1.0 + 5.0 * (i % 7) as f32 / 6.0));
        // Every other one inward, so that some face an eye in the middle.
        normals.push(if i % 2 == 0 { normal } else { -normal });
        albedo.push([rng.random(), rng.random(), rng.random(), 255]);
    }
    // Short ones between neighbours in the list would be as long as any: each to a place close by.
    let mut ends = LinesPart {
        positions: positions.iter().flat_map(|&p| [p, p * 1.02 + Vec3::splat(0.04)]).collect(),
        normals: normals.iter().flat_map(|&n| [n, n.yzx()]).collect(),
        albedo: albedo.iter().flat_map(|&[r, g, b, a]: &[u8; 4]| [[r, g, b, a], [b, r, g, a]]).collect(),
        indices: (0..2 * count as u32).collect(),
    };
    // And some through all of it, past the eye.
    ends.indices.extend((0..40).map(|i| (i * 7919) % (2 * count as u32)));
    let points = PointsPart { positions, normals, albedo, radius, two_sided };
    Payload { origin: DVec3::Y, bounds: Aabb::EMPTY, parts: vec![Part::Points(points), Part::Lines(ends)] }
}

#[test]
fn points_and_lines_are_the_same() {
    let scene = vases(12, DVec3::ZERO, 21);
    let Some(mut pair) = pair("points_and_lines_are_the_same", &scene) else { return };
    let id = |n| PayloadRef { asset: AssetId(2), id: LocalPayload(n) };
    let payloads = [stars(20_011, 0.02, false, 22), stars(3_001, 0.05, true, 23), stars(500, 0.0, false, 24)];
    for (n, p) in (0..).zip(&payloads) {
        pair.upload(id(n), p);
    }
    let of = |n: u32, part: u16| draw(DrawWhat::Payload { id: id(n), part, object: 100 + 2 * n + u32::from(part) });
    let all: Vec<_> = (0..3).flat_map(|n| [of(n, 0), of(n, 1)]).collect();
    for (i, camera) in cameras(&scene, [401, 300]).into_iter().enumerate() {
        let inside = Camera { eye: DVec3::new(0.3, 1.2, 0.1), near: 0.4, ..camera };
        for (place, camera) in [("outside", camera), ("inside", inside)] {
            for n in 0..3 {
                for part in 0..2 {
                    let what = format!("payload {n}, part {part}, camera {i}, {place}");
                    let (surface, _) = pair.check(&what, &list(&scene, camera, vec![of(n, part)]));
                    assert!(hits(&surface) > 3, "{what}: {} pixels", hits(&surface));
                }
            }
            let chunks = draw(DrawWhat::Chunks(scene.all_chunks()));
            let draws = all.iter().cloned().chain([chunks]).collect();
            let (surface, _) = pair.check(&format!("all together, camera {i}, {place}"), &list(&scene, camera, draws));
            let kinds = [100, 101, 102, 103].map(|o| surface.object.iter().filter(|&&v| v == o).count());
            assert!(kinds.iter().all(|&k| k > 50), "{kinds:?} pixels of each");
        }
    }
}
