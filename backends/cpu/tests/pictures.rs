//! Pictures of the reference backend against formulas and brute force, and against themselves on other threads.

use farfield_core::Camera;
use farfield_core::backend::{Backend, upload_scene};
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::context::{Capture, Shot};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{ChunkId, MaterialId, TargetId};
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{ChunkSet, Material, Placement, Scene, SceneBuilder};
use farfield_cpu::{CpuBackend, CpuCapture, CpuOptions};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn soup(rng: &mut ChaCha8Rng, triangles: u32, edge: f32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    let mut point = |s: f32| Vec3::new(rng.random_range(-s..s), rng.random_range(-s..s), rng.random_range(-s..s));
    for i in 0..triangles {
        let centre = point(1.0);
        for k in 0..3 {
            m.positions.push(centre + point(edge));
            m.normals.push(point(1.0).normalize_or(Vec3::Y));
            let [r, g, b] = point(120.0).to_array().map(|v| (v + 128.0) as u8);
            m.colors.push([r, g, b, 255]);
            m.indices.push(3 * i + k);
        }
    }
    let half = triangles / 2 * 3;
    m.sections = vec![(0..half, MaterialId(0)), (half..3 * triangles, MaterialId(1))];
    m
}

/// Turned, stretched, mirrored copies of a soup, half of it two-sided.
fn scene(seed: u64, triangles: u32, copies: u32) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut b = SceneBuilder::default();
    b.materials = [false, true].map(|two_sided| Material { two_sided, ..Material::default() }).to_vec();
    let mesh = b.mesh("soup", soup(&mut rng, triangles, 0.5)).expect("a sound mesh");
    for i in 0..copies {
        let mut r = |s: f64| rng.random_range(-s..s);
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, r(3.0), r(3.0), r(3.0)));
        let size = DVec3::new(if i % 2 == 1 { -0.9 } else { 1.1 }, 0.8, 1.3);
        let place = DVec3::new(r(1.5), r(1.5), r(1.5));
        b.place(Placement {
            mesh,
            transform: DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(size), place),
        });
    }
    b.build().expect("a sound scene")
}

fn camera(scene: &Scene, size: [u32; 2]) -> Camera {
    let middle = scene.bounds.centre().as_dvec3();
    let eye = middle + DVec3::new(1.0, 2.0, 4.5);
    Camera::looking(eye, (middle - eye).as_vec3(), Vec3::Y, 1.0, size, 2.0)
}

fn backend(scene: &Scene, threads: usize) -> CpuBackend {
    let mut b =
        CpuBackend::new(scene, CpuOptions { threads: Some(threads), ..CpuOptions::default() }).expect("a backend");
    upload_scene(&mut b, scene).expect("the scene is uploaded");
    b
}

fn surface(b: &mut CpuBackend, camera: &Camera, chunks: ChunkSet) -> SurfaceImage {
    let draws = vec![Draw { what: DrawWhat::Chunks(chunks), bounds: farfield_core::Aabb::EMPTY, error_px: 0.0 }];
    let pass = Pass { kind: PassKind::Surface, camera: *camera, writes: TargetId(0), draws };
    b.render(&DrawList { passes: vec![pass] }).expect("the frame is drawn");
    b.read_surface(TargetId(0)).expect("the surface is read")
}

/// A triangle in the local frame, with all that a pixel needs.
struct Placed {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    colors: [Vec3; 3],
    two_sided: bool,
    object: u32,
}

fn flatten(scene: &Scene) -> Vec<Placed> {
    let mut all = vec![];
    for (i, c) in scene.chunks.iter().enumerate() {
        let at = scene.objects[c.object.index()].placement;
        let turn = at.matrix3.inverse().transpose();
        let two_sided = scene.materials[scene.material_of(ChunkId(i as u32)).index()].two_sided;
        let take = &mut |m: &farfield_core::mesh::ChunkMesh| {
            all.extend(m.indices.chunks_exact(3).map(|t| Placed {
                corners: [0, 1, 2].map(|k| at.transform_point3(m.positions[t[k] as usize].as_dvec3())),
                normals: [0, 1, 2].map(|k| turn * m.normals[t[k] as usize].as_dvec3()),
                colors: [0, 1, 2].map(|k| Vec3::from([0, 1, 2].map(|j| linear_of_byte(m.colors[t[k] as usize][j])))),
                two_sided,
                object: c.object.0 + 1,
            }));
        };
        scene.geometry.with(c.source, take).expect("the chunk is read");
    }
    all
}

/// Every pixel against every triangle, in the local frame and 64 bits (Möller and Trumbore 1997). A pixel that lies close to an edge,
/// or sees two surfaces at nearly one depth, is not judged.
#[test]
fn every_pixel_is_that_of_brute_force() {
    for (seed, triangles, copies) in [(1, 60, 1), (2, 40, 4)] {
        let scene = scene(seed, triangles, copies);
        let camera = camera(&scene, [72, 56]);
        let image = surface(&mut backend(&scene, 2), &camera, scene.all_chunks());
        let all = flatten(&scene);
        let (mut judged, mut hits) = (0, 0);
        for y in 0..56 {
            for x in 0..72 {
                let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
                let d = ray.as_dvec3();
                let mut best: Option<(f64, f64, f64, &Placed)> = None;
                let mut doubtful = false;
                for p in &all {
                    let [a, b, c] = p.corners;
                    let (e1, e2, s) = (b - a, c - a, camera.eye - a);
                    let det = e1.dot(d.cross(e2));
                    let (u, v) = (s.dot(d.cross(e2)) / det, d.dot(s.cross(e1)) / det);
                    let t = e2.dot(s.cross(e1)) / det;
                    let inside = u.min(v).min(1.0 - u - v);
                    if det <= 0.0 && !p.two_sided || inside < -1e-4 || t < 2.0 - 1e-4 {
                        continue;
                    }
                    doubtful |= inside < 1e-4 || t < 2.0 + 1e-4;
                    if let Some((near, ..)) = best {
                        doubtful |= (near - t).abs() < 1e-4;
                    }
                    if best.is_none_or(|b| t < b.0) {
                        best = Some((t, u, v, p));
                    }
                }
                if doubtful {
                    continue;
                }
                judged += 1;
                let i = image.at(x, y);
                let Some((t, u, v, p)) = best else {
                    assert!(!image.hit(i) && image.depth[i] == f32::INFINITY && image.albedo[i] == [0; 4]);
                    continue;
                };
                hits += 1;
                assert_eq!(image.object[i], p.object, "object at {x}, {y}");
                assert!((f64::from(image.depth[i]) - t).abs() < 1e-5 * t, "depth {} for {t}", image.depth[i]);
                let w = [1.0 - u - v, u, v];
                let color = (0..3).fold(Vec3::ZERO, |s, k| s + p.colors[k] * w[k] as f32) * 0.6;
                for k in 0..3 {
                    assert!(image.albedo[i][k].abs_diff(byte_of_linear(color[k])) <= 1, "albedo at {x}, {y}");
                }
                let n = (0..3).fold(DVec3::ZERO, |s, k| s + p.normals[k] * w[k]).normalize().as_vec3();
                let n = if p.two_sided && n.dot(ray) > 0.0 { -n } else { n };
                let close = from_octahedral(image.normal[i]).distance(n) < 1e-3;
                assert!(close || n.dot(ray).abs() < 1e-3, "normal at {x}, {y}");
            }
        }
        assert!(judged > 3500 && hits > 300, "{judged} pixels judged, {hits} hits");
    }
}

/// A ball of radius 1 as 128 x 256 quads: its silhouette is a circle of known size, its depths are known.
#[test]
fn a_ball_has_the_silhouette_and_the_depth_of_a_ball() {
    let (rings, sectors) = (128u32, 256u32);
    let mut m = TriangleMesh::default();
    for j in 0..=rings {
        for i in 0..sectors {
            let (a, b) = (f64::from(j) / f64::from(rings), f64::from(i) / f64::from(sectors));
            let (polar, turn) = (a * std::f64::consts::PI, b * std::f64::consts::TAU);
            let p = DVec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin());
            m.positions.push(p.as_vec3());
            m.normals.push(p.as_vec3());
        }
    }
    for j in 0..rings {
        for i in 0..sectors {
            let (a, b) = (j * sectors + i, j * sectors + (i + 1) % sectors);
            m.indices.extend([a, b, b + sectors, a, b + sectors, a + sectors]);
        }
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    let mesh = b.mesh("ball", m).expect("a sound mesh");
    b.place(Placement { mesh, transform: DAffine3::from_scale(DVec3::splat(10.0)) });
    let scene = b.build().expect("a sound scene");
    let centre = -scene.origin;
    let camera = Camera::looking(centre + DVec3::Z * 30.0, -Vec3::Z, Vec3::Y, 1.0, [400, 400], 0.1);
    let image = surface(&mut backend(&scene, 2), &camera, scene.all_chunks());
    // The cone that touches the ball has the tangent r / sqrt(d^2 - r^2).
    let radius_px = 10.0 / f64::sqrt(900.0 - 100.0) * f64::from(camera.px_per_tan());
    let hits = (0..160_000).filter(|&i| image.hit(i)).count() as f64;
    let disc = std::f64::consts::PI * radius_px * radius_px;
    assert!((hits / disc - 1.0).abs() < 2e-3, "{hits} pixels of {disc}");
    for y in 0..400 {
        for x in 0..400 {
            let d = camera.ray(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
            // |eye + t d - centre| = 10.
            let (a, half_b, c) = (d.length_squared(), d.z * 30.0, 900.0 - 100.0);
            let disc = half_b * half_b - a * c;
            let i = image.at(x, y);
            if disc > 5.0 {
                let t = (-half_b - disc.sqrt()) / a;
                // The facets lie within 10 (1 - cos(pi / 128)) = 0.003 of the ball, the more along a slanting ray.
                let slack = 0.004 * 10.0 * a.sqrt() / disc.sqrt();
                assert!((f64::from(image.depth[i]) - t).abs() < slack, "{} for {t}", image.depth[i]);
                let n = (DVec3::Z * 30.0 + d * t).normalize().as_vec3();
                assert!(from_octahedral(image.normal[i]).distance(n) < 0.01);
            } else if disc < -5.0 {
                assert!(!image.hit(i));
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let scene = scene(3, 300, 12);
    let camera = camera(&scene, [131, 77]);
    let one = surface(&mut backend(&scene, 1), &camera, scene.all_chunks());
    assert!((0..one.depth.len()).filter(|&i| one.hit(i)).count() > 3000);
    for threads in [2, 5] {
        assert_eq!(one, surface(&mut backend(&scene, threads), &camera, scene.all_chunks()));
    }
}

#[test]
fn captures_are_the_backend_s_pictures_whoever_takes_them() {
    let scene = scene(4, 200, 10);
    let capture = CpuCapture::new(&scene).expect("captures");
    let mut renderer = backend(&scene, 2);
    let shots: Vec<Shot> = (0..6u32)
        .map(|i| {
            let camera = camera(&scene, [40 + 3 * i, 30]);
            let eye = camera.eye + DVec3::new(0.3, 0.1, -0.2) * f64::from(i);
            let chunks = scene.all_chunks().iter().filter(|c| c.0 % 3 != i % 3).collect();
            Shot { chunks, camera: Camera { eye, ..camera } }
        })
        .collect();
    let expected: Vec<_> = shots.iter().map(|s| surface(&mut renderer, &s.camera, s.chunks.clone())).collect();
    assert_eq!(capture.shoot(&shots).expect("shots"), expected);
    std::thread::scope(|s| {
        for (shot, expected) in shots.iter().zip(&expected) {
            let capture = &capture;
            s.spawn(move || assert_eq!(&capture.shoot(std::slice::from_ref(shot)).expect("a shot")[0], expected));
        }
    });
    assert!(capture.identity().contains("version"));
    let beyond = Shot { chunks: ChunkSet::from_range(0..10_000), camera: camera(&scene, [8, 8]) };
    assert!(matches!(capture.shoot(&[beyond]), Err(farfield_core::Fault::Refused(_))));
    let none = Shot { chunks: ChunkSet::default(), camera: camera(&scene, [8, 8]) };
    assert!(capture.shoot(&[none]).expect("an empty shot")[0].object.iter().all(|&o| o == 0));
}
