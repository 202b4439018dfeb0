//! The solid angle of a pixel.
//!
//! The paper adds the interior angles of a spherical quadrilateral and takes 2 pi away (Wilson and Manocha 2003, section 3.3.5): for a
//! pixel of 1e-6 sr that is the difference of numbers near 6, and all but a few digits are lost. Here the rectangle is two triangles,
//! each by Van Oosterom and Strackee (1983): with a, b, c the vectors to its corners
//!
//! ```text
//! tan(omega / 2) = |a . (b x c)| / (|a| |b| |c| + (a . b) |c| + (b . c) |a| + (c . a) |b|)
//! ```
//!
//! On the plane z = 1, a rectangle of dx by dy has a . (b x c) = dx dy: nothing cancels, at any size.

use crate::Camera;

/// The solid angle of the pixel (x, y) of a camera, steradians; relative error below 1e-12 for pixels under a radian.
pub fn pixel_solid_angle_sr(camera: &Camera, x: u32, y: u32) -> f64 {
    let [w, h] = camera.size.map(f64::from);
    let (left, top) = (f64::from(camera.left), f64::from(camera.top));
    let dx = (f64::from(camera.right_tan) - left) / w;
    let dy = (top - f64::from(camera.bottom)) / h;
    let (x0, y0) = (left + f64::from(x) * dx, top - f64::from(y) * dy);
    let (x1, y1) = (x0 + dx, y0 - dy);
    let (a, b, c, d) = ([x0, y0], [x1, y0], [x1, y1], [x0, y1]);
    right_triangle(dx * dy, a, b, c) + right_triangle(dx * dy, a, c, d)
}

/// A triangle on the plane z = 1 whose corners have the triple product `volume`, steradians.
fn right_triangle(volume: f64, a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let dot = |p: [f64; 2], q: [f64; 2]| p[0] * q[0] + p[1] * q[1] + 1.0;
    let length = |p: [f64; 2]| dot(p, p).sqrt();
    let (la, lb, lc) = (length(a), length(b), length(c));
    2.0 * volume.atan2(la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    /// The paper's formula, in 64 bits.
    fn by_angles(c: &Camera, x: u32, y: u32) -> f64 {
        let ray = |dx: u32, dy: u32| {
            let t = |lo: f32, hi: f32, n: u32, i: u32| {
                f64::from(lo) + (f64::from(hi) - f64::from(lo)) * f64::from(i) / f64::from(n)
            };
            let (u, v) = (t(c.left, c.right_tan, c.size[0], x + dx), t(c.top, c.bottom, c.size[1], y + dy));
            (c.forward.as_dvec3() + c.right.as_dvec3() * u + c.up.as_dvec3() * v).normalize()
        };
        let p: [DVec3; 4] = [ray(0, 0), ray(1, 0), ray(1, 1), ray(0, 1)];
        let angle = |i: usize| {
            let (at, next, last) = (p[i], p[(i + 1) % 4], p[(i + 3) % 4]);
            at.cross(next).angle_between(at.cross(last))
        };
        (0..4).map(angle).sum::<f64>() - 2.0 * std::f64::consts::PI
    }

    #[test]
    fn the_pixels_of_a_cube_are_the_whole_sphere() {
        for n in [1, 2, 7, 64, 512] {
            let sum: f64 = Camera::cube(DVec3::ZERO, n, 0.1)
                .iter()
                .flat_map(|c| (0..n * n).map(|i| pixel_solid_angle_sr(c, i % n, i / n)))
                .sum();
            assert!((sum / (4.0 * std::f64::consts::PI) - 1.0).abs() < 3e-7, "{n}: {sum}");
        }
    }

    #[test]
    fn a_small_pixel_is_its_area_over_the_cube_of_its_distance() {
        let c = Camera::cube(DVec3::ZERO, 1 << 20, 0.1)[0];
        let edge = 2.0 / f64::from(1 << 20);
        for (x, y) in [(1 << 19, 1 << 19), (5, 7), (1 << 18, 1000)] {
            let t = |i: u32| (f64::from(i) + 0.5) * edge - 1.0;
            let expected = edge * edge / (1.0 + t(x) * t(x) + t(y) * t(y)).powf(1.5);
            let found = pixel_solid_angle_sr(&c, x, y);
            assert!((found / expected - 1.0).abs() < 1e-6, "{x} {y}: {found} against {expected}");
        }
    }

    #[test]
    fn a_large_pixel_has_the_angle_sum_of_the_paper_and_a_tiny_one_has_its_area() {
        let mut c = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.2, [5, 4], 0.1);
        c.left *= 1.5;
        for (x, y) in [(0, 0), (2, 1), (4, 3)] {
            assert!((by_angles(&c, x, y) / pixel_solid_angle_sr(&c, x, y) - 1.0).abs() < 1e-9);
        }
        // 1e-6 radians wide, straight ahead: dx dy, to within 1e-12.
        (c.left, c.right_tan, c.bottom, c.top, c.size) = (-1e-6, 1e-6, -1e-6, 1e-6, [2, 2]);
        let exact = f64::from(1e-6f32).powi(2);
        assert!((pixel_solid_angle_sr(&c, 0, 0) / exact - 1.0).abs() < 1e-11);
        let cancelled = (by_angles(&c, 0, 0) / exact - 1.0).abs();
        assert!(cancelled > 1e-6, "the angle sum had not lost its digits: {cancelled}");
    }
}
