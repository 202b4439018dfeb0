//! The quadric error: how far a vertex lies from the planes of the triangles that it stands for.
//!
//! Garland and Heckbert 1997 (Surface simplification using quadric error metrics, sections 5 and 6), planes weighted by their
//! triangles' areas; borders are held by planes through them at right angles to their triangles. Deviations:
//!
//! * A quadric is kept in coordinates relative to *its own vertex*, in mesh sizes: A, b and c of x'Ax + 2b'x + c with x the
//!   offset from the vertex. At first b = c = 0, since every plane of a vertex goes through it; a merge shifts one of
//!   the two. So f32 is enough wherever the mesh is and whatever its size: no difference of large numbers is taken.
//! * The optimal place minimises the error plus a small pull towards the edge's middle, Q(x) + ridge tr(A) |x - middle|^2, which
//!   has one well-conditioned minimum on flat and cylindrical neighbourhoods too. Where tr(A) = 0 the middle is taken.
//! * The cost is sqrt(error / area), the root mean square distance to the planes in the positions' unit. It is an estimate
//!   and no bound.
//!
//! * With half edges it is the distance to the dying vertex's planes alone: what the other one has paid stays paid.
//!
//! 64 bytes a vertex; about 60 (half-edge) or 120 (optimal) floating-point operations a price, and two cache lines.

use glam::Vec3;

use super::lanes::{self, Vertex};
use super::mesh::{LiveMesh, others};
use super::{Candidate, Cost};

/// Where survivors may sit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Placement {
    /// On one of the edge's ends: no position is new.
    HalfEdge,
    /// Where the error is least.
    #[default]
    Optimal,
}

/// Settings of the quadric error.
#[derive(Clone, Copy, Debug)]
pub struct QuadricSettings {
    /// Where survivors may sit.
    pub placement: Placement,
    /// Weight of the planes that hold borders, relative to a triangle of the border edge's squared length; 0 lets borders go.
    pub border_weight: f32,
    /// Weight of the squared distance from where a vertex came from, relative to that from its planes; decides among edges of a
    /// flat neighbourhood, in favour of short ones.
    pub shape_weight: f32,
}

impl Default for QuadricSettings {
    fn default() -> Self {
        Self { placement: Placement::default(), border_weight: 0.3, shape_weight: 1e-6 }
    }
}

/// x'Ax + 2b'x + c over offsets x from its vertex, in mesh sizes; A is symmetric.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz.
    pub(super) diagonal: Vec3,
    /// yz, xz, xy.
    pub(super) mixed: Vec3,
    pub(super) b: Vec3,
    pub(super) c: f32,
    /// Area that it stands for, in squared mesh sizes.
    pub(super) area: f32,
}

impl Quadric {
    /// weight times the squared distance to the plane through the origin with this unit normal.
    fn plane(n: Vec3, weight: f32) -> Self {
        Self { diagonal: n * n * weight, mixed: Vec3::new(n.y * n.z, n.x * n.z, n.x * n.y) * weight, ..Self::default() }
    }

    #[inline]
    fn add(&mut self, q: &Self) {
        self.diagonal += q.diagonal;
        self.mixed += q.mixed;
        self.b += q.b;
        self.c += q.c;
        self.area += q.area;
    }

    /// A x.
    #[inline]
    fn times(&self, x: Vec3) -> Vec3 {
        let Vec3 { x: yz, y: xz, z: xy } = self.mixed;
        self.diagonal * x + Vec3::new(xy * x.y + xz * x.z, xy * x.x + yz * x.z, xz * x.x + yz * x.y)
    }

    /// The same error over offsets from a vertex that lies at `t`: Q(x + t).
    #[inline]
    fn seen_from(&self, t: Vec3) -> Self {
        let at = self.times(t);
        Self { b: self.b + at, c: (self.c + t.dot(at + 2.0 * self.b)).max(0.0), ..*self }
    }
}

/// The quadric cost of a mesh's vertices.
pub struct Quadrics {
    vertices: Vec<Vertex>,
    placement: Placement,
}

impl Quadrics {
    /// The quadrics of a mesh as it is now. O(triangles).
    pub fn new(mesh: &LiveMesh, settings: QuadricSettings) -> Self {
        let unit = mesh.unit();
        let vertex = |v: u32| Vertex::new(mesh.position(v) * unit, mesh.is_locked(v));
        let mut vertices: Vec<Vertex> = (0..mesh.vertices() as u32).map(vertex).collect();
        for t in (0..mesh.all_triangles() as u32).filter(|&t| mesh.is_alive(t)) {
            let corners = mesh.corners(t);
            let at = |k: usize| vertices[corners[k] as usize].position();
            let p = [at(0), at(1), at(2)];
            let twice_area = (p[1] - p[0]).cross(p[2] - p[0]);
            let length = twice_area.length();
            if !(length.is_finite() && length > 0.0) {
                continue;
            }
            let (n, area) = (twice_area / length, length / 2.0);
            let mut q = Quadric::plane(n, area);
            q.diagonal += area * settings.shape_weight;
            q.area = area;
            corners.iter().for_each(|&v| vertices[v as usize].add_first(&q));
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if settings.border_weight > 0.0 && is_border(mesh, a, b) {
                    let edge = p[(k + 1) % 3] - p[k];
                    let across = edge.cross(n).normalize_or_zero();
                    let q = Quadric::plane(across, settings.border_weight * edge.length_squared());
                    [a, b].iter().for_each(|&v| vertices[v as usize].add_first(&q));
                }
            }
        }
        Self { vertices, placement: settings.placement }
    }

    /// What it costs that `from` dies onto `onto`'s place, whatever the placement is: the root mean square distance of that place to
    /// the planes of `from`, in the positions' unit. Infinite where it is no number.
    pub fn half_edge(&self, mesh: &LiveMesh, from: u32, onto: u32) -> f32 {
        let [from, onto] = [from, onto].map(|v| &self.vertices[v as usize]);
        let (q, x) = (from.quadric(), onto.position() - from.position());
        let mean = (x.dot(q.times(x) + 2.0 * q.b) + q.c).max(0.0) / q.area.max(f32::MIN_POSITIVE);
        if mean.is_finite() { mean.sqrt() / mesh.unit() } else { f32::INFINITY }
    }
}

impl Cost for Quadrics {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        // A power of two, so exact.
        let size = 1.0 / mesh.unit();
        let ends = |&[a, b]: &[u32; 2]| (&self.vertices[a as usize], &self.vertices[b as usize]);
        let price = |four| match self.placement {
            Placement::HalfEdge => lanes::half_edge(four, size),
            Placement::Optimal => lanes::optimal(four, size),
        };
        let (fours, rest) = edges.as_chunks::<4>();
        let (out_fours, out_rest) = out.as_chunks_mut::<4>();
        for (four, out) in fours.iter().zip(out_fours) {
            *out = price([ends(&four[0]), ends(&four[1]), ends(&four[2]), ends(&four[3])]);
        }
        if let Some(first) = rest.first() {
            // The free lanes repeat the first edge.
            let prices = price([0, 1, 2, 3].map(|i| ends(rest.get(i).unwrap_or(first))));
            out_rest.iter_mut().zip(prices).for_each(|(out, price)| *out = price);
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        let at = at * mesh.unit();
        let (from, stays) = (self.vertices[from as usize], &mut self.vertices[onto as usize]);
        let mut q = from.quadric().seen_from(at - from.position());
        q.add(&stays.quadric().seen_from(at - stays.position()));
        stays.set(&q, at);
    }
}

/// Whether the edge has other than two triangles.
fn is_border(mesh: &LiveMesh, a: u32, b: u32) -> bool {
    mesh.is_border(a)
        && mesh.is_border(b)
        && mesh.triangles_of(a).iter().filter(|&&t| others(mesh.corners(t), a).contains(&b)).count() != 2
}
