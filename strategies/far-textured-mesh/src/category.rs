//! What a pixel of a depth image lies on: an outline, an inner edge, a crease, or none of them.
//!
//! Follows textured LOD meshes (2003, section 3.1.3.1), pixel by pixel along rows and along columns:
//!
//! * exterior silhouette: a hit with background (or the picture's border) among its four neighbours;
//! * interior silhouette (C0): a neighbour lies behind by more than T_C0, z[i+1] - z[i] > T_C0 or z[i-1] - z[i] > T_C0;
//! * sharp edge (C1): the slope changes by more than T_C1, |(z[i-1] - z[i]) - (z[i] - z[i+1])| > T_C1;
//! * interior: any other hit.
//!
//! The paper gives T_C0 = 3.4e-4 and T_C1 = 1.28e-4 for the window-space z of a projection that it does not give. Here depth is
//! linear and, by default, tolerances are in *footprints*, p = z / q with q the pixels a unit of tangent: the side of the square that the
//! pixel covers at its depth. A surface at an angle a to the picture has steps of tan(a) p from pixel to pixel, so 4 p is a slope of 76
//! degrees, and so nothing depends on the scene's scale or distance. The paper's own measure is there for comparison: window z = 1 - near / z
//! (far plane at infinity). O(pixels).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// In what depth steps are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DepthMeasure {
    /// Linear depth over the side of the square that a pixel covers there: free of scale.
    #[default]
    Footprint,
    /// Window-space z with the near distance of the views: the paper's tolerances.
    WindowZ,
}

/// The categories, in the order of the paper's weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Category {
    Background,
    Interior,
    Sharp,
    InteriorSilhouette,
    ExteriorSilhouette,
}

/// Tolerances with their measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steps {
    pub(crate) measure: DepthMeasure,
    /// One-sided step of an interior silhouette.
    pub(crate) c0: f64,
    /// Second difference of a sharp edge.
    pub(crate) c1: f64,
    /// Near distance (window z), scene units.
    pub(crate) near: f64,
}

impl Steps {
    /// The step from depth `z` to depth `to`, in the measure.
    fn step(&self, z: f64, to: f64, px_per_tan: f64) -> f64 {
        match self.measure {
            // (to - z) / p, p = z / q.
            DepthMeasure::Footprint => (to - z) / z * px_per_tan,
            // (1 - n/to) - (1 - n/z) = n (to - z) / (z to).
            DepthMeasure::WindowZ => self.near * ((to - z) / z / to),
        }
    }
}

/// The category of each pixel of a picture of linear depths (infinite where nothing was hit), rows from the top.
pub(crate) fn categories(depth: &[f32], size: [u32; 2], px_per_tan: f32, steps: &Steps) -> Vec<Category> {
    let (w, h) = (size[0] as i64, size[1] as i64);
    let at = |x: i64, y: i64| -> Option<f64> {
        let inside = (0..w).contains(&x) && (0..h).contains(&y);
        let z = if inside { depth[(y * w + x) as usize] } else { f32::INFINITY };
        z.is_finite().then_some(f64::from(z))
    };
    let q = f64::from(px_per_tan);
    let of = |x: i64, y: i64| {
        let Some(z) = at(x, y) else { return Category::Background };
        let mut found = Category::Interior;
        for (dx, dy) in [(1, 0), (0, 1)] {
            let (Some(before), Some(after)) = (at(x - dx, y - dy), at(x + dx, y + dy)) else {
                return Category::ExteriorSilhouette;
            };
            let (back, ahead) = (steps.step(z, before, q), steps.step(z, after, q));
            if back.max(ahead) > steps.c0 {
                found = found.max(Category::InteriorSilhouette);
            } else if (back + ahead).abs() > steps.c1 {
                found = found.max(Category::Sharp);
            }
        }
        found
    };
    (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).map(|(x, y)| of(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Camera;
    use glam::{DVec3, Vec3};

    const STEPS: Steps = Steps { measure: DepthMeasure::Footprint, c0: 4.0, c1: 1.0, near: 0.1 };

    fn camera(n: u32) -> Camera {
        Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [n, n], 0.01)
    }

    /// The depths of a surface given by the least positive ray parameter, if any.
    fn shoot(n: u32, hit: &dyn Fn(Vec3) -> Option<f32>) -> (Vec<f32>, Vec<Category>) {
        shoot_with(n, hit, &STEPS)
    }
    fn shoot_with(n: u32, hit: &dyn Fn(Vec3) -> Option<f32>, steps: &Steps) -> (Vec<f32>, Vec<Category>) {
        let c = camera(n);
        let depth: Vec<f32> = (0..n * n)
            .map(|i| hit(c.ray((i % n) as f32 + 0.5, (i / n) as f32 + 0.5)).unwrap_or(f32::INFINITY))
            .collect();
        let found = categories(&depth, [n, n], c.px_per_tan(), steps);
        (depth, found)
    }

    fn sphere(centre: Vec3, r: f32) -> impl Fn(Vec3) -> Option<f32> {
        move |d| {
            let (a, b, c) = (d.dot(d), d.dot(centre), centre.dot(centre) - r * r);
            let root = b * b - a * c;
            (root >= 0.0).then(|| (b - root.sqrt()) / a)
        }
    }

    fn count(found: &[Category], what: Category) -> usize {
        found.iter().filter(|&&c| c == what).count()
    }

    #[test]
    fn a_sphere_has_an_outline_one_pixel_wide_and_a_plain_middle() {
        let n = 200;
        let (depth, found) = shoot(n, &sphere(Vec3::new(0.0, 0.0, -10.0), 3.0));
        for (i, c) in found.iter().enumerate() {
            let (x, y) = (i as i64 % i64::from(n), i as i64 / i64::from(n));
            let hit = |x: i64, y: i64| depth[(y * i64::from(n) + x) as usize].is_finite();
            let outline = hit(x, y) && [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().any(|(a, b)| !hit(x + a, y + b));
            assert_eq!(*c == Category::ExteriorSilhouette, outline);
            assert_eq!(*c == Category::Background, !hit(x, y));
            // Well inside, a sphere has neither steps nor creases.
            let from_middle = ((x - 100) as f32).hypot((y - 100) as f32);
            if from_middle < 45.0 {
                assert_eq!(*c, Category::Interior);
            }
        }
        assert!(count(&found, Category::ExteriorSilhouette) > 200);
    }

    #[test]
    fn the_edge_of_a_box_towards_the_viewer_is_sharp_and_its_faces_are_plain() {
        // Two planes x + z = -10 and -x + z = -10 that meet in the line x = 0, z = -10, under 90 degrees, nearest there.
        let hit = |d: Vec3| {
            let plane = |n: Vec3| -10.0 / n.dot(d);
            Some(plane(Vec3::new(1.0, 0.0, 1.0)).max(plane(Vec3::new(-1.0, 0.0, 1.0))))
        };
        let (_, found) = shoot(101, &hit);
        for y in 1..100 {
            assert_eq!(found[y * 101 + 50], Category::Sharp, "row {y}");
            for x in (2..45).chain(56..99) {
                assert_eq!(found[y * 101 + x], Category::Interior, "{x}, {y}");
            }
        }
    }

    #[test]
    fn a_step_marks_its_nearer_side_and_only_where_it_is_deep_enough() {
        let step = |size: f32| {
            let hit = move |d: Vec3| Some(if d.x < 0.0 { 10.0 } else { 10.0 + size });
            shoot(100, &hit).1
        };
        // Footprint at depth 10: 10 / 91.5 = 0.109; 4 of them 0.437.
        let deep = step(0.5);
        for y in 1..99 {
            assert_eq!(deep[y * 100 + 49], Category::InteriorSilhouette);
            assert_ne!(deep[y * 100 + 50], Category::InteriorSilhouette);
        }
        assert_eq!(count(&step(0.4), Category::InteriorSilhouette), 0);
        assert_eq!(step(0.4)[50 * 100 + 49], Category::Sharp);
        assert_eq!(count(&step(0.05), Category::Sharp), 0);
    }

    #[test]
    fn footprints_do_not_know_the_scale_and_window_depth_does() {
        let two = |k: f32| {
            let (front, back) =
                (sphere(Vec3::new(-1.0, 0.3, -9.0) * k, 2.0 * k), sphere(Vec3::new(1.0, 0.0, -14.0) * k, 4.0 * k));
            move |d: Vec3| front(d).into_iter().chain(back(d)).min_by(f32::total_cmp)
        };
        let home = shoot(128, &two(1.0)).1;
        assert!(count(&home, Category::InteriorSilhouette) > 50);
        for k in [1e-3, 1e6] {
            assert_eq!(shoot(128, &two(k)).1, home);
        }
        let window = Steps { measure: DepthMeasure::WindowZ, c0: 3.4e-4, c1: 1.28e-4, near: 1.0 };
        let (near, far) = (shoot_with(128, &two(1.0), &window).1, shoot_with(128, &two(1e3), &window).1);
        assert!(count(&near, Category::InteriorSilhouette) > 50);
        assert_eq!(count(&far, Category::InteriorSilhouette), 0);
    }
}
