//! The first phase: a merge tree in the order of the quadric error.

use std::collections::HashMap;

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
    borders: Borders<'a>,
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
            borders: Borders { mesh, extremes, between: HashMap::new() },
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

/// The border as it was: for each of its edges that is left, the vertices that went. Tells how far they are from it now.
struct Borders<'a> {
    mesh: &'a Dense,
    extremes: &'a Extremes,
    /// By the edge's ends, the smaller first; `None` once they were too far to be kept account of.
    between: HashMap<[u32; 2], Option<Vec<u32>>>,
}

/// Beyond this no cut follows the border any more, pixels: what comes later is not measured.
const LOST_PX: f32 = 64.0;

impl Borders<'_> {
    /// `from` goes; its border runs from `onto` straight to `end` now. The most that a vertex that went is seen to be off it,
    /// pixels.
    fn merge(&mut self, from: u32, onto: u32, end: Option<u32>) -> f32 {
        let key = |a: u32, b: u32| [a.min(b), a.max(b)];
        let mut gone = vec![from];
        let mut lost = end.is_none();
        for other in [Some(onto), end].into_iter().flatten() {
            match self.between.remove(&key(from, other)) {
                Some(Some(more)) => gone.extend(more),
                Some(None) => lost = true,
                None => {}
            }
        }
        let Some(end) = end else { return f32::INFINITY };
        let at = |v: u32| self.mesh.positions[v as usize];
        let off = |&v: &u32| self.extremes.moved(at(v), from_segment(at(v), at(onto), at(end)));
        let px = if lost { f32::INFINITY } else { gone.iter().map(off).fold(0.0, f32::max) };
        // Two ways along one edge: whatever closes here is not followed further.
        let taken = self.between.insert(key(onto, end), (px <= LOST_PX).then_some(gone)).is_some();
        if taken { f32::INFINITY } else { px }
    }
}

/// From a point to the nearest one of a segment.
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
            px = px.max(self.borders.merge(from, onto, next_on_border(live, from, onto)));
        }
        self.merges.push(Merge { from, onto, px });
        self.quadrics.collapsed(live, from, onto, at);
    }
}
