//! Texels: bilinear look-ups with texel centres at halves, colours mixed in linear light.

use std::sync::LazyLock;

use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::payload::{AtlasPart, Projector};
use farfield_core::scene::Texture;
use glam::{Vec2, Vec3};

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| linear_of_byte(i as u8)));

/// `EDGES[i]` is the least linear value whose byte is i + 1, so that encoding is a search and not a power.
static EDGES: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        // Bit patterns of positive numbers are in the numbers' order: halve between 0 and 1.
        let (mut low, mut high) = (0u32, 1f32.to_bits());
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if usize::from(byte_of_linear(f32::from_bits(middle))) > i { high = middle } else { low = middle }
        }
        f32::from_bits(high)
    })
});

/// sRGB bytes in linear light.
pub(crate) fn decode(c: [u8; 4]) -> Vec3 {
    let table = &*LINEAR;
    Vec3::new(table[usize::from(c[0])], table[usize::from(c[1])], table[usize::from(c[2])])
}

/// Linear light as opaque sRGB bytes: what [`byte_of_linear`] gives, without the power.
pub(crate) fn encode(c: Vec3) -> [u8; 4] {
    let edges = &*EDGES;
    let byte = |v: f32| edges.partition_point(|&e| e <= v) as u8;
    [byte(c.x), byte(c.y), byte(c.z), 255]
}

/// The four texels around a point in texels and their weights; `wrap` maps a texel number to one that is there.
fn corners(at: Vec2, size: [u32; 2], wrap: impl Fn(i64, u32) -> usize) -> [(usize, f32); 4] {
    let at = at - 0.5;
    let low = at.floor();
    let f = at - low;
    let (x, y) = (low.x as i64, low.y as i64);
    let (x0, x1) = (wrap(x, size[0]), wrap(x.saturating_add(1), size[0]));
    let (y0, y1) = (wrap(y, size[1]), wrap(y.saturating_add(1), size[1]));
    let w = size[0] as usize;
    [
        (y0 * w + x0, (1.0 - f.x) * (1.0 - f.y)),
        (y0 * w + x1, f.x * (1.0 - f.y)),
        (y1 * w + x0, (1.0 - f.x) * f.y),
        (y1 * w + x1, f.x * f.y),
    ]
}

/// A texture's linear colour at `uv`, repeated outside 0..1. A texture without texels is white.
pub(crate) fn texture(t: &Texture, uv: Vec2) -> Vec3 {
    if t.rgba.len() < t.size[0] as usize * t.size[1] as usize || t.size.contains(&0) {
        return Vec3::ONE;
    }
    // The fraction first: numbers of repeats would take bits from the texel.
    let uv = (uv - uv.floor()) * Vec2::new(t.size[0] as f32, t.size[1] as f32);
    let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
    let repeat = |i: i64, n: u32| i.rem_euclid(i64::from(n)) as usize;
    corners(uv, t.size, repeat).iter().fold(Vec3::ZERO, |sum, &(i, w)| sum + decode(t.rgba[i]) * w)
}

/// The linear albedo and the (not normalised) normal that a projector throws on a point relative to its payload's origin.
pub(crate) fn projected(atlas: &AtlasPart, p: &Projector, point: Vec3) -> (Vec3, Vec3) {
    let q = p.matrix * point.extend(1.0);
    let [x, y, w, h] = p.rect.map(|v| v as f32);
    // f32::max and min drop what is not a number, so that a point without an image takes the rectangle's corner.
    let u = (q.x / q.w).max(x + 0.5).min(x + w - 0.5);
    let v = (q.y / q.w).max(y + 0.5).min(y + h - 0.5);
    let clamp = |i: i64, n: u32| i.clamp(0, i64::from(n) - 1) as usize;
    let layer = p.layer as usize * atlas.size[0] as usize * atlas.size[1] as usize;
    let mut sum = (Vec3::ZERO, Vec3::ZERO);
    for (i, w) in corners(Vec2::new(u, v), atlas.size, clamp) {
        let n = atlas.normal[layer + i];
        sum.0 += decode(atlas.albedo[layer + i]) * w;
        sum.1 += Vec3::new(f32::from(n[0]), f32::from(n[1]), f32::from(n[2])) * w;
    }
    (sum.0, sum.1 * (2.0 / 255.0) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_by_search_is_encoding_by_formula() {
        for i in 0..=200_000u32 {
            let v = i as f32 / 190_000.0 - 0.01;
            assert_eq!(encode(Vec3::splat(v))[0], byte_of_linear(v), "{v}");
        }
        for b in 0..=255 {
            assert_eq!(encode(decode([b; 4])), [b, b, b, 255]);
        }
        assert_eq!(encode(Vec3::NAN)[0], byte_of_linear(f32::NAN));
    }

    #[test]
    fn a_texture_repeats_and_mixes_linear_light() {
        let t = Texture { name: String::new(), size: [2, 1], rgba: vec![[0, 0, 0, 255], [255, 255, 255, 255]] };
        let at = |u: f32| texture(&t, Vec2::new(u, 0.3)).x;
        assert_eq!([at(0.25), at(0.75), at(0.5), at(0.0), at(-0.25), at(7.25)], [0.0, 1.0, 0.5, 0.5, 1.0, 0.0]);
        assert!(at(f32::NAN).is_finite() && at(1e30).is_finite());
    }
}
