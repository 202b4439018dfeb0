//! Candidates in a convex polygon: the paper's, by the Delaunay triangulation of the samples.
//!
//! Circumcentres of its triangles are the Voronoi vertices. A Voronoi edge lies on the bisector of a Delaunay edge, between or
//! beyond the circumcentres beside it; where the bisector crosses the polygon's border is therefore decided by a test that knows
//! no orientation and no ray to infinity: no sample may be nearer than the edge's two. That serves collinear samples too, whose
//! triangulation has edges and no triangle. O(n log n + n^2 m) for n samples and m corners.

use glam::{DVec2, dvec2};
use spade::{DelaunayTriangulation, Point2, Triangulation};

use super::{Frame, MERGED, SLACK, empty_ball, finish, nearest2};

/// The candidates for another sample in a convex polygon: Voronoi vertices inside, crossings of Voronoi edges with the border,
/// corners that are locally farthest; sorted by x, then y. Without samples the polygon's corners. Empty for a polygon without
/// corners or one that is not finite.
pub fn planar(footprint: &[[f32; 2]], samples: &[DVec2]) -> Vec<DVec2> {
    let mut corners: Vec<[f64; 2]> = footprint.iter().map(|c| c.map(f64::from)).collect();
    let Some(frame) = Frame::around(&corners) else { return vec![] };
    corners.iter_mut().for_each(|c| *c = frame.into(*c));
    let mut polygon: Vec<DVec2> = vec![];
    for c in corners.into_iter().map(DVec2::from) {
        if polygon.iter().all(|p| p.distance(c) > MERGED) {
            polygon.push(c);
        }
    }
    if area(&polygon) < 0.0 {
        polygon.reverse();
    }
    let samples = frame.samples(samples.iter().map(|s| s.to_array()));
    if samples.is_empty() {
        return finish(frame, polygon.iter().map(|p| p.to_array()).collect(), &samples)
            .into_iter()
            .map(DVec2::from)
            .collect();
    }
    let mut found = vec![];
    diagram(&polygon, &samples, &mut found);
    found
        .extend((0..polygon.len()).filter(|&i| locally_farthest(&polygon, i, &samples)).map(|i| polygon[i].to_array()));
    finish(frame, found, &samples).into_iter().map(DVec2::from).collect()
}

/// Vertices of the Voronoi diagram inside, crossings of its edges with the border.
fn diagram(polygon: &[DVec2], samples: &[[f64; 2]], found: &mut Vec<[f64; 2]>) {
    let mut delaunay: DelaunayTriangulation<Point2<f64>> = DelaunayTriangulation::new();
    for s in samples {
        // Finite, neither huge nor tiny: it cannot be refused.
        let _ = delaunay.insert(Point2::new(s[0], s[1]));
    }
    for face in delaunay.inner_faces() {
        let c = face.circumcenter();
        let p = dvec2(c.x, c.y);
        if p.is_finite() && inside(polygon, p) {
            found.push(p.to_array());
        }
    }
    for edge in delaunay.undirected_edges() {
        let [a, b] = edge.positions().map(|p| dvec2(p.x, p.y));
        for i in 0..polygon.len() {
            let (from, to) = (polygon[i], polygon[(i + 1) % polygon.len()]);
            if let Some(p) = on_bisector(a, b, from, to)
                && empty_ball(p.to_array(), p.distance_squared(a).max(p.distance_squared(b)), samples)
            {
                found.push(p.to_array());
            }
        }
    }
}

/// Where the bisector of a and b crosses a segment; `None` where it does not, or lies along it: then the neighbouring sides of the
/// polygon are crossed at the segment's ends.
fn on_bisector(a: DVec2, b: DVec2, from: DVec2, to: DVec2) -> Option<DVec2> {
    // (p - (a + b) / 2) . (b - a) = 0 on p = from + t (to - from).
    let n = b - a;
    let side = |p: DVec2| (p - 0.5 * (a + b)).dot(n);
    let (u, v) = (side(from), side(to));
    let t = u / (u - v);
    let slack = SLACK / from.distance(to);
    (t >= -slack && t <= 1.0 + slack).then(|| from.lerp(to, t.clamp(0.0, 1.0)))
}

/// Twice the signed area.
fn area(polygon: &[DVec2]) -> f64 {
    (0..polygon.len()).map(|i| polygon[i].perp_dot(polygon[(i + 1) % polygon.len()])).sum()
}

/// Whether a point lies in a counter-clockwise polygon, its border included. A polygon without area is its points' hull.
fn inside(polygon: &[DVec2], p: DVec2) -> bool {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    polygon.iter().for_each(|&c| (low, high) = (low.min(c), high.max(c)));
    let within = p.cmpge(low - SLACK).all() && p.cmple(high + SLACK).all();
    within
        && (0..polygon.len()).all(|i| {
            let along = polygon[(i + 1) % polygon.len()] - polygon[i];
            along.perp_dot(p - polygon[i]) >= -SLACK * along.length()
        })
}

/// Whether the distance to the nearest sample falls along both sides that leave a corner. (Square to a side it grows.)
fn locally_farthest(polygon: &[DVec2], i: usize, samples: &[[f64; 2]]) -> bool {
    let (n, c) = (polygon.len(), polygon[i]);
    let least = nearest2(c.to_array(), samples);
    let Some(s) = samples.iter().map(|&s| DVec2::from(s)).find(|s| s.distance_squared(c) <= least) else {
        return false;
    };
    n == 1 || [polygon[(i + 1) % n], polygon[(i + n - 1) % n]].iter().all(|&to| (c - s).dot(to - c) < -SLACK)
}
