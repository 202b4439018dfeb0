//! Shading passes: Lambert light on a surface target, the background elsewhere.

use farfield_core::draw::Shading;
use farfield_core::image::{Picture, SurfaceImage, from_octahedral};
use farfield_core::scene::LightKind;
use farfield_core::{Camera, Fault};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::texel;

/// Lights `surface`, which was seen through `camera`.
///
/// # Errors
/// [`Fault::Refused`] where there are too many lights or the sizes differ.
pub(crate) fn shade(surface: &SurfaceImage, camera: &Camera, shading: &Shading) -> Result<Picture, Fault> {
    if shading.lights.len() > Shading::MAX_LIGHTS {
        let (n, max) = (shading.lights.len(), Shading::MAX_LIGHTS);
        return Err(Fault::Refused(format!("{n} lights in a shading pass that takes {max}")));
    }
    if surface.size != camera.size {
        let (a, b) = (surface.size, camera.size);
        return Err(Fault::Refused(format!("a shading pass of {b:?} pixels reads a surface of {a:?}")));
    }
    // Relative to the eye in 64 bits, as everything that rays meet.
    let lights: Vec<(LightKind, Vec3)> = shading
        .lights
        .iter()
        .map(|l| match l.kind {
            LightKind::Directional { .. } => (l.kind, l.color),
            LightKind::Point { position, radius } => {
                let from_eye = (DVec3::from(position) - camera.eye).as_vec3();
                (LightKind::Point { position: from_eye, radius }, l.color)
            }
        })
        .collect();
    let opaque = |c: [u8; 3]| [c[0], c[1], c[2], 255];
    let (sky, ground) = (opaque(shading.sky), opaque(shading.ground));
    let width = camera.size[0] as usize;
    let pixel = |i: usize| {
        let ray = camera.ray((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
        if !surface.hit(i) {
            return if ray.y >= 0.0 { sky } else { ground };
        }
        let normal = from_octahedral(surface.normal[i]);
        let point = ray * surface.depth[i];
        let light = lights.iter().fold(shading.ambient, |sum, (kind, color)| {
            let to_light = match kind {
                LightKind::Directional { to_light, .. } => *to_light,
                LightKind::Point { position, .. } => (*position - point).normalize_or_zero(),
            };
            sum + *color * normal.dot(to_light).max(0.0)
        });
        texel::encode(texel::decode(surface.albedo[i]) * light)
    };
    let rgba = (0..surface.depth.len()).into_par_iter().with_min_len(1024).map(pixel).collect();
    Ok(Picture { size: camera.size, rgba })
}
