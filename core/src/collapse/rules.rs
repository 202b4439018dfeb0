//! What no collapse may do: move a locked vertex, change the topology, fold a triangle over.
//!
//! The link condition follows Dey, Edelsbrunner, Guha and Nekhayev 1999 (Topology preserving edge contraction, section 4): the
//! links of the two vertices may meet in the link of the edge only. Borders (edges of other than two triangles) count as if a
//! cone closed them, as the paper's section 5 does it: one flag a vertex stands for its edge to the cone's tip, which is exact
//! on manifolds with boundary and conservative at non-manifold edges. O(valence) a check.

use glam::{Mat4, Vec3, Vec4};

use super::mesh::{LiveMesh, Marks, others};
use super::{Place, Settings, resolve};

pub(super) struct Rules {
    marks: Marks,
    apexes: Vec<u32>,
    link_condition: bool,
    /// Cosine of the largest turn; None lets anything pass.
    min_cos: Option<f32>,
}

impl Rules {
    pub(super) fn new(mesh: &LiveMesh, settings: &Settings) -> Self {
        let turn = settings.max_turn_rad;
        Self {
            marks: Marks::new(mesh.vertices()),
            apexes: Vec::new(),
            link_condition: settings.link_condition,
            min_cos: (turn < std::f32::consts::PI).then(|| turn.max(0.0).cos()),
        }
    }

    /// Whether the edge may be collapsed so. The edge is a living one.
    pub(super) fn allow(&mut self, mesh: &LiveMesh, edge: [u32; 2], place: Place) -> bool {
        let (from, onto, at) = resolve(mesh, edge, place);
        let moves = matches!(place, Place::At(_));
        if mesh.is_locked(from) || (moves && (mesh.is_locked(onto) || !at.is_finite())) {
            return false;
        }
        if let Some(min_cos) = self.min_cos
            && (folds(mesh, from, onto, at, min_cos) || (moves && folds(mesh, onto, from, at, min_cos)))
        {
            return false;
        }
        !self.link_condition || self.keeps_topology(mesh, from, onto)
    }

    fn keeps_topology(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> bool {
        // Marked: the neighbours of `onto`, less the apexes of the edge's triangles.
        self.marks.clear();
        self.apexes.clear();
        let mut sides = 0;
        for &t in mesh.triangles_of(onto) {
            let [x, y] = others(mesh.corners(t), onto);
            self.marks.insert(x);
            self.marks.insert(y);
            if x == from || y == from {
                self.apexes.push(if x == from { y } else { x });
                sides += 1;
            }
        }
        self.apexes.iter().for_each(|&w| self.marks.remove(w));
        self.marks.remove(from);
        let apexes = &self.apexes;
        for &t in mesh.triangles_of(from) {
            let [x, y] = others(mesh.corners(t), from);
            if x == onto || y == onto {
                continue;
            }
            // A common neighbour beside the apexes, or an edge (x, y) in both links.
            if self.marks.has(x) || self.marks.has(y) {
                return false;
            }
            if apexes.contains(&x) && apexes.contains(&y) && spans(mesh, [onto, x, y]) {
                return false;
            }
        }
        match sides {
            // A lone triangle: the edge (apex, cone's tip) must not be in both links.
            1 => sides_of(mesh, from, apexes[0]) != 1 || sides_of(mesh, onto, apexes[0]) != 1,
            // The cone's tip is in both links but not in the edge's.
            2 => !(mesh.is_border(from) && mesh.is_border(onto)),
            _ => true,
        }
    }
}

/// Number of triangles of an edge.
fn sides_of(mesh: &LiveMesh, a: u32, b: u32) -> usize {
    mesh.triangles_of(a).iter().filter(|&&t| mesh.corners(t).contains(&b)).count()
}

/// Whether these three vertices are a triangle of the mesh, either way round.
fn spans(mesh: &LiveMesh, [a, b, c]: [u32; 3]) -> bool {
    mesh.triangles_of(a).iter().any(|&t| {
        let around = others(mesh.corners(t), a);
        around == [b, c] || around == [c, b]
    })
}

/// Whether a triangle of `moving` that survives would turn too far, or lose its area, with that vertex `at`.
#[inline]
fn folds(mesh: &LiveMesh, moving: u32, partner: u32, at: Vec3, min_cos: f32) -> bool {
    let fold = Fold::new(mesh, moving, at, min_cos);
    let mut four = [[moving; 2]; 4];
    let mut filled = 0;
    for &t in mesh.triangles_of(moving) {
        let [x, y] = others(mesh.corners(t), moving);
        // No branch: it would be mispredicted at every other collapse.
        four[filled] = [x, y];
        filled += ((x != partner) & (y != partner)) as usize;
        if filled == 4 {
            if fold.any(mesh, &four) {
                return true;
            }
            filled = 0;
        }
    }
    if filled == 0 {
        return false;
    }
    // The free lanes repeat the first triangle.
    let first = four[0];
    four[filled..].fill(first);
    fold.any(mesh, &four)
}

/// A move of a vertex, to be tried on its triangles four at a time: a vector's lanes are four triangles.
struct Fold {
    old: [Vec4; 3],
    new: [Vec4; 3],
    unit: f32,
    min_cos: f32,
}

impl Fold {
    #[inline]
    fn new(mesh: &LiveMesh, moving: u32, at: Vec3, min_cos: f32) -> Self {
        // Twice the area vectors' squares multiply to lengths^8: with 1024 a mesh, edges of 1e-7 to 10 meshes stay within f32.
        let unit = mesh.unit() * 1024.0;
        let splat = |p: Vec3| [Vec4::splat(p.x), Vec4::splat(p.y), Vec4::splat(p.z)];
        Self { old: splat(mesh.position(moving)), new: splat(at), unit, min_cos }
    }

    /// Whether one of four triangles, named by the two vertices beside the one that moves, turns too far or loses its area.
    #[inline]
    fn any(&self, mesh: &LiveMesh, four: &[[u32; 2]; 4]) -> bool {
        let lanes = |k: usize| {
            let row = |i: usize| mesh.row(four[i][k]);
            let rows = Mat4::from_cols(row(0), row(1), row(2), row(3)).transpose();
            [rows.x_axis, rows.y_axis, rows.z_axis]
        };
        let (x, y) = (lanes(0), lanes(1));
        let side = minus(y, x, self.unit);
        let before = cross(minus(x, self.old, self.unit), side);
        let after = cross(minus(x, self.new, self.unit), side);
        let sizes = (dot(before, before) * dot(after, after)).sqrt();
        let is_not_zero = |a: [Vec4; 3]| a[0].cmpne(Vec4::ZERO) | a[1].cmpne(Vec4::ZERO) | a[2].cmpne(Vec4::ZERO);
        // Written so that NaN folds. A triangle without area has no side to turn.
        let keeps = dot(before, after).cmpge(self.min_cos * sizes) & is_not_zero(after);
        (is_not_zero(before) & !keeps).any()
    }
}

#[inline]
fn minus(a: [Vec4; 3], b: [Vec4; 3], scale: f32) -> [Vec4; 3] {
    [(a[0] - b[0]) * scale, (a[1] - b[1]) * scale, (a[2] - b[2]) * scale]
}

#[inline]
fn cross(a: [Vec4; 3], b: [Vec4; 3]) -> [Vec4; 3] {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

#[inline]
fn dot(a: [Vec4; 3], b: [Vec4; 3]) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
