//! The first phase: a merge tree in the order of the quadric error.

use farfield_core::collapse::{Candidate, Cost, LiveMesh, Place, Placement, QuadricSettings, Quadrics};
use glam::Vec3;

use super::Extremes;
use crate::dense::Dense;

/// Weight of the planes that hold borders: a border counts as much as the surface of its edges' squares.
const BORDER_WEIGHT: f32 = 1.0;

/// A vertex that was merged into another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Merge {
    pub(super) from: u32,
    pub(super) onto: u32,
    /// How far the surface moves for it, with all that was merged before, pixels.
    pub(super) px: f32,
}

/// Prices by quadrics, and takes down what is merged.
pub(super) struct Tree<'a> {
    quadrics: Quadrics,
    mesh: &'a Dense,
    extremes: &'a Extremes,
    normals: Vec<Vec3>,
    /// How far a vertex's stretch of border has moved, pixels.
    border_px: Vec<f32>,
    pub(super) merges: Vec<Merge>,
}

impl<'a> Tree<'a> {
    pub(super) fn new(live: &LiveMesh, mesh: &'a Dense, extremes: &'a Extremes) -> Self {
        let settings =
            QuadricSettings { placement: Placement::HalfEdge, border_weight: BORDER_WEIGHT, ..Default::default() };
        let mut normals = vec![Vec3::ZERO; mesh.positions.len()];
        for t in mesh.indices.as_chunks::<3>().0 {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|&v| normals[v as usize] += n);
        }
        Self {
            quadrics: Quadrics::new(live, settings),
            mesh,
            extremes,
            normals: normals.into_iter().map(Vec3::normalize_or_zero).collect(),
            border_px: vec![0.0; mesh.positions.len()],
            merges: vec![],
        }
    }
}

/// Whether `from` may die onto `onto`: vertices of a border and of the cube's edges stay on theirs.
pub(super) fn may(live: &LiveMesh, views_of: &[u8], from: u32, onto: u32) -> bool {
    let (own, other) = (views_of[from as usize], views_of[onto as usize]);
    let slides = own.is_power_of_two() || own & other == own;
    slides && (!live.is_border(from) || (live.is_border(onto) && sides(live, from, onto) == 1))
}

/// Number of triangles of an edge.
pub(super) fn sides(live: &LiveMesh, a: u32, b: u32) -> usize {
    live.triangles_of(a).iter().filter(|&&t| live.corners(t).contains(&b)).count()
}

/// The other neighbour along the border of a border vertex.
fn next_on_border(live: &LiveMesh, v: u32, beside: u32) -> Option<u32> {
    let around = live.triangles_of(v).iter().flat_map(|&t| live.corners(t));
    around.filter(|&x| x != v && x != beside).find(|&x| live.is_border(x) && sides(live, v, x) == 1)
}

fn from_segment(p: Vec3, a: Vec3, b: Vec3) -> Vec3 {
    let d = b - a;
    let t = ((p - a).dot(d) / d.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    a + d * t - p
}

impl Cost for Tree<'_> {
    fn costs(&mut self, live: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.quadrics.costs(live, edges, out);
        for (&[a, b], out) in edges.iter().zip(out) {
            let (first, second) = (may(live, &self.mesh.views_of, b, a), may(live, &self.mesh.views_of, a, b));
            let chosen = if out.place == Place::First { first } else { second };
            if chosen {
                continue;
            }
            *out = match (first, second) {
                (true, _) => Candidate { cost: self.quadrics.half_edge(live, b, a), place: Place::First },
                (_, true) => Candidate { cost: self.quadrics.half_edge(live, a, b), place: Place::Second },
                _ => Candidate::FORBIDDEN,
            };
        }
    }

    fn collapsed(&mut self, live: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        let p = live.position(from);
        let error = self.quadrics.half_edge(live, from, onto);
        let mut px = error * self.extremes.along(p, self.normals[from as usize]);
        if live.is_border(from) {
            let end = next_on_border(live, from, onto).map_or(at, |v| live.position(v));
            let moved = self.extremes.moved(p, from_segment(p, at, end));
            let sum = self.border_px[from as usize].max(self.border_px[onto as usize]) + moved;
            self.border_px[onto as usize] = sum;
            px = px.max(sum);
        }
        self.merges.push(Merge { from, onto, px });
        self.quadrics.collapsed(live, from, onto, at);
    }
}
