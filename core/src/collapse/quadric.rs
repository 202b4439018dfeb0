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
//! * With half edges it is the distance to the dying vertex's planes alone: what the other one has paid stays paid.
//!
//! 64 bytes a vertex; about 60 (half-edge) or 120 (optimal) floating-point operations a price, and two cache lines.

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

    /// Adds one of the same origin whose b and c are 0.
    #[inline]
    fn add_first(&mut self, q: &Self) {
        self.diagonal += q.diagonal;
        self.mixed += q.mixed;
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

    /// The error there by area.
    #[inline]
    fn mean_square(&self, x: Vec3) -> f32 {
        self.at(x) / self.area.max(f32::MIN_POSITIVE)
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

/// All that a price reads of a vertex: one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
struct Vertex {
    quadric: Quadric,
    /// Its position in mesh sizes.
    position: Vec3,
    locked: bool,
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
        let vertex = |v: u32| Vertex {
            quadric: Quadric::default(),
            position: mesh.position(v) * unit,
            locked: mesh.is_locked(v),
        };
        let mut vertices: Vec<Vertex> = (0..mesh.vertices() as u32).map(vertex).collect();
        for t in (0..mesh.all_triangles() as u32).filter(|&t| mesh.is_alive(t)) {
            let corners = mesh.corners(t);
            let p = corners.map(|v| vertices[v as usize].position);
            let twice_area = (p[1] - p[0]).cross(p[2] - p[0]);
            let length = twice_area.length();
            if !(length.is_finite() && length > 0.0) {
                continue;
            }
            let (n, area) = (twice_area / length, length / 2.0);
            let mut q = Quadric::plane(n, area);
            q.diagonal += area * settings.shape_weight;
            q.area = area;
            corners.iter().for_each(|&v| vertices[v as usize].quadric.add_first(&q));
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if settings.border_weight > 0.0 && is_border(mesh, a, b) {
                    let edge = p[(k + 1) % 3] - p[k];
                    let across = edge.cross(n).normalize_or_zero();
                    let q = Quadric::plane(across, settings.border_weight * edge.length_squared());
                    [a, b].iter().for_each(|&v| vertices[v as usize].quadric.add_first(&q));
                }
            }
        }
        Self { vertices, placement: settings.placement }
    }

    /// An end of the edge, which reaches over `d`, and the root mean square distance, in mesh sizes, to the planes of the one that dies.
    #[inline]
    fn half_edge(a: &Vertex, b: &Vertex, d: Vec3) -> (f32, Place) {
        let (first, second) = (b.quadric.mean_square(-d), a.quadric.mean_square(d));
        // A distance that is not finite must not hide behind the other one: both are NaN or infinite then.
        let second_is_best = if a.locked == b.locked { second < first } else { b.locked };
        let place = if second_is_best { Place::Second } else { Place::First };
        let least = if second_is_best { second } else { first };
        (if a.locked && b.locked { f32::INFINITY } else { least.sqrt() }, place)
    }

    /// The best place, and the root mean square distance, in mesh sizes, to the planes of both ends.
    #[inline]
    fn optimal(a: &Vertex, b: &Vertex, d: Vec3, size: f32) -> (f32, Place) {
        if a.locked || b.locked {
            return Self::half_edge(a, b, d);
        }
        // Everything in the frame of a.
        let mut both = b.quadric.seen_from(-d);
        both.add(&a.quadric);
        let middle = d / 2.0;
        let x = both.minimum(middle).unwrap_or_else(|| {
            let ends = [middle, Vec3::ZERO, d].map(|x| (both.at(x), x));
            ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(middle, |(_, x)| x)
        });
        (both.mean_square(x).sqrt(), Place::At((a.position + x) * size))
    }
}

impl Cost for Quadrics {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        // A power of two, so exact.
        let size = 1.0 / mesh.unit();
        let ends = |&[a, b]: &[u32; 2]| (&self.vertices[a as usize], &self.vertices[b as usize]);
        let mut offsets = [Vec3::ZERO; 32];
        for (edges, out) in edges.chunks(32).zip(out.chunks_mut(32)) {
            // The vertices' first touch, for many edges at once: the processor waits for their cache lines together.
            for (edge, d) in edges.iter().zip(&mut offsets) {
                let (a, b) = ends(edge);
                *d = b.position - a.position;
            }
            for ((edge, &d), out) in edges.iter().zip(&offsets).zip(out) {
                let (a, b) = ends(edge);
                let (distance, place) = match self.placement {
                    Placement::HalfEdge => Self::half_edge(a, b, d),
                    Placement::Optimal => Self::optimal(a, b, d, size),
                };
                *out = Candidate { cost: distance * size, place };
            }
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        let at = at * mesh.unit();
        let from = &self.vertices[from as usize];
        let mut q = from.quadric.seen_from(at - from.position);
        let stays = &mut self.vertices[onto as usize];
        q.add(&stays.quadric.seen_from(at - stays.position));
        (stays.quadric, stays.position) = (q, at);
    }
}

/// Whether the edge has other than two triangles.
fn is_border(mesh: &LiveMesh, a: u32, b: u32) -> bool {
    mesh.is_border(a)
        && mesh.is_border(b)
        && mesh.triangles_of(a).iter().filter(|&&t| others(mesh.corners(t), a).contains(&b)).count() != 2
}
