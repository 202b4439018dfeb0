//! Merging construction images into one layered image.
//!
//! A pixel of a picture is a surface element: a point, a normal, and the parallelogram that the pixel cuts from the plane through
//! both. Following Shade et al. (1998, section 5.2) elements are gathered by the layered image's pixels, and those of one pixel that
//! are the same surface are kept once. Chosen here, where the papers are silent:
//!
//! * A sample stands on its pixel's central ray. An element is given to every ray that meets its parallelogram, at the depth where it
//!   meets it: coarser pictures leave no gaps, finer ones no doubles, and outlines stay where they are to half a pixel.
//! * An element that the layered image sees too much at a slant ([`GRAZING`]) meets no ray worth the name: it is given to the
//!   pixel that it falls into, at its own depth moved along its plane, which is taken as if it were seen at that slant.
//!   Several such samples of a pixel, one behind the other, make up a wall that is seen edge-on.
//! * The central picture has the layered image's own rays and is merged first: what it sees is exactly the front of every
//!   pixel. Nothing may stand before it: an element that would, a rounding apart, is given to the nearest of the pixels around that
//!   allow it, or dropped. (The paper merges the images nearest to the window first.)
//! * Elements that their own picture sees at a slant wait until all others are in.
//! * The same surface: with footprint f = depth / pixels a unit tangent and slope s = tan of the angle between normal and ray (as
//!   for [`GRAZING`] at most), two samples no farther apart in depth than merge_px f (1 + s / 2), whose normals are less
//!   than 73 degrees apart; or no farther apart than f, whatever their normals.

use farfield_core::Camera;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::layered::{GRAZING, Warp};
use glam::{DVec3, Vec2, Vec3};

/// Ends a list.
const NONE: u32 = u32::MAX;
/// A ray may miss an element by this share of the element's pixel: planes of neighbouring elements do not quite join.
const SLACK: f32 = 0.1;
/// The least cosine between normals of one surface.
const SAME: f32 = 0.3;
/// The most samples of a pixel.
const MOST: usize = 255;

/// A sample on its way into a layered image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// Along the camera's forward axis.
    pub(crate) depth: f32,
    /// Unit normal.
    pub(crate) normal: Vec3,
    /// sRGB albedo.
    pub(crate) albedo: [u8; 3],
    /// Object number + 1.
    pub(crate) object: u32,
}

/// A surface element, relative to the layered image's eye.
struct Element {
    at: Vec3,
    sample: Sample,
}

/// A layered image in the making.
pub(crate) struct Layers {
    camera: Camera,
    merge_px: f32,
    /// Depth of the central picture.
    front: Vec<f32>,
    /// Each pixel's first node.
    heads: Vec<u32>,
    nodes: Vec<(Sample, u32)>,
    waiting: Vec<Element>,
}

impl Layers {
    /// From the central picture.
    pub(crate) fn new(camera: Camera, merge_px: f32, central: &SurfaceImage) -> Self {
        let mut out = Self {
            camera,
            merge_px,
            front: central.depth.clone(),
            heads: vec![NONE; central.depth.len()],
            nodes: Vec::with_capacity(central.depth.len()),
            waiting: vec![],
        };
        for i in (0..central.depth.len()).filter(|&i| central.hit(i)) {
            out.heads[i] = out.nodes.len() as u32;
            out.nodes.push((sample(central, i), NONE));
        }
        out
    }

    /// Merges a picture through a camera with the same axes.
    pub(crate) fn add(&mut self, camera: &Camera, picture: &SurfaceImage) {
        let offset = (camera.eye - self.camera.eye).as_vec3();
        let warp = Warp::new(&Camera { eye: DVec3::ZERO, ..*camera }, camera.eye, &self.camera);
        for y in 0..camera.size[1] {
            for x in 0..camera.size[0] {
                let i = picture.at(x, y);
                if !picture.hit(i) {
                    continue;
                }
                let ray = camera.ray(x as f32 + 0.5, y as f32 + 0.5);
                let s = sample(picture, i);
                let element = Element { at: offset + ray * s.depth, sample: s };
                let wait = s.normal.dot(ray).abs() < GRAZING * ray.length();
                if slanted(&element) {
                    if wait { self.waiting.push(element) } else { self.put_slanted(&element) }
                    continue;
                }
                if wait {
                    // Rays that meet it are looked for once its own picture is gone: the point itself has to do.
                    self.waiting.push(element);
                    continue;
                }
                let Some(splat) = warp.splat(x, y, s.depth, s.normal) else { continue };
                let [columns, rows] = splat.pixels(self.camera.size);
                let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                for v in rows {
                    for u in columns.clone() {
                        let own = self.ray(u, v);
                        let depth = s.normal.dot(element.at) / s.normal.dot(own);
                        let meets = depth > 0.0
                            && camera.project(own * depth - offset).is_some_and(|p| {
                                (p.truncate() - middle).abs().max_element() <= 0.5 + SLACK
                            });
                        if meets {
                            self.put(u, v, Sample { depth, ..s });
                        }
                    }
                }
            }
        }
    }

    fn ray(&self, x: u32, y: u32) -> Vec3 {
        self.camera.ray(x as f32 + 0.5, y as f32 + 0.5)
    }

    fn index(&self, x: u32, y: u32) -> usize {
        (y * self.camera.size[0] + x) as usize
    }

    /// What counts as one place in depth, for a sample on a ray.
    fn tolerance(&self, s: &Sample, ray: Vec3) -> [f32; 2] {
        let footprint = s.depth / self.camera.px_per_tan();
        let c = (s.normal.dot(ray).abs() / ray.length()).clamp(GRAZING, 1.0);
        let slope = (1.0 - c * c).sqrt() / c;
        [footprint, self.merge_px * footprint * (1.0 + 0.5 * slope)]
    }

    /// Whether a sample would stand before what the centre sees on its ray.
    fn before_the_front(&self, i: usize, depth: f32, tolerance: f32) -> bool {
        depth < self.front[i] - tolerance
    }

    /// Keeps a sample unless its surface is there or the centre sees past it.
    fn put(&mut self, x: u32, y: u32, s: Sample) {
        let (i, ray) = (self.index(x, y), self.ray(x, y));
        let [footprint, along] = self.tolerance(&s, ray);
        let mut at = self.heads[i];
        while at != NONE {
            let (there, next) = &self.nodes[at as usize];
            let apart = (there.depth - s.depth).abs();
            let same = s.normal.dot(there.normal) > SAME;
            if apart <= footprint || (same && apart <= along.max(self.tolerance(there, ray)[1])) {
                return;
            }
            at = *next;
        }
        if self.before_the_front(i, s.depth, 0.0) {
            return;
        }
        self.nodes.push((s, self.heads[i]));
        self.heads[i] = self.nodes.len() as u32 - 1;
    }

    /// A single sample for an element that rays meet at too much of a slant.
    fn put_slanted(&mut self, e: &Element) {
        let Some(p) = self.camera.project(e.at) else { return };
        let [w, h] = self.camera.size;
        if !(p.x >= 0.0 && p.y >= 0.0 && p.x < w as f32 && p.y < h as f32) {
            return;
        }
        let (x, y) = ((p.x as u32).min(w - 1), (p.y as u32).min(h - 1));
        let n = e.sample.normal;
        let moved = |x: u32, y: u32| {
            let ray = self.ray(x, y);
            let least = GRAZING * ray.length();
            let facing = n.dot(ray);
            let facing = if facing.abs() < least { least.copysign(facing) } else { facing };
            p.z + n.dot(e.at - ray * p.z) / facing
        };
        let depth = moved(x, y);
        let [footprint, _] = self.tolerance(&e.sample, self.ray(x, y));
        if !self.before_the_front(self.index(x, y), depth, footprint) {
            let front = self.front[self.index(x, y)];
            self.put(x, y, Sample { depth: if front.is_finite() { depth.max(front) } else { depth }, ..e.sample });
            return;
        }
        let mut best: Option<(f32, u32, u32)> = None;
        for v in y.saturating_sub(1)..(y + 2).min(h) {
            for u in x.saturating_sub(1)..(x + 2).min(w) {
                let away = (Vec2::new(u as f32 + 0.5, v as f32 + 0.5) - p.truncate()).length_squared();
                if !self.before_the_front(self.index(u, v), p.z, footprint) && best.is_none_or(|b| away < b.0) {
                    best = Some((away, u, v));
                }
            }
        }
        if let Some((_, u, v)) = best {
            let depth = p.z.max(self.front[self.index(u, v)]);
            self.put(u, v, Sample { depth, ..e.sample });
        }
    }

    /// The samples of each pixel from front to back, by rows from the top.
    pub(crate) fn finish(mut self) -> Vec<Vec<Sample>> {
        for e in std::mem::take(&mut self.waiting) {
            self.put_slanted(&e);
        }
        let pixel = |&head: &u32| {
            let mut out = vec![];
            let mut at = head;
            while at != NONE {
                let (s, next) = self.nodes[at as usize];
                out.push(s);
                at = next;
            }
            // Later ones come first in the list.
            out.reverse();
            out.sort_by(|a, b| a.depth.total_cmp(&b.depth));
            out.truncate(MOST);
            out
        };
        self.heads.iter().map(pixel).collect()
    }
}

/// Whether the layered image sees an element at too much of a slant for its rays to meet it well.
fn slanted(e: &Element) -> bool {
    e.sample.normal.dot(e.at).abs() < GRAZING * e.at.length()
}

fn sample(picture: &SurfaceImage, i: usize) -> Sample {
    let [r, g, b, _] = picture.albedo[i];
    Sample {
        depth: picture.depth[i],
        normal: from_octahedral(picture.normal[i]),
        albedo: [r, g, b],
        object: picture.object[i],
    }
}
