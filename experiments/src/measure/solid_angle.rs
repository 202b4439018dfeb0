//! The solid angle of a pixel, steradians.
//!
//! A pixel is two triangles on the picture plane one unit ahead. A triangle with corners a, b, c seen from the origin spans (van Oosterom
//! and Strackee 1983)
//!
//! ```text
//! tan(omega / 2) = a . (b x c) / (|a| |b| |c| + (a . b) |c| + (b . c) |a| + (c . a) |b|)
//! ```
//!
//! and a . (b x c) is twice its area on that plane: no difference of nearly equal numbers is taken, where "the sum of
//! angles minus 2 pi" loses everything for small pixels.

use farfield_core::Camera;
use glam::DVec3;

/// The solid angle of pixel (x, y) of a camera's picture, steradians.
pub(crate) fn pixel_solid_angle(camera: &Camera, x: u32, y: u32) -> f64 {
    let [w, h] = camera.size.map(f64::from);
    let (left, top) = (f64::from(camera.left), f64::from(camera.top));
    let (dx, dy) = ((f64::from(camera.right_tan) - left) / w, (top - f64::from(camera.bottom)) / h);
    let corner = |i: u32, j: u32| DVec3::new(left + f64::from(x + i) * dx, top - f64::from(y + j) * dy, 1.0);
    let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
    let half = |a: DVec3, b: DVec3, c: DVec3| {
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        2.0 * (dx * dy).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    half(a, b, c) + half(a, c, d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_pixels_of_a_cube_are_a_whole_sphere() {
        for n in [1, 2, 7, 64] {
            let face = |c: &Camera| -> f64 {
                (0..n).flat_map(|y| (0..n).map(move |x| (x, y))).map(|(x, y)| pixel_solid_angle(c, x, y)).sum()
            };
            let sphere: f64 = Camera::cube(DVec3::ZERO, n, 0.1).iter().map(face).sum();
            assert!((sphere - 4.0 * PI).abs() < 1e-5, "{n}: {sphere}");
        }
    }

    #[test]
    fn a_small_pixel_is_its_area_over_the_cube_of_its_distance() {
        let c = Camera::cube(DVec3::ZERO, 1 << 20, 0.1)[0];
        let edge = 2.0 / f64::from(1 << 20);
        for (x, y) in [(1 << 19, 1 << 19), (5, 7), (1 << 18, 1000)] {
            let t = |i: u32| (f64::from(i) + 0.5) * edge - 1.0;
            let expected = edge * edge / (1.0 + t(x) * t(x) + t(y) * t(y)).powf(1.5);
            let found = pixel_solid_angle(&c, x, y);
            assert!((found / expected - 1.0).abs() < 1e-6, "{x} {y}: {found} against {expected}");
        }
    }
}
