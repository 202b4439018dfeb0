//! Frame times of wgpu and Vulkan on one device, in one run, as lines of text: least and median of nine frames of each.
//!
//! ```text
//! cargo bench -p farfield-integration-tests --bench frame_times [-- TRIANGLES...]
//! ```
//!
//! Without counts 100,000, 1,000,000 and 8,000,000 triangles, which takes minutes and gigabytes of memory. The two are timed in
//! turns, so that whatever else the machine does meets both, and only after their first frames were found to be the same.

use farfield_core::Camera;
use farfield_core::backend::{Backend, Counted};
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use farfield_integration_tests::pair::{everything, hits, pair};
use farfield_integration_tests::turned::turned;
use glam::{DAffine3, DVec3, Vec3};

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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo's own `--bench` is passed over.
    let given: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let counts: Vec<u32> = match given.is_empty() {
        true => vec![100_000, 1_000_000, 8_000_000],
        false => given.iter().map(|a| a.parse().map_err(|e| format!("{a}: {e}"))).collect::<Result<_, _>>()?,
    };
    counts.into_iter().try_for_each(side_by_side)?;
    Ok(())
}
