//! Shading passes: Lambert light and the background.

use farfield_core::backend::upload_scene;
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::draw::{DrawList, Pass, PassKind, Shading};
use farfield_core::id::TargetId;
use farfield_core::image::from_octahedral;
use farfield_core::scene::{Light, LightKind};
use farfield_core::{Camera, Fault};
use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::Make;
use super::fixture::*;

/// A turned square before sky and ground, lit by a light far away, one at a point and one behind the surface.
pub(super) fn all(make: Make<'_>) {
    let turn = DAffine3::from_quat(DQuat::from_rotation_y(0.7)) * DAffine3::from_translation(DVec3::new(0.0, 1e5, 0.0));
    let scene = scene(quad(), plain([0.5, 0.3, 0.7], true), &[turn]);
    let camera = ahead(&scene, turn.translation + DVec3::new(0.1, 0.2, 3.5), [48, 40]);
    let lamp = Vec3::new(0.8, 1.5, 2.0);
    let lights = vec![
        light(LightKind::Directional { to_light: Vec3::new(0.6, 0.0, 0.8), angle_rad: 0.0 }, [0.4, 0.5, 0.3]),
        light(LightKind::Point { position: lamp, radius: 0.0 }, [0.3, 0.2, 0.4]),
        light(LightKind::Directional { to_light: -Vec3::Z, angle_rad: 0.0 }, [9.0, 9.0, 9.0]),
    ];
    let shading = Shading { ambient: Vec3::new(0.1, 0.05, 0.2), lights, sky: [101, 152, 203], ground: [54, 45, 36] };
    let mut backend = make(&scene);
    upload_scene(&mut *backend, &scene).expect("the scene is uploaded");
    let shade = |camera: Camera, shading: Shading| Pass {
        kind: PassKind::Shade { surface: TargetId(1), shading },
        camera,
        writes: TargetId(2),
        draws: vec![],
    };
    let frame = |shade: Pass| DrawList { passes: vec![surface_pass(&camera, 1, everything(&scene)), shade] };
    backend.render(&frame(shade(camera, shading.clone()))).expect("the frame is drawn");
    let surface = backend.read_surface(TargetId(1)).expect("the surface is read");
    let picture = backend.read_picture(TargetId(2)).expect("the picture is read");
    assert_eq!((picture.size, picture.rgba.len()), (camera.size, 48 * 40));

    let mut seen = [0; 3];
    for (p, c) in pixels(camera.size) {
        let i = surface.at(p[0], p[1]);
        let got = picture.rgba[i];
        let ray = camera.ray(c.x, c.y);
        if !surface.hit(i) {
            let rises = ray.y >= 0.0;
            seen[usize::from(rises)] += 1;
            let b = if rises { shading.sky } else { shading.ground };
            assert_eq!(got, [b[0], b[1], b[2], 255], "background at {p:?}");
            continue;
        }
        seen[2] += 1;
        let n = from_octahedral(surface.normal[i]);
        let point = camera.eye.as_vec3() + ray * surface.depth[i];
        let light = shading.ambient
            + Vec3::new(0.4, 0.5, 0.3) * n.dot(Vec3::new(0.6, 0.0, 0.8)).max(0.0)
            + Vec3::new(0.3, 0.2, 0.4) * n.dot((lamp - point).normalize()).max(0.0);
        for k in 0..3 {
            let byte = byte_of_linear(linear_of_byte(surface.albedo[i][k]) * light[k]);
            assert!(got[k].abs_diff(byte) <= 1, "light at {p:?}: {got:?}, channel {k} should be {byte}");
        }
        assert_eq!(got[3], 255);
    }
    assert!(seen.iter().all(|&n| n > 100), "sky, ground and surface should all show: {seen:?}");

    let many = Shading { lights: vec![shading.lights[0].clone(); Shading::MAX_LIGHTS + 1], ..shading.clone() };
    let refused = |list: DrawList, backend: &mut dyn farfield_core::backend::Backend| {
        matches!(backend.render(&list), Err(Fault::Refused(_)))
    };
    assert!(refused(frame(shade(camera, many)), &mut *backend), "more lights than a pass takes are refused");
    let other = Camera { size: [8, 8], ..camera };
    assert!(refused(frame(shade(other, shading)), &mut *backend), "light on a surface of another size is refused");
}

fn light(kind: LightKind, color: [f32; 3]) -> Light {
    Light { kind, color: Vec3::from_array(color), moves: false }
}
