//! A hierarchy over boxes: the level above triangles.

use std::ops::ControlFlow;

use super::Ray;
use super::tree::Tree;
use crate::Aabb;

/// A hierarchy over boxes, told apart by their indices.
#[derive(Clone, Default)]
pub struct BoxBvh {
    tree: Tree,
}

impl BoxBvh {
    /// Builds over boxes; empty ones and ones that are not finite are left out.
    pub fn build(boxes: &[Aabb]) -> Self {
        Self { tree: Tree::build(boxes, 1) }
    }

    /// The box around all; `None` when there is none.
    pub fn bounds(&self) -> Option<Aabb> {
        self.tree.bounds
    }

    /// Bytes that it holds.
    pub fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// Calls `visit` with every box that the ray may meet within its t, about from near to far, and with the greatest t still of
    /// interest, which it may lower to leave out boxes that begin beyond. The tests err towards visiting.
    #[inline]
    pub fn cast(&self, ray: &Ray, mut visit: impl FnMut(u32, &mut f32) -> ControlFlow<()>) {
        self.tree.cast(ray, ray.t_max, &mut |run, limit| {
            for i in run {
                visit(self.tree.order[i as usize], limit)?;
            }
            ControlFlow::Continue(())
        });
    }

    /// Calls `visit` with every box that lies within `distance` of `p`, about from near to far, and with the greatest squared
    /// distance still of interest, which it may lower.
    pub fn around(&self, p: glam::Vec3, distance: f32, mut visit: impl FnMut(u32, &mut f32)) {
        self.tree.around(p, distance * distance, &mut |run, limit| {
            for i in run {
                visit(self.tree.order[i as usize], limit);
            }
        });
    }
}
