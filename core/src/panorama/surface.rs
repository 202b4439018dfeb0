//! The surface of a panorama: every pixel's solid angle covered, without seams between joined pixels, with walls at skins.
//!
//! Follows Wilson and Manocha 2003, section 4.2.1: a pixel is a quadrilateral that covers just its solid angle; the depth at a corner
//! is interpolated over the pixels around it (three at the corners of a cube) that are joined to the pixel. Two readings of ours:
//!
//! - joined *side by side, directly or through another of these pixels*, so that all pixels of one surface have the same corner and share
//!   a vertex: no seam inside a surface, across faces either. Pixels that are joined over a corner alone do not share it;
//! - what is interpolated is 1 / depth, continued from each pixel's centre along its slope, no further than the pixels that it is joined
//!   with. On a plane 1 / depth is linear over the picture, so that planes come out exactly; on a silhouette, where slopes have no
//!   bound, a surface ends at its last pixel's depth.
//!
//! Where two neighbouring pixels do not share their corners there is a **wall** between them, along the rays through their border, from
//! one depth to the other: the skins of section 3.3.3 as a surface that closes the space behind which nothing is known. Seen from
//! its own eye a wall has no area. O(pixels).

use std::collections::BTreeMap;

use glam::Vec3;

use super::{Joined, Panorama, Place};

/// No pixel, no vertex.
pub const NONE: u32 = u32::MAX;

/// The directions of [`super::AROUND`] to the pixels around a corner: one beside, the diagonal, the other beside.
const ROUND: [[usize; 3]; 4] = [[4, 3, 2], [2, 1, 0], [0, 7, 6], [6, 5, 4]];

/// Quadrilaterals over shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertices, relative to the panorama's eye.
    pub points: Vec<Vec3>,
    /// For each pixel its corners as vertices: top left, top right, bottom right, bottom left; [`NONE`] where nothing was hit.
    pub quads: Vec<[u32; 4]>,
}

/// A pixel at a corner: the reciprocal of its depth there, along its own axis.
#[derive(Clone, Copy)]
struct Spot {
    pixel: u32,
    /// Which of the pixel's corners it is.
    corner: usize,
    /// 1 / (distance from the eye).
    reciprocal: f32,
}

/// 1 / depth around a pixel's centre.
#[derive(Clone, Copy)]
struct Slope {
    /// At the centre; 0 where nothing was hit.
    own: f32,
    /// A pixel further along x and y.
    step: [f32; 2],
    /// The least and the greatest of the pixel and those that it is joined with side by side.
    range: [f32; 2],
}

struct Build<'p, 'a> {
    p: &'p Panorama<'a>,
    joined: &'p Joined,
    slopes: Vec<Slope>,
    out: Surface,
}

impl Surface {
    /// The surface of a panorama.
    pub fn new(p: &Panorama<'_>, joined: &Joined) -> Self {
        let slopes = (0..p.views().len()).flat_map(|v| slopes(p, joined, v)).collect();
        let quads = vec![[NONE; 4]; p.pixels() as usize];
        let mut b = Build { p, joined, slopes, out: Self { points: vec![], quads } };
        for view in 0..p.views().len() {
            let [w, h] = p.views()[view].0.size;
            for y in 0..=h {
                for x in 0..=w {
                    if x == 0 || y == 0 || x == w || y == h {
                        b.outer(view, x, y);
                    } else {
                        b.inner(view, x, y);
                    }
                }
            }
        }
        b.out
    }

    /// A pixel's quadrilateral, relative to the eye: top left, top right, bottom right, bottom left. `None` where nothing was hit.
    pub fn quad(&self, pixel: u32) -> Option<[Vec3; 4]> {
        let q = self.quads[pixel as usize];
        (q[0] != NONE).then(|| q.map(|v| self.points[v as usize]))
    }

    /// Calls `f` with every wall, as a quadrilateral relative to the eye: two points on one ray, then two on the next. Where nothing was
    /// hit on one side the wall ends at `far` from the eye, or just behind its nearer end where that is farther.
    pub fn walls(&self, p: &Panorama<'_>, far: f32, mut f: impl FnMut([Vec3; 4])) {
        // Border by border: right and down, and all borders with another picture, each once.
        let borders: [(usize, [usize; 2]); 4] = [(0, [1, 2]), (6, [3, 2]), (4, [0, 3]), (2, [0, 1])];
        for view in 0..p.views().len() {
            let [w, h] = p.views()[view].0.size;
            for y in 0..h {
                for x in 0..w {
                    let at = Place { view, x, y };
                    let a = p.pixel(at);
                    for (direction, corners) in borders {
                        let b = p.beside(at, direction);
                        let other = b != NONE && !p.of_view(view).contains(&b);
                        if b == NONE || (direction != 0 && direction != 6 && !(other && b > a)) || (other && b < a) {
                            continue;
                        }
                        self.wall(p, at, [a, b], corners, other, far, &mut f);
                    }
                }
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn wall(
        &self,
        p: &Panorama<'_>,
        at: Place,
        [a, b]: [u32; 2],
        corners: [usize; 2],
        other: bool,
        far: f32,
        f: &mut impl FnMut([Vec3; 4]),
    ) {
        let (qa, qb) = (self.quads[a as usize], self.quads[b as usize]);
        let rays = corners.map(|k| p.corner_ray(at, k));
        let across = |i: usize| {
            if other {
                let place = p.place(b);
                nearest_corner(p, place, rays[i])
            } else {
                // The corner that lies over the border: 0 and 1, 3 and 2 over a vertical one, 0 and 3, 1 and 2 over a horizontal one.
                match corners {
                    [1, 2] => [0, 3][i],
                    _ => [0, 1][i],
                }
            }
        };
        let ends: [[u32; 2]; 2] = [0, 1].map(|i| [qa[corners[i]], qb[across(i)]]);
        if ends.iter().all(|[u, v]| u == v) {
            return;
        }
        let point = |i: usize, v: u32, against: u32| {
            if v != NONE {
                return self.points[v as usize];
            }
            let least = if against == NONE { 0.0 } else { self.points[against as usize].length() * 1.001 };
            rays[i].normalize() * far.max(least)
        };
        let ([u0, v0], [u1, v1]) = (ends[0], ends[1]);
        f([point(0, u0, v0), point(0, v0, u0), point(1, v1, u1), point(1, u1, v1)]);
    }
}

/// Which corner of a pixel lies on a ray.
fn nearest_corner(p: &Panorama<'_>, at: Place, ray: Vec3) -> usize {
    let towards = ray.normalize();
    let off = |k: usize| p.corner_ray(at, k).normalize().distance_squared(towards);
    (0..4).min_by(|&a, &b| off(a).total_cmp(&off(b))).unwrap_or_default()
}

/// The slopes of a picture's pixels: the mean of those to the joined pixels beside it, none where there are none.
fn slopes(p: &Panorama<'_>, joined: &Joined, view: usize) -> Vec<Slope> {
    let (c, image) = &p.views()[view];
    let [w, h] = c.size;
    let first = p.of_view(view).start;
    let at = |x: u32, y: u32| 1.0 / image.depth[image.at(x, y)];
    let one = |i: u32| {
        let (x, y) = (i % w, i / w);
        let own = at(x, y);
        let mut range = [own; 2];
        let mut along = |ahead: usize, behind: usize, next: Option<(u32, u32)>, last: Option<(u32, u32)>| {
            let mut to = |k: usize, n: Option<(u32, u32)>| {
                let other = n.filter(|_| joined.towards(first + i, k)).map(|(x, y)| at(x, y))?;
                range = [range[0].min(other), range[1].max(other)];
                Some(other - own)
            };
            match (to(ahead, next), to(behind, last)) {
                (Some(a), Some(b)) => 0.5 * (a - b),
                (Some(a), None) => a,
                (None, Some(b)) => -b,
                (None, None) => 0.0,
            }
        };
        let gx = along(0, 4, (x + 1 < w).then(|| (x + 1, y)), (x > 0).then(|| (x - 1, y)));
        let gy = along(6, 2, (y + 1 < h).then(|| (x, y + 1)), (y > 0).then(|| (x, y - 1)));
        // On a picture's border the surface goes on in the next one.
        if x == 0 || y == 0 || x + 1 == w || y + 1 == h {
            let reach = gx.abs() + gy.abs();
            range = [(range[0] - reach).max(0.5 * own), range[1] + reach];
        }
        Slope { own, step: [gx, gy], range }
    };
    (0..w * h).map(one).collect()
}

impl Build<'_, '_> {
    /// 1 / depth that a pixel has at one of its corners.
    fn at_corner(&self, pixel: u32, corner: usize) -> f32 {
        let Slope { own, step: [gx, gy], range: [least, most] } = self.slopes[pixel as usize];
        let (sx, sy) = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)][corner];
        (own + sx * gx + sy * gy).clamp(least, most)
    }

    /// A corner within a picture: the four pixels around it.
    fn inner(&mut self, view: usize, x: u32, y: u32) {
        let w = self.p.views()[view].0.size[0];
        let d = self.p.of_view(view).start + y * w + x;
        // Top left, top right, bottom right, bottom left of the corner; it is their corner 2, 3, 0, 1.
        let pixels = [d - w - 1, d - w, d, d - 1];
        let j = self.joined;
        // Each with the next one around.
        let ring = [j.towards(pixels[0], 0), j.towards(pixels[1], 6), j.towards(pixels[2], 4), j.towards(pixels[3], 2)];
        let mut group = [0usize, 1, 2, 3];
        let mut merge = |a: usize, b: usize| {
            let (to, from) = (group[a].min(group[b]), group[a].max(group[b]));
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        };
        (0..4).filter(|&i| ring[i]).for_each(|i| merge(i, (i + 1) % 4));
        let ray = self.p.views()[view].0.ray(x as f32, y as f32);
        for g in 0..4 {
            let (mut sum, mut n) = (0.0, 0.0);
            for i in (0..4).filter(|&i| group[i] == g && self.slopes[pixels[i] as usize].own > 0.0) {
                sum += self.at_corner(pixels[i], (i + 2) % 4);
                n += 1.0;
            }
            if n > 0.0 {
                let vertex = self.out.points.len() as u32;
                self.out.points.push(ray * (n / sum));
                for i in (0..4).filter(|&i| group[i] == g && self.slopes[pixels[i] as usize].own > 0.0) {
                    self.out.quads[pixels[i] as usize][(i + 2) % 4] = vertex;
                }
            }
        }
    }

    /// A corner on a picture's border: the pixels around it may lie in up to three pictures. Made by the picture of the first of them.
    fn outer(&mut self, view: usize, x: u32, y: u32) {
        let p = self.p;
        let [w, h] = p.views()[view].0.size;
        // A pixel of this picture that has the corner, and which one it is.
        let own = Place { view, x: x.min(w - 1), y: y.min(h - 1) };
        let corner = match (x > own.x, y > own.y) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3,
        };
        let pixel = p.pixel(own);
        let mut around = vec![pixel];
        let beside = |a: u32, k: usize| Some(p.neighbour(a, k)).filter(|&b| b != NONE);
        around.extend(ROUND[corner].iter().filter_map(|&k| beside(pixel, k)));
        around.sort_unstable();
        around.dedup();
        if around.first().is_none_or(|&a| !p.of_view(view).contains(&a)) {
            return;
        }
        let ray = p.corner_ray(own, corner);
        let length = ray.length();
        let spots: Vec<Spot> = around
            .iter()
            .filter(|&&a| self.slopes[a as usize].own > 0.0)
            .map(|&a| {
                let corner = nearest_corner(p, p.place(a), ray);
                let own_ray = p.corner_ray(p.place(a), corner).length();
                Spot { pixel: a, corner, reciprocal: self.at_corner(a, corner) / own_ray }
            })
            .collect();
        let mut groups: BTreeMap<usize, Vec<Spot>> = BTreeMap::new();
        for (i, g) in grouped(p, self.joined, &spots).into_iter().enumerate() {
            groups.entry(g).or_default().push(spots[i]);
        }
        for spots in groups.into_values() {
            let mean = spots.iter().map(|s| s.reciprocal).sum::<f32>() / spots.len() as f32;
            let vertex = self.out.points.len() as u32;
            self.out.points.push(ray / (mean * length));
            spots.iter().for_each(|s| self.out.quads[s.pixel as usize][s.corner] = vertex);
        }
    }
}

/// For each spot the first one that it is joined with, directly or through others.
fn grouped(p: &Panorama<'_>, joined: &Joined, spots: &[Spot]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..spots.len()).collect();
    for i in 0..spots.len() {
        for j in 0..i {
            if joined.beside(p, spots[i].pixel, spots[j].pixel) {
                let (to, from) = (group[i].min(group[j]), group[i].max(group[j]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    group
}
