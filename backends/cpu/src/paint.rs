//! Surface passes: albedo, normal, depth and object of every pixel.

use farfield_core::Camera;
use farfield_core::image::{SurfaceImage, octahedral};
use farfield_core::payload::ProjectedPart;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::frame::{Frame, Paint};
use crate::texel;
use crate::trace::{Met, first};

/// Pixels are traced in squares of this edge, so that neighbours in time are neighbours in space.
const TILE_PX: usize = 16;

/// The planes of a run of rows.
struct Rows<'a> {
    albedo: &'a mut [[u8; 4]],
    normal: &'a mut [u32],
    depth: &'a mut [f32],
    object: &'a mut [u32],
}

/// Casts the frame through a camera; over the current pool's threads, or on this one only.
pub(crate) fn surface(frame: &Frame<'_>, camera: &Camera, parallel: bool) -> SurfaceImage {
    let [w, h] = camera.size.map(|v| v as usize);
    let mut image = SurfaceImage {
        size: camera.size,
        albedo: vec![[0; 4]; w * h],
        normal: vec![0; w * h],
        depth: vec![f32::INFINITY; w * h],
        object: vec![0; w * h],
    };
    if w * h == 0 || frame.instances.is_empty() {
        return image;
    }
    let run = TILE_PX * w;
    let work = |(i, rows): (usize, Rows<'_>)| cast_rows(frame, camera, i * TILE_PX, rows);
    if parallel {
        image
            .albedo
            .par_chunks_mut(run)
            .zip(image.normal.par_chunks_mut(run))
            .zip(image.depth.par_chunks_mut(run))
            .zip(image.object.par_chunks_mut(run))
            .map(|(((albedo, normal), depth), object)| Rows { albedo, normal, depth, object })
            .enumerate()
            .for_each(work);
    } else {
        image
            .albedo
            .chunks_mut(run)
            .zip(image.normal.chunks_mut(run))
            .zip(image.depth.chunks_mut(run))
            .zip(image.object.chunks_mut(run))
            .map(|(((albedo, normal), depth), object)| Rows { albedo, normal, depth, object })
            .enumerate()
            .for_each(work);
    }
    image
}

fn cast_rows(frame: &Frame<'_>, camera: &Camera, top: usize, rows: Rows<'_>) {
    let w = camera.size[0] as usize;
    for left in (0..w).step_by(TILE_PX) {
        for y in 0..rows.depth.len() / w {
            for x in left..(left + TILE_PX).min(w) {
                let ray = camera.ray(x as f32 + 0.5, (top + y) as f32 + 0.5);
                if let Some(met) = first(frame, ray, camera.near) {
                    let i = y * w + x;
                    let (albedo, normal) = look(frame, &met, ray);
                    rows.albedo[i] = texel::encode(albedo);
                    rows.normal[i] = octahedral(normal);
                    rows.depth[i] = met.hit.t;
                    rows.object[i] = frame.instances[met.instance as usize].object;
                }
            }
        }
    }
}

/// Linear albedo and unit normal, local frame, of a hit seen along `ray`.
fn look(frame: &Frame<'_>, met: &Met, ray: Vec3) -> (Vec3, Vec3) {
    let instance = &frame.instances[met.instance as usize];
    let space = &frame.spaces[instance.space as usize];
    let (surface, [a, b, c]) = (instance.surface, met.hit.weights);
    let v = surface.triangle(met.hit.triangle);
    let vertex_normal =
        || space.normals * (surface.normals[v[0]] * a + surface.normals[v[1]] * b + surface.normals[v[2]] * c);
    let vertex_color = || match surface.colors.is_empty() {
        true => Vec3::ONE,
        false => {
            let k = v.map(|v| texel::decode(surface.colors[v]));
            k[0] * a + k[1] * b + k[2] * c
        }
    };
    let (albedo, normal) = match &instance.paint {
        Paint::Vertices => (vertex_color(), vertex_normal()),
        Paint::Material { base, texture } => {
            let texture = match texture {
                Some(t) if !surface.uvs.is_empty() => {
                    let uv: Vec2 = surface.uvs[v[0]] * a + surface.uvs[v[1]] * b + surface.uvs[v[2]] * c;
                    texel::texture(t, uv)
                }
                _ => Vec3::ONE,
            };
            (*base * texture * vertex_color(), vertex_normal())
        }
        Paint::Projectors { views, projectors, atlases } => {
            // Both relative to the payload's origin.
            let eye = space.eye.as_vec3();
            let point = (space.eye + ray.as_dvec3() * f64::from(met.hit.t)).as_vec3();
            let set = views[met.hit.triangle as usize];
            match ProjectedPart::blend(projectors, set, point, eye) {
                None => (vertex_color(), vertex_normal()),
                Some((i, j, weight)) => {
                    let one = texel::projected(atlases[i], &projectors[i], point);
                    let two = if i == j { one } else { texel::projected(atlases[j], &projectors[j], point) };
                    (one.0 * weight + two.0 * (1.0 - weight), one.1 * weight + two.1 * (1.0 - weight))
                }
            }
        }
    };
    let normal = normal.normalize_or_zero();
    (albedo, if instance.two_sided && normal.dot(ray) > 0.0 { -normal } else { normal })
}
