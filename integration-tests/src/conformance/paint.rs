//! Albedo: base colour times texture times vertex colour, in linear light.

use farfield_core::backend::BlockData;
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::id::{Block, TextureId};
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::scene::{Material, Placement, Scene, Texture};
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DVec3, Vec3};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    vertex_colors(make);
    textures(make);
    part_colors(make);
    normals_between_vertices(make);
}

/// The square fills the picture, one unit of x or y to 16 pixels.
fn filling(scene: &Scene) -> Camera {
    let mut c = Camera::looking(DVec3::Z * 2.0 - scene.origin, -Vec3::Z, Vec3::Y, 1.0, [32, 32], 0.01);
    (c.left, c.right_tan, c.bottom, c.top) = (-0.5, 0.5, -0.5, 0.5);
    c
}

fn expect(albedo: [f32; 3]) -> Option<Expected> {
    Some(Expected { albedo: albedo.map(byte_of_linear), normal: Vec3::Z, depth: 2.0, object: 1 })
}

fn vertex_colors(make: Make<'_>) {
    let mut mesh = quad();
    // Red falls from left to right, green rises, blue is one byte all over: sRGB bytes, mixed in linear light.
    mesh.colors = [[255, 20, 99, 255], [20, 255, 99, 255], [20, 255, 99, 255], [255, 20, 99, 255]].to_vec();
    let scene = scene(mesh, plain([0.5, 1.0, 0.8], false), &[DAffine3::IDENTITY]);
    let image = shoot(make, &scene, &filling(&scene));
    for (p, c) in pixels([32, 32]) {
        let t = c.x / 32.0;
        let mix = |a: u8, b: u8| linear_of_byte(a) * (1.0 - t) + linear_of_byte(b) * t;
        let albedo = [0.5 * mix(255, 20), mix(20, 255), 0.8 * linear_of_byte(99)];
        check("vertex colours", &image, p, expect(albedo), 1);
    }
}

/// 4 x 2 texels, repeated two and a half times across and one and a half times down.
fn textures(make: Make<'_>) {
    let texels: [[u8; 4]; 8] = [
        [200, 90, 90, 255],
        [90, 210, 120, 255],
        [110, 100, 220, 255],
        [240, 240, 140, 255],
        [100, 130, 160, 255],
        [220, 110, 230, 255],
        [130, 220, 230, 255],
        [150, 150, 150, 255],
    ];
    let texture = Texture { name: "t".into(), size: [4, 2], rgba: texels.to_vec() };
    let material = Material { texture: Some(TextureId(0)), ..plain([1.0, 0.7, 0.9], false) };
    let mut b = builder(vec![material], vec![texture]);
    let mut mesh = quad();
    mesh.uvs.iter_mut().for_each(|uv| *uv = glam::Vec2::new(uv.x * 2.5 - 1.25, uv.y * 1.5));
    let mesh = b.mesh("square", mesh).expect("a sound mesh");
    b.place(Placement { mesh, transform: DAffine3::IDENTITY });
    let scene = b.build().expect("a sound scene");
    let image = shoot(make, &scene, &filling(&scene));
    for (p, c) in pixels([32, 32]) {
        let (u, v) = ((c.x / 32.0 * 2.5 - 1.25) * 4.0 - 0.5, c.y / 32.0 * 1.5 * 2.0 - 0.5);
        let texel = |dx: i32, dy: i32, k: usize| {
            let (x, y) = ((u.floor() as i32 + dx).rem_euclid(4), (v.floor() as i32 + dy).rem_euclid(2));
            linear_of_byte(texels[(y * 4 + x) as usize][k])
        };
        let (fx, fy) = (u - u.floor(), v - v.floor());
        let albedo = [0, 1, 2].map(|k| {
            let row = |dy| texel(0, dy, k) * (1.0 - fx) + texel(1, dy, k) * fx;
            (row(0) * (1.0 - fy) + row(1) * fy) * [1.0, 0.7, 0.9][k]
        });
        // Devices may round the filter's weights to 8 bits: 2 levels in these mid tones.
        check("a texture", &image, p, expect(albedo), 2);
    }
}

fn part_colors(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let colors = vec![[255, 20, 99, 255], [20, 255, 99, 255], [20, 255, 99, 255], [255, 20, 99, 255]];
    let mesh = MeshPart { albedo: colors, ..quad_part([0; 4]) };
    let p = Payload { origin: -scene.origin, bounds: Aabb::EMPTY, parts: vec![Part::Mesh(mesh)] };
    let mut backend = make(&scene);
    backend.upload(Block::Payload(payload(0)), &BlockData::Payload(&p)).expect("a payload");
    let (image, _) = render(&mut *backend, &filling(&scene), vec![part(0, 0, 1)]);
    for (p, c) in pixels([32, 32]) {
        let t = c.x / 32.0;
        let mix = |a: u8, b: u8| linear_of_byte(a) * (1.0 - t) + linear_of_byte(b) * t;
        check("a part's colours", &image, p, expect([mix(255, 20), mix(20, 255), linear_of_byte(99)]), 1);
    }
}

fn normals_between_vertices(make: Make<'_>) {
    let mut mesh = quad();
    let (left, right) = (Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, 0.8));
    mesh.normals = vec![left, right, right, left];
    let scene = scene(mesh, plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let image = shoot(make, &scene, &filling(&scene));
    for (p, c) in pixels([32, 32]) {
        let normal = left.lerp(right, c.x / 32.0).normalize();
        check("normals", &image, p, Some(Expected { albedo: [255; 3], normal, depth: 2.0, object: 1 }), 0);
    }
}
