//! What a simplified surface is off by, bounded: the two-sided distance measured on the whole, not added up.
//!
//! From the new surface to the original: the original triangles round a new triangle's corners and on from there are projected onto its
//! plane and cut to its outline. Where what is cut covers all of it once, every point of it has a point of the original straight above or below,
//! no farther than the corners of the pieces are. From the original to the new surface: the distance to a triangle is a convex function, so
//! a piece of the original whose corners are within d of one new triangle is within d of it everywhere. Pieces that cross new edges
//! are divided while that is worth it (the branch and bound of Tang, Lee and Kim, *Interactive Hausdorff distance computation for
//! general polygonal models*, 2009, with a depth limit in place of a tolerance: what is left over counts as it is).
//!
//! Where a new triangle is not covered, at borders that moved and in folds, its pieces are compared with the original in the second way.

use std::cell::OnceCell;

use farfield_core::bvh::{TriangleBvh, nearest_on_triangle};
use farfield_core::collapse::LiveMesh;
use glam::Vec3;

/// No triangle.
const NONE: u32 = u32::MAX;
/// Parts of the original are cut by so many new triangles at most.
const CUTS: u32 = 4;
/// Pieces that may lie anywhere are divided so many times at most.
const DEPTH: u32 = 20;
/// Of what is allowed, a part that is not worth a division.
const FINE: f32 = 0.25;
/// Of what is allowed, a part below which the first bound that is found will do: above it nearer triangles are looked for.
const TIGHT: f32 = 0.75;
/// How much too far a piece's bound may be.
const SLACK: f32 = 1.1;
/// What may be missing of a triangle's area that counts as covered: rounding.
const ROUNDING: f32 = 1e-3;

/// Measures again and again what a mesh is off by, as collapses are taken back: only where it has changed.
pub(crate) struct Measure<'a> {
    was: Surface<'a>,
    sheet: Sheet,
    /// Triangles as they were measured last; dead ones name no vertices.
    corners: Vec<[u32; 3]>,
    /// How far each is from the original.
    back: Vec<f32>,
    /// Which original triangles lie over or under which ones; sorted.
    pairs: Vec<[u32; 2]>,
    /// How far a part of an original triangle is from a triangle.
    there: Vec<(u32, u32, f32)>,
}

impl<'a> Measure<'a> {
    /// Of three vertices a triangle, before anything collapsed.
    pub(crate) fn new(positions: &'a [Vec3], original: &'a [u32]) -> Self {
        Self {
            was: Surface { positions, indices: original, tree: OnceCell::new() },
            sheet: Sheet::new(positions.len(), original),
            corners: original.as_chunks::<3>().0.to_vec(),
            back: vec![0.0; original.len() / 3],
            pairs: vec![],
            there: vec![],
        }
    }

    /// For each triangle of `mesh`, which was made of the original and whose vertices have not moved, a distance d, scene units: none of its points is
    /// farther than d from the original surface, and every point of the original is within the d of some triangle of that triangle.
    /// Dead triangles have 0, and so have those that stand for themselves alone. `allowed` says how fine is worth it. O(n log n) for n triangles of
    /// the original at first, then for those that have changed.
    pub(crate) fn off(&mut self, mesh: &LiveMesh, allowed: f32) -> Vec<f32> {
        let (positions, original) = (self.was.positions, self.was.indices);
        let at = |c: [u32; 3]| c.map(|v| positions[v as usize]);
        let whole = |o: u32| [0, 1, 2].map(|k| original[3 * o as usize + k]);
        let all = 0..mesh.all_triangles() as u32;
        let now: Vec<[u32; 3]> =
            all.clone().map(|t| if mesh.is_alive(t) { mesh.corners(t) } else { [NONE; 3] }).collect();
        let same = |t: u32| now[t as usize] == whole(t);
        let changed: Vec<bool> = now.iter().zip(&self.corners).map(|(a, b)| a != b).collect();
        // Originals that are to be compared anew: their triangle, or one that they were compared with, has changed.
        let mut anew = changed.clone();
        self.pairs.iter().filter(|p| changed[p[1] as usize]).for_each(|p| anew[p[0] as usize] = true);
        self.there.iter().filter(|w| changed[w.1 as usize]).for_each(|w| anew[w.0 as usize] = true);
        self.pairs.retain(|p| !changed[p[1] as usize]);
        for t in all.clone().filter(|&t| changed[t as usize]) {
            let far = &mut self.back[t as usize];
            *far = 0.0;
            if !mesh.is_alive(t) || same(t) {
                continue;
            }
            let over = self.sheet.covering(mesh.corners(t), positions, original).unwrap_or(f32::INFINITY);
            // A steep sliver sees what is far along its normal.
            if over > TIGHT * allowed {
                self.was.pieces(Piece::new(at(mesh.corners(t))), DEPTH, allowed, &mut |_, d| *far = far.max(d));
            }
            *far = if *far > 0.0 { far.min(over) } else { over };
            self.sheet.found.iter().for_each(|&o| anew[o as usize] = true);
            self.pairs.extend(self.sheet.found.iter().map(|&o| [o, t]));
        }
        self.pairs.sort_unstable();
        self.there.retain(|w| !anew[w.0 as usize]);
        let living: Vec<u32> = all.clone().filter(|&t| mesh.is_alive(t)).collect();
        let left: Vec<u32> = living.iter().flat_map(|&t| mesh.corners(t)).collect();
        let is = Surface { positions, indices: &left, tree: OnceCell::new() };
        let mut next = 0;
        for o in all.filter(|&o| anew[o as usize] && !same(o)) {
            next += self.pairs[next..].partition_point(|p| p[0] < o);
            let run = &self.pairs[next..next + self.pairs[next..].partition_point(|p| p[0] == o)];
            let original = Piece::new(at(whole(o)));
            // Of its pieces at one triangle the farthest.
            let first = self.there.len();
            let mut keep = |t: u32, d: f32| match self.there[first..].iter_mut().find(|w| w.1 == t) {
                Some(known) => known.2 = known.2.max(d),
                None => self.there.push((o, t, d)),
            };
            // Where it lies over none, or nearer to one that it does not lie over.
            let mut rest = vec![];
            if run.is_empty() {
                rest.push(original);
            }
            among(original, CUTS, run, &|t| at(mesh.corners(t)), allowed, &mut |piece, t, d| {
                if d > TIGHT * allowed { rest.push(piece) } else { keep(t, d) }
            });
            for p in rest {
                is.pieces(p, DEPTH, allowed, &mut |t, d| keep(living[t as usize], d));
            }
        }
        self.corners = now;
        let mut out = self.back.clone();
        self.there.iter().for_each(|&(_, t, d)| out[t as usize] = out[t as usize].max(d));
        out
    }
}

/// The distance of a point from a triangle, rounded up.
fn distance(p: Vec3, triangle: [Vec3; 3]) -> f32 {
    let p = p.as_dvec3();
    (nearest_on_triangle(p, triangle.map(|v| v.as_dvec3())).0.distance(p) as f32).next_up()
}

/// Bounds a piece of the original by the triangles in `run`: by one of them where that is tight, else what lies over or under one is cut out.
fn among(
    piece: Piece,
    depth: u32,
    run: &[[u32; 2]],
    triangle: &dyn Fn(u32) -> [Vec3; 3],
    allowed: f32,
    keep: &mut dyn FnMut(Piece, u32, f32),
) {
    if piece.count == 0 || run.is_empty() {
        return;
    }
    // Of each corner the nearest triangle, of each triangle the farthest corner.
    let (mut near, mut best) = ([f32::INFINITY; CORNERS], (f32::INFINITY, NONE));
    for &[_, t] in run {
        let there = triangle(t);
        let mut far = 0f32;
        for (near, &p) in near.iter_mut().zip(piece.corners()) {
            let off = distance(p, there);
            (*near, far) = (near.min(off), far.max(off));
        }
        if far < best.0 {
            best = (far, t);
        }
    }
    let (far, t) = best;
    if depth == 0 || far <= FINE * allowed || far <= SLACK * near[..piece.count].iter().copied().fold(0.0, f32::max) {
        return keep(piece, t, far);
    }
    let middle = piece.middle();
    let host = run
        .iter()
        .map(|p| p[1])
        .min_by(|&a, &b| distance(middle, triangle(a)).total_cmp(&distance(middle, triangle(b))));
    let Some(host) = host else { return };
    let (outside, inside) = piece.split(triangle(host));
    outside.into_iter().for_each(|p| among(p, depth - 1, run, triangle, allowed, keep));
    among(inside, 0, run, triangle, allowed, keep);
}

/// Triangles with a tree that is built when it is asked for.
struct Surface<'a> {
    positions: &'a [Vec3],
    indices: &'a [u32],
    tree: OnceCell<TriangleBvh>,
}

impl Surface<'_> {
    /// Bounds a piece by the triangle of this surface that is nearest to its middle; where that is not tight, what lies over or under that
    /// triangle is cut out, if it is of its size and not every time, else it is halved.
    fn pieces(&self, piece: Piece, depth: u32, allowed: f32, out: &mut dyn FnMut(u32, f32)) {
        let tree = self.tree.get_or_init(|| TriangleBvh::build(self.positions, self.indices));
        if piece.count == 0 {
            return;
        }
        let Some(near) = tree.closest_point(piece.middle(), f32::INFINITY) else { return };
        let there = [0, 1, 2].map(|k| self.positions[self.indices[3 * near.triangle as usize + k] as usize]);
        let far = |p: &Piece| p.corners().iter().map(|&p| distance(p, there)).fold(0.0, f32::max);
        let whole = far(&piece);
        if depth == 0 || whole <= FINE * allowed || whole <= SLACK * near.distance {
            return out(near.triangle, whole);
        }
        let (outside, inside) = piece.split(there);
        let over = far(&inside);
        // Every second time, since cutting alone may go round in slivers.
        let small = depth.is_multiple_of(2) && piece.longest().0 <= 2.0 * Piece::new(there).longest().0;
        if small && inside.count > 0 && over <= TIGHT * allowed {
            out(near.triangle, over);
            outside.into_iter().for_each(|p| self.pieces(p, depth - 1, allowed, out));
        } else {
            piece.halves().into_iter().for_each(|p| self.pieces(p, depth - 1, allowed, out));
        }
    }
}

/// The original surface, to walk on.
struct Sheet {
    /// Triangles of vertex v: `triangles[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// The walk that met a triangle last.
    met: Vec<u32>,
    walks: u32,
    /// Triangles of the last walk that lie over or under its triangle.
    found: Vec<u32>,
    stack: Vec<u32>,
}

impl Sheet {
    fn new(vertices: usize, indices: &[u32]) -> Self {
        let mut starts = vec![0u32; vertices + 1];
        indices.iter().for_each(|&v| starts[v as usize + 1] += 1);
        (0..vertices).for_each(|v| starts[v + 1] += starts[v]);
        let (mut next, mut triangles) = (starts.clone(), vec![0; indices.len()]);
        for (i, &v) in indices.iter().enumerate() {
            triangles[next[v as usize] as usize] = i as u32 / 3;
            next[v as usize] += 1;
        }
        let met = vec![0; indices.len() / 3];
        Self { starts, triangles, met, walks: 0, found: vec![], stack: vec![] }
    }

    fn meet(&mut self, vertex: u32) {
        for i in self.starts[vertex as usize]..self.starts[vertex as usize + 1] {
            let t = self.triangles[i as usize];
            if self.met[t as usize] != self.walks {
                self.met[t as usize] = self.walks;
                self.stack.push(t);
            }
        }
    }

    /// The largest height over or under a triangle of what lies there, walking from its corners; `None` where that does not cover it once.
    fn covering(&mut self, corners: [u32; 3], positions: &[Vec3], indices: &[u32]) -> Option<f32> {
        self.walks += 1;
        self.found.clear();
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        let (across, up) = normal.any_orthonormal_pair();
        let flat = |p: Vec3| Vec3::new((p - a).dot(across), (p - a).dot(up), (p - a).dot(normal));
        let outline = [a, b, c].map(flat);
        let outwards = [0, 1, 2].map(|k| (outline[(k + 1) % 3] - outline[k]).cross(Vec3::Z));
        let whole = (b - a).cross(c - a).length();
        corners.iter().for_each(|&v| self.meet(v));
        let (mut height, mut area) = (0f32, 0f32);
        while let Some(t) = self.stack.pop() {
            let ids = [0, 1, 2].map(|k| indices[3 * t as usize + k]);
            let mut cut = Piece::new(ids.map(|v| flat(positions[v as usize])));
            for (&at, &outwards) in outline.iter().zip(&outwards) {
                cut = cut.cut(at, outwards).0;
            }
            if cut.count == 0 {
                continue;
            }
            self.found.push(t);
            (height, area) = (height.max(cut.height()), area + cut.area());
            ids.iter().for_each(|&v| self.meet(v));
        }
        ((area - whole).abs() <= ROUNDING * whole).then_some(height.next_up())
    }
}

/// Corners at most of what cuts leave of a triangle.
const CORNERS: usize = 16;

/// A convex polygon.
#[derive(Clone, Copy)]
struct Piece {
    points: [Vec3; CORNERS],
    count: usize,
}

impl Piece {
    const NONE: Self = Self { points: [Vec3::ZERO; CORNERS], count: 0 };

    fn new(triangle: [Vec3; 3]) -> Self {
        let mut out = Self { count: 3, ..Self::NONE };
        out.points[..3].copy_from_slice(&triangle);
        out
    }

    fn corners(&self) -> &[Vec3] {
        &self.points[..self.count]
    }

    fn middle(&self) -> Vec3 {
        self.corners().iter().sum::<Vec3>() / self.count as f32
    }

    fn push(&mut self, p: Vec3) {
        self.points[self.count] = p;
        self.count += 1;
    }

    /// What lies behind a plane and what lies before it (Sutherland and Hodgman 1974); what only touches it lies on one side. All of it lies behind where
    /// its parts had too many corners.
    fn cut(&self, at: Vec3, normal: Vec3) -> (Self, Self) {
        let (mut behind, mut before) = (Self::NONE, Self::NONE);
        let sides = self.points.map(|p| (p - at).dot(normal));
        let sides = &sides[..self.count];
        // Two for a convex polygon; more where rounding bends its sides.
        let crosses = |s: f32, t: f32| s > 0.0 && t < 0.0 || s < 0.0 && t > 0.0;
        let crossings = (0..self.count).filter(|&i| crosses(sides[i], sides[(i + 1) % self.count])).count();
        if self.count + crossings > CORNERS || sides.iter().all(|&s| s <= 0.0) {
            return (*self, before);
        }
        if sides.iter().all(|&s| s >= 0.0) {
            return (behind, *self);
        }
        for i in 0..self.count {
            let next = (i + 1) % self.count;
            let (p, s, t) = (self.points[i], sides[i], sides[next]);
            if s <= 0.0 {
                behind.push(p);
            }
            if s >= 0.0 {
                before.push(p);
            }
            if crosses(s, t) {
                let on = p + (self.points[next] - p) * (s / (s - t));
                behind.push(on);
                before.push(on);
            }
        }
        (behind, before)
    }

    /// The length of its longest side, and the corner where that begins.
    fn longest(&self) -> (f32, usize) {
        let length = |i: usize| self.points[i].distance(self.points[(i + 1) % self.count]);
        (0..self.count).map(|i| (length(i), i)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a })
    }

    /// Cut across its longest side, in the middle.
    fn halves(self) -> [Self; 2] {
        let longest = self.longest().1;
        let (p, q) = (self.points[longest], self.points[(longest + 1) % self.count]);
        let (behind, before) = self.cut(p.midpoint(q), q - p);
        [behind, before]
    }

    /// What lies outside a triangle's prism, in three pieces, and what lies inside.
    fn split(self, [a, b, c]: [Vec3; 3]) -> ([Self; 3], Self) {
        let normal = (b - a).cross(c - a);
        let mut rest = self;
        let outside = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            let (inside, outside) = rest.cut(p, (q - p).cross(normal));
            rest = inside;
            outside
        });
        (outside, rest)
    }

    /// Twice the area of what it is in the plane z = 0, counter-clockwise positive.
    fn area(&self) -> f32 {
        let arms = self.corners().iter().map(|p| p.truncate() - self.points[0].truncate());
        arms.clone().zip(arms.skip(1)).map(|(a, b)| a.perp_dot(b)).sum()
    }

    fn height(&self) -> f32 {
        self.corners().iter().map(|p| p.z.abs()).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bent_sides_cut_along_them_stay_within_their_corners() {
        // Every second corner is off the plane by rounding: each side crosses it.
        for count in 3..=CORNERS {
            let mut piece = Piece { count, ..Piece::NONE };
            for (i, p) in piece.points[..count].iter_mut().enumerate() {
                *p = Vec3::new(i as f32, if i % 2 == 0 { 1e-7 } else { -1e-7 }, 0.0);
            }
            let (behind, before) = piece.cut(Vec3::ZERO, Vec3::Y);
            let all = |p: &Vec3| behind.corners().contains(p) || before.corners().contains(p);
            assert!(piece.corners().iter().all(all) && behind.count.max(before.count) <= CORNERS);
        }
    }
}
