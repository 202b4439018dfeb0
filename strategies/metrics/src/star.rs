//! What collapsing a vertex inside a surface moves, fast: its neighbours in order, flattened once for all edges at it.
//!
//! The distance is that of the file beside it, `hausdorff`, which also serves borders and what is no surface; here its sums run
//! over arrays of fixed length without branches, so that the compiler makes vectors of them. O(k^2) for k neighbours.

use farfield_core::collapse::LiveMesh;
use glam::{Vec2, Vec3};

/// Neighbours at most; more are left to the general way.
const MOST: usize = 16;
/// How far parts of an edge or of a triangle may lie outside it after rounding.
pub(crate) const ROUNDING: f32 = 1e-4;
/// The squared sine below which edges run along each other instead of crossing: where they meet would be rounding, and the distance along
/// them is that at their ends.
const PARALLEL: f32 = 1e-8;
/// Stars that are remembered: those of about as many edges as are priced in one call.
const REMEMBERED: usize = 512;

/// A vertex inside a surface with its neighbours, counter-clockwise seen from the tip of the normal. Arrays hold them twice in a row, so that
/// any neighbour can be the first.
#[derive(Clone)]
pub(crate) struct Star {
    vertex: u32,
    count: usize,
    ids: [u32; MOST],
    x: [f32; 2 * MOST],
    y: [f32; 2 * MOST],
    height: [f32; 2 * MOST],
    /// Unit normal of the plane that the star is projected onto; zero where that folds it.
    pub(crate) normal: Vec3,
    /// The largest bound of its triangles.
    pub(crate) before: f32,
}

/// Stars by vertex, as long as nothing collapses.
pub(crate) struct Stars {
    /// Each with the number of collapses before it.
    slots: Vec<Option<(u64, Star)>>,
    collapses: u64,
}

impl Default for Stars {
    fn default() -> Self {
        Self { slots: vec![None; REMEMBERED], collapses: 0 }
    }
}

impl Stars {
    /// The star of a vertex; `None` where it is no inner vertex of a surface, or has too many neighbours.
    pub(crate) fn of(&mut self, mesh: &LiveMesh, vertex: u32, bounds: &[f32]) -> Option<&Star> {
        let slot = &mut self.slots[vertex as usize % REMEMBERED];
        if slot.as_ref().is_none_or(|(at, s)| s.vertex != vertex || *at != self.collapses) {
            *slot = Some((self.collapses, Star::new(mesh, vertex, bounds)));
        }
        slot.as_ref().map(|s| &s.1).filter(|s| s.count > 0)
    }

    /// Something collapsed.
    pub(crate) fn forget(&mut self) {
        self.collapses += 1;
    }
}

impl Star {
    fn new(mesh: &LiveMesh, vertex: u32, bounds: &[f32]) -> Self {
        let mut out = Self {
            vertex,
            count: 0,
            ids: [0; MOST],
            x: [0.0; 2 * MOST],
            y: [0.0; 2 * MOST],
            height: [0.0; 2 * MOST],
            normal: Vec3::ZERO,
            before: 0.0,
        };
        let triangles = mesh.triangles_of(vertex);
        let n = triangles.len();
        if !(3..=MOST).contains(&n) {
            return out;
        }
        let mut pairs = [[0; 2]; MOST];
        for (pair, &t) in pairs.iter_mut().zip(triangles) {
            let c = mesh.corners(t);
            let k = usize::from(c[1] == vertex) + 2 * usize::from(c[2] == vertex);
            *pair = [c[(k + 1) % 3], c[(k + 2) % 3]];
            out.before = out.before.max(bounds[t as usize]);
        }
        // Each triangle begins where another one ends, all in one round.
        let mut next = pairs[0];
        for i in 0..n {
            out.ids[i] = next[0];
            let mut found = None;
            for p in &pairs[..n] {
                if p[0] == next[1] {
                    if found.is_some() {
                        return out;
                    }
                    found = Some(*p);
                }
            }
            match found {
                Some(p) if (p == pairs[0]) == (i + 1 == n) => next = p,
                _ => return out,
            }
        }
        out.count = n;
        out.flatten(mesh);
        out
    }

    /// Onto the plane across the sum of the triangles' areas.
    fn flatten(&mut self, mesh: &LiveMesh) {
        let (n, p) = (self.count, mesh.position(self.vertex));
        let mut arms = [Vec3::ZERO; MOST];
        for (arm, &v) in arms.iter_mut().zip(&self.ids[..n]) {
            *arm = mesh.position(v) - p;
        }
        let mut sum = Vec3::ZERO;
        for i in 0..n {
            sum += arms[i].cross(arms[(i + 1) % n]);
        }
        let Some(normal) = sum.try_normalize() else { return };
        let (across, up) = normal.any_orthonormal_pair();
        for (i, arm) in arms[..n].iter().enumerate() {
            for at in [i, i + n] {
                (self.x[at], self.y[at], self.height[at]) = (arm.dot(across), arm.dot(up), arm.dot(normal));
            }
        }
        // Without folds: every triangle counter-clockwise, and all of them once round.
        let mut rounds = 0;
        for i in 0..n {
            if self.x[i] * self.y[i + 1] - self.y[i] * self.x[i + 1] < 0.0 {
                return;
            }
            rounds += u32::from(self.y[i] <= 0.0 && self.y[i + 1] > 0.0);
        }
        if rounds <= 1 {
            self.normal = normal;
        }
    }

    /// The largest distance of corresponding points once the vertex went onto a neighbour, scene units; `None` where old or new triangles fold.
    pub(crate) fn distance(&self, onto: u32) -> Option<f32> {
        let n = self.count;
        if self.normal == Vec3::ZERO {
            return None;
        }
        let j = self.ids[..n].iter().position(|&v| v == onto)?;
        let at = |i: usize| Vec2::new(self.x[j + i], self.y[j + i]);
        let q = at(0);
        // The vertex under or over the triangle that covers it, or that, after rounding, comes nearest to it.
        let (mut inside, mut tip) = (f32::NEG_INFINITY, 0.0);
        for i in 1..n - 1 {
            let (a, b) = (at(i) - q, at(i + 1) - q);
            let area = a.perp_dot(b);
            if area <= 0.0 || area.is_nan() {
                return None;
            }
            let (u, v) = ((-q).perp_dot(b) / area, a.perp_dot(-q) / area);
            let least = u.min(v).min(1.0 - u - v);
            if least > inside {
                let h = |i: usize| self.height[j + i];
                (inside, tip) = (least, (1.0 - u - v) * h(0) + u * h(i) + v * h(i + 1));
            }
        }
        if inside.is_nan() || inside < -ROUNDING {
            return None;
        }
        let most = if n <= 8 { self.crossings::<8>(j) } else { self.crossings::<MOST>(j) };
        Some(most.max(tip.abs()))
    }

    /// The largest distance where old edges, from the origin, cross new ones, from neighbour j to those that are not beside it.
    fn crossings<const W: usize>(&self, j: usize) -> f32 {
        let n = self.count;
        let (qx, qy, qh) = (self.x[j], self.y[j], self.height[j]);
        let (x, y, h) = (&self.x[..W], &self.y[..W], &self.height[..W]);
        let mut most = [0f32; W];
        for m in j + 2..j + n - 1 {
            let (dx, dy, dh) = (self.x[m] - qx, self.y[m] - qy, self.height[m] - qh);
            let (turn, least) = (qx * dy - qy * dx, PARALLEL * (dx * dx + dy * dy));
            for i in 0..W {
                let area = x[i] * dy - y[i] * dx;
                let over = 1.0 / area;
                let (s, t) = (turn * over, (qx * y[i] - qy * x[i]) * over);
                let off = (s * h[i] - (qh + t * dh)).abs();
                let within = |v: f32| (v - 0.5).abs() <= 0.5 + ROUNDING;
                let crosses = area * area > least * (x[i] * x[i] + y[i] * y[i]);
                let off = if within(s) & within(t) & crosses { off } else { 0.0 };
                most[i] = if off > most[i] { off } else { most[i] };
            }
        }
        most.into_iter().fold(0.0, f32::max)
    }
}
