//! The nearest point of a surface.

use glam::{DVec3, Vec3};

use super::TriangleBvh;

/// The point of a surface that is nearest to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: Vec3,
    /// How far it is.
    pub distance: f32,
    /// The triangle it is on, as it was given.
    pub triangle: u32,
    /// Weights of that triangle's vertices, not negative, together 1.
    pub weights: [f32; 3],
}

impl TriangleBvh {
    /// The point of the surface nearest to `p`, at most `distance` away; of equally near ones that on the lowest triangle.
    pub fn closest_point(&self, p: Vec3, distance: f32) -> Option<Nearest> {
        let mut best: Option<(f64, Nearest)> = None;
        let reach = f64::from(distance);
        self.tree.around(p, distance * distance, &mut |run, limit| {
            for i in run {
                let v = self.triangles[i as usize].vertices().map(|v| v.as_dvec3());
                let (q, weights) = nearest_on_triangle(p.as_dvec3(), v);
                let d2 = q.distance_squared(p.as_dvec3());
                let triangle = self.tree.order[i as usize];
                let wins = best.is_none_or(|(b, n)| d2 < b || d2 == b && triangle < n.triangle);
                if wins && d2 <= reach * reach {
                    *limit = (d2 as f32).next_up();
                    let weights = weights.map(|w| w as f32);
                    best = Some((d2, Nearest { point: q.as_vec3(), distance: d2.sqrt() as f32, triangle, weights }));
                }
            }
        });
        best.map(|(_, n)| n)
    }
}

/// The point of a triangle nearest to `p` and its weights: the foot of the perpendicular where that lies inside, else the nearest
/// point of the three sides. Triangles without area are their sides.
pub fn nearest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> (DVec3, [f64; 3]) {
    let n = (b - a).cross(c - a);
    let n2 = n.length_squared();
    if n2 > 0.0 && n2.is_finite() {
        // Twice the signed areas that the foot spans with the sides, over twice the triangle's: its weights.
        let w = [(c - b).cross(p - b), (a - c).cross(p - c), (b - a).cross(p - a)].map(|e| e.dot(n) / n2);
        if w.iter().all(|&w| w >= 0.0) {
            let sum = w[0] + w[1] + w[2];
            let w = w.map(|w| w / sum);
            return (a * w[0] + b * w[1] + c * w[2], w);
        }
    }
    let side = |from: DVec3, to: DVec3| {
        let d = to - from;
        let t = ((p - from).dot(d) / d.length_squared()).clamp(0.0, 1.0);
        let t = if t.is_nan() { 0.0 } else { t };
        (from + d * t, t)
    };
    let ((ab, s), (bc, t), (ca, u)) = (side(a, b), side(b, c), side(c, a));
    [(ab, [1.0 - s, s, 0.0]), (bc, [0.0, 1.0 - t, t]), (ca, [u, 0.0, 1.0 - u])]
        .into_iter()
        .reduce(|x, y| if y.0.distance_squared(p) < x.0.distance_squared(p) { y } else { x })
        .unwrap_or((a, [1.0, 0.0, 0.0]))
}
