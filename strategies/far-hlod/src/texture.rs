//! How far textures are off where only vertices carry albedo.

use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::scene::{Gathered, Texture, texture_at};
use glam::Vec3;

/// Samples along an edge.
const STEPS: u32 = 8;

/// The largest distance of a place whose texture differs from what its triangle's corners show by more than `max_off` grey levels in
/// some channel, to the nearest corner, where colours are right; scene units. Sampled, [`STEPS`] along an edge.
pub(crate) fn off(mesh: &Gathered, textures: &[Texture], max_off: u8) -> f32 {
    let mut most = 0f32;
    for t in &mesh.textured {
        let (Some(texture), corners) = (textures.get(t.texture as usize), mesh.corners[t.triangle as usize]) else {
            continue;
        };
        let places = mesh.places(corners);
        let shown = corners.map(|w| {
            let [r, g, b, _] = mesh.wedges[w as usize].albedo;
            Vec3::new(linear_of_byte(r), linear_of_byte(g), linear_of_byte(b))
        });
        for w in lattice() {
            let mix = |v: [Vec3; 3]| v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
            let uv = t.uv[0] * w[0] + t.uv[1] * w[1] + t.uv[2] * w[2];
            let bytes = |c: Vec3| c.to_array().map(byte_of_linear);
            let (is, seen) = (bytes(mix(t.tint) * texture_at(texture, uv)), bytes(mix(shown)));
            if is.iter().zip(seen).any(|(a, b)| a.abs_diff(b) > max_off) {
                let at = mix(places);
                most = most.max(places.iter().map(|p| p.distance(at)).fold(f32::INFINITY, f32::min));
            }
        }
    }
    most
}

/// Weights of the corners inside a triangle.
fn lattice() -> impl Iterator<Item = [f32; 3]> {
    let at = |i: u32, j: u32| {
        let (a, b) = ((i as f32 + 1.0 / 3.0) / STEPS as f32, (j as f32 + 1.0 / 3.0) / STEPS as f32);
        [a, b, 1.0 - a - b]
    };
    (0..STEPS).flat_map(move |i| (0..STEPS - i).map(move |j| at(i, j)))
}
