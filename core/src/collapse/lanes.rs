//! Prices of four edges at a time: a vector's lanes are four edges.
//!
//! A vertex is one cache line of four rows of four numbers, so four vertices become lanes by four 4 x 4 transpositions. The formulas
//! are those of [`super::quadric`], which has the words. Arrays are spelt out: a map over one is not always inlined. Plain [`glam::Vec4`]: SSE2 or NEON where there is one.

use glam::{Mat4, Vec3, Vec4};

use super::quadric::Quadric;
use super::{Candidate, Place};

/// Pull towards the edge's middle, relative to the quadric's trace. f32 solves a system of condition 1/ridge to 1e-3.
const RIDGE: f32 = 1e-4;

/// All that a price reads of a vertex. Rows: A's xx, yy, zz and the area; A's yz, xz, xy and c; b and whether it is locked
/// (1 or 0); the position in mesh sizes and 0.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Vertex([Vec4; 4]);

impl Vertex {
    pub(super) fn new(position: Vec3, locked: bool) -> Self {
        Self([Vec4::ZERO, Vec4::ZERO, Vec4::new(0.0, 0.0, 0.0, locked as u8 as f32), position.extend(0.0)])
    }

    #[inline]
    pub(super) fn position(&self) -> Vec3 {
        self.0[3].truncate()
    }

    #[inline]
    pub(super) fn quadric(&self) -> Quadric {
        let [d, m, b, _] = self.0;
        Quadric { diagonal: d.truncate(), mixed: m.truncate(), b: b.truncate(), c: m.w, area: d.w }
    }

    #[inline]
    pub(super) fn set(&mut self, q: &Quadric, position: Vec3) {
        let locked = self.0[2].w;
        self.0 = [q.diagonal.extend(q.area), q.mixed.extend(q.c), q.b.extend(locked), position.extend(0.0)];
    }

    /// Adds a quadric of the same origin whose b and c are 0.
    #[inline]
    pub(super) fn add_first(&mut self, q: &Quadric) {
        self.0[0] += q.diagonal.extend(q.area);
        self.0[1] += q.mixed.extend(0.0);
    }
}

/// A vertex of each of four edges.
struct Lanes {
    xx: Vec4,
    yy: Vec4,
    zz: Vec4,
    area: Vec4,
    yz: Vec4,
    xz: Vec4,
    xy: Vec4,
    c: Vec4,
    b: [Vec4; 3],
    locked: Vec4,
    position: [Vec4; 3],
}

impl Lanes {
    #[inline]
    fn of(v: [&Vertex; 4]) -> Self {
        let row = |k: usize| Mat4::from_cols(v[0].0[k], v[1].0[k], v[2].0[k], v[3].0[k]).transpose();
        let [d, m, b, p] = [row(0), row(1), row(2), row(3)];
        Self {
            xx: d.x_axis,
            yy: d.y_axis,
            zz: d.z_axis,
            area: d.w_axis,
            yz: m.x_axis,
            xz: m.y_axis,
            xy: m.z_axis,
            c: m.w_axis,
            b: [b.x_axis, b.y_axis, b.z_axis],
            locked: b.w_axis,
            position: [p.x_axis, p.y_axis, p.z_axis],
        }
    }

    #[inline]
    fn of_both([p, q, r, s]: [(&Vertex, &Vertex); 4]) -> (Self, Self) {
        (Self::of([p.0, q.0, r.0, s.0]), Self::of([p.1, q.1, r.1, s.1]))
    }

    /// A x.
    #[inline]
    fn times(&self, [x, y, z]: [Vec4; 3]) -> [Vec4; 3] {
        [
            self.xx * x + self.xy * y + self.xz * z,
            self.xy * x + self.yy * y + self.yz * z,
            self.xz * x + self.yz * y + self.zz * z,
        ]
    }

    /// Mean square distance at x to the planes; infinite where it is no number.
    #[inline]
    fn mean_square(&self, x: [Vec4; 3]) -> Vec4 {
        let [ax, ay, az] = self.times(x);
        let [bx, by, bz] = self.b;
        let error = x[0] * (ax + 2.0 * bx) + x[1] * (ay + 2.0 * by) + x[2] * (az + 2.0 * bz) + self.c;
        let mean = error.max(Vec4::ZERO) / self.area.max(Vec4::splat(f32::MIN_POSITIVE));
        Vec4::select(error.is_finite_mask(), mean, Vec4::INFINITY)
    }

    /// Adds a quadric that is seen from d further on: Q(x - d).
    #[inline]
    fn add_from(&mut self, q: &Self, d: [Vec4; 3]) {
        let ad = q.times(d);
        self.c += q.c;
        for k in 0..3 {
            self.c += d[k] * (ad[k] - 2.0 * q.b[k]);
            self.b[k] += q.b[k] - ad[k];
        }
        self.xx += q.xx;
        self.yy += q.yy;
        self.zz += q.zz;
        self.yz += q.yz;
        self.xz += q.xz;
        self.xy += q.xy;
        self.area += q.area;
    }

    /// Minimum of Q(x) + ridge tr(A) |x - middle|^2, or the middle where there is no finite one.
    #[inline]
    fn minimum(&self, middle: [Vec4; 3]) -> [Vec4; 3] {
        let ridge = RIDGE * (self.xx + self.yy + self.zz);
        let (xx, yy, zz) = (self.xx + ridge, self.yy + ridge, self.zz + ridge);
        let (yz, xz, xy) = (self.yz, self.xz, self.xy);
        // (A + ridge I) x = ridge middle - b =: r, by Cramer's rule: x = adj(A + ridge I) r / det(A + ridge I).
        let (xx_, xy_, xz_) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let (yy_, yz_, zz_) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
        let over = 1.0 / (xx * xx_ + xy * xy_ + xz * xz_);
        let r = |k: usize| ridge * middle[k] - self.b[k];
        let r = [r(0), r(1), r(2)];
        let x = [
            (xx_ * r[0] + xy_ * r[1] + xz_ * r[2]) * over,
            (xy_ * r[0] + yy_ * r[1] + yz_ * r[2]) * over,
            (xz_ * r[0] + yz_ * r[1] + zz_ * r[2]) * over,
        ];
        let finite = (x[0] + x[1] + x[2]).is_finite_mask();
        let or_middle = |k: usize| Vec4::select(finite, x[k], middle[k]);
        [or_middle(0), or_middle(1), or_middle(2)]
    }
}

#[inline]
fn offset(a: &Lanes, b: &Lanes) -> [Vec4; 3] {
    let d = |k: usize| b.position[k] - a.position[k];
    [d(0), d(1), d(2)]
}

/// The mean square distance to the planes of the vertex that dies, and whether it is the first.
#[inline]
fn onto_an_end(a: &Lanes, b: &Lanes, d: [Vec4; 3]) -> (Vec4, [bool; 4]) {
    // A locked vertex does not die.
    let forbid = |v: &Lanes, mean: Vec4| Vec4::select(v.locked.cmpgt(Vec4::ZERO), Vec4::INFINITY, mean);
    let first_dies = forbid(a, a.mean_square(d));
    let second_dies = forbid(b, b.mean_square([-d[0], -d[1], -d[2]]));
    (first_dies.min(second_dies), first_dies.cmplt(second_dies).into())
}

/// Prices with the survivor at an end, in the unit of `size`.
#[inline]
pub(super) fn half_edge(four: [(&Vertex, &Vertex); 4], size: f32) -> [Candidate; 4] {
    let (a, b) = Lanes::of_both(four);
    let (mean, first_dies) = onto_an_end(&a, &b, offset(&a, &b));
    let mean = (mean.sqrt() * size).to_array();
    let candidate =
        |i: usize| Candidate { cost: mean[i], place: if first_dies[i] { Place::Second } else { Place::First } };
    [candidate(0), candidate(1), candidate(2), candidate(3)]
}

/// Prices with the survivor where the error is least, in the unit of `size`; at an end where the other one is locked.
#[inline]
pub(super) fn optimal(four: [(&Vertex, &Vertex); 4], size: f32) -> [Candidate; 4] {
    let (mut a, b) = Lanes::of_both(four);
    let locked = (a.locked + b.locked).to_array();
    let d = offset(&a, &b);
    a.add_from(&b, d);
    let x = a.minimum([0.5 * d[0], 0.5 * d[1], 0.5 * d[2]]);
    let mean = (a.mean_square(x).sqrt() * size).to_array();
    let at = |k: usize| ((a.position[k] + x[k]) * size).to_array();
    let at = [at(0), at(1), at(2)];
    let candidate = |i: usize| Candidate { cost: mean[i], place: Place::At(Vec3::new(at[0][i], at[1][i], at[2][i])) };
    let mut out = [candidate(0), candidate(1), candidate(2), candidate(3)];
    if locked != [0.0; 4] {
        let ends = half_edge(four, size);
        (0..4).filter(|&i| locked[i] > 0.0).for_each(|i| out[i] = ends[i]);
    }
    out
}
