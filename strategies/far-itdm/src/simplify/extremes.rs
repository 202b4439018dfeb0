//! What a move of the surface is worth in pixels, from the extreme viewpoints of a region.
//!
//! A point p that moves by d is seen to move, from a viewpoint W with r = (p - W) / |p - W|, by
//!
//! ```text
//! |d - (d . r) r| / |p - W| * q    pixels,  q = pixels a unit of tangent
//! ```
//!
//! and the most over the extreme viewpoints counts: the corners of the region's outline, and the sample's own eye. A move along the
//! line from the sample shows only to eyes beside it.

use glam::Vec3;

use crate::dense::Dense;

/// The viewpoints, relative to the sample's eye.
#[derive(Clone, Debug)]
pub(crate) struct Extremes {
    pub(crate) eyes: Vec<Vec3>,
    pub(crate) px_per_tan: f32,
}

impl Extremes {
    /// How far a move at `p` along the unit vector `n` is seen, pixels a scene unit.
    pub(crate) fn along(&self, p: Vec3, n: Vec3) -> f32 {
        let seen = |w: &Vec3| {
            let v = p - w;
            let length = v.length().max(f32::MIN_POSITIVE);
            let across = (1.0 - (n.dot(v) / length).powi(2)).max(0.0).sqrt();
            across / length
        };
        self.eyes.iter().map(seen).fold(0.0, f32::max) * self.px_per_tan
    }

    /// How far a move at `p` by `d` is seen, pixels.
    pub(crate) fn moved(&self, p: Vec3, d: Vec3) -> f32 {
        let length = d.length();
        if length > 0.0 { self.along(p, d / length) * length } else { 0.0 }
    }

    /// For each vertex whether some of its triangles face an extreme viewpoint while others turn away from it.
    pub(crate) fn silhouettes(&self, mesh: &Dense) -> Vec<bool> {
        let mut out = vec![false; mesh.positions.len()];
        let (mut faces, mut turns) = (vec![false; out.len()], vec![false; out.len()]);
        for w in &self.eyes {
            faces.fill(false);
            turns.fill(false);
            for t in mesh.indices.as_chunks::<3>().0 {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                let to = if (b - a).cross(c - a).dot(w - a) > 0.0 { &mut faces } else { &mut turns };
                t.iter().for_each(|&v| to[v as usize] = true);
            }
            out.iter_mut().zip(faces.iter().zip(&turns)).for_each(|(o, (f, t))| *o |= f & t);
        }
        out
    }
}
