//! Candidates in a convex polyhedron, beyond the paper.
//!
//! The farthest points of the region lie at vertices of Voronoi cells cut by the region: points where three constraints meet, each
//! the bisector of two samples or a face of the region. All of them are tried:
//!
//! ```text
//! 4 samples                       a vertex of the Voronoi diagram          C(n, 4)
//! 3 samples and a face            an edge of it crosses a face             C(n, 3) h
//! 2 samples and two faces         a face of it crosses an edge             C(n, 2) C(h, 2)
//! 3 faces                         a corner that is locally farthest        C(h, 3)
//! ```
//!
//! each with a test that no sample is nearer: no topology is built, so cospherical, coplanar, collinear and coincident samples are
//! no special cases. Constraints that do not meet in a point are passed over; where they should, others do. For 32 samples in a
//! box that is 36,000 + 30,000 + 7,000 systems of three equations, some milliseconds; it grows with n^4.

use farfield_core::region::Region;
use glam::{DMat3, DVec3};

use super::{Frame, MERGED, SLACK, empty_ball, finish, nearest2};

/// All p with normal . p <= offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Its outward unit normal.
    pub normal: DVec3,
    /// normal . p of its border.
    pub offset: f64,
}

/// Below this share of the product of the normals' lengths three planes do not meet in a point.
const SINGULAR: f64 = 1e-9;

/// The half-spaces whose intersection a region is; empty where it has no bound. A ball gives the 26 that touch it along the
/// axes, the diagonals of a cube's faces and those of the cube.
pub fn half_spaces(region: &Region) -> Vec<HalfSpace> {
    let through = |normal: DVec3, p: DVec3| HalfSpace { normal, offset: normal.dot(p) };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    match region {
        Region::Everywhere => vec![],
        Region::Box(b) => {
            let (low, high) = (b.min.as_dvec3(), b.max.as_dvec3());
            axes.into_iter().flat_map(|n| [through(n, high), through(-n, low)]).collect()
        }
        Region::Prism { polygon, y } => {
            let corner = |i: usize| DVec3::new(polygon[i][0].into(), 0.0, polygon[i][1].into());
            let n = polygon.len();
            // Counter-clockwise in (x, z): outwards is the side's direction turned clockwise.
            let side = |i: usize| {
                let along = corner((i + 1) % n) - corner(i);
                DVec3::new(along.z, 0.0, -along.x).try_normalize().map(|out| through(out, corner(i)))
            };
            let caps = [through(DVec3::Y, DVec3::Y * f64::from(y[1])), through(-DVec3::Y, DVec3::Y * f64::from(y[0]))];
            (0..n).filter_map(side).chain(caps).collect()
        }
        Region::Sphere { centre, radius } => {
            let (c, r) = (centre.as_dvec3(), f64::from(*radius));
            let steps = [-1.0, 0.0, 1.0];
            let all =
                steps.into_iter().flat_map(|x| steps.into_iter().flat_map(move |y| steps.map(|z| DVec3::new(x, y, z))));
            all.filter_map(DVec3::try_normalize).map(|n| through(n, c + n * r)).collect()
        }
    }
}

/// The candidates for another sample in a convex polyhedron; sorted by x, y, z. Without samples its corners. Empty where the
/// half-spaces have no corner.
pub fn solid(region: &[HalfSpace], samples: &[DVec3]) -> Vec<DVec3> {
    let corners = corners(region);
    let Some(frame) = Frame::around(&corners.iter().map(DVec3::to_array).collect::<Vec<_>>()) else { return vec![] };
    let to = |h: &HalfSpace| HalfSpace {
        normal: h.normal,
        offset: (h.offset - h.normal.dot(DVec3::from(frame.middle))) / frame.size,
    };
    let faces: Vec<HalfSpace> = region.iter().map(to).collect();
    let samples = frame.samples(samples.iter().map(|s| s.to_array()));
    let mut search = Search { faces: &faces, samples: &samples, found: vec![] };
    if samples.is_empty() {
        search.found = corners.iter().map(|c| frame.into(c.to_array())).collect();
    } else {
        search.of_four_samples();
        search.of_three_samples();
        search.of_two_samples();
        search.of_corners();
    }
    finish(frame, search.found, &samples).into_iter().map(DVec3::from).collect()
}

struct Search<'a> {
    faces: &'a [HalfSpace],
    samples: &'a [[f64; 3]],
    found: Vec<[f64; 3]>,
}

impl Search<'_> {
    fn of_four_samples(&mut self) {
        let n = self.samples.len();
        for i in 0..n {
            for j in i + 1..n {
                for k in j + 1..n {
                    for l in k + 1..n {
                        self.consider(i, [self.bisector(i, j), self.bisector(i, k), self.bisector(i, l)]);
                    }
                }
            }
        }
    }

    fn of_three_samples(&mut self) {
        let n = self.samples.len();
        for i in 0..n {
            for j in i + 1..n {
                for k in j + 1..n {
                    for f in 0..self.faces.len() {
                        self.consider(i, [self.bisector(i, j), self.bisector(i, k), self.faces[f]]);
                    }
                }
            }
        }
    }

    fn of_two_samples(&mut self) {
        for i in 0..self.samples.len() {
            for j in i + 1..self.samples.len() {
                for f in 0..self.faces.len() {
                    for g in f + 1..self.faces.len() {
                        self.consider(i, [self.bisector(i, j), self.faces[f], self.faces[g]]);
                    }
                }
            }
        }
    }

    /// Corners c whose nearest sample s has c - s in the cone of the faces' normals: nothing around is farther from s.
    fn of_corners(&mut self) {
        for three in threes(self.faces) {
            let Some(c) = meet(three).filter(|&c| within(self.faces, c)) else { continue };
            let least = nearest2(c.to_array(), self.samples);
            let normals = DMat3::from_cols(three[0].normal, three[1].normal, three[2].normal);
            let from = self.samples.iter().map(|&s| DVec3::from(s)).find(|s| s.distance_squared(c) <= least);
            if from.is_some_and(|s| (normals.inverse() * (c - s)).cmpge(DVec3::splat(-SLACK)).all()) {
                self.found.push(c.to_array());
            }
        }
    }

    /// The points as far from sample i as from j.
    fn bisector(&self, i: usize, j: usize) -> HalfSpace {
        let [a, b] = [self.samples[i], self.samples[j]].map(DVec3::from);
        let normal = (b - a).normalize();
        HalfSpace { normal, offset: normal.dot(0.5 * (a + b)) }
    }

    /// Keeps the point where three planes meet when it lies in the region and no sample is nearer than sample i.
    fn consider(&mut self, i: usize, planes: [HalfSpace; 3]) {
        if let Some(p) = meet(planes)
            && within(self.faces, p)
            && empty_ball(p.to_array(), p.distance_squared(self.samples[i].into()), self.samples)
            && !self.found.iter().any(|&f| DVec3::from(f).distance_squared(p) <= MERGED * MERGED)
        {
            self.found.push(p.to_array());
        }
    }
}

/// The corners of a polyhedron, some of them several times.
fn corners(region: &[HalfSpace]) -> Vec<DVec3> {
    let met: Vec<DVec3> = threes(region).filter_map(meet).collect();
    let Some(&first) = met.first() else { return vec![] };
    // Rounding grows with the distance from the origin, the region's own slack with its size.
    let away = region.iter().map(|h| h.offset.abs()).fold(0.0, f64::max);
    let size = region.iter().map(|h| (h.offset - h.normal.dot(first)).abs()).fold(0.0, f64::max);
    let slack = SLACK * size + 8.0 * f64::EPSILON * away;
    let inside = |p: &DVec3| region.iter().all(|h| h.normal.dot(*p) <= h.offset + slack);
    met.into_iter().filter(inside).collect()
}

fn threes(faces: &[HalfSpace]) -> impl Iterator<Item = [HalfSpace; 3]> + '_ {
    let n = faces.len();
    (0..n).flat_map(move |i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [faces[i], faces[j], faces[k]])))
}

/// The point of three planes.
fn meet([a, b, c]: [HalfSpace; 3]) -> Option<DVec3> {
    let (bc, ca, ab) = (b.normal.cross(c.normal), c.normal.cross(a.normal), a.normal.cross(b.normal));
    let volume = a.normal.dot(bc);
    let p = (bc * a.offset + ca * b.offset + ab * c.offset) / volume;
    (volume.abs() > SINGULAR && p.is_finite()).then_some(p)
}

fn within(faces: &[HalfSpace], p: DVec3) -> bool {
    faces.iter().all(|h| h.normal.dot(p) <= h.offset + SLACK)
}
