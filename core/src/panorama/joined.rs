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
        let joins = |a: u32, b: u32| {
            let near = |i: u32| p.depth(i) <= tests.far;
            let (pa, pb) = (points[a as usize], points[b as usize]);
            // Written so that what is not finite does not join.
            let (edge, ray) = (pb - pa, pa + pb);
            let limit = cos * edge.length() * ray.length();
            near(a) && near(b) && pa.is_finite() && pb.is_finite() && edge.dot(ray).abs() <= limit
        };
        let mut out = Self { bits: vec![0; p.pixels() as usize] };
        out.each_edge(p, |_| true, joins);
        out
    }

    /// Every edge a skin: what a panorama of unrelated points has.
    pub fn nothing(p: &Panorama<'_>) -> Self {
        Self { bits: vec![0; p.pixels() as usize] }
    }

    /// Every edge between pixels that hit something joined: a mesh that keeps its skins.
    pub fn everything(p: &Panorama<'_>) -> Self {
        let mut out = Self::nothing(p);
        out.each_edge(p, |_| true, |a, b| p.depth(a).is_finite() && p.depth(b).is_finite());
        out
    }

    /// Takes away what another sample sees past (test 3).
    pub fn see_past(&mut self, p: &Panorama<'_>, other: &Panorama<'_>) {
        let moved = (p.eye() - other.eye()).as_vec3();
        if moved == Vec3::ZERO {
            return;
        }
        let points = points(p);
        let bits = self.bits.clone();
        let camera = &p.views()[0].0;
        let past = PAST_PX * (camera.right_tan - camera.left) / camera.size[0] as f32;
        let stays = |a: u32, b: u32| {
            let middle = 0.5 * (points[a as usize] + points[b as usize]);
            let seen = other.nearest_around(middle + moved);
            seen.is_none_or(|(least, own)| least <= own + past * middle.length())
        };
        self.each_edge(p, |(a, k)| bits[a as usize] >> k & 1 == 1, stays);
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

    /// Sets the bits of each edge that is asked for, at both ends, to what `joins` says; each edge once, from the smaller pixel.
    fn each_edge(&mut self, p: &Panorama<'_>, ask: impl Fn((u32, usize)) -> bool, joins: impl Fn(u32, u32) -> bool) {
        for view in 0..p.views().len() {
            let [w, h] = p.views()[view].0.size;
            for y in 0..h {
                for x in 0..w {
                    let at = super::Place { view, x, y };
                    let a = p.pixel(at);
                    let inner = x > 0 && y > 0 && x + 1 < w && y + 1 < h;
                    for (k, (dx, dy)) in AROUND.into_iter().enumerate() {
                        let b = if inner {
                            (i64::from(a) + i64::from(dy) * i64::from(w) + i64::from(dx)) as u32
                        } else {
                            p.beside(at, k)
                        };
                        if b == NONE || b < a || !ask((a, k)) {
                            continue;
                        }
                        let back = if inner || p.place(b).view == view { (k + 4) % 8 } else { towards(p, b, a) };
                        self.set(a, k, joins(a, b));
                        self.set(b, back, self.towards(a, k));
                    }
                }
            }
        }
    }

    fn set(&mut self, pixel: u32, direction: usize, joined: bool) {
        let bits = &mut self.bits[pixel as usize];
        *bits = *bits & !(1 << direction) | u8::from(joined) << direction;
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
