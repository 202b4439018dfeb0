//! Regions: the sets of viewpoints that cells stand for.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::Aabb;

/// A convex set of viewpoints in the local frame. A closed list, because far fields ask different things of it: a support
/// function (regional back-face culling), the distance to a box, a footprint polygon, samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Region {
    /// Any viewpoint.
    Everywhere,
    /// A convex polygon (x, z) over a range of heights.
    Prism {
        /// Corners, counter-clockwise in (x, z).
        polygon: Vec<[f32; 2]>,
        /// Lowest and highest eye.
        y: [f32; 2],
    },
    /// A ball.
    Sphere {
        /// Its centre.
        centre: Vec3,
        /// Its radius, scene units.
        radius: f32,
    },
    /// An axis-aligned box.
    Box(Aabb),
}

impl Region {
    /// max over the region of dir . p. A triangle with normal n through x is back-facing to the whole region exactly
    /// when support(n) <= n . x.
    pub fn support(&self, dir: Vec3) -> f32 {
        match self {
            Self::Everywhere => f32::INFINITY,
            Self::Sphere { centre, radius } => centre.dot(dir) + radius * dir.length(),
            Self::Box(b) => dir.max(Vec3::ZERO).dot(b.max) + dir.min(Vec3::ZERO).dot(b.min),
            Self::Prism { polygon, y } => {
                let flat = polygon.iter().map(|p| p[0] * dir.x + p[1] * dir.z).fold(f32::NEG_INFINITY, f32::max);
                flat + (dir.y * y[0]).max(dir.y * y[1])
            }
        }
    }

    /// Whether `p` is one of its viewpoints, its border included.
    pub fn contains(&self, p: Vec3) -> bool {
        self.distance(&Aabb { min: p, max: p }) <= 0.0
    }

    /// The least distance between a viewpoint and a point of the box; 0 where they meet.
    pub fn distance(&self, b: &Aabb) -> f32 {
        match self {
            Self::Everywhere => 0.0,
            Self::Sphere { centre, radius } => (b.distance(*centre) - radius).max(0.0),
            Self::Box(r) => (b.min - r.max).max(r.min - b.max).max(Vec3::ZERO).length(),
            Self::Prism { polygon, y } => {
                let dy = (b.min.y - y[1]).max(y[0] - b.max.y).max(0.0);
                polygon_to_rectangle(polygon, b).hypot(dy)
            }
        }
    }

    /// The corners of its outline seen from above (x, z), counter-clockwise; empty where it has no bound. A ball gives the
    /// 32-gon around it.
    pub fn footprint(&self) -> Vec<[f32; 2]> {
        match self {
            Self::Everywhere => vec![],
            Self::Prism { polygon, .. } => polygon.clone(),
            Self::Box(b) => vec![[b.min.x, b.min.z], [b.max.x, b.min.z], [b.max.x, b.max.z], [b.min.x, b.max.z]],
            Self::Sphere { centre, radius } => {
                let r = radius / (std::f32::consts::PI / 32.0).cos();
                (0..32)
                    .map(|k| (k as f32 * std::f32::consts::TAU / 32.0).sin_cos())
                    .map(|(s, c)| [centre.x + r * c, centre.z + r * s])
                    .collect()
            }
        }
    }

    /// Extreme viewpoints whose convex hull holds the region; `None` where it has no bound. Exact for boxes and prisms;
    /// a ball gives the corners of its box.
    pub fn corners(&self) -> Option<Vec<Vec3>> {
        match self {
            Self::Everywhere => None,
            Self::Prism { polygon, y } => {
                Some(y.iter().flat_map(|&y| polygon.iter().map(move |p| Vec3::new(p[0], y, p[1]))).collect())
            }
            Self::Sphere { centre, radius } => {
                let r = Vec3::splat(*radius);
                Some(Aabb { min: *centre - r, max: *centre + r }.corners().to_vec())
            }
            Self::Box(b) => Some(b.corners().to_vec()),
        }
    }

    /// A point brought into a ball; what bounds a ball from outside (its footprint, its corners) stands a little beside it. Boxes and
    /// prisms hold their own corners: the point itself.
    pub fn brought_in(&self, p: Vec3) -> Vec3 {
        match self {
            Self::Sphere { centre, radius } => *centre + (p - *centre).clamp_length_max(*radius),
            _ => p,
        }
    }

    /// A viewpoint from three numbers in 0..1, uniformly spread where they are; `None` where it has no bound.
    pub fn sample(&self, u: [f32; 3]) -> Option<Vec3> {
        match self {
            Self::Everywhere => None,
            Self::Box(b) => Some(b.min + b.size() * Vec3::from(u)),
            Self::Sphere { centre, radius } => {
                let (z, (s, c)) = (1.0 - 2.0 * u[0], (std::f32::consts::TAU * u[1]).sin_cos());
                let flat = (1.0 - z * z).max(0.0).sqrt();
                Some(*centre + Vec3::new(flat * c, z, flat * s) * (radius * u[2].cbrt()))
            }
            Self::Prism { polygon, y } => {
                let p = sample_polygon(polygon, u[0], u[1]);
                Some(Vec3::new(p.x, y[0] + (y[1] - y[0]) * u[2], p.y))
            }
        }
    }
}

/// A uniform point of a convex polygon: a triangle of its fan by area, then a point in it.
fn sample_polygon(polygon: &[[f32; 2]], u: f32, v: f32) -> Vec2 {
    let at = |i: usize| Vec2::from(polygon[i]);
    let area = |i: usize| (at(i) - at(0)).perp_dot(at(i + 1) - at(0)).abs();
    let total: f32 = (1..polygon.len() - 1).map(area).sum();
    let mut left = u * total;
    for i in 1..polygon.len() - 1 {
        let a = area(i);
        if left <= a || i + 2 == polygon.len() {
            let s = (left / a.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0).sqrt();
            return at(0) * (1.0 - s) + (at(i) * (1.0 - v) + at(i + 1) * v) * s;
        }
        left -= a;
    }
    at(0)
}

/// Distance in the plane between a convex polygon and a box's footprint; 0 where they meet.
fn polygon_to_rectangle(polygon: &[[f32; 2]], b: &Aabb) -> f32 {
    let rect = [[b.min.x, b.min.z], [b.max.x, b.min.z], [b.max.x, b.max.z], [b.min.x, b.max.z]].map(Vec2::from);
    let poly: Vec<Vec2> = polygon.iter().map(|&p| Vec2::from(p)).collect();
    if poly.iter().any(|p| p.cmpge(rect[0]).all() && p.cmple(rect[2]).all()) || inside(&poly, rect[0]) {
        return 0.0;
    }
    let mut best = f32::INFINITY;
    for (p0, p1) in edges(&poly) {
        for (r0, r1) in edges(&rect) {
            if cross(p0, p1, r0, r1) {
                return 0.0;
            }
            let d = to_segment(p0, r0, r1).min(to_segment(p1, r0, r1)).min(to_segment(r0, p0, p1));
            best = best.min(d);
        }
    }
    best
}

fn edges(p: &[Vec2]) -> impl Iterator<Item = (Vec2, Vec2)> + '_ {
    (0..p.len()).map(|i| (p[i], p[(i + 1) % p.len()]))
}

fn inside(poly: &[Vec2], p: Vec2) -> bool {
    let side = |(a, b): (Vec2, Vec2)| (b - a).perp_dot(p - a);
    edges(poly).all(|e| side(e) >= 0.0) || edges(poly).all(|e| side(e) <= 0.0)
}

fn cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

fn to_segment(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let d = b - a;
    let t = ((p - a).dot(d) / d.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(a + d * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hexagon() -> Region {
        let polygon = (0..6).map(|k| (k as f32 * std::f32::consts::FRAC_PI_3).sin_cos()).map(|(s, c)| [c, s]).collect();
        Region::Prism { polygon, y: [1.0, 2.0] }
    }

    proptest! {
        #[test]
        fn samples_lie_in_the_region_and_under_its_support(
            u in [0f32..1.0, 0f32..1.0, 0f32..1.0], d in [-1f32..1.0, -1f32..1.0, -1f32..1.0]
        ) {
            let shapes = [
                hexagon(),
                Region::Sphere { centre: Vec3::ONE, radius: 3.0 },
                Region::Box(Aabb { min: -Vec3::ONE, max: Vec3::new(1.0, 2.0, 3.0) }),
            ];
            for r in shapes {
                let p = r.sample(u).unwrap();
                prop_assert!(r.distance(&Aabb::of([p])) < 1e-5);
                prop_assert!(r.support(Vec3::from(d)) >= p.dot(Vec3::from(d)) - 1e-5);
            }
        }

        #[test]
        fn the_distance_is_what_dense_samples_find(c in [-4f32..4.0, -1f32..4.0, -4f32..4.0], s in 0.01f32..1.5) {
            let (r, c) = (hexagon(), Vec3::from(c));
            let b = Aabb { min: c - s, max: c + s };
            let mut nearest = f32::INFINITY;
            for i in 0..20 { for j in 0..20 { for k in 0..5 {
                let p = r.sample([i as f32 / 19.0, j as f32 / 19.0, k as f32 / 4.0]).unwrap();
                nearest = nearest.min(b.distance(p));
            }}}
            let d = r.distance(&b);
            prop_assert!(d <= nearest + 1e-4 && d > nearest - 0.2, "{d} against {nearest}");
        }
    }
}
