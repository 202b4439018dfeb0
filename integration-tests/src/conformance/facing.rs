//! Which sides are drawn, and where their normals point.

use farfield_core::backend::BlockData;
use farfield_core::id::Block;
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::{Aabb, Camera};
use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::Make;
use super::fixture::*;

pub(super) fn all(make: Make<'_>) {
    chunks_from_both_sides(make);
    mirrored_placements(make);
    normals_under_uneven_scale(make);
    parts_from_both_sides(make);
}

const WHITE: [u8; 3] = [255; 3];

/// From in front (+z) or behind, at distance 3.
fn camera(scene: &farfield_core::scene::Scene, front: bool) -> Camera {
    let side = if front { 1.0 } else { -1.0 };
    Camera::looking(DVec3::Z * 3.0 * side - scene.origin, -Vec3::Z * side as f32, Vec3::Y, 1.0, [32, 32], 0.01)
}

fn seen(normal: Vec3) -> Option<Expected> {
    Some(Expected { albedo: WHITE, normal, depth: 3.0, object: 1 })
}

fn chunks_from_both_sides(make: Make<'_>) {
    for two_sided in [false, true] {
        let scene = scene(quad(), plain([1.0; 3], two_sided), &[DAffine3::IDENTITY]);
        let front = shoot(make, &scene, &camera(&scene, true));
        check("the front", &front, [16, 16], seen(Vec3::Z), 0);
        let back = shoot(make, &scene, &camera(&scene, false));
        let expected = if two_sided { seen(-Vec3::Z) } else { None };
        check(&format!("the back, two-sided: {two_sided}"), &back, [16, 16], expected, 0);
    }
}

/// A mirror in x leaves the square where it is and turns its winding round: +z becomes its back. A mirror in z leaves the winding
/// seen along z as it is, yet turns the normal, which is stored apart.
fn mirrored_placements(make: Make<'_>) {
    for two_sided in [false, true] {
        for (axis, mirror) in [("x", DVec3::new(-1.0, 1.0, 1.0)), ("xyz", DVec3::splat(-1.0))] {
            // Under a mirror the inverse transpose keeps normals at right angles to the surface.
            let normal = (Vec3::Z * mirror.as_vec3()).normalize();
            let scene = scene(quad(), plain([1.0; 3], two_sided), &[DAffine3::from_scale(mirror)]);
            for front in [true, false] {
                let image = shoot(make, &scene, &camera(&scene, front));
                // The stored order of x, y corners turns with the sign of x times y.
                let winding_is_kept = mirror.x * mirror.y > 0.0;
                let drawn = two_sided || front == winding_is_kept;
                let to_eye = if front { Vec3::Z } else { -Vec3::Z };
                let expected = if two_sided { to_eye } else { normal };
                let what = format!("mirrored in {axis}, two-sided: {two_sided}, from in front: {front}");
                check(&what, &image, [16, 16], if drawn { seen(expected) } else { None }, 0);
            }
        }
    }
}

/// A slope of 45 degrees, stretched: positions go by the placement, normals by its inverse transpose.
fn normals_under_uneven_scale(make: Make<'_>) {
    let mut mesh = quad();
    mesh.positions.iter_mut().for_each(|p| p.z = p.x);
    mesh.normals = vec![Vec3::new(-1.0, 0.0, 1.0).normalize(); 4];
    let turn = DMat3::from_rotation_z(0.3);
    let place = DAffine3::from_mat3(turn * DMat3::from_diagonal(DVec3::new(3.0, 0.5, 1.0)));
    let scene = scene(mesh, plain([1.0; 3], false), &[place]);
    let camera = ahead(&scene, DVec3::Z * 6.0, [33, 33]);
    let image = shoot(make, &scene, &camera);
    // Tangents of the placed surface, straight from its corners.
    let [a, b] = [DVec3::new(1.0, 0.0, 1.0), DVec3::Y].map(|t| place.transform_vector3(t));
    let normal = a.cross(b).normalize().as_vec3();
    let depth = (camera.eye + scene.origin).z as f32;
    check("stretched", &image, [16, 16], Some(Expected { albedo: WHITE, normal, depth, object: 1 }), 0);
}

fn parts_from_both_sides(make: Make<'_>) {
    let scene = scene(quad(), plain([1.0; 3], false), &[DAffine3::IDENTITY]);
    let mut backend = make(&scene);
    for two_sided in [false, true] {
        let mesh = MeshPart { two_sided, ..quad_part([255; 4]) };
        let p =
            Payload { origin: DVec3::ZERO, bounds: Aabb::of([-Vec3::ONE, Vec3::ONE]), parts: vec![Part::Mesh(mesh)] };
        backend.upload(Block::Payload(payload(0)), &BlockData::Payload(&p)).expect("a payload");
        for front in [true, false] {
            let mut camera = camera(&scene, front);
            camera.eye = DVec3::Z * if front { 3.0 } else { -3.0 };
            let (image, _) = render(&mut *backend, &camera, vec![part(0, 0, 1)]);
            let expected = if front { seen(Vec3::Z) } else { seen(-Vec3::Z).filter(|_| two_sided) };
            check(&format!("a part, two-sided: {two_sided}, from in front: {front}"), &image, [16, 16], expected, 0);
        }
    }
}
