//! A route: a closed way that a scene brings along, walked like a tour.
//!
//! For scenes whose free space is not between boxes: a walk through the rooms of a house, along the gangways of a plant. Corners are
//! rounded by quadratic Bezier curves, which stay in the triangle of the corner and its two ends: a route whose corners'
//! triangles are free is free. O(points + frames).

use glam::DVec2;

use super::{PathJob, walk};
use crate::{Camera, Fault};

/// Chords of a rounded corner.
const CHORDS: usize = 12;
/// Most that a corner takes of a leg; two corners share it.
const SHARE: f64 = 0.45;

/// Walks a closed route of points (x, z), local frame, at eye height and pitch, within the limits of speed and turn. Corners are
/// rounded from at most `rounding` scene units before them.
///
/// # Errors
/// [`Fault::Refused`] where there are fewer than three points, or one is not finite or repeats the one before it.
pub fn route(job: &PathJob<'_>, points: &[DVec2], rounding: f64) -> Result<Vec<Camera>, Fault> {
    let n = points.len();
    if n < 3 {
        return Err(Fault::Refused(format!("a route needs at least three points, not {n}")));
    }
    if let Some(i) = (0..n).find(|&i| !points[i].is_finite() || points[i] == points[(i + n - 1) % n]) {
        return Err(Fault::Refused(format!("point {i} of the route is not finite, or is the one before it")));
    }
    Ok(walk(job, &rounded(points, rounding)))
}

/// The closed polyline with its corners rounded.
fn rounded(points: &[DVec2], rounding: f64) -> Vec<DVec2> {
    let n = points.len();
    let mut out = Vec::with_capacity(n * (CHORDS + 1));
    for i in 0..n {
        let (a, b, c) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
        let cut = rounding.min(SHARE * a.distance(b)).min(SHARE * b.distance(c));
        let (from, to) = (b + (a - b).normalize() * cut, b + (c - b).normalize() * cut);
        for k in 0..=CHORDS {
            let t = k as f64 / CHORDS as f64;
            // B(t) = (1 - t)^2 from + 2 t (1 - t) b + t^2 to.
            out.push(from * ((1.0 - t) * (1.0 - t)) + b * (2.0 * t * (1.0 - t)) + to * (t * t));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, Vec3};

    use super::*;
    use crate::Aabb;
    use crate::camera::ViewModel;

    fn views() -> ViewModel {
        ViewModel {
            fov_y_rad: 1.0,
            resolution: [64, 64],
            near: 0.01,
            eye_height: [1.6, 1.6],
            pitch_rad: [0.0, 0.0],
            max_speed: 1.0,
            max_turn_rad: 60f32.to_radians(),
        }
    }

    fn job(views: &ViewModel) -> PathJob<'_> {
        let bounds = Aabb { min: Vec3::ZERO, max: Vec3::splat(10.0) };
        PathJob { bounds, obstacles: &[], views, frames_per_s: 10.0, frames: 600, seed: 1 }
    }

    fn l_shape() -> Vec<DVec2> {
        [(1.0, 1.0), (9.0, 1.0), (9.0, 5.0), (5.0, 5.0), (5.0, 9.0), (1.0, 9.0)].map(|(x, z)| DVec2::new(x, z)).to_vec()
    }

    /// The distance of a point from the closed polyline, leg by leg.
    fn off(points: &[DVec2], p: DVec2) -> f64 {
        let leg = |i: usize| {
            let (a, d) = (points[i], points[(i + 1) % points.len()] - points[i]);
            p.distance(a + d * ((p - a).dot(d) / d.length_squared()).clamp(0.0, 1.0))
        };
        (0..points.len()).map(leg).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_route_is_followed_within_the_limits_and_comes_back() {
        let (views, points) = (views(), l_shape());
        let path = route(&job(&views), &points, 0.6).unwrap();
        let flat = |c: &Camera| DVec2::new(c.eye.x, c.eye.z);
        // A Bezier corner of a right angle leaves the legs by at most rounding / (2 sqrt 2).
        assert!(path.iter().all(|c| off(&points, flat(c)) <= 0.6 / 8f64.sqrt() + 1e-6 && (c.eye.y - 1.6).abs() < 1e-6));
        for w in path.windows(2) {
            assert!(w[0].eye.distance(w[1].eye) <= 0.1 + 1e-6);
            let turn = w[0].forward.angle_between(w[1].forward);
            assert!(turn <= 6f32.to_radians() * 1.001, "{} degrees", turn.to_degrees());
        }
        for p in &points {
            assert!(path.iter().any(|c| flat(c).distance(*p) < 0.4), "it does not come by {p}");
        }
        assert!(path[300..].iter().any(|c| c.eye.distance(path[0].eye) < 0.2), "it is closed");
    }

    #[test]
    fn routes_that_are_none_are_refused() {
        let views = views();
        let text = |p: &[DVec2]| route(&job(&views), p, 0.5).unwrap_err().to_string();
        assert!(text(&l_shape()[..2]).contains("three points"));
        let mut twice = l_shape();
        twice[2] = twice[1];
        assert!(text(&twice).contains("point 2"));
        twice[2].x = f64::NAN;
        assert!(text(&twice).contains("point 2"));
    }
}
