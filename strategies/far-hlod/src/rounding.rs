//! Rounding before storage: positions to a grid, normals to octahedral codes. What it moves counts in a node's error.
//!
//! All nodes share one grid, a power of two wide, from one origin: a vertex that several nodes draw stays one point whatever their levels, and
//! rounded positions are exact in 32 bits as long as the scene is narrower than 2^24 steps. Normals are rounded to
//! [`NORMAL_BITS`] bits a coordinate of the octahedral map (Cigolle et al., *A survey of efficient representations for
//! independent unit vectors*, 2014): off by less than half a grey level of Lambert's shading, which the appearance metric does not see either.

use glam::{DVec3, Vec2, Vec3};

/// Bits a coordinate: an angle of at most 0.0015 rad, under 1 / 510.
const NORMAL_BITS: u32 = 11;

/// The grid of positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Edge of its cells, a power of two, scene units; 0 rounds nothing.
    pub(crate) step: f32,
}

impl Grid {
    /// The widest grid whose cells are at most `step` wide, and not narrower than a scene of `size` allows in 32 bits.
    pub(crate) fn at_most(step: f32, size: f32) -> Self {
        let least = size * f32::EPSILON;
        let wide = step.max(least);
        Self { step: if wide > 0.0 && wide.is_finite() { wide.log2().floor().exp2() } else { 0.0 } }
    }

    /// How far a position moves at most: half a cell's diagonal, and the rounding of 32 bits where they are coarser.
    pub(crate) fn error(self) -> f32 {
        0.5 * 3f32.sqrt() * self.step
    }

    pub(crate) fn round(self, p: Vec3) -> Vec3 {
        if self.step > 0.0 { (p / self.step).round() * self.step } else { p }
    }

    /// The grid's point next to a place.
    pub(crate) fn origin(self, p: Vec3) -> DVec3 {
        self.round(p).as_dvec3()
    }
}

/// A unit normal, rounded.
pub(crate) fn normal(n: Vec3) -> Vec3 {
    const HALF: f32 = ((1 << (NORMAL_BITS - 1)) - 1) as f32;
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return n;
    }
    let flat = Vec2::new(n.x, n.y) / sum;
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    let folded = |p: Vec2| Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    let code = ((if n.z < 0.0 { folded(flat) } else { flat }) * HALF).round() / HALF;
    let z = 1.0 - code.x.abs() - code.y.abs();
    let back = if z < 0.0 { folded(code) } else { code };
    Vec3::new(back.x, back.y, z).normalize_or(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn normals_turn_by_less_than_half_a_grey_level(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            let n = Vec3::new(x, y, z);
            prop_assume!(n.length() > 1e-3);
            let (n, r) = (n.normalize(), normal(n.normalize()));
            prop_assert!(n.cross(r).length().atan2(n.dot(r)) < 0.5 / 255.0);
            prop_assert_eq!(normal(r).distance(r) < 1e-6, true);
        }

        #[test]
        fn positions_move_by_no_more_than_is_said(x in -1e3f32..1e3, y in -1e3f32..1e3, z in -1e3f32..1e3, step in 1e-5f32..10.0) {
            let (p, grid) = (Vec3::new(x, y, z), Grid::at_most(step, 2e3));
            let r = grid.round(p);
            prop_assert!(p.distance(r) <= grid.error() * (1.0 + 1e-6));
            // On the grid, and there to stay.
            prop_assert_eq!(grid.round(r), r);
            prop_assert!(grid.step <= step.max(2e3 * f32::EPSILON));
        }
    }

    #[test]
    fn nothing_is_rounded_where_nothing_has_a_size() {
        assert_eq!(Grid::at_most(0.0, 0.0).round(Vec3::splat(0.3)), Vec3::splat(0.3));
        assert_eq!(normal(Vec3::ZERO), Vec3::ZERO);
    }
}
