//! Layered depth images: pictures with several samples a pixel, each a small piece of surface (Shade, Gortler, He and Szeliski,
//! "Layered Depth Images", 1998).
//!
//! A sample is a surface element: it stands where its pixel's central ray reaches its depth, is as large as the pixel there and lies in
//! the plane of its normal. To draw one is to *warp* it ([`Warp::splat`]): the element is thrown into the picture of another eye
//! and covers the rectangle around its image there, so that neighbouring samples of one surface leave no gaps. The nearest sample
//! of a pixel wins; geometry in front of it hides it.
//!
//! Samples are kept as they are stored: depth in 16 bits, evenly spaced in 1 / depth, so that what rounding moves on screen is bounded
//! ([`LayeredPart::rounding_px`]); normals as octahedral pairs of bytes. 10 bytes a sample and one a pixel.

mod stored;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::Camera;

/// The cosine of the angle at which elements stop growing: one seen more grazing than this by its image is taken as if it were
/// seen so, or its plane would reach to infinity.
pub const GRAZING: f32 = 0.2;

/// The largest edge of a splat, pixels: what a sample can stand for when the eye comes near it.
pub const MAX_SPLAT_PX: f32 = 8.0;

/// A layered depth image. The samples of a pixel follow each other from front to back; pixels run by rows from the top.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "stored::Stored", try_from = "stored::Stored")]
pub struct LayeredPart {
    /// Its camera; the eye is relative to the payload's origin.
    pub camera: Camera,
    /// 1 / depth at stored depth 0 (the nearest) and at 65535 (the farthest); evenly spaced between.
    pub inverse_depth: [f32; 2],
    /// How many samples each pixel has.
    pub counts: Vec<u8>,
    /// Depth along the camera's forward axis, sample by sample.
    pub depth: Vec<u16>,
    /// sRGB albedo.
    pub albedo: Vec<[u8; 3]>,
    /// Unit normals in the local frame: octahedral pairs of signed fractions of 127.
    pub normal: Vec<[i8; 2]>,
    /// Whose surface it is: an index into `objects`.
    pub object: Vec<u16>,
    /// Object numbers + 1, as the object plane has them.
    pub objects: Vec<u32>,
    /// Drawn smoothed: albedo and normal of a covered pixel are averaged with those of the covered ones among its eight
    /// neighbours, with weights 1 2 1, 2 4 2, 1 2 1 (Aliaga and Lastra 1999, section 5). Only pixels that this image covers, before
    /// any other image of the pass, take part.
    pub smooth: bool,
}

impl LayeredPart {
    /// How many samples it has.
    pub fn samples(&self) -> usize {
        self.depth.len()
    }

    /// Depth of a sample, scene units.
    pub fn depth_at(&self, sample: usize) -> f32 {
        depth_of(self.depth[sample], self.inverse_depth)
    }

    /// The nearest stored depth.
    pub fn quantise(depth: f32, inverse_depth: [f32; 2]) -> u16 {
        let [near, far] = inverse_depth;
        let t = (near - depth.recip()) / (near - far).max(f32::MIN_POSITIVE);
        (t.clamp(0.0, 1.0) * 65535.0).round() as u16
    }

    /// A bound of how far rounding of depths moves a sample's image, pixels a unit of the viewer's stretch (1 / cos^2 of the angle to
    /// its axis), for an eye at most `moved` scene units away from the image's with `px_per_tan` pixels a unit tangent; infinite where
    /// such an eye may touch a sample.
    ///
    /// With the eye at o, a ray r (|r| >= 1) and w = 1 / z the sample stands at r / w - o. Half a step of w, d = (near - far) / (2 * 65535)
    /// with the ends of [`LayeredPart::inverse_depth`], moves it by z^2 d along r, which is seen under at most z^2 d |o x r| / (z |r| - |o|)^2
    /// <= moved d / (1 - moved near)^2 radians.
    pub fn rounding_px(&self, moved: f32, px_per_tan: f32) -> f32 {
        let [near, far] = self.inverse_depth;
        let left = 1.0 - moved * near;
        if left <= 0.0 { f32::INFINITY } else { moved * px_per_tan * (near - far) / (2.0 * 65535.0) / (left * left) }
    }

    /// Unit normal of a sample.
    pub fn normal_at(&self, sample: usize) -> Vec3 {
        normal_of(self.normal[sample])
    }

    /// The index of every pixel's first sample, and one past the last.
    pub fn first_samples(&self) -> Vec<u32> {
        let mut at = 0;
        let sum = self.counts.iter().map(|&n| {
            at += u32::from(n);
            at
        });
        std::iter::once(0).chain(sum).collect()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> u64 {
        (self.counts.len() + 10 * self.samples() + 4 * self.objects.len()) as u64
    }
}

/// Depth from its stored form.
pub fn depth_of(stored: u16, [near, far]: [f32; 2]) -> f32 {
    (near + (far - near) * (f32::from(stored) / 65535.0)).recip()
}

/// Octahedral pair of bytes of a unit vector.
pub fn normal_bytes(n: Vec3) -> [i8; 2] {
    let wide = crate::image::octahedral(n);
    let q = |v: u32| (f32::from(v as u16 as i16) / 32767.0 * 127.0).round() as i8;
    [q(wide), q(wide >> 16)]
}

/// The unit vector of [`normal_bytes`].
pub fn normal_of([x, y]: [i8; 2]) -> Vec3 {
    let wide = |v: i8| (f32::from(v) / 127.0 * 32767.0).round() as i16 as u16;
    crate::image::from_octahedral(u32::from(wide(x)) | u32::from(wide(y)) << 16)
}

/// What is the same for all samples of an image that is warped to an eye. The shaders hold the same numbers.
#[derive(Clone, Copy, Debug)]
pub struct Warp {
    /// The image's eye relative to the viewer's.
    pub offset: Vec3,
    /// From the image's eye to the centre of its first pixel, one unit ahead.
    pub corner: Vec3,
    /// From a pixel's ray to that of its right neighbour.
    pub step_x: Vec3,
    /// From a pixel's ray to that of the one below.
    pub step_y: Vec3,
    /// The viewer.
    pub to: Camera,
}

/// A warped sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// The sample's image, pixels from the viewer's top left.
    pub centre: Vec2,
    /// Half the edges of the rectangle that it covers, pixels.
    pub half: Vec2,
    /// Depth along the viewer's forward axis.
    pub depth: f32,
}

impl Warp {
    /// The warp of an image whose payload stands at `origin` to a viewer.
    pub fn new(image: &Camera, origin: glam::DVec3, to: &Camera) -> Self {
        let [w, h] = image.size.map(|s| s as f32);
        let step_x = image.right * ((image.right_tan - image.left) / w);
        let step_y = -image.up * ((image.top - image.bottom) / h);
        let corner = image.forward + image.right * image.left + image.up * image.top + 0.5 * (step_x + step_y);
        Self { offset: (origin + image.eye - to.eye).as_vec3(), corner, step_x, step_y, to: *to }
    }

    /// A sample of pixel (x, y) warped; `None` where it is nearer than the viewer's near distance.
    ///
    /// With ray r of the pixel, depth z, normal n and the viewer's axes R, U, F: the point is p = offset + z r. One pixel along x the
    /// element's plane is met at p + z (s - r (n . s) / (n . r)) with s the pixel step. Half the rectangle is half the sum
    /// of both steps' images, at least half a pixel, at most half of [`MAX_SPLAT_PX`].
    pub fn splat(&self, x: u32, y: u32, z: f32, n: Vec3) -> Option<Splat> {
        let to = &self.to;
        let ray = self.corner + self.step_x * x as f32 + self.step_y * y as f32;
        let p = self.offset + ray * z;
        let depth = p.dot(to.forward);
        if depth.partial_cmp(&to.near) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let scale = Vec2::new(to.size[0] as f32 / (to.right_tan - to.left), to.size[1] as f32 / (to.top - to.bottom));
        let tangent = Vec2::new(p.dot(to.right), p.dot(to.up)) / depth;
        let least = GRAZING * ray.length();
        let facing = n.dot(ray);
        let facing = if facing.abs() < least { if facing > 0.0 { least } else { -least } } else { facing };
        // How far the image of the element's edge along `s` reaches, pixels.
        let reach = |s: Vec3| {
            let d = (s - ray * (n.dot(s) / facing)) * z;
            let ahead = d.dot(to.forward);
            ((Vec2::new(d.dot(to.right), d.dot(to.up)) - tangent * ahead) / depth * scale).abs()
        };
        let half =
            (0.5 * (reach(self.step_x) + reach(self.step_y))).clamp(Vec2::splat(0.5), Vec2::splat(0.5 * MAX_SPLAT_PX));
        let centre = Vec2::new((tangent.x - to.left) * scale.x, (to.top - tangent.y) * scale.y);
        Some(Splat { centre, half, depth })
    }
}

impl Splat {
    /// The pixels that it covers, as columns and rows first..end within a picture: those whose centres lie in
    /// centre - half .. centre + half.
    pub fn pixels(&self, size: [u32; 2]) -> [std::ops::Range<u32>; 2] {
        let range = |c: f32, half: f32, n: u32| {
            let clamp = |v: f32| v.ceil().clamp(0.0, n as f32) as u32;
            clamp(c - half - 0.5)..clamp(c + half - 0.5)
        };
        [range(self.centre.x, self.half.x, size[0]), range(self.centre.y, self.half.y, size[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    fn image() -> Camera {
        Camera::looking(DVec3::ZERO, Vec3::new(0.2, 0.1, -1.0), Vec3::Y, 1.0, [64, 48], 0.1)
    }

    proptest! {
        #[test]
        fn warped_to_itself_a_sample_covers_its_own_pixel(
            x in 0u32..64, y in 0u32..48, z in 1f32..100.0, tilt in -1f32..1.0
        ) {
            let c = image();
            let n = (-c.forward + c.right * tilt).normalize();
            let s = Warp::new(&c, DVec3::ZERO, &c).splat(x, y, z, n).unwrap();
            prop_assert!((s.centre - Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).length() < 1e-2);
            prop_assert!((s.half - 0.5).length() < 1e-2 && (s.depth - z).abs() < 1e-4 * z);
        }

        #[test]
        fn samples_of_a_plane_leave_no_gap_between_them(
            tilt in -1.5f32..1.5, ex in -3f32..3.0, ey in -2f32..2.0, ez in -2f32..4.0, x in 1u32..62, y in 1u32..46
        ) {
            // A plane ten units ahead; the neighbours' rectangles overlap or touch in both directions.
            let c = image();
            let n = (-c.forward + c.right * tilt).normalize();
            let on = c.forward * 10.0;
            let eye = (c.right * ex + c.up * ey + c.forward * ez).as_dvec3();
            let to = Camera { eye, ..c };
            let w = Warp::new(&c, DVec3::ZERO, &to);
            let splat = |x: u32, y: u32| {
                let ray = w.corner + w.step_x * x as f32 + w.step_y * y as f32;
                w.splat(x, y, n.dot(on) / n.dot(ray), n)
            };
            let ray = w.corner + w.step_x * x as f32 + w.step_y * y as f32;
            prop_assume!(n.dot(ray).abs() > 0.25 * ray.length());
            let (Some(a), Some(b), Some(d)) = (splat(x, y), splat(x + 1, y), splat(x, y + 1)) else { return Ok(()) };
            prop_assume!(a.half.max_element().max(b.half.max_element()).max(d.half.max_element()) < 0.49 * MAX_SPLAT_PX);
            for o in [b, d] {
                let gap = (a.centre - o.centre).abs() - a.half - o.half;
                prop_assert!(gap.max_element() < 0.05 * a.half.max_element(), "{a:?} {o:?}");
            }
        }

        #[test]
        fn stored_depths_are_within_half_a_step_of_inverse_depth(z in 2f32..500.0) {
            let ends = [1.0 / 2.0, 1.0 / 500.0];
            let back = depth_of(LayeredPart::quantise(z, ends), ends);
            prop_assert!((1.0 / back - 1.0 / z).abs() <= 0.51 * (ends[0] - ends[1]) / 65535.0);
        }

        #[test]
        fn rounding_moves_an_image_no_farther_than_stated(
            o in [-1f32..1.0, -1f32..1.0, -1f32..1.0], x in 0f32..64.0, y in 0f32..48.0, z in 2f32..50.0
        ) {
            let c = image();
            let part = LayeredPart {
                camera: c,
                inverse_depth: [0.5, 0.02],
                counts: vec![],
                depth: vec![],
                albedo: vec![],
                normal: vec![],
                object: vec![],
                objects: vec![],
                smooth: false,
            };
            let eye = Vec3::from(o);
            let step = (0.5 - 0.02) / 65535.0;
            let ray = c.ray(x, y);
            let at = |w: f32| (ray.as_dvec3() / f64::from(w) - eye.as_dvec3()).normalize();
            // The whole step, in 64 bits, so that the bound of half a step is held to what can be measured.
            let angle = at(1.0 / z).angle_between(at(1.0 / z + step));
            let bound = f64::from(part.rounding_px(eye.length(), 1.0)) * 2.0;
            prop_assert!(angle <= bound * 1.001 + 1e-7, "{angle} against {bound}");
        }

        #[test]
        fn normals_are_within_a_degree(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            prop_assume!(Vec3::new(x, y, z).length() > 1e-3);
            let n = Vec3::new(x, y, z).normalize();
            prop_assert!(normal_of(normal_bytes(n)).angle_between(n) < 0.0175);
        }
    }
}
