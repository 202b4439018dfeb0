//! What no collapse may do: move a locked vertex, change the topology, fold a triangle over.
//!
//! The link condition follows Dey, Edelsbrunner, Guha and Nekhayev 1999 (Topology preserving edge contraction, section 4): the
//! links of the two vertices may meet in the link of the edge only. Borders (edges of other than two triangles) count as if a
//! cone closed them, as the paper's section 5 does it: one flag a vertex stands for its edge to the cone's tip, which is exact
//! on manifolds with boundary and conservative at non-manifold edges. O(valence) a check.

use glam::Vec3;

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
    // Twice the area vectors' squares multiply to lengths^8: with 1024 a mesh, edges of 1e-7 to 10 meshes stay within f32.
    let unit = mesh.unit() * 1024.0;
    let old = mesh.position(moving);
    mesh.triangles_of(moving).iter().any(|&t| {
        let [x, y] = others(mesh.corners(t), moving);
        if x == partner || y == partner {
            return false;
        }
        let [x, y] = [mesh.position(x), mesh.position(y)];
        let side = (y - x) * unit;
        let before = ((x - old) * unit).cross(side);
        let after = ((x - at) * unit).cross(side);
        let sizes = (before.length_squared() * after.length_squared()).sqrt();
        // Written so that NaN folds. A triangle without area has no side to turn.
        before != Vec3::ZERO && !(before.dot(after) >= min_cos * sizes && after != Vec3::ZERO)
    })
}
