//! Where surfaces appear: position, depth, nearest first, near distance, scale, far away.

use farfield_core::backend::{BlockData, upload_scene};
use farfield_core::id::{Block, ChunkId};
use farfield_core::image::SurfaceImage;
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::Scene;
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    a_square_off_axis(make);
    nearest_wins_in_any_order(make);
    the_near_distance(make);
    scales(make);
    far_away(make);
    payload_origins(make);
}

fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// Holds a picture against the square -1..1 at z = 0 of an unturned placement, `scale` in size, seen along -z from outside.
fn check_square(what: &str, image: &SurfaceImage, camera: &Camera, centre: Vec3, scale: f32, object: u32) {
    let corner = |s: f32| camera.project(centre + Vec3::new(s, s, 0.0) * scale).expect("ahead").truncate();
    let (a, b) = (corner(-1.0), corner(1.0));
    let depth = -centre.z;
    let albedo = [137, 188, 225];
    let (mut inner, mut outer) = (0, 0);
    for (p, c) in pixels(camera.size) {
        let d = inside_px(c, a, b);
        if d > 1.0 {
            inner += 1;
            check(what, image, p, Some(Expected { albedo, normal: Vec3::Z, depth, object }), 1);
        } else if d < -1.0 {
            outer += 1;
            check(what, image, p, None, 0);
        }
    }
    assert!(inner > 20 && outer > 20, "{what}: the picture shows too little to judge");
}

/// Linear; [137, 188, 225] in bytes.
const BLUISH: [f32; 3] = [0.25, 0.5, 0.752];

fn a_square_off_axis(make: Make<'_>) {
    let scene = scene(quad(), plain(BLUISH, false), &[DAffine3::IDENTITY]);
    let mut camera = ahead(&scene, DVec3::new(0.4, -0.3, 3.0), [61, 47]);
    (camera.left, camera.top) = (camera.left * 1.4, camera.top * 0.8);
    let image = shoot(make, &scene, &camera);
    let centre = (-scene.origin - camera.eye).as_vec3();
    check_square("off axis", &image, &camera, centre, 1.0, 1);
}

fn nearest_wins_in_any_order(make: Make<'_>) {
    let places = [at(0.0, 0.0, 0.0), at(0.0, 0.0, 1.0), at(0.0, 0.0, -1.0)];
    let scene = scene(quad(), plain(BLUISH, false), &places);
    let camera = ahead(&scene, DVec3::Z * 4.0, [32, 32]);
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let draws = order.iter().flat_map(|&i| chunks([ChunkId(i)].into_iter().collect())).collect();
        let (image, counted) = render(&mut *backend, &camera, draws);
        assert_eq!(counted.near_triangles, 6);
        let e = Expected { albedo: [137, 188, 225], normal: Vec3::Z, depth: 3.0, object: 2 };
        check("nearest of three", &image, [16, 16], Some(e), 1);
    }
    // A set that leaves one out draws the others only.
    let (image, _) = render(&mut *backend, &camera, chunks([ChunkId(0), ChunkId(2)].into_iter().collect()));
    let e = Expected { albedo: [137, 188, 225], normal: Vec3::Z, depth: 4.0, object: 1 };
    check("nearest of the two drawn", &image, [16, 16], Some(e), 1);
}

/// A floor under the eye that begins behind it: rows show it from the near distance on and not before.
fn the_near_distance(make: Make<'_>) {
    let down = DAffine3::from_mat3(DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2) * 100.0);
    let scene = scene(quad(), plain(BLUISH, false), &[down]);
    let mut camera = ahead(&scene, DVec3::Y, [24, 64]);
    camera.near = 2.5;
    let image = shoot(make, &scene, &camera);
    for (p, c) in pixels(camera.size) {
        let ray = camera.ray(c.x, c.y);
        let depth = -1.0 / ray.y;
        if ray.y < 0.0 && depth > 2.6 && depth < 80.0 {
            check(
                "the floor",
                &image,
                p,
                Some(Expected { albedo: [137, 188, 225], normal: Vec3::Y, depth, object: 1 }),
                1,
            );
        } else if ray.y > 0.0 || depth < 2.4 {
            check("before the near distance", &image, p, None, 0);
        }
    }
}

/// The same picture for a mesh and a placement of any scale.
fn scales(make: Make<'_>) {
    for (mesh_scale, placed_scale) in [(1e-3, 1.0), (1.0, 1e-3), (1e6, 1.0), (1.0, 1e6), (1e6, 1e-6), (1e-3, 1e6)] {
        let mut mesh = quad();
        mesh.positions.iter_mut().for_each(|p| *p *= mesh_scale);
        let scale = f64::from(mesh_scale) * placed_scale;
        let scene = scene(mesh, plain(BLUISH, false), &[DAffine3::from_scale(DVec3::splat(placed_scale))]);
        let mut camera = ahead(&scene, DVec3::new(0.2, 0.1, 3.0) * scale, [40, 40]);
        camera.near = 1e-3 * scale as f32;
        let image = shoot(make, &scene, &camera);
        let centre = (-scene.origin - camera.eye).as_vec3();
        check_square(&format!("scales {mesh_scale} and {placed_scale}"), &image, &camera, centre, scale as f32, 1);
    }
}

/// 1e7 from home, and 1e7 from each other.
fn far_away(make: Make<'_>) {
    let home = scene(quad(), plain(BLUISH, false), &[DAffine3::IDENTITY]);
    let away = scene(quad(), plain(BLUISH, false), &[at(1e7, -3e6, 1e7)]);
    let apart = scene(quad(), plain(BLUISH, false), &[at(-1e7, 0.0, 0.0), at(1e7, 3e6, -2e6)]);
    let eye = DVec3::new(0.3, 0.2, 2.7);
    let cases: [(&Scene, DVec3, u32); 4] = [
        (&home, DVec3::ZERO, 1),
        (&away, DVec3::new(1e7, -3e6, 1e7), 1),
        (&apart, DVec3::new(-1e7, 0.0, 0.0), 1),
        (&apart, DVec3::new(1e7, 3e6, -2e6), 2),
    ];
    for (scene, place, object) in cases {
        let camera = ahead(scene, place + eye, [40, 40]);
        let image = shoot(make, scene, &camera);
        let centre = (place - scene.origin - camera.eye).as_vec3();
        check_square(&format!("object {object} at {place}"), &image, &camera, centre, 1.0, object);
    }
}

/// A payload's positions count from its origin, however far that is.
fn payload_origins(make: Make<'_>) {
    let scene = scene(quad(), plain(BLUISH, false), &[at(0.0, 0.0, -50.0)]);
    let mut backend = make(&scene);
    for origin in [DVec3::ZERO, DVec3::new(1e7, 2e6, -1e7)] {
        let p = Payload {
            origin,
            bounds: Aabb::of([(origin - 1.0).as_vec3(), (origin + 1.0).as_vec3()]),
            parts: vec![Part::Mesh(quad_part([1; 4])), Part::Mesh(quad_part([137, 188, 225, 255]))],
        };
        backend.upload(Block::Payload(payload(1)), &BlockData::Payload(&p)).expect("a payload");
        let mut camera = ahead(&scene, DVec3::ZERO, [40, 40]);
        camera.eye = origin + DVec3::new(-0.2, 0.1, 3.0);
        let (image, _) = render(&mut *backend, &camera, vec![part(1, 1, 77)]);
        check_square(&format!("payload at {origin}"), &image, &camera, (origin - camera.eye).as_vec3(), 1.0, 77);
    }
    // Turned instances: a corner of a turned square appears where the camera says.
    let turn = DAffine3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.4));
    let scene = super::fixture::scene(quad(), plain(BLUISH, true), &[turn]);
    let camera = ahead(&scene, DVec3::Z * 3.0, [64, 64]);
    let image = shoot(make, &scene, &camera);
    let normal = turn.transform_vector3(DVec3::Z).as_vec3();
    for x in [-0.8, 0.0, 0.8] {
        for y in [-0.8, 0.0, 0.8] {
            let p = (turn.transform_point3(DVec3::new(x, y, 0.0)) - scene.origin - camera.eye).as_vec3();
            let px = camera.project(p).expect("ahead");
            let pixel = [px.x as u32, px.y as u32];
            let ray = camera.ray(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
            let depth = normal.dot(p) / normal.dot(ray);
            check("turned", &image, pixel, Some(Expected { albedo: [137, 188, 225], normal, depth, object: 1 }), 1);
        }
    }
}
