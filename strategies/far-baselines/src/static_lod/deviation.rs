//! How far a level of detail is off, scene units: its *deviation* from the original in both directions, and how far colours lie
//! from their places.
//!
//! **Original to level: a bound.** The distance to a triangle is a convex function, so over a part of an original triangle it is
//! nowhere larger than at the part's corners; the distance to the level is at most that to any one of its triangles. The
//! part's bound is the least over the level's triangles that are nearest to its corners; where that is more than [`SLACK`] above the
//! largest distance already met, the part is quartered (branch and bound, as in Tang, Lee and Kim, *Interactive Hausdorff
//! distance computation for general polygonal models*, 2009). At [`MAX_DEPTH`] the bound stands as it is: still one, at most 1/64 of
//! an original edge too large (on flat walls, where the distance is 0, that is what is left).
//!
//! **Level to original: the largest sampled distance**, on a lattice in each of the level's triangles as fine as the original's mean
//! edge: bounding it the same way would cost the level's area over its squared error.
//!
//! **Colour.** A level has colours at its vertices only. Where the original's albedo (its texture included) and the level's at the
//! nearest point differ by more than a setting in some channel, colours are right again at the level's vertices: the distance to the
//! nearest corner of that triangle counts as the deviation there. Sampled at the original's vertices and on a lattice inside its
//! textured triangles.
//!
//! O((n + m) log m) for n original triangles and m of the level.

use farfield_core::bvh::{TriangleBvh, nearest_on_triangle};
use farfield_core::color::{byte_of_linear, linear_of_byte};
use farfield_core::scene::{Gathered, Texture, Textured, texture_at};
use glam::Vec3;

/// How far a bound may stand above what was met before it is made better.
const SLACK: f32 = 1.05;
/// Quarterings of an original triangle: 64 parts an edge.
const MAX_DEPTH: u32 = 6;
/// Bounds are not made better than this, in sizes of the object: it is under a pixel while the object spans fewer than 10,000.
const FINE: f32 = 1e-4;
/// Rounding of positions and distances, in sizes of the object.
const ROUNDING: f32 = 1e-6;
/// Samples along an edge at most, of a level's triangle and of a textured one.
const MOST_SAMPLES: f32 = 64.0;
/// Samples of a texture across the whole object: finer detail is under a pixel once the object fills that many pixels.
const TEXTURE_SAMPLES: f32 = 64.0;

/// An object to compare levels with.
pub(super) struct Original<'a> {
    source: &'a Gathered,
    textures: &'a [Texture],
    bvh: TriangleBvh,
    /// Vertices that triangles use, each with one of its wedges after the other.
    used: Vec<(u32, Vec<u32>)>,
    mean_edge: f32,
    size: f32,
}

/// A level as points are compared with it.
struct Target<'a> {
    bvh: TriangleBvh,
    corners: &'a [[u32; 3]],
    source: &'a Gathered,
}

/// A point with its nearest triangle.
#[derive(Clone, Copy)]
struct Met {
    point: Vec3,
    triangle: u32,
    distance: f32,
    weights: [f32; 3],
}

impl<'a> Original<'a> {
    /// Its hierarchy. O(n log n).
    pub(super) fn new(source: &'a Gathered, textures: &'a [Texture]) -> Self {
        let mut wedges: Vec<Vec<u32>> = vec![vec![]; source.positions.len()];
        let mut used = vec![false; source.wedges.len()];
        source.corners.iter().flatten().for_each(|&w| used[w as usize] = true);
        for w in (0..source.wedges.len()).filter(|&w| used[w]) {
            wedges[source.wedges[w].vertex as usize].push(w as u32);
        }
        let used = (0u32..).zip(wedges).filter(|(_, w)| !w.is_empty()).collect();
        let edge = |c: &[u32; 3]| longest_edge(source.places(*c));
        let edges: f64 = source.corners.iter().map(edge).filter(|e| e.is_finite()).map(f64::from).sum();
        let bvh = built(source, &source.corners);
        Self {
            size: bvh.bounds().map_or(0.0, |b| b.size().length()),
            mean_edge: (edges / source.corners.len().max(1) as f64) as f32,
            source,
            textures,
            bvh,
            used,
        }
    }

    /// The deviation of a level: a wedge a corner. `max_off` is the difference of albedo that does not count, grey levels.
    pub(super) fn deviation(&self, level: &[[u32; 3]], max_off: u8) -> f32 {
        let target = Target { bvh: built(self.source, level), corners: level, source: self.source };
        if self.bvh.is_empty() || target.bvh.is_empty() {
            return if self.bvh.is_empty() { 0.0 } else { self.size };
        }
        let mut met: Vec<Option<Met>> = vec![None; self.source.positions.len()];
        let mut colour = 0f32;
        for (v, wedges) in &self.used {
            met[*v as usize] = target.nearest(self.source.positions[*v as usize]);
            if let Some(m) = met[*v as usize] {
                let seen = target.albedo(&m);
                let off = |w: &u32| difference(self.source.wedges[*w as usize].albedo, seen);
                if wedges.iter().map(off).min() > Some(max_off) {
                    colour = colour.max(target.to_corner(&m));
                }
            }
        }
        let there = self.outwards(&target, &met);
        let back = self.inwards(level);
        let textured = self.source.textured.iter().map(|t| self.texture(&target, t, max_off)).fold(0.0, f32::max);
        there.max(back).max(colour).max(textured) + self.size * ROUNDING
    }

    /// The bound on the original's distances from the level.
    fn outwards(&self, target: &Target<'_>, met: &[Option<Met>]) -> f32 {
        let mut lower = met.iter().flatten().map(|m| m.distance).fold(0.0, f32::max);
        let mut upper = lower;
        let enough = |bound: f32, lower: f32| bound <= (lower * SLACK).max(self.size * FINE);
        let mut parts: Vec<([Met; 3], u32)> = vec![];
        for &c in &self.source.corners {
            let [Some(a), Some(b), Some(c)] = self.source.vertices(c).map(|v| met[v as usize]) else { continue };
            parts.push(([a, b, c], 0));
            while let Some((m, depth)) = parts.pop() {
                let bound = target.bound(&m);
                if enough(bound, lower) || depth == MAX_DEPTH {
                    upper = upper.max(bound);
                    continue;
                }
                let middle = |i: usize, j: usize| target.nearest((m[i].point + m[j].point) * 0.5);
                let (Some(ab), Some(bc), Some(ca)) = (middle(0, 1), middle(1, 2), middle(2, 0)) else { continue };
                lower = lower.max(ab.distance).max(bc.distance).max(ca.distance);
                parts.extend([[m[0], ab, ca], [ab, m[1], bc], [ca, bc, m[2]], [ab, bc, ca]].map(|p| (p, depth + 1)));
            }
        }
        upper.max(lower)
    }

    /// The level's largest sampled distance from the original.
    fn inwards(&self, level: &[[u32; 3]]) -> f32 {
        let mut most = 0f32;
        for &c in level {
            let p = self.source.places(c);
            if !p.iter().all(|p| p.is_finite()) {
                continue;
            }
            let k = steps(longest_edge(p) / self.mean_edge);
            for w in lattice(k) {
                let point = p[0] * w[0] + p[1] * w[1] + p[2] * w[2];
                most = most.max(self.bvh.closest_point(point, f32::INFINITY).map_or(0.0, |n| n.distance));
            }
        }
        most
    }

    /// What a textured triangle adds: how far the level's vertices are where its colours are missed.
    fn texture(&self, target: &Target<'_>, t: &Textured, max_off: u8) -> f32 {
        let p = self.source.places(self.source.corners[t.triangle as usize]);
        let Some(texture) = self.textures.get(t.texture as usize) else { return 0.0 };
        let mut most = 0f32;
        for w in insides(steps(longest_edge(p) * TEXTURE_SAMPLES / self.size)) {
            let mix = |v: [Vec3; 3]| v[0] * w[0] + v[1] * w[1] + v[2] * w[2];
            let uv = t.uv[0] * w[0] + t.uv[1] * w[1] + t.uv[2] * w[2];
            let [r, g, b] = (mix(t.tint) * texture_at(texture, uv)).to_array().map(byte_of_linear);
            let Some(m) = target.nearest(mix(p)) else { continue };
            if difference([r, g, b, 255], target.albedo(&m)) > max_off {
                most = most.max(target.to_corner(&m));
            }
        }
        most
    }
}

impl Target<'_> {
    fn nearest(&self, point: Vec3) -> Option<Met> {
        let n = self.bvh.closest_point(point, f32::INFINITY)?;
        Some(Met { point, triangle: n.triangle, distance: n.distance, weights: n.weights })
    }

    /// How far a point is from the nearest corner of its triangle.
    fn to_corner(&self, m: &Met) -> f32 {
        let p = self.source.places(self.corners[m.triangle as usize]);
        p.iter().map(|c| c.distance(m.point)).fold(f32::INFINITY, f32::min)
    }

    /// No point between three is farther from the level than this.
    fn bound(&self, m: &[Met; 3]) -> f32 {
        let from = |t: u32| {
            let corners = self.source.places(self.corners[t as usize]).map(|p| p.as_dvec3());
            let distance = |p: &Met| {
                let p64 = p.point.as_dvec3();
                nearest_on_triangle(p64, corners).0.distance(p64) as f32
            };
            m.iter().map(distance).fold(0.0, f32::max)
        };
        from(m[0].triangle).min(from(m[1].triangle)).min(from(m[2].triangle))
    }

    fn albedo(&self, m: &Met) -> [u8; 4] {
        let of = |k: usize| self.source.wedges[self.corners[m.triangle as usize][k] as usize].albedo;
        let channel = |i: usize| (0..3).map(|k| linear_of_byte(of(k)[i]) * m.weights[k]).sum();
        let [r, g, b] = [0, 1, 2].map(|i| byte_of_linear(channel(i)));
        [r, g, b, 255]
    }
}

fn built(source: &Gathered, corners: &[[u32; 3]]) -> TriangleBvh {
    let indices: Vec<u32> = corners.iter().flat_map(|&c| source.vertices(c)).collect();
    TriangleBvh::build(&source.positions, &indices)
}

fn longest_edge(p: [Vec3; 3]) -> f32 {
    p[0].distance(p[1]).max(p[1].distance(p[2])).max(p[2].distance(p[0]))
}

fn difference(a: [u8; 4], b: [u8; 4]) -> u8 {
    a[0].abs_diff(b[0]).max(a[1].abs_diff(b[1])).max(a[2].abs_diff(b[2]))
}

/// Samples along an edge.
fn steps(wanted: f32) -> u32 {
    if wanted.is_finite() { wanted.ceil().clamp(1.0, MOST_SAMPLES) as u32 } else { 1 }
}

/// Weights of the corners at the points of a triangle's lattice of k steps an edge, its border included, and of its middle.
fn lattice(k: u32) -> impl Iterator<Item = [f32; 3]> {
    let at = move |i: u32, j: u32| [i, j, k - i - j].map(|n| n as f32 / k as f32);
    (0..=k).flat_map(move |i| (0..=k - i).map(move |j| at(i, j))).chain(std::iter::once([1.0 / 3.0; 3]))
}

/// The same inside it: no point lies on the border, where a seam's other side is as near.
fn insides(k: u32) -> impl Iterator<Item = [f32; 3]> {
    let at = move |i: u32, j: u32| {
        let (a, b) = ((i as f32 + 1.0 / 3.0) / k as f32, (j as f32 + 1.0 / 3.0) / k as f32);
        [a, b, 1.0 - a - b]
    };
    (0..k).flat_map(move |i| (0..k - i).map(move |j| at(i, j)))
}
