//! Rays a second, and triangles a second into hierarchies: `cargo bench -p farfield-cpu [-- TRIANGLES]`.
//!
//! The scene is a field of bumpy balls, half of all rays against sky. Three figures: one picture of 1024 x 1024 over all
//! threads; the same on one; and small pictures of single objects on one thread, as bakes take them.

use std::time::Instant;

use farfield_core::Camera;
use farfield_core::backend::{Backend, upload_scene};
use farfield_core::context::{Capture, Shot};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{MaterialId, TargetId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
use farfield_cpu::{CpuBackend, CpuCapture, CpuOptions};
use glam::{DAffine3, DVec3, Vec3};

fn ball(rings: u32) -> TriangleMesh {
    let sectors = 2 * rings;
    let mut m = TriangleMesh::default();
    for j in 0..=rings {
        for i in 0..sectors {
            let polar = j as f32 / rings as f32 * std::f32::consts::PI;
            let turn = i as f32 / sectors as f32 * std::f32::consts::TAU;
            let bump = 1.0 + 0.1 * (9.0 * polar).sin() * (7.0 * turn).cos();
            m.positions.push(Vec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin()) * bump);
        }
    }
    for j in 0..rings {
        for i in 0..sectors {
            let (a, b) = (j * sectors + i, j * sectors + (i + 1) % sectors);
            m.indices.extend([a, b, b + sectors, a, b + sectors, a + sectors]);
        }
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m.smooth_normals();
    m
}

fn scene(triangles: u32) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    // 20 balls, 4 rings^2 triangles each, placed 400 times.
    let rings = (f64::from(triangles) / 80.0).sqrt() as u32;
    let meshes: Vec<_> = (0..20).map(|i| b.mesh("ball", ball(rings + i)).expect("a sound mesh")).collect();
    for i in 0..400u32 {
        let place = DVec3::new(f64::from(i % 20) * 3.0, 0.0, f64::from(i / 20) * 3.0);
        b.place(Placement { mesh: meshes[i as usize % 20], transform: DAffine3::from_translation(place) });
    }
    b.build().expect("a sound scene")
}

fn main() {
    let triangles = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(1_000_000);
    let scene = scene(triangles);
    let unique: u64 = scene.meshes.iter().map(|m| m.triangles).sum();
    println!("{unique} triangles in {} chunks, {} placed", scene.mesh_chunk_ids().count(), scene.triangles());
    let start = Instant::now();
    let capture = CpuCapture::new(&scene).expect("captures");
    let s = start.elapsed().as_secs_f64();
    println!("hierarchies, all threads: {s:.2} s, {:.2} M triangles/s", unique as f64 / s * 1e-6);

    let middle = scene.bounds.centre().as_dvec3();
    let eye = middle + DVec3::new(-20.0, 6.0, 45.0);
    let camera = Camera::looking(eye, (middle - eye).as_vec3() + Vec3::Y * 4.0, Vec3::Y, 1.0, [1024, 1024], 0.1);
    for threads in [None, Some(1)] {
        let mut b = CpuBackend::new(&scene, CpuOptions { threads, ..CpuOptions::default() }).expect("a backend");
        upload_scene(&mut b, &scene).expect("the scene is uploaded");
        let what = DrawWhat::Chunks(scene.all_chunks());
        let draws = vec![Draw { what, bounds: scene.bounds, error_px: 0.0 }];
        let list = DrawList { passes: vec![Pass { kind: PassKind::Surface, camera, writes: TargetId(0), draws }] };
        let ms = (0..5).map(|_| b.render(&list).expect("a frame").wall_ms).fold(f64::INFINITY, f64::min);
        let image = b.read_surface(TargetId(0)).expect("the surface");
        let hit = (0..image.depth.len()).filter(|&i| image.hit(i)).count() as f64 / image.depth.len() as f64;
        println!(
            "1024 x 1024, threads {threads:?}: {ms:.1} ms, {:.2} Mrays/s, {:.0} % hit",
            1.048_576e3 / ms,
            hit * 100.0
        );
    }

    let (mut rays, start) = (0, Instant::now());
    for o in scene.objects.iter().take(200) {
        let axis = (o.bounds.centre().as_dvec3() - eye).as_vec3();
        let camera = Camera::around(eye, axis, o.bounds.corners(), 1600.0, 1, 0.1).expect("an object ahead");
        let shot = Shot { chunks: ChunkSet::from_range(o.chunks.clone()), camera };
        rays += capture.shoot(&[shot]).expect("a shot")[0].depth.len();
    }
    let s = start.elapsed().as_secs_f64();
    println!("200 objects, one thread: {:.2} ms each, {rays} rays, {:.2} Mrays/s", s * 5.0, rays as f64 / s * 1e-6);
}
