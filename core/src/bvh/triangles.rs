//! Rays against triangles, watertight along shared edges.

use std::ops::ControlFlow;

use glam::{DVec3, Vec3, Vec3A, Vec3Swizzles};

use super::Ray;
use super::tree::Tree;
use crate::Aabb;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The ray's parameter.
    pub t: f32,
    /// The triangle's index as it was given.
    pub triangle: u32,
    /// Weights of its three vertices, not negative, together 1.
    pub weights: [f32; 3],
    /// Whether its counter-clockwise side was met.
    pub front: bool,
}

/// A hierarchy over triangles.
#[derive(Clone, Default)]
pub struct TriangleBvh {
    pub(super) tree: Tree,
    /// In leaf order.
    pub(super) triangles: Vec<Triangle>,
}

/// The three vertices, coordinate by coordinate.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    x: Vec3A,
    y: Vec3A,
    z: Vec3A,
}

impl Triangle {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        Self { x: Vec3A::new(a.x, b.x, c.x), y: Vec3A::new(a.y, b.y, c.y), z: Vec3A::new(a.z, b.z, c.z) }
    }

    pub(super) fn vertices(&self) -> [Vec3; 3] {
        [0, 1, 2].map(|i| Vec3::new(self.x[i], self.y[i], self.z[i]))
    }

    /// The hit with t in `ray.t_min..=t_max`, its index left 0. Woop et al. 2013: vertices are sheared into the ray's space, each by
    /// the same arithmetic whichever triangle it is in; the signs of the three edge functions are then exact, since products of
    /// 32-bit numbers are exact in 64 bits (the paper falls back on 64 bits only at 0; here 32 bits serve to reject). Triangles
    /// seen exactly edge-on are missed.
    #[inline]
    fn hit(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let x = self.x - ray.origin.x - ray.rest.x;
        let y = self.y - ray.origin.y - ray.rest.y;
        let z = self.z - ray.origin.z - ray.rest.z;
        let row = |r: Vec3| x * r.x + y * r.y + z * r.z;
        let (px, py) = (row(ray.shear[0]), row(ray.shear[1]));
        // Lane 0 holds the edge function of the second and third vertex, and so on around.
        let e = px.zxy() * py.yzx() - py.zxy() * px.yzx();
        if e.cmplt(Vec3A::ZERO).any() && e.cmpgt(Vec3A::ZERO).any() {
            return None;
        }
        let (px, py) = (px.as_dvec3(), py.as_dvec3());
        let e = px.zxy() * py.yzx() - py.zxy() * px.yzx();
        let sum = e.x + e.y + e.z;
        let front = e.cmpge(DVec3::ZERO).all();
        if !(front || e.cmple(DVec3::ZERO).all()) || sum == 0.0 || !sum.is_finite() {
            return None;
        }
        let t = (e.dot(row(ray.shear[2]).as_dvec3()) / sum) as f32;
        if !(ray.t_min <= t && t <= t_max && t.is_finite()) {
            return None;
        }
        let w = e / sum;
        Some(Hit { t, triangle: 0, weights: [w.x as f32, w.y as f32, w.z as f32], front })
    }
}

impl TriangleBvh {
    /// Builds over three indices a triangle. Triangles that name no vertex or one that is not finite are left out; degenerate
    /// ones stay (rays miss them, nearest points find them).
    pub fn build(positions: &[Vec3], indices: &[u32]) -> Self {
        let corners = |i: usize| -> Option<[Vec3; 3]> {
            let v = |k: usize| indices.get(3 * i + k).and_then(|&v| positions.get(v as usize)).copied();
            Some([v(0)?, v(1)?, v(2)?])
        };
        let boxes: Vec<Aabb> = (0..indices.len() / 3)
            .map(|i| match corners(i) {
                Some(c) if c.iter().all(|p| p.is_finite()) => Aabb::of(c),
                _ => Aabb::EMPTY,
            })
            .collect();
        let tree = Tree::build(&boxes, 4);
        let triangles =
            tree.order.iter().map(|&i| Triangle::new(corners(i as usize).unwrap_or([Vec3::ZERO; 3]))).collect();
        Self { tree, triangles }
    }

    /// The box of its triangles; `None` when it has none.
    pub fn bounds(&self) -> Option<Aabb> {
        self.tree.bounds
    }

    /// How many triangles it has.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether it has no triangle.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Bytes that it holds.
    pub fn bytes(&self) -> usize {
        self.tree.bytes() + size_of_val(&self.triangles[..])
    }

    /// The accepted hit with the least t, and of those with equal t the one with the lowest triangle index. `accept` sees any
    /// hit that may win, in any order: cull back faces or skip triangles there.
    #[inline]
    pub fn closest_hit(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        self.tree.cast(ray, ray.t_max, &mut |run, limit| {
            for i in run {
                let Some(mut hit) = self.triangles[i as usize].hit(ray, *limit) else { continue };
                hit.triangle = self.tree.order[i as usize];
                let wins = best.is_none_or(|b| hit.t < b.t || hit.triangle < b.triangle);
                if wins && accept(&hit) {
                    *limit = hit.t;
                    best = Some(hit);
                }
            }
            ControlFlow::Continue(())
        });
        best
    }

    /// Whether the ray has any accepted hit.
    #[inline]
    pub fn any_hit(&self, ray: &Ray, mut accept: impl FnMut(&Hit) -> bool) -> bool {
        let mut found = false;
        self.tree.cast(ray, ray.t_max, &mut |run, limit| {
            for i in run {
                let Some(mut hit) = self.triangles[i as usize].hit(ray, *limit) else { continue };
                hit.triangle = self.tree.order[i as usize];
                if accept(&hit) {
                    found = true;
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        found
    }
}
