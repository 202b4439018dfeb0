//! Rounding of positions to a grid before storage; what it moves counts in a node's error.
//!
//! A vertex inside a node goes to a grid whose cells are parts of what the node may be off by. One that nodes share goes to the finest grid of the tree,
//! in all of them: it stays one point whatever their levels. Grids are powers of two wide, from one origin, and never finer than the scene's size
//! allows, so that rounded positions are exact in 32 bits.

use glam::{DVec3, Vec3};

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
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
    }
}
