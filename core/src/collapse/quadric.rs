//! The quadric error: how far a vertex lies from the planes of the triangles that it stands for.
//!
//! Garland and Heckbert 1997 (Surface simplification using quadric error metrics, sections 5 and 6), planes weighted by their
//! triangles' areas; borders are held by planes through them at right angles to their triangles. Deviations:
//!
//! * A quadric is kept in coordinates relative to *its own vertex*, in mesh sizes: A, b and c of x'Ax + 2b'x + c with x the
//!   offset from the vertex. At first b = c = 0, since every plane of a vertex goes through it; a merge shifts one of
//!   the two. So f32 is enough wherever the mesh is and whatever its size: no difference of large numbers is taken.
//! * The optimal place minimises the error plus a small pull towards the edge's middle, Q(x) + ridge tr(A) |x - middle|^2, which
//!   has one well-conditioned minimum on flat and cylindrical neighbourhoods too. Where tr(A) = 0 or the minimum is not
//!   finite, the middle or an end is taken, whichever costs least.
//! * The cost is sqrt(error / area), the root mean square distance to the planes in the positions' unit. It is an estimate
//!   and no bound.
//!
//! 44 bytes a vertex; about 60 (half-edge) or 120 (optimal) floating-point operations a price.

use glam::{Mat3, Vec3};

use super::mesh::{LiveMesh, others};
use super::{Candidate, Cost, Place};

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
        Self { placement: Placement::default(), border_weight: 10.0, shape_weight: 1e-6 }
    }
}

/// Pull towards the edge's middle, relative to the quadric's trace. f32 solves a system of condition 1/ridge to 1e-3.
const RIDGE: f32 = 1e-4;

/// x'Ax + 2b'x + c over offsets x from its vertex, in mesh sizes; A is symmetric.
#[derive(Clone, Copy, Debug, Default)]
struct Quadric {
    /// xx, yy, zz.
    diagonal: Vec3,
    /// yz, xz, xy.
    mixed: Vec3,
    b: Vec3,
    c: f32,
    /// Area that it stands for, in squared mesh sizes.
    area: f32,
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

    #[inline]
    fn at(&self, x: Vec3) -> f32 {
        (x.dot(self.times(x) + 2.0 * self.b) + self.c).max(0.0)
    }

    /// The same error over offsets from a vertex that lies at `t`: Q(x + t).
    #[inline]
    fn seen_from(&self, t: Vec3) -> Self {
        let at = self.times(t);
        Self { b: self.b + at, c: (self.c + t.dot(at + 2.0 * self.b)).max(0.0), ..*self }
    }

    /// Minimum of Q(x) + ridge tr(A) |x - middle|^2, or None where there is no finite one.
    #[inline]
    fn minimum(&self, middle: Vec3) -> Option<Vec3> {
        let ridge = RIDGE * self.diagonal.element_sum();
        let d = self.diagonal + ridge;
        let Vec3 { x: yz, y: xz, z: xy } = self.mixed;
        // (A + ridge I) x = ridge middle - b, by Cramer's rule: columns of the adjugate are cross products of A's.
        let (r0, r1, r2) = (Vec3::new(d.x, xy, xz), Vec3::new(xy, d.y, yz), Vec3::new(xz, yz, d.z));
        let adjugate = Mat3::from_cols(r1.cross(r2), r2.cross(r0), r0.cross(r1));
        let x = adjugate * (ridge * middle - self.b) / r0.dot(adjugate.x_axis);
        x.is_finite().then_some(x)
    }
}

/// The quadric cost of a mesh's vertices.
pub struct Quadrics {
    of: Vec<Quadric>,
    placement: Placement,
}

impl Quadrics {
    /// The quadrics of a mesh as it is now. O(triangles).
    pub fn new(mesh: &LiveMesh, settings: QuadricSettings) -> Self {
        let unit = mesh.unit();
        let mut of = vec![Quadric::default(); mesh.positions().len()];
        for t in (0..mesh.all_triangles() as u32).filter(|&t| mesh.is_alive(t)) {
            let corners = mesh.corners(t);
            let p = corners.map(|v| mesh.position(v));
            let twice_area = ((p[1] - p[0]) * unit).cross((p[2] - p[0]) * unit);
            let length = twice_area.length();
            if !(length.is_finite() && length > 0.0) {
                continue;
            }
            let (n, area) = (twice_area / length, length / 2.0);
            let mut q = Quadric::plane(n, area);
            q.diagonal += area * settings.shape_weight;
            q.area = area;
            corners.iter().for_each(|&v| of[v as usize].add(&q));
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if settings.border_weight > 0.0 && is_border(mesh, a, b) {
                    let edge = (p[(k + 1) % 3] - p[k]) * unit;
                    let across = edge.cross(n).normalize_or_zero();
                    let q = Quadric::plane(across, settings.border_weight * edge.length_squared());
                    [a, b].iter().for_each(|&v| of[v as usize].add(&q));
                }
            }
        }
        Self { of, placement: settings.placement }
    }

    /// Price of the edge.
    #[inline]
    fn price(&self, mesh: &LiveMesh, [a, b]: [u32; 2]) -> Candidate {
        let unit = mesh.unit();
        let (qa, qb) = (&self.of[a as usize], &self.of[b as usize]);
        // Everything in the frame of a.
        let d = (mesh.position(b) - mesh.position(a)) * unit;
        let q = qb.seen_from(-d);
        let at_first = qa.c + q.c;
        let at_second = qa.at(d) + qb.c;
        let locked = (mesh.is_locked(a), mesh.is_locked(b));
        let (mut error, mut place) = match locked {
            (true, true) => return Candidate::FORBIDDEN,
            (true, false) => (at_first, Place::First),
            (false, true) => (at_second, Place::Second),
            _ if at_first <= at_second => (at_first, Place::First),
            _ => (at_second, Place::Second),
        };
        if self.placement == Placement::Optimal && locked == (false, false) {
            let mut both = q;
            both.add(qa);
            let middle = d / 2.0;
            let x = both.minimum(middle).unwrap_or(middle);
            let least = both.at(x);
            if least <= error {
                (error, place) = (least, Place::At(mesh.position(a) + x / unit));
            }
        }
        Candidate { cost: (error / (qa.area + qb.area).max(f32::MIN_POSITIVE)).sqrt() / unit, place }
    }
}

impl Cost for Quadrics {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (edge, out) in edges.iter().zip(out) {
            *out = self.price(mesh, *edge);
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        let mut q = self.of[from as usize].seen_from((at - mesh.position(from)) * mesh.unit());
        q.add(&self.of[onto as usize].seen_from((at - mesh.position(onto)) * mesh.unit()));
        self.of[onto as usize] = q;
    }
}

/// Whether the edge has other than two triangles.
fn is_border(mesh: &LiveMesh, a: u32, b: u32) -> bool {
    mesh.is_border(a)
        && mesh.is_border(b)
        && mesh.triangles_of(a).iter().filter(|&&t| others(mesh.corners(t), a).contains(&b)).count() != 2
}
