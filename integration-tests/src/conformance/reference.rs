//! Scenes without a formula, held against the reference backend.

use farfield_core::Camera;
use farfield_core::id::{MaterialId, TextureId};
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, Scene, Texture};
use farfield_cpu::{CpuBackend, CpuOptions};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Make;
use super::fixture::*;

/// Random triangles with every attribute, half of them two-sided.
fn random_mesh(rng: &mut ChaCha8Rng, triangles: u32, edge: f32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    let mut point = |s: f32| Vec3::new(rng.random_range(-s..s), rng.random_range(-s..s), rng.random_range(-s..s));
    for i in 0..triangles {
        let centre = point(1.0);
        for k in 0..3 {
            m.positions.push(centre + point(edge));
            m.normals.push(point(1.0).normalize_or(Vec3::Y));
            m.uvs.push(point(1.0).truncate() + Vec2::splat(0.5));
            let [r, g, b] = point(60.0).to_array().map(|v| (v + 160.0) as u8);
            m.colors.push([r, g, b, 255]);
            m.indices.push(3 * i + k);
        }
    }
    let half = triangles / 2 * 3;
    m.sections = vec![(0..half, MaterialId(0)), (half..3 * triangles, MaterialId(1))];
    m
}

fn materials() -> (Vec<Material>, Vec<Texture>) {
    let texture = Texture {
        name: "checks".into(),
        size: [5, 3],
        rgba: (0..15u8).map(|i| [120 + 9 * i, 250 - 8 * i, 140 + 60 * (i % 2), 255]).collect(),
    };
    let textured = Material { texture: Some(TextureId(0)), ..plain([0.9, 0.8, 0.7], false) };
    (vec![textured, plain([0.6, 0.9, 0.8], true)], vec![texture])
}

/// 400 large triangles through one another.
pub(super) fn soup(make: Make<'_>) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (materials, textures) = materials();
    let mut b = builder(materials, textures);
    let mesh = b.mesh("soup", random_mesh(&mut rng, 400, 0.5)).expect("a sound mesh");
    b.place(Placement { mesh, transform: DAffine3::IDENTITY });
    let scene = b.build().expect("a sound scene");
    compare("soup", make, &scene, &ahead(&scene, DVec3::new(0.2, 0.3, 3.2), [128, 96]), 0.06);
}

/// 60 instances of a mesh, turned, stretched and mirrored.
pub(super) fn instances(make: Make<'_>) {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let (materials, textures) = materials();
    let mut b = builder(materials, textures);
    let mesh = b.mesh("tuft", random_mesh(&mut rng, 30, 0.8)).expect("a sound mesh");
    for i in 0..60 {
        let mut r = |s: f64| rng.random_range(-s..s);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, r(3.0), r(3.0), r(3.0));
        let mirror = if i % 3 == 0 { -1.0 } else { 1.0 };
        let size = 0.5 + 0.2 * r(1.0);
        let linear = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::new(size * mirror, size, size));
        let place = DVec3::new(r(4.0), r(2.0), r(4.0));
        b.place(Placement { mesh, transform: DAffine3::from_mat3_translation(linear, place) });
    }
    let scene = b.build().expect("a sound scene");
    compare("instances", make, &scene, &ahead(&scene, DVec3::new(0.0, 0.5, 7.0), [128, 96]), 0.08);
}

/// At most `share` of the pixels may show another triangle, as happens at silhouettes; the rest agree in every plane.
fn compare(what: &str, make: Make<'_>, scene: &Scene, camera: &Camera, share: f32) {
    let reference = |s: &Scene| -> Box<dyn farfield_core::backend::Backend> {
        Box::new(CpuBackend::new(s, CpuOptions::default()).expect("the reference"))
    };
    let (a, b) = (shoot(&reference, scene, camera), shoot(make, scene, camera));
    let n = a.depth.len();
    let (mut other, mut covered) = (0, 0);
    for i in 0..n {
        covered += usize::from(a.hit(i));
        if !same(&a, &b, i) {
            other += 1;
        }
    }
    assert!(covered * 4 > n, "{what}: only {covered} of {n} pixels show anything");
    assert!(other as f32 <= share * n as f32, "{what}: {other} of {n} pixels differ from the reference");
}

pub(super) fn same(a: &SurfaceImage, b: &SurfaceImage, i: usize) -> bool {
    if !a.hit(i) {
        return !b.hit(i) && b.depth[i] == f32::INFINITY;
    }
    let levels = (0..4).map(|k| a.albedo[i][k].abs_diff(b.albedo[i][k])).max().unwrap_or(0);
    a.object[i] == b.object[i]
        && (a.depth[i] - b.depth[i]).abs() <= 2e-4 * a.depth[i]
        && levels <= 3
        && from_octahedral(a.normal[i]).distance(from_octahedral(b.normal[i])) < 0.02
}
