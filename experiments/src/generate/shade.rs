//! Vertex colours of the statues: a stone or bronze base, dark in the cavities and near the ground, mottled by noise.
//!
//! A cavity is found as Evans 2006 ("Fast Approximations for Global Illumination") finds occlusion in a distance field: along
//! the normal the distance grows less than the way gone where something is in front. O(4) distances a vertex.

use glam::Vec3;

use super::noise::fbm;
use super::sdf::Solid;

/// Base colours of a material, sRGB 0..1.
pub(super) struct Palette {
    /// Where light reaches.
    pub(super) light: Vec3,
    /// In folds.
    pub(super) cavity: Vec3,
    /// Blotches: verdigris, lichen, soot.
    pub(super) patina: Vec3,
    /// Share of patina, 0..1.
    pub(super) patina_share: f32,
}

/// Colour of the point `p` of a sculpture of height `height` that stands on y = `ground`.
pub(super) fn color(
    solid: &Solid,
    palette: &Palette,
    p: Vec3,
    normal: Vec3,
    (ground, height): (f32, f32),
    seed: u32,
) -> [u8; 4] {
    let mut open = 1.0;
    for (step, weight) in [(0.01, 0.5), (0.025, 0.5), (0.06, 0.45), (0.12, 0.35)] {
        let reach = step * height;
        open -= weight * (1.0 - (solid.distance(p + normal * reach) / reach).clamp(0.0, 1.0));
    }
    let open = open.clamp(0.0, 1.0);
    let mottle = fbm(p, 0.18 * height, 5, solid.detail(), seed ^ 0x51ed);
    let streak = fbm(Vec3::new(p.x, 0.25 * p.y, p.z), 0.06 * height, 3, solid.detail(), seed ^ 0x77a1);
    let blotch = ((fbm(p, 0.3 * height, 4, solid.detail(), seed ^ 0x0c0de) * 2.5 + 0.5).clamp(0.0, 1.0)
        + 0.6 * (1.0 - open))
        * palette.patina_share;
    let low = 1.0 - ((p.y - ground) / (0.12 * height)).clamp(0.0, 1.0);
    let mut c = palette.cavity.lerp(palette.light, open);
    c = c.lerp(palette.patina, blotch.clamp(0.0, 1.0));
    c *= 1.0 + 0.16 * mottle + 0.12 * streak - 0.18 * low + 0.05 * normal.y;
    let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    [byte(c.x), byte(c.y), byte(c.z), 255]
}
