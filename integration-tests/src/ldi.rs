//! Layered depth images to test with, gathered from captures the plain way: every pixel of every capture becomes a sample.

use farfield_core::Camera;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::layered::{LayeredPart, normal_bytes};

/// Of two samples in one pixel whose depths differ by less than this share of the nearer, the first one stays.
const SAME: f32 = 0.01;

/// The image of a camera, whose eye is relative to the payload's origin, here that of the local frame, from captures: a sample where its
/// rays, or those of other cameras, met something that falls into its picture. The camera's own capture goes first.
pub fn gathered(camera: &Camera, captures: &[(Camera, SurfaceImage)], smooth: bool) -> LayeredPart {
    struct Sample {
        depth: f32,
        albedo: [u8; 3],
        normal: [i8; 2],
        object: u32,
    }
    let mut pixels: Vec<Vec<Sample>> = vec![];
    pixels.resize_with((camera.size[0] * camera.size[1]) as usize, Vec::new);
    for (from, image) in captures {
        for i in (0..image.depth.len()).filter(|&i| image.hit(i)) {
            let (x, y) = (i as u32 % image.size[0], i as u32 / image.size[0]);
            let point = from.ray(x as f32 + 0.5, y as f32 + 0.5) * image.depth[i] + (from.eye - camera.eye).as_vec3();
            let Some(at) = camera.project(point) else { continue };
            let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < camera.size[0] as f32 && at.y < camera.size[1] as f32;
            if !inside || at.z <= camera.near {
                continue;
            }
            let pixel = &mut pixels[(at.y as u32 * camera.size[0] + at.x as u32) as usize];
            if pixel.iter().all(|s| (s.depth - at.z).abs() > SAME * s.depth.min(at.z)) && pixel.len() < 255 {
                let [r, g, b, _] = image.albedo[i];
                let normal = normal_bytes(from_octahedral(image.normal[i]));
                pixel.push(Sample { depth: at.z, albedo: [r, g, b], normal, object: image.object[i] });
            }
        }
    }
    pixels.iter_mut().for_each(|p| p.sort_by(|a, b| a.depth.total_cmp(&b.depth)));
    let all = || pixels.iter().flatten();
    let (near, far) = all().fold((f32::INFINITY, f32::MIN_POSITIVE), |(n, f), s| (n.min(s.depth), f.max(s.depth)));
    let inverse_depth = if near.is_finite() { [near.recip(), far.recip()] } else { [1.0; 2] };
    let mut objects: Vec<u32> = all().map(|s| s.object).collect();
    objects.sort_unstable();
    objects.dedup();
    LayeredPart {
        camera: *camera,
        inverse_depth,
        counts: pixels.iter().map(|p| p.len() as u8).collect(),
        depth: all().map(|s| LayeredPart::quantise(s.depth, inverse_depth)).collect(),
        albedo: all().map(|s| s.albedo).collect(),
        normal: all().map(|s| s.normal).collect(),
        object: all().map(|s| objects.binary_search(&s.object).map_or(0, |o| o as u16)).collect(),
        objects,
        smooth,
    }
}
