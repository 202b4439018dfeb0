//! Merging construction images into one layered image.
//!
//! A pixel of a picture is a surface element: a point, a normal, and the parallelogram that the pixel cuts from the plane through
//! both. Following Shade et al. (1998, section 5.2) elements are gathered by the layered image's pixels, and those of one pixel that
//! are the same surface are kept once. Chosen here, where the papers are silent:
//!
//! * A sample stands on its pixel's central ray. An element is given to every ray that meets its parallelogram, at the depth where it
//!   meets it: coarser pictures leave no gaps, finer ones no doubles, and outlines stay where they are to half a pixel.
//! * On a surface that the layered image sees at a slant ([`SLANT`]) one sample a ray is far from the next, farther than a drawn sample
//!   reaches once the eye comes near. Its elements are also given, as points at their own depth, to the pixel that they fall
//!   into: several samples of a pixel, one behind the other, make up a wall that is seen edge-on. That such a point moves to its
//!   pixel's ray takes it off its plane by half a pixel times the cosine of the slant at most.
//! * The central picture has the layered image's own rays and is merged first: what it sees is exactly the front of every
//!   pixel. Nothing may stand before it: a point that would is given to the nearest of the pixels around that allow it, or
//!   dropped. (The paper merges the images nearest to the window first.)
//! * Elements that their own picture sees at a grazing angle wait until all others are in, as points.
//! * The same surface: with footprint f = depth / pixels a unit tangent and slope s = tan of the angle between normal and ray (that of
//!   [`GRAZING`] at most), two samples no farther apart in depth than merge_px f (1 + s / 2), whose normals are less
//!   than 73 degrees apart; or no farther apart than f (merge_px f where that is less), whatever their normals. A point: no farther than merge_px f.

use farfield_core::Camera;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::layered::{GRAZING, Warp};
use glam::{DVec3, Vec2, Vec3};

/// Ends a list.
const NONE: u32 = u32::MAX;
/// The cosine between normal and ray under which a surface takes points beside its rays' samples.
const SLANT: f32 = 0.4;
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
                if s.normal.dot(ray).abs() < GRAZING * ray.length() {
                    self.waiting.push(element);
                    continue;
                }
                let facing = s.normal.dot(element.at).abs() / element.at.length();
                if facing < SLANT {
                    self.put_point(&element);
                }
                if facing < GRAZING {
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
                            && camera
                                .project(own * depth - offset)
                                .is_some_and(|p| (p.truncate() - middle).abs().max_element() <= 0.5 + SLACK);
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

    /// A footprint at a sample, and how far along its ray the same surface reaches.
    fn tolerance(&self, s: &Sample, ray: Vec3) -> [f32; 2] {
        let footprint = s.depth / self.camera.px_per_tan();
        let c = (s.normal.dot(ray).abs() / ray.length()).clamp(GRAZING, 1.0);
        let slope = (1.0 - c * c).sqrt() / c;
        [footprint, self.merge_px * footprint * (1.0 + 0.5 * slope)]
    }

    /// Keeps a sample on its ray unless its surface is there or the centre sees past it.
    fn put(&mut self, x: u32, y: u32, s: Sample) {
        let (i, ray) = (self.index(x, y), self.ray(x, y));
        let [footprint, along] = self.tolerance(&s, ray);
        let there = |there: &Sample| {
            let apart = (there.depth - s.depth).abs();
            let same = s.normal.dot(there.normal) > SAME;
            apart <= footprint * self.merge_px.min(1.0) || (same && apart <= along.max(self.tolerance(there, ray)[1]))
        };
        if s.depth >= self.front[i] && !self.any(i, there) {
            self.push(i, s);
        }
    }

    /// Keeps a point in the pixel that it falls into, or in the nearest one around where nothing that the centre sees lies behind it.
    fn put_point(&mut self, e: &Element) {
        let Some(p) = self.camera.project(e.at) else { return };
        let [w, h] = self.camera.size;
        if !(p.x >= 0.0 && p.y >= 0.0 && p.x < w as f32 && p.y < h as f32) {
            return;
        }
        let (x, y) = ((p.x as u32).min(w - 1), (p.y as u32).min(h - 1));
        let mut best: Option<(f32, usize)> = None;
        for v in y.saturating_sub(1)..(y + 2).min(h) {
            for u in x.saturating_sub(1)..(x + 2).min(w) {
                let away = (Vec2::new(u as f32 + 0.5, v as f32 + 0.5) - p.truncate()).length_squared();
                let i = self.index(u, v);
                if p.z >= self.front[i] && best.is_none_or(|b| away < b.0) {
                    best = Some((away, i));
                }
            }
        }
        let apart = self.merge_px * p.z / self.camera.px_per_tan();
        if let Some((_, i)) = best.filter(|&(_, i)| !self.any(i, |there| (there.depth - p.z).abs() <= apart)) {
            self.push(i, Sample { depth: p.z, ..e.sample });
        }
    }

    fn any(&self, pixel: usize, mut test: impl FnMut(&Sample) -> bool) -> bool {
        let mut at = self.heads[pixel];
        while let Some((there, next)) = self.nodes.get(at as usize) {
            if test(there) {
                return true;
            }
            at = *next;
        }
        false
    }

    fn push(&mut self, pixel: usize, s: Sample) {
        self.nodes.push((s, self.heads[pixel]));
        self.heads[pixel] = self.nodes.len() as u32 - 1;
    }

    /// The samples of each pixel from front to back, by rows from the top.
    pub(crate) fn finish(mut self) -> Vec<Vec<Sample>> {
        for e in std::mem::take(&mut self.waiting) {
            self.put_point(&e);
        }
        let pixel = |&head: &u32| {
            let mut out = vec![];
            let mut at = head;
            while let Some(&(s, next)) = self.nodes.get(at as usize) {
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

fn sample(picture: &SurfaceImage, i: usize) -> Sample {
    let [r, g, b, _] = picture.albedo[i];
    Sample {
        depth: picture.depth[i],
        normal: from_octahedral(picture.normal[i]),
        albedo: [r, g, b],
        object: picture.object[i],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::image::octahedral;

    const EYE: Vec3 = Vec3::ZERO;

    fn camera(eye: Vec3, size: u32) -> Camera {
        Camera::looking(eye.as_dvec3(), -Vec3::Z, Vec3::Y, 1.2, [size; 2], 0.01)
    }

    /// A rectangle: a point, two edges whose cross product faces the viewer, and whose it is.
    type Wall = (Vec3, Vec3, Vec3, u32);

    /// What a camera sees of rectangles, their backs left out.
    fn picture(c: &Camera, walls: &[Wall]) -> SurfaceImage {
        let [w, h] = c.size;
        let mut out = SurfaceImage { size: c.size, ..SurfaceImage::default() };
        for i in 0..w * h {
            let ray = c.ray((i % w) as f32 + 0.5, (i / w) as f32 + 0.5);
            let mut hit = (f32::INFINITY, Vec3::Y, 0);
            for &(p, a, b, object) in walls {
                let n = a.cross(b);
                let z = n.dot(p - c.eye.as_vec3()) / n.dot(ray);
                let q = c.eye.as_vec3() + ray * z - p;
                let inside = |e: Vec3| (0.0..=1.0).contains(&(q.dot(e) / e.length_squared()));
                if n.dot(ray) < 0.0 && z > 0.0 && z < hit.0 && inside(a) && inside(b) {
                    hit = (z, n.normalize(), object);
                }
            }
            out.depth.push(hit.0);
            out.normal.push(octahedral(hit.1));
            out.object.push(hit.2);
            out.albedo.push([hit.2 as u8, 0, 0, if hit.2 > 0 { 255 } else { 0 }]);
        }
        out
    }

    fn merged(walls: &[Wall], others: &[(Vec3, u32)]) -> Vec<Vec<Sample>> {
        let own = camera(EYE, 64);
        let mut layers = Layers::new(own, 1.0, &picture(&own, walls));
        for &(eye, size) in others {
            let c = camera(eye, size);
            layers.add(&c, &picture(&c, walls));
        }
        layers.finish()
    }

    fn facing(z: f32, half: f32, object: u32) -> Wall {
        (Vec3::new(-half, -half, z), Vec3::X * 2.0 * half, Vec3::Y * 2.0 * half, object)
    }

    #[test]
    fn a_wall_that_many_pictures_see_is_kept_once() {
        let others = [(Vec3::new(2.0, 1.0, -3.0), 100), (Vec3::new(-1.5, 0.3, 4.0), 37)];
        for pixel in merged(&[facing(-10.0, 50.0, 1)], &others) {
            assert_eq!(pixel.len(), 1);
            assert!((pixel[0].depth - 10.0).abs() < 1e-3);
        }
    }

    #[test]
    fn what_another_picture_sees_behind_comes_second_without_gaps_and_nothing_comes_before_the_front() {
        // A coarse picture from the right, which sees all of the wall that the plate hides from the centre.
        let walls = [facing(-5.0, 1.0, 1), facing(-10.0, 50.0, 2)];
        let pixels = merged(&walls, &[(Vec3::new(4.0, 0.0, 0.0), 40)]);
        let central = picture(&camera(EYE, 64), &walls);
        let row = |y: usize| -> String {
            let of = |p: &Vec<Sample>| char::from(b'0' + p.iter().map(|s| s.object as u8).fold(0, |n, o| 4 * n + o));
            pixels[y * 64..][..64].iter().map(of).collect()
        };
        // '2' is the wall alone, '6' the plate before the wall.
        let middle = row(32);
        let seen = middle.trim_matches('2');
        assert_eq!(seen.len(), central.object[32 * 64..][..64].iter().filter(|o| **o == 1).count());
        assert!(seen.len() > 10 && seen.chars().all(|c| c == '6'), "a gap in {middle}");
        for (i, p) in pixels.iter().enumerate() {
            assert_eq!((p[0].depth, p[0].object), (central.depth[i], central.object[i]));
            assert!(p.iter().all(|s| s.object == 1 || (s.depth - 10.0).abs() < 1e-2));
        }
    }

    #[test]
    fn a_wall_that_the_centre_sees_edge_on_gets_samples_all_along() {
        // The right side of a box, of which the centre sees the front alone.
        let side = (Vec3::new(1.0, -1.0, -10.0), Vec3::new(0.0, 0.0, -10.0), Vec3::Y * 2.0, 2);
        let pixels = merged(&[facing(-10.0, 1.0, 1), side], &[(Vec3::new(4.0, 0.0, -5.0), 256)]);
        let footprint = 10.0 / camera(EYE, 64).px_per_tan();
        let mut depths: Vec<f32> =
            pixels[32 * 64..][..64].iter().flatten().filter(|s| s.object == 2).map(|s| s.depth).collect();
        depths.sort_by(f32::total_cmp);
        assert!(depths[0] < 10.0 + 3.0 * footprint && *depths.last().unwrap() > 19.0, "{depths:?}");
        assert!(depths.windows(2).all(|w| w[1] - w[0] < 5.0 * footprint), "{depths:?} by {footprint}");
        assert!(pixels.iter().all(|p| p.len() < 64));
    }
}
