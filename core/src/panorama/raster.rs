//! Which pixels of a set of pictures of one eye a triangle covers, and how deep it lies there.
//!
//! A pixel is covered when the ray r through its centre pierces the triangle. In homogeneous form (Olano and Greer, "Triangle scan
//! conversion using 2D homogeneous coordinates", 1997), with a, b, c the corners relative to the eye,
//!
//! ```text
//! e = (r . (b x c), r . (c x a), r . (a x b))     all of one sign: covered
//! depth = a . (b x c) / (e0 + e1 + e2)            along the picture's axis, where r has the component 1
//! ```
//!
//! so that nothing is divided by a depth that may be 0, nothing is clipped at the eye's plane, and a cube's faces need no special
//! case. Products of 32-bit numbers are exact in 64 bits and a x b = -(b x a) to the last bit: triangles that share two corners
//! leave no pixel between them uncovered. A ray that runs exactly through an edge is covered by both sides (depths and masks
//! do not mind). Triangles seen edge-on cover nothing.
//!
//! [`Raster`] gives fragments to whoever asks, [`DepthCube`] keeps the nearest. O(1) a triangle between pixel centres, which is what
//! most triangles of a finer panorama are, else O(pixels of its rectangle).

use glam::{DVec3, Vec3};

use crate::{Aabb, Camera};

/// Pixels of pictures that were taken from one eye, numbered picture by picture, row by row.
#[derive(Clone, Debug)]
pub struct Raster {
    views: Vec<View>,
    pixels: usize,
}

#[derive(Clone, Debug)]
struct View {
    camera: Camera,
    first: usize,
    /// Tangents of the pixels' centres.
    tx: Vec<f64>,
    ty: Vec<f64>,
    /// Pixels a unit of tangent.
    scale: [f32; 2],
}

/// Pixels of one picture: columns and rows from the first up to, not including, the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// Columns.
    pub x: [u32; 2],
    /// Rows.
    pub y: [u32; 2],
}

/// Corners are projected with this precision, pixels: 32-bit rounding at 8192 pixels.
const ROUNDED_PX: f32 = 2e-3;

/// Corners nearer to the eye's plane than this share of the farthest one count as behind it when a rectangle is looked for.
const BESIDE: f32 = 1e-6;

impl Raster {
    /// The pixels of `cameras`, which share one eye.
    pub fn new(cameras: &[Camera]) -> Self {
        let (mut views, mut pixels) = (Vec::with_capacity(cameras.len()), 0);
        for &camera in cameras {
            let [w, h] = camera.size;
            let (left, top) = (f64::from(camera.left), f64::from(camera.top));
            let dx = (f64::from(camera.right_tan) - left) / f64::from(w);
            let dy = (top - f64::from(camera.bottom)) / f64::from(h);
            views.push(View {
                camera,
                first: pixels,
                tx: (0..w).map(|x| left + (f64::from(x) + 0.5) * dx).collect(),
                ty: (0..h).map(|y| top - (f64::from(y) + 0.5) * dy).collect(),
                scale: [dx.recip() as f32, dy.recip() as f32],
            });
            pixels += w as usize * h as usize;
        }
        Self { views, pixels }
    }

    /// The camera of a picture.
    pub fn camera(&self, view: usize) -> &Camera {
        &self.views[view].camera
    }

    /// Number of pictures.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// Number of pixels of all pictures.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// The pixel numbers of a picture.
    pub fn of_view(&self, view: usize) -> std::ops::Range<usize> {
        let v = &self.views[view];
        v.first..v.first + v.tx.len() * v.ty.len()
    }

    /// The ray through a pixel's centre, relative to the eye; its component along the picture's axis is 1.
    pub fn ray(&self, view: usize, x: u32, y: u32) -> Vec3 {
        self.views[view].camera.ray(x as f32 + 0.5, y as f32 + 0.5)
    }

    /// The pixels of a picture that a box relative to the eye may cover, and the least depth at which it may; `None` where it does
    /// not stand in the picture.
    pub fn footprint(&self, view: usize, bounds: &Aabb) -> Option<(Rect, f32)> {
        let v = &self.views[view];
        let corners = bounds.corners().map(|c| v.turned(c));
        if v.beside(&corners) {
            return None;
        }
        let least = corners.iter().fold(f32::INFINITY, |z, c| z.min(c.z));
        if least > BESIDE * longest(&corners) {
            return Some((v.rect(corners.into_iter())?, least));
        }
        Some((Rect { x: [0, v.tx.len() as u32], y: [0, v.ty.len() as u32] }, 0.0))
    }

    /// Calls `f` with the number and the depth of each pixel of a picture that a triangle covers; corners are relative to the eye.
    /// What is nearer than the camera's near distance is left out, and so are corners that are not finite.
    pub fn triangle(&self, view: usize, corners: [Vec3; 3], mut f: impl FnMut(usize, f32)) {
        let v = &self.views[view];
        v.fill(corners.map(|c| v.turned(c)), &mut f);
    }

    /// As [`Raster::triangle`], for the two triangles of a quadrilateral: first, second and third corner; first, third and fourth.
    pub fn quad(&self, view: usize, corners: [Vec3; 4], mut f: impl FnMut(usize, f32)) {
        let v = &self.views[view];
        let c = corners.map(|c| v.turned(c));
        let least = c[0].z.min(c[1].z).min(c[2].z).min(c[3].z);
        // Most quadrilaterals lie ahead and between pixel centres.
        if least > BESIDE * longest(&c) && v.rect(c.into_iter()).is_none() {
            return;
        }
        v.fill([c[0], c[1], c[2]], &mut f);
        v.fill([c[0], c[2], c[3]], &mut f);
    }
}

impl View {
    /// Into the picture's axes: right, up, ahead.
    fn turned(&self, p: Vec3) -> Vec3 {
        Vec3::new(p.dot(self.camera.right), p.dot(self.camera.up), p.dot(self.camera.forward))
    }

    /// Whether all corners lie beyond one side of the picture, or behind the eye.
    fn beside(&self, corners: &[Vec3]) -> bool {
        let c = &self.camera;
        corners.iter().all(|p| p.z <= 0.0)
            || corners.iter().all(|p| p.x < c.left * p.z)
            || corners.iter().all(|p| p.x > c.right_tan * p.z)
            || corners.iter().all(|p| p.y < c.bottom * p.z)
            || corners.iter().all(|p| p.y > c.top * p.z)
    }

    /// The pixels whose centres lie in the rectangle around projected corners; `None` without any.
    fn rect(&self, corners: impl Iterator<Item = Vec3>) -> Option<Rect> {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for p in corners {
            let inverse = p.z.recip();
            let x = (p.x * inverse - self.camera.left) * self.scale[0];
            let y = (self.camera.top - p.y * inverse) * self.scale[1];
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let range = |low: f32, high: f32, n: usize| {
            // Centres lie at halves; casts saturate.
            let from = (low - 0.5 - ROUNDED_PX).ceil().max(0.0) as u32;
            let to = ((high - 0.5 + ROUNDED_PX).floor() + 1.0).clamp(0.0, n as f32) as u32;
            (from < to).then_some([from, to])
        };
        Some(Rect { x: range(low[0], high[0], self.tx.len())?, y: range(low[1], high[1], self.ty.len())? })
    }

    /// The pixels that a triangle may cover, corners in the picture's axes.
    fn reach(&self, c: &[Vec3; 3]) -> Option<Rect> {
        let least = BESIDE * longest(c);
        if c.iter().all(|p| p.z > least) {
            return self.rect(c.iter().copied());
        }
        if self.beside(c) {
            return None;
        }
        let cut = (0..3).flat_map(|i| {
            let (a, b) = (c[i], c[(i + 1) % 3]);
            let crossing = ((a.z > least) != (b.z > least)).then(|| a + (b - a) * ((least - a.z) / (b.z - a.z)));
            let crossing = crossing.map(|p| p.with_z(least));
            [(a.z > least).then_some(a), crossing].into_iter().flatten()
        });
        self.rect(cut)
    }

    /// The columns of a row in which all three e = n.x t + row may have one sign, and one more on both sides.
    fn span(&self, rect: &Rect, n: &[DVec3; 3], row: &[f64; 3]) -> [u32; 2] {
        // Covered where all are >= 0 (a range of t) or all are <= 0 (another): the hull of both.
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for sign in [1.0, -1.0] {
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            for (n, row) in n.iter().zip(row) {
                let (slope, start) = (sign * n.x, sign * row);
                let root = -start / slope;
                if slope > 0.0 {
                    low = low.max(root);
                } else if slope < 0.0 {
                    high = high.min(root);
                } else if start < 0.0 {
                    high = f64::NEG_INFINITY;
                }
            }
            let slack = 1e-9 * (low.abs().min(1e9) + high.abs().min(1e9));
            if low <= high + slack {
                (from, to) = (from.min(low), to.max(high));
            }
        }
        let left = self.tx[0];
        let column = |t: f64| (t - left) * f64::from(self.scale[0]);
        // Casts saturate.
        let first = ((column(from) - 1.0).max(0.0) as u32).max(rect.x[0]);
        let last = ((column(to) + 2.0).max(0.0) as u32).min(rect.x[1]);
        [first.min(last), last]
    }

    fn fill(&self, c: [Vec3; 3], f: &mut impl FnMut(usize, f32)) {
        if !c.iter().all(|p| p.is_finite()) {
            return;
        }
        let Some(rect) = self.reach(&c) else { return };
        let (nearest, farthest) = (c[0].z.min(c[1].z).min(c[2].z), c[0].z.max(c[1].z).max(c[2].z));
        let d = c.map(|p| p.as_dvec3());
        let n = [d[1].cross(d[2]), d[2].cross(d[0]), d[0].cross(d[1])];
        let volume = d[0].dot(n[0]);
        for y in rect.y[0]..rect.y[1] {
            let row = n.map(|n: DVec3| n.y * self.ty[y as usize] + n.z);
            let first = self.first + y as usize * self.tx.len();
            let columns = if rect.x[1] - rect.x[0] > SHORT { self.span(&rect, &n, &row) } else { rect.x };
            for x in columns[0]..columns[1] {
                let tx = self.tx[x as usize];
                let e = [n[0].x * tx + row[0], n[1].x * tx + row[1], n[2].x * tx + row[2]];
                let sum = e[0] + e[1] + e[2];
                let one_sign = if sum > 0.0 { e.iter().all(|&e| e >= 0.0) } else { e.iter().all(|&e| e <= 0.0) };
                if !one_sign || sum == 0.0 {
                    continue;
                }
                let depth = (volume / sum) as f32;
                // Ahead of the eye the sign is known, and an edge-on triangle's depth is kept to the triangle's.
                let depth = if nearest > 0.0 { depth.clamp(nearest, farthest) } else { depth };
                if depth >= self.camera.near {
                    f(first + x as usize, depth);
                }
            }
        }
    }
}

/// Up to this many columns are tried one by one.
const SHORT: u32 = 4;

fn longest(c: &[Vec3]) -> f32 {
    c.iter().fold(0.0, |m, p| p.abs().max_element().max(m))
}

/// The nearest depth of what was drawn around one eye: usually a cube's six faces.
#[derive(Clone, Debug)]
pub struct DepthCube {
    raster: Raster,
    depth: Vec<f32>,
}

impl DepthCube {
    /// Pictures of one eye with nothing in them.
    pub fn new(cameras: &[Camera]) -> Self {
        let raster = Raster::new(cameras);
        let depth = vec![f32::INFINITY; raster.pixels()];
        Self { raster, depth }
    }

    /// Takes everything away.
    pub fn clear(&mut self) {
        self.depth.fill(f32::INFINITY);
    }

    /// Draws a triangle; corners relative to the eye.
    pub fn draw_triangle(&mut self, corners: [Vec3; 3]) {
        for view in 0..self.raster.views() {
            let depth = &mut self.depth;
            self.raster.triangle(view, corners, |i, z| depth[i] = depth[i].min(z));
        }
    }

    /// Draws the two triangles of a quadrilateral; corners relative to the eye.
    pub fn draw_quad(&mut self, corners: [Vec3; 4]) {
        for view in 0..self.raster.views() {
            let depth = &mut self.depth;
            let ahead = self.raster.views[view].camera.forward;
            if corners.iter().any(|c| c.dot(ahead) > 0.0) {
                self.raster.quad(view, corners, |i, z| depth[i] = depth[i].min(z));
            }
        }
    }

    /// The pixels.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// The nearest depth along each pixel's picture axis, scene units; infinite where nothing was drawn.
    pub fn depth(&self) -> &[f32] {
        &self.depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Ray, TriangleBvh};
    use proptest::prelude::*;

    fn cube() -> [Camera; 6] {
        Camera::cube(DVec3::ZERO, 24, 1e-3)
    }

    /// What rays find in the same pixels.
    fn cast(r: &Raster, positions: &[Vec3], indices: &[u32]) -> Vec<f32> {
        let bvh = TriangleBvh::build(positions, indices);
        let mut out = vec![];
        for view in 0..r.views() {
            let [w, h] = r.camera(view).size;
            for i in 0..w * h {
                let ray = Ray::new(DVec3::ZERO, r.ray(view, i % w, i / w), 1e-3, f32::INFINITY).unwrap();
                out.push(bvh.closest_hit(&ray, |_| true).map_or(f32::INFINITY, |h| h.t));
            }
        }
        out
    }

    prop_compose! {
        fn point()(x in -3f32..3.0, y in -3f32..3.0, z in -3f32..3.0) -> Vec3 { Vec3::new(x, y, z) }
    }

    proptest! {
        #[test]
        fn triangles_all_around_are_where_rays_find_them(
            points in prop::collection::vec(point(), 12..13), exponent in -3i32..=6
        ) {
            let k = 10f32.powi(exponent);
            let mut d = DepthCube::new(&Camera::cube(DVec3::ZERO, 24, 1e-3 * k));
            let points: Vec<Vec3> = points.into_iter().map(|p| p * k).collect();
            points.chunks(3).for_each(|c| d.draw_triangle([c[0], c[1], c[2]]));
            let unit: Vec<Vec3> = points.iter().map(|&p| p / k).collect();
            let truth = cast(d.raster(), &unit, &(0..12).collect::<Vec<u32>>());
            let apart = |a: f32, b: f32| a != b && (a / k - b).abs() > 1e-3 * b;
            let wrong = d.depth().iter().zip(&truth).filter(|&(&a, &b)| apart(a, b)).count();
            // A pixel's centre may lie on an edge to the last bit.
            prop_assert!(wrong <= 2, "{wrong} of {} pixels", truth.len());
        }

        #[test]
        fn a_closed_surface_around_the_eye_has_no_crack(seed in prop::collection::vec(0.2f32..5.0, 98..99), px in 1u32..80) {
            // A 4 x 4 x 6 grid of quadrilaterals on a cube, every vertex at a distance of its own, shared by its neighbours.
            let mut d = DepthCube::new(&Camera::cube(DVec3::ZERO, px, 1e-4));
            let mut seen: Vec<Vec3> = vec![];
            let mut vertex = |p: Vec3| {
                let i = seen.iter().position(|&s| s == p).unwrap_or_else(|| { seen.push(p); seen.len() - 1 });
                p * seed[i]
            };
            for axis in 0..3 {
                for side in [-1.0, 1.0] {
                    for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                        let mut at = |u: i32, v: i32| {
                            let mut p = [0.0; 3];
                            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u as f32 / 2.0 - 1.0, v as f32 / 2.0 - 1.0);
                            vertex(Vec3::from(p))
                        };
                        d.draw_quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                    }
                }
            }
            prop_assert!(d.depth().iter().all(|z| z.is_finite()));
        }

        #[test]
        fn a_boxs_footprint_holds_what_lies_in_it(a in point(), b in point(), inner in prop::collection::vec(0f32..1.0, 9..10)) {
            let bounds = Aabb::of([a, b]);
            let at = |i: usize| bounds.min + bounds.size() * Vec3::new(inner[i], inner[i + 1], inner[i + 2]);
            let r = Raster::new(&cube());
            for view in 0..6 {
                let footprint = r.footprint(view, &bounds);
                r.triangle(view, [at(0), at(3), at(6)], |i, z| {
                    let (rect, least) = footprint.expect("a triangle in a box that is not there");
                    let (x, y) = ((i % 576 % 24) as u32, (i % 576 / 24) as u32);
                    assert!((rect.x[0]..rect.x[1]).contains(&x) && (rect.y[0]..rect.y[1]).contains(&y));
                    assert!(z >= least * (1.0 - 1e-5));
                });
            }
        }
    }

    #[test]
    fn edge_on_behind_and_unreal_triangles_cover_nothing() {
        let mut d = DepthCube::new(&cube()[..1]);
        d.draw_triangle([Vec3::new(1.0, 1.0, 0.0), Vec3::new(2.0, 2.0, 0.0), Vec3::new(3.0, 1.0, 0.0) * 1e-9]);
        d.draw_triangle([Vec3::new(-1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, 0.0, 1.0)]);
        d.draw_triangle([Vec3::NAN, Vec3::X, Vec3::Y]);
        d.draw_triangle([Vec3::INFINITY, Vec3::X, Vec3::Y]);
        d.draw_triangle([Vec3::X; 3]);
        d.draw_quad([Vec3::ZERO; 4]);
        assert!(d.depth().iter().all(|z| *z == f32::INFINITY));
        d.draw_triangle([Vec3::new(1.0, -9.0, -9.0), Vec3::new(1.0, 9.0, 0.0), Vec3::new(1.0, -9.0, 9.0)]);
        assert!(d.depth().contains(&1.0));
        d.clear();
        assert!(!d.depth().contains(&1.0));
    }
}
