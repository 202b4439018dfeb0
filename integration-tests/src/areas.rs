//! Random points of a surface, spread by area.

use glam::Vec3;
use rand::{Rng, RngExt};

/// Triangles with the sums of their areas.
pub struct Areas {
    triangles: Vec<[Vec3; 3]>,
    sums: Vec<f64>,
}

impl Areas {
    /// Over these triangles. O(n).
    pub fn new(triangles: Vec<[Vec3; 3]>) -> Self {
        let mut sum = 0.0;
        let area = |[a, b, c]: &[Vec3; 3]| f64::from((*b - *a).cross(*c - *a).length());
        let sums = triangles.iter().map(|t| {
            sum += area(t);
            sum
        });
        Self { sums: sums.collect(), triangles }
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[Vec3; 3]] {
        &self.triangles
    }

    /// A point of one of them; there has to be one. O(log n).
    pub fn point(&self, rng: &mut impl Rng) -> Vec3 {
        let at = rng.random_range(0.0..1.0) * self.sums[self.sums.len() - 1];
        let [a, b, c] = self.triangles[self.sums.partition_point(|&s| s <= at).min(self.sums.len() - 1)];
        let (s, t): (f32, f32) = (rng.random_range(0.0..1f32).sqrt(), rng.random_range(0.0..1.0));
        a * (1.0 - s) + (b * (1.0 - t) + c * t) * s
    }
}
