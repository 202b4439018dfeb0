//! Measured distance between two surfaces: from points spread over one to the nearest point of the other.
//!
//! A binary tree of boxes over triangles (median splits), walked nearest child first. Nothing of it is shared with the code
//! that is measured.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const LEAF: usize = 4;

struct Node {
    low: Vec3,
    high: Vec3,
    /// Range of triangles.
    first: usize,
    end: usize,
    /// Index of the first of two children; 0 in a leaf.
    child: usize,
}

pub(crate) struct Surface {
    triangles: Vec<[Vec3; 3]>,
    nodes: Vec<Node>,
}

impl Surface {
    pub(crate) fn new(positions: &[Vec3], indices: &[u32]) -> Self {
        let triangles = indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| positions[t[k] as usize])).collect();
        let mut surface = Self { triangles, nodes: Vec::new() };
        let root = surface.node(0, indices.len() / 3);
        surface.nodes.push(root);
        let mut next = 0;
        while next < surface.nodes.len() {
            surface.split(next);
            next += 1;
        }
        surface
    }

    fn node(&self, first: usize, end: usize) -> Node {
        let corners = || self.triangles[first..end].iter().flatten();
        let low = corners().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let high = corners().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        Node { low, high, first, end, child: 0 }
    }

    fn split(&mut self, at: usize) {
        let Node { low, high, first, end, .. } = self.nodes[at];
        if end - first <= LEAF {
            return;
        }
        let axis = (high - low).max_position();
        let middle = (end - first) / 2;
        let centre = |t: &[Vec3; 3]| t.iter().map(|p| p[axis]).sum::<f32>();
        self.triangles[first..end].select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)));
        self.nodes[at].child = self.nodes.len();
        for (first, end) in [(first, first + middle), (first + middle, end)] {
            let node = self.node(first, end);
            self.nodes.push(node);
        }
    }

    /// Squared distance to the nearest point.
    fn distance_squared(&self, p: Vec3) -> f32 {
        let to_box = |n: &Node| p.clamp(n.low, n.high).distance_squared(p);
        let mut best = f32::INFINITY;
        let mut stack = vec![(0.0, 0)];
        while let Some((bound, at)) = stack.pop() {
            if bound >= best {
                continue;
            }
            let node = &self.nodes[at];
            if node.child == 0 {
                for t in &self.triangles[node.first..node.end] {
                    best = best.min(nearest(p, t).distance_squared(p));
                }
                continue;
            }
            let mut children = [0, 1].map(|k| (to_box(&self.nodes[node.child + k]), node.child + k));
            if children[0].0 < children[1].0 {
                children.swap(0, 1);
            }
            stack.extend(children);
        }
        best
    }

    /// `n` points, uniform by area.
    fn samples(&self, n: usize) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut areas = Vec::with_capacity(self.triangles.len());
        let mut sum = 0.0;
        for t in &self.triangles {
            sum += (t[1] - t[0]).cross(t[2] - t[0]).length() as f64;
            areas.push(sum);
        }
        (0..n)
            .map(|_| {
                let at = rng.random_range(0.0..sum);
                let t = &self.triangles[areas.partition_point(|&a| a <= at).min(areas.len() - 1)];
                let (u, v): (f32, f32) = (rng.random(), rng.random());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0])
            })
            .collect()
    }
}

/// Root mean square and maximum of the distance over `n` points of each surface, both ways, in the positions' unit.
pub(crate) fn two_sided(a: &Surface, b: &Surface, n: usize) -> (f64, f64) {
    let (mut sum, mut most) = (0.0, 0.0);
    for (from, to) in [(a, b), (b, a)] {
        for p in from.samples(n) {
            let d = to.distance_squared(p) as f64;
            sum += d;
            most = f64::max(most, d);
        }
    }
    ((sum / (2 * n) as f64).sqrt(), most.sqrt())
}

/// The point of a triangle that is nearest to `p` (Ericson 2005, Real-time collision detection, 5.1.5).
fn nearest(p: Vec3, &[a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    if sum > 0.0 { a + ab * (vb / sum) + ac * (vc / sum) } else { a }
}
