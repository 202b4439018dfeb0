//! Which neighbouring pixels show one surface, and which edges between them are skins.
//!
//! Follows Wilson and Manocha 2003, section 3.3.3. The edge E between the surface points of two neighbouring pixels is a **skin**
//! when
//!
//! 1. an end lies beyond a far threshold (or nothing was hit there);
//! 2. the angle between E and the view ray through its mid-point is under alpha;
//! 3. another sample, looking at E's mid-point, sees past it to something farther.
//!
//! Test 2 marks surfaces that are seen at a grazing angle too, test 3 finds small steps. In test 3 a sample *sees past* a point when
//! the surfaces at all four pixels around it lie farther by more than two pixels' width: one pixel alone would accuse slanted
//! surfaces, and no distance at all would accuse the corners of rooms. O(pixels), and O(pixels) for each other sample.

use glam::Vec3;

use super::{AROUND, NONE, Panorama};

/// Farther by less than this many pixels' width at the edge is not past: between two walls that meet in a corner of a room the
/// edge's mid-point hangs before both, at most by the smaller of the two pixels' pieces of wall.
const PAST_PX: f32 = 2.0;

/// An edge whose 1 / depth is linear to this share of a pixel's width is part of a plane: a step that small is nothing
/// that another sample could be said to see past.
const FLAT_PX: f32 = 0.05;

/// The first two tests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinTests {
    /// Surfaces beyond this depth join nothing, scene units; infinite for none.
    pub far: f32,
    /// Edges nearer to the view ray than this are skins, radians.
    pub alpha_rad: f32,
}

/// For each pixel the neighbours that it shares a surface with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Joined {
    /// Bit k: the neighbour in direction k of [`AROUND`].
    bits: Vec<u8>,
}

impl Joined {
    /// By the tests that need no other sample.
    pub fn new(p: &Panorama<'_>, tests: &SkinTests) -> Self {
        let cos = tests.alpha_rad.cos();
        let points = points(p);
        let depths: Vec<f32> = p.views().iter().flat_map(|(_, image)| image.depth.iter().copied()).collect();
        let joins = |a: u32, b: u32| {
            let near = |i: u32| depths[i as usize] <= tests.far;
            let (pa, pb) = (points[a as usize], points[b as usize]);
            // Written so that what is not finite does not join.
            let (edge, ray) = (pb - pa, pa + pb);
            let limit = cos * edge.length() * ray.length();
            near(a) && near(b) && pa.is_finite() && pb.is_finite() && edge.dot(ray).abs() <= limit
        };
        let mut out = Self { bits: vec![0; p.pixels() as usize] };
        out.each(p, joins);
        out
    }

    /// Every edge a skin: what a panorama of unrelated points has.
    pub fn nothing(p: &Panorama<'_>) -> Self {
        Self { bits: vec![0; p.pixels() as usize] }
    }

    /// Every edge between pixels that hit something joined: a mesh that keeps its skins.
    pub fn everything(p: &Panorama<'_>) -> Self {
        let mut out = Self::nothing(p);
        out.each(p, |a, b| p.depth(a).is_finite() && p.depth(b).is_finite());
        out
    }

    /// Takes away what another sample sees past (test 3).
    pub fn see_past(&mut self, p: &Panorama<'_>, other: &Panorama<'_>) {
        self.see_past_all(p, [other]);
    }

    /// Takes away what any of several other samples sees past (test 3). Edges in the middle of a plane are surfaces and are not
    /// asked about, which leaves few: O(pixels), and O(the others' number) for those few.
    pub fn see_past_all<'o>(&mut self, p: &Panorama<'_>, others: impl IntoIterator<Item = &'o Panorama<'o>>) {
        self.see_past_beyond(p, others, FLAT_PX);
    }

    /// As [`Joined::see_past_all`]; edges are asked about when they bend by more than this many pixels' width.
    pub(super) fn see_past_beyond<'o>(
        &mut self,
        p: &Panorama<'_>,
        others: impl IntoIterator<Item = &'o Panorama<'o>>,
        flat_px: f32,
    ) {
        let camera = &p.views()[0].0;
        let pixel = (camera.right_tan - camera.left) / camera.size[0] as f32;
        let mut asked = self.bent(p, flat_px * pixel);
        for other in others {
            let moved = (p.eye() - other.eye()).as_vec3();
            if moved == Vec3::ZERO {
                continue;
            }
            asked.retain(|(edge, middle)| {
                let seen = other.nearest_around(middle + moved);
                let stays = seen.is_none_or(|(least, own)| least <= own + PAST_PX * pixel * middle.length());
                if !stays {
                    self.set_both(edge, false);
                }
                stays
            });
        }
    }

    /// The joined edges that do not lie in the middle of a plane, and their mid-points. On a plane 1 / depth is linear over a
    /// picture: a pixel before and one behind the edge are asked.
    fn bent(&self, p: &Panorama<'_>, flat: f32) -> Vec<(Edge, Vec3)> {
        let points = points(p);
        let reciprocal: Vec<f32> =
            p.views().iter().flat_map(|(_, image)| image.depth.iter().map(|z| z.recip())).collect();
        let mut out = vec![];
        each_edge(p, |edge| {
            if !self.towards(edge.a, edge.towards) {
                return;
            }
            let at = |i: u32| reciprocal[i as usize];
            // Written so that what is not finite is not level.
            let level = |before: u32, a: u32, b: u32| (at(before) - 2.0 * at(a) + at(b)).abs() <= flat * at(a);
            let plane = |[before, behind]: [u32; 2]| level(before, edge.a, edge.b) && level(behind, edge.b, edge.a);
            if !edge.along(p).is_some_and(plane) {
                out.push((edge, 0.5 * (points[edge.a as usize] + points[edge.b as usize])));
            }
        });
        out
    }

    /// Whether a pixel shares a surface with its neighbour in a direction of [`AROUND`].
    pub fn towards(&self, pixel: u32, direction: usize) -> bool {
        self.bits[pixel as usize] >> direction & 1 == 1
    }

    /// Whether two pixels are neighbours side by side, not over a corner, and share a surface.
    pub fn beside(&self, p: &Panorama<'_>, a: u32, b: u32) -> bool {
        self.bits[a as usize] != 0 && [0, 2, 4, 6].iter().any(|&k| self.towards(a, k) && p.neighbour(a, k) == b)
    }

    /// Number of edges that are skins although both ends hit something.
    pub fn skins(&self, p: &Panorama<'_>) -> usize {
        let hit = |i: u32| p.depth(i).is_finite();
        let skin = |a: u32, k: usize| {
            let b = p.neighbour(a, k);
            !self.towards(a, k) && b != NONE && hit(b)
        };
        (0..p.pixels()).filter(|&a| hit(a)).map(|a| (0..8).filter(|&k| skin(a, k)).count()).sum::<usize>() / 2
    }

    /// Sets the bits of each edge, at both ends, to what `joins` says.
    fn each(&mut self, p: &Panorama<'_>, joins: impl Fn(u32, u32) -> bool) {
        each_edge(p, |edge| self.set_both(&edge, joins(edge.a, edge.b)));
    }

    fn set_both(&mut self, edge: &Edge, joined: bool) {
        self.set(edge.a, edge.towards, joined);
        self.set(edge.b, edge.back, joined);
    }

    fn set(&mut self, pixel: u32, direction: usize, joined: bool) {
        let bits = &mut self.bits[pixel as usize];
        *bits = *bits & !(1 << direction) | u8::from(joined) << direction;
    }
}

/// Two neighbouring pixels, the smaller number first.
#[derive(Clone, Copy)]
struct Edge {
    a: u32,
    b: u32,
    /// The direction from a to b, and from b to a.
    towards: usize,
    back: usize,
    /// Where a is.
    at: super::Place,
}

impl Edge {
    /// The pixel before a and the one behind b, on one line with both; `None` where the line leaves the picture.
    fn along(&self, p: &Panorama<'_>) -> Option<[u32; 2]> {
        let [w, h] = p.views()[self.at.view].0.size.map(|n| n as i32);
        let (dx, dy) = AROUND[self.towards];
        let (x, y) = (self.at.x as i32, self.at.y as i32);
        let inside = |k: i32| (0..w).contains(&(x + k * dx)) && (0..h).contains(&(y + k * dy));
        let step = dy * w + dx;
        (inside(-1) && inside(2)).then(|| [self.a.wrapping_add_signed(-step), self.b.wrapping_add_signed(step)])
    }
}

/// Calls `f` with each pair of neighbours once.
fn each_edge(p: &Panorama<'_>, mut f: impl FnMut(Edge)) {
    for view in 0..p.views().len() {
        let [w, h] = p.views()[view].0.size;
        for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
            let at = super::Place { view, x, y };
            let a = p.pixel(at);
            let inner = x > 0 && y > 0 && x + 1 < w && y + 1 < h;
            for (k, (dx, dy)) in AROUND.into_iter().enumerate() {
                let b = if inner { a.wrapping_add_signed(dy * w as i32 + dx) } else { p.beside(at, k) };
                if b != NONE && b > a {
                    let back = if inner || p.of_view(view).contains(&b) { (k + 4) % 8 } else { towards(p, b, a) };
                    f(Edge { a, b, towards: k, back, at });
                }
            }
        }
    }
}

/// The direction from a pixel to its neighbour.
fn towards(p: &Panorama<'_>, from: u32, to: u32) -> usize {
    (0..8).find(|&k| p.neighbour(from, k) == to).unwrap_or_default()
}

/// All surface points, relative to the eye.
fn points(p: &Panorama<'_>) -> Vec<Vec3> {
    let of = |(c, image): &(crate::Camera, crate::image::SurfaceImage)| -> Vec<Vec3> {
        let [w, h] = c.size;
        let at = |i: u32| c.ray((i % w) as f32 + 0.5, (i / w) as f32 + 0.5) * image.depth[i as usize];
        (0..w * h).map(at).collect()
    };
    p.views().iter().flat_map(of).collect()
}
