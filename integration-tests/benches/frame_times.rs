//! Frame times of wgpu and Vulkan on one device, in one run, as lines of text: least and median of nine frames of each.
//!
//! ```text
//! cargo bench -p farfield-integration-tests --bench frame_times [-- TRIANGLES... | primitives]
//! ```
//!
//! With `primitives` in the place of counts, instead: what a point of two pixels' edge and a line of two pixels' length cost, in triangles
//! with two edges of two pixels, on the cpu backend, wgpu and Vulkan.
//!
//! Without counts 100,000, 1,000,000 and 8,000,000 triangles, which takes minutes and gigabytes of memory. The two are timed in
//! turns, so that whatever else the machine does meets both, and only after their first frames were found to be the same.

use farfield_core::backend::{Backend, BlockData, Counted};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, TargetId};
use farfield_core::payload::{LinesPart, MeshPart, Part, Payload, PointsPart};
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use farfield_core::{Aabb, Camera, Fault};
use farfield_cpu::{CpuBackend, CpuOptions};
use farfield_integration_tests::pair::{draw, everything, hits, pair};
use farfield_integration_tests::turned::turned;
use glam::{DAffine3, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Frames of each, the first, compared ones left out.
const FRAMES: usize = 9;

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

/// The least and the median, milliseconds.
fn told(mut all: Vec<f64>) -> String {
    all.sort_by(f64::total_cmp);
    format!("{:.1} / {:.1} ms", all[0], all[all.len() / 2])
}

fn side_by_side(triangles: u32) -> Result<(), farfield_core::Fault> {
    let (scene, camera) = sheets(triangles);
    let Some(mut pair) = pair("frame_times", &scene) else { return Ok(()) };
    let list = everything(&scene, camera);
    let (surface, _) = pair.check("first frame", &list);
    let (mut wgpu, mut vulkan): (Vec<Counted>, Vec<Counted>) = (vec![], vec![]);
    for _ in 0..FRAMES {
        wgpu.push(pair.wgpu.render(&list)?);
        vulkan.push(pair.vulkan.render(&list)?);
    }
    for (name, all) in [("wgpu", wgpu), ("vulkan", vulkan)] {
        println!(
            "{} triangles in {} chunks, {:.0} % of pixels hit, {name}: wall {}, gpu {} (least / median), {:?} clipped",
            scene.triangles(),
            scene.chunks.len(),
            100.0 * hits(&surface) as f64 / surface.object.len() as f64,
            told(all.iter().map(|c| c.wall_ms).collect()),
            told(all.iter().map(|c| c.gpu_ms.unwrap_or(f64::NAN)).collect()),
            all[0].clipped_primitives,
        );
    }
    Ok(())
}

/// Primitives of each kind; many against what an empty frame costs.
const PRIMITIVES: usize = 200_000;

/// Triangles, points and lines of about two pixels, each at the same random places of a picture, all facing the eye, and the camera.
fn small_primitives() -> ([(&'static str, Part); 3], Camera) {
    let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [1024, 1024], 0.1);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let px = |x: f32, y: f32, z: f32| camera.ray(x, y) * z;
    let places: Vec<[f32; 3]> = (0..PRIMITIVES)
        .map(|_| [rng.random_range(2f32..1020.0), rng.random_range(2f32..1020.0), rng.random_range(5f32..50.0)])
        .collect();
    let colors = |n: usize| (0..n).map(|i| [(i % 256) as u8, 90, 160, 255]).collect::<Vec<_>>();
    let corners: Vec<Vec3> =
        places.iter().flat_map(|&[x, y, z]| [px(x, y, z), px(x, y + 2.0, z), px(x + 2.0, y, z)]).collect();
    let triangles = MeshPart {
        normals: vec![Vec3::Z; corners.len()],
        albedo: colors(corners.len()),
        indices: (0..corners.len() as u32).collect(),
        positions: corners,
        two_sided: false,
    };
    // One radius a part: of one depth.
    let positions: Vec<Vec3> = places.iter().map(|&[x, y, _]| px(x, y, 20.0)).collect();
    let radius = 20.0 / camera.px_per_tan();
    let points = PointsPart {
        normals: vec![Vec3::Z; PRIMITIVES],
        albedo: colors(PRIMITIVES),
        positions,
        radius,
        two_sided: false,
    };
    let ends: Vec<Vec3> = places.iter().flat_map(|&[x, y, z]| [px(x, y, z), px(x + 1.7, y + 1.0, z)]).collect();
    let lines = LinesPart {
        normals: vec![Vec3::Z; ends.len()],
        albedo: colors(ends.len()),
        indices: (0..ends.len() as u32).collect(),
        positions: ends,
    };
    let parts = [("triangle", Part::Mesh(triangles)), ("point", Part::Points(points)), ("line", Part::Lines(lines))];
    (parts, camera)
}

/// Costs of the small primitives on every backend that there is, from frames taken in turns, less what an empty frame takes.
fn primitives() -> Result<(), Fault> {
    let scene = SceneBuilder::default().build()?;
    let (parts, camera) = small_primitives();
    let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(CpuBackend::new(&scene, CpuOptions::default())?)];
    if let Some(pair) = pair("primitives", &scene) {
        backends.push(Box::new(pair.wgpu));
        backends.push(Box::new(pair.vulkan));
    }
    let id = |n| PayloadRef { asset: AssetId(0), id: LocalPayload(n) };
    for backend in &mut backends {
        let mut lists = vec![surface(camera, vec![])];
        for (n, (_, part)) in (0..).zip(&parts) {
            let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![part.clone()] };
            backend.upload(Block::Payload(id(n)), &BlockData::Payload(&payload))?;
            lists.push(surface(camera, vec![draw(DrawWhat::Payload { id: id(n), part: 0, object: 1 })]));
        }
        let mut times = vec![vec![]; lists.len()];
        for turn in 0..=FRAMES {
            for (list, times) in lists.iter().zip(&mut times) {
                let counted = backend.render(list)?;
                if turn > 0 {
                    times.push(counted.gpu_ms.unwrap_or(counted.wall_ms));
                }
            }
        }
        let medians: Vec<f64> = times.iter_mut().map(|t| median(t)).collect();
        let each_ns = |i: usize| (medians[i] - medians[0]) * 1e6 / PRIMITIVES as f64;
        println!(
            "{}: empty {:.1} ms; of two pixels: {}; a point costs {:.2} triangles, a line {:.2}",
            backend.info().backend,
            medians[0],
            (1..4).map(|i| format!("{} {:.0} ns", parts[i - 1].0, each_ns(i))).collect::<Vec<_>>().join(", "),
            each_ns(2) / each_ns(1),
            each_ns(3) / each_ns(1),
        );
    }
    Ok(())
}

/// A frame of one surface pass.
fn surface(camera: Camera, draws: Vec<Draw>) -> DrawList {
    DrawList { passes: vec![Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws }] }
}

fn median(all: &mut [f64]) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo's own `--bench` is passed over.
    let given: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if given == ["primitives"] {
        return Ok(primitives()?);
    }
    let counts: Vec<u32> = match given.is_empty() {
        true => vec![100_000, 1_000_000, 8_000_000],
        false => given.iter().map(|a| a.parse().map_err(|e| format!("{a}: {e}"))).collect::<Result<_, _>>()?,
    };
    counts.into_iter().try_for_each(side_by_side)?;
    Ok(())
}
