//! Which pixels a point's splat or a line covers, and how deep it lies there: one rule, which the cpu backend runs and the shaders
//! repeat, number by number.
//!
//! **Points.** A splat is a rectangle that faces the picture: its centre is the point's image, its edges are as long as twice the
//! radius at the point's depth, and at least a pixel. A pixel is covered where its centre lies in centre - half .. centre + half, the
//! end left out, so that a splat of one pixel covers exactly one. Its depth is the point's linear depth, all over: a splat is
//! flat and parallel to the picture, and stands out of a surface that does not face the picture by up to radius times the tangent
//! of the angle. A point nearer than the near distance is not drawn, even where its splat is large; one beside the picture is, as
//! far as its splat reaches into it. Seen from the side that its normal points away from (n . p >= 0, p from the eye), it is not
//! drawn unless the part has two sides.
//!
//! **Lines.** The rule of the minor axis, ends included: along the axis in which the line's image is the longer one, from the pixel
//! that holds one end to the pixel that holds the other, each step covers the one pixel that holds the line where it crosses the
//! step's middle. So a line has no gaps and is one pixel wide, lines that share a vertex touch, and one shorter than a pixel covers
//! one. What lies nearer than the near distance is cut off. Inverse depth is linear along the image, attributes are
//! perspective-correct; before the first end's and behind the second end's place they stay what they are there.
//!
//! Points after Rusinkiewicz and Levoy's QSplat (2000) and the point-polygon hierarchies of Guthe, Borodin, Balazs and Klein (2004), who draw
//! screen-aligned squares by the size of a `GL_POINTS`; lines as the latter close cracks with. Neither states a rule of coverage; this one is made so
//! that a ray caster and rasterisers of any subpixel precision agree. Cost: O(pixels covered).

use std::ops::Range;

use glam::{Vec2, Vec3};

use crate::Camera;

/// How far beside the picture lines are cut off, pixels: beyond the pixel that an end's place rounds to.
const BESIDE_PX: f32 = 2.0;

/// A camera in the form that points and lines need. With p from the eye: depth z = p . ahead, pixels (p . across, p . down) / z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screen {
    /// The gradient of depth times column.
    pub across: Vec3,
    /// The gradient of depth times row.
    pub down: Vec3,
    /// The gradient of depth.
    pub ahead: Vec3,
    /// Pixels a unit tangent, across and down.
    pub px_per_tan: Vec2,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Nothing nearer is drawn, scene units.
    pub near: f32,
}

/// The pixels of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Splat {
    /// Columns within the picture.
    pub columns: Range<u32>,
    /// Rows within the picture.
    pub rows: Range<u32>,
    /// Linear depth, of all of it.
    pub depth: f32,
}

/// A line's image, cut to what may be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its ends, pixels from the picture's top left.
    pub ends: [Vec2; 2],
    /// 1 / depth there.
    pub inverse: [f32; 2],
    /// Where they lie on the line that was given: 0 its first end, 1 its second.
    pub along: [f32; 2],
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
}

/// A pixel of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinePixel {
    /// Its column and row.
    pub pixel: [u32; 2],
    /// Linear depth.
    pub depth: f32,
    /// The weight of the second end's attributes; that of the first is the rest.
    pub weight: f32,
}

/// A sum in this order, which the shaders keep.
fn inner(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Whether a point with this normal, `from_eye` from the eye, turns its front to it. A point seen from its side does not.
pub fn faces(normal: Vec3, from_eye: Vec3) -> bool {
    inner(normal, from_eye) < 0.0
}

impl Screen {
    /// The screen of a camera.
    pub fn new(camera: &Camera) -> Self {
        let [w, h] = camera.size.map(|s| s as f32);
        let px_per_tan = Vec2::new(w / (camera.right_tan - camera.left), h / (camera.top - camera.bottom));
        Self {
            across: (camera.right - camera.forward * camera.left) * px_per_tan.x,
            down: (camera.forward * camera.top - camera.up) * px_per_tan.y,
            ahead: camera.forward,
            px_per_tan,
            size: camera.size,
            near: camera.near,
        }
    }

    /// The splat of a point `from_eye` from the eye; `None` where it covers no pixel. `radius` is in scene units.
    pub fn splat(&self, from_eye: Vec3, radius: f32) -> Option<Splat> {
        let depth = inner(from_eye, self.ahead);
        if depth.partial_cmp(&self.near).is_none_or(std::cmp::Ordering::is_lt) {
            return None;
        }
        let centre = Vec2::new(inner(from_eye, self.across), inner(from_eye, self.down)) / depth;
        let half = (self.px_per_tan * radius / depth).max(Vec2::splat(0.5));
        // What overflows has no place.
        if !(centre.is_finite() && half.is_finite()) {
            return None;
        }
        let range = |c: f32, half: f32, n: u32| {
            let edge = |v: f32| v.ceil().clamp(0.0, n as f32) as u32;
            edge(c - half - 0.5)..edge(c + half - 0.5)
        };
        let columns = range(centre.x, half.x, self.size[0]);
        let rows = range(centre.y, half.y, self.size[1]);
        (!columns.is_empty() && !rows.is_empty()).then_some(Splat { columns, rows, depth })
    }

    /// The image of a line between two points, both from the eye; `None` where all of it is too near or beside the picture.
    pub fn line(&self, from_eye: [Vec3; 2]) -> Option<Line> {
        // Columns and rows times depth, and depth: all linear along the line.
        let [a, b] = from_eye.map(|p| Vec3::new(inner(p, self.across), inner(p, self.down), inner(p, self.ahead)));
        let [w, h] = self.size.map(|s| s as f32);
        let inside = |p: Vec3| {
            [
                p.z - self.near,
                p.x + BESIDE_PX * p.z,
                (w + BESIDE_PX) * p.z - p.x,
                p.y + BESIDE_PX * p.z,
                (h + BESIDE_PX) * p.z - p.y,
            ]
        };
        // Liang and Barsky (1984).
        let (mut first, mut last) = (0f32, 1f32);
        for (d, e) in inside(a).into_iter().zip(inside(b)) {
            if d < 0.0 && e < 0.0 {
                return None;
            } else if d < 0.0 {
                first = first.max(d / (d - e));
            } else if e < 0.0 {
                last = last.min(d / (d - e));
            }
        }
        if first > last {
            return None;
        }
        let at = |s: f32| if s == 1.0 { b } else { a + (b - a) * s };
        let ends = [at(first), at(last)];
        let inverse = ends.map(|p| p.z.max(self.near).recip());
        let places = [0, 1].map(|i: usize| ends[i].truncate() * inverse[i]);
        // Cut off, they lie in the picture or just beside; what overflowed does not.
        let beside = Vec2::splat(2.0 * BESIDE_PX);
        let placed = |p: Vec2| (p.cmpge(-beside) & p.cmple(Vec2::new(w, h) + beside)).all();
        (placed(places[0]) && placed(places[1])).then_some(Line {
            ends: places,
            inverse,
            along: [first, last],
            size: self.size,
        })
    }
}

impl Line {
    /// The pixels that it covers within the picture, from the left or from the top.
    pub fn pixels(&self) -> impl Iterator<Item = LinePixel> + use<> {
        let [a, b] = self.ends;
        let steep = (b.y - a.y).abs() > (b.x - a.x).abs();
        // The longer axis first.
        let turn = |v: Vec2| if steep { Vec2::new(v.y, v.x) } else { v };
        let (a, d) = (turn(a), turn(b - a));
        let [steps, others] = if steep { [self.size[1], self.size[0]] } else { self.size };
        let clamp = |v: f32| v.floor().clamp(0.0, steps as f32) as u32;
        let [low, high] = [a.x.min(a.x + d.x), a.x.max(a.x + d.x)];
        let (inverse, along) = (self.inverse, self.along);
        (clamp(low)..clamp(high.floor() + 1.0)).filter_map(move |step| {
            let t = if d.x == 0.0 { 0.0 } else { (step as f32 + 0.5 - a.x) / d.x };
            let other = (a.y + d.y * t).floor();
            if other < 0.0 || other >= others as f32 {
                return None;
            }
            let t = t.clamp(0.0, 1.0);
            let [near, far] = [inverse[0] * (1.0 - t), inverse[1] * t];
            let sum = near + far;
            let pixel = if steep { [other as u32, step] } else { [step, other as u32] };
            Some(LinePixel { pixel, depth: sum.recip(), weight: (along[0] * near + along[1] * far) / sum })
        })
    }
}

#[cfg(test)]
mod tests;
