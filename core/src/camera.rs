//! One camera for eyes, captures, windows, cube faces and lights: a pinhole with an off-axis picture plane.

use glam::{DMat4, DVec3, Mat4, Vec3, Vec4};
use serde::{Deserialize, Serialize};

use crate::Aabb;

/// A pinhole. The picture spans the tangents `left..right` and `bottom..top` on the plane one unit ahead.
///
/// `right`, `up` and `forward` are orthonormal, and right x up = -forward (right-handed). Depth is linear distance along
/// `forward`; projected depth is reversed: 1 at `near`, 0 infinitely far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Where it stands, in the scene's local frame.
    pub eye: DVec3,
    /// Unit vector to the picture's right.
    pub right: Vec3,
    /// Unit vector to the picture's top.
    pub up: Vec3,
    /// Unit vector into the picture.
    pub forward: Vec3,
    /// Tangent at the left edge.
    pub left: f32,
    /// Tangent at the right edge.
    pub right_tan: f32,
    /// Tangent at the bottom edge.
    pub bottom: f32,
    /// Tangent at the top edge.
    pub top: f32,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Nothing nearer along `forward` is drawn, scene units.
    pub near: f32,
}

impl Camera {
    /// A symmetric camera that looks along `forward` with `up` as near to the picture's top as can be.
    /// `fov_y` is the full vertical angle in radians.
    pub fn looking(eye: DVec3, forward: Vec3, up: Vec3, fov_y: f32, size: [u32; 2], near: f32) -> Self {
        let forward = forward.normalize();
        let side = forward.cross(up);
        let right = if side.length_squared() > 1e-12 { side.normalize() } else { forward.any_orthonormal_vector() };
        let top = (0.5 * fov_y).tan();
        let right_tan = top * size[0] as f32 / size[1] as f32;
        Self {
            eye,
            right,
            up: right.cross(forward),
            forward,
            left: -right_tan,
            right_tan,
            bottom: -top,
            top,
            size,
            near,
        }
    }

    /// The camera at `eye` that looks along `axis` and whose picture just holds `points`, at `px_per_tan` pixels a unit
    /// tangent, with a border of `border_px` pixels around. `None` when a point lies beside or behind the eye.
    pub fn around(
        eye: DVec3,
        axis: Vec3,
        points: impl IntoIterator<Item = Vec3>,
        px_per_tan: f32,
        border_px: u32,
        near: f32,
    ) -> Option<Self> {
        let mut c = Self::looking(eye, axis, Vec3::Y, 1.0, [1, 1], near);
        let (mut lo, mut hi) = (glam::Vec2::INFINITY, glam::Vec2::NEG_INFINITY);
        for p in points {
            let v = (p.as_dvec3() - eye).as_vec3();
            let z = v.dot(c.forward);
            if z.partial_cmp(&near) != Some(std::cmp::Ordering::Greater) {
                return None;
            }
            let t = glam::Vec2::new(v.dot(c.right), v.dot(c.up)) / z;
            (lo, hi) = (lo.min(t), hi.max(t));
        }
        if !(lo.is_finite() && hi.is_finite()) {
            return None;
        }
        let border = border_px as f32;
        let (first, last) = ((lo * px_per_tan - border).floor(), (hi * px_per_tan + border).ceil());
        let px = (last - first).max(glam::Vec2::ONE);
        (c.left, c.right_tan) = (first.x / px_per_tan, (first.x + px.x) / px_per_tan);
        (c.bottom, c.top) = (first.y / px_per_tan, (first.y + px.y) / px_per_tan);
        c.size = [px.x as u32, px.y as u32];
        Some(c)
    }

    /// The six 90 degree cameras of a cube of `face_px` x `face_px` pictures, in the order +x -x +y -y +z -z.
    pub fn cube(eye: DVec3, face_px: u32, near: f32) -> [Self; 6] {
        [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].map(|axis| {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            Self::looking(eye, axis, up, std::f32::consts::FRAC_PI_2, [face_px; 2], near)
        })
    }

    /// Pixels a unit of tangent, vertically: a length s at distance d covers s / d times this many pixels.
    pub fn px_per_tan(&self) -> f32 {
        self.size[1] as f32 / (self.top - self.bottom)
    }

    /// The largest 1 / cos^2 over the picture: how much a small angle is stretched in its farthest corner.
    pub fn corner_stretch(&self) -> f32 {
        let t = |a: f32, b: f32| a.abs().max(b.abs());
        let (x, y) = (t(self.left, self.right_tan), t(self.bottom, self.top));
        1.0 + x * x + y * y
    }

    /// Clip-space matrix for positions relative to the eye (rows of the picture from the top, depth reversed, far plane
    /// at infinity; clip y points up).
    pub fn projection(&self) -> Mat4 {
        let (w, h) = (self.right_tan - self.left, self.top - self.bottom);
        let row_x = (self.right * 2.0 - self.forward * (self.left + self.right_tan)) / w;
        let row_y = (self.up * 2.0 - self.forward * (self.bottom + self.top)) / h;
        Mat4::from_cols(
            Vec4::new(row_x.x, row_x.y, row_x.z, 0.0),
            Vec4::new(row_y.x, row_y.y, row_y.z, 0.0),
            Vec4::new(0.0, 0.0, 0.0, self.near),
            Vec4::new(self.forward.x, self.forward.y, self.forward.z, 0.0),
        )
        .transpose()
    }

    /// The same as one matrix from the local frame, 64 bit.
    pub fn view_projection(&self) -> DMat4 {
        self.projection().as_dmat4() * DMat4::from_translation(-self.eye)
    }

    /// Where a point relative to the eye falls: pixels from the picture's top left, and linear depth. The point may lie
    /// outside the picture; one beside or behind the eye has no pixel.
    pub fn project(&self, from_eye: Vec3) -> Option<Vec3> {
        let z = from_eye.dot(self.forward);
        if z.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let (x, y) = (from_eye.dot(self.right) / z, from_eye.dot(self.up) / z);
        Some(Vec3::new(
            (x - self.left) / (self.right_tan - self.left) * self.size[0] as f32,
            (self.top - y) / (self.top - self.bottom) * self.size[1] as f32,
            z,
        ))
    }

    /// The ray through the point (x, y) of the picture, pixels from the top left; its component along `forward` is 1, so
    /// that the ray's parameter is linear depth. Pixel centres lie at halves.
    pub fn ray(&self, x: f32, y: f32) -> Vec3 {
        let tx = self.left + x / self.size[0] as f32 * (self.right_tan - self.left);
        let ty = self.top - y / self.size[1] as f32 * (self.top - self.bottom);
        self.forward + self.right * tx + self.up * ty
    }

    /// The inward normals of the four side planes, all through the eye: left, right, bottom, top. Near and far are left
    /// out on purpose, so that culling is monotone in the frustum.
    pub fn side_planes(&self) -> [Vec3; 4] {
        [
            self.right - self.forward * self.left,
            self.forward * self.right_tan - self.right,
            self.up - self.forward * self.bottom,
            self.forward * self.top - self.up,
        ]
    }

    /// Whether a box may be seen: false only when it lies wholly outside one side plane. Boxes are in the local frame.
    pub fn may_see(&self, b: &Aabb) -> bool {
        if b.is_empty() {
            return false;
        }
        let (lo, hi) = ((b.min.as_dvec3() - self.eye).as_vec3(), (b.max.as_dvec3() - self.eye).as_vec3());
        self.side_planes().iter().all(|n| {
            let far = Vec3::select(n.cmpge(Vec3::ZERO), hi, lo);
            n.dot(far) >= 0.0
        })
    }
}

/// What is known of every view before any is taken: what partitions and error formulas may rely on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewModel {
    /// Full vertical field of view, radians.
    pub fov_y_rad: f32,
    /// Width and height, pixels.
    pub resolution: [u32; 2],
    /// Near distance, scene units.
    pub near: f32,
    /// The range of eye heights, local frame, scene units.
    pub eye_height: [f32; 2],
    /// The range of pitch, radians; 0 is level, positive looks up.
    pub pitch_rad: [f32; 2],
    /// Greatest speed, scene units a second.
    pub max_speed: f32,
    /// Greatest turn, radians a second.
    pub max_turn_rad: f32,
}

impl ViewModel {
    /// Pixels a unit of tangent.
    pub fn px_per_tan(&self) -> f32 {
        self.resolution[1] as f32 / (2.0 * (0.5 * self.fov_y_rad).tan())
    }

    /// Full horizontal field of view, radians.
    pub fn fov_x_rad(&self) -> f32 {
        2.0 * ((0.5 * self.fov_y_rad).tan() * self.resolution[0] as f32 / self.resolution[1] as f32).atan()
    }

    /// Half the diagonal field of view, radians.
    pub fn half_diagonal_rad(&self) -> f32 {
        let (x, y) = ((0.5 * self.fov_x_rad()).tan(), (0.5 * self.fov_y_rad).tan());
        x.hypot(y).atan()
    }

    /// The camera of this model at `eye`, looking along `yaw` (0 = -z, counter-clockwise seen from above) and `pitch`.
    pub fn camera(&self, eye: DVec3, yaw_rad: f32, pitch_rad: f32) -> Camera {
        let (cp, sp) = (pitch_rad.cos(), pitch_rad.sin());
        let forward = Vec3::new(-yaw_rad.sin() * cp, sp, -yaw_rad.cos() * cp);
        let up = Vec3::new(yaw_rad.sin() * sp, cp, yaw_rad.cos() * sp);
        Camera::looking(eye, forward, up, self.fov_y_rad, self.resolution, self.near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera() -> Camera {
        let mut c =
            Camera::looking(DVec3::new(1.0, 2.0, 3.0), Vec3::new(0.3, -0.2, -1.0), Vec3::Y, 1.0, [640, 480], 0.1);
        c.left *= 1.3;
        c.top *= 0.7;
        c
    }

    proptest! {
        #[test]
        fn the_matrix_and_the_pixels_agree(x in -5f32..5.0, y in -5f32..5.0, z in 0.2f32..50.0) {
            let c = camera();
            let p = c.right * x + c.up * y + c.forward * z;
            let clip = c.projection() * p.extend(1.0);
            let px = c.project(p).unwrap();
            let ndc = clip / clip.w;
            prop_assert!(((ndc.x * 0.5 + 0.5) * 640.0 - px.x).abs() < 0.05);
            prop_assert!(((0.5 - ndc.y * 0.5) * 480.0 - px.y).abs() < 0.05);
            prop_assert!((clip.w - z).abs() < 1e-3 * z);
            prop_assert!((ndc.z - 0.1 / z).abs() < 1e-4);
        }

        #[test]
        fn a_ray_goes_where_its_pixel_is(x in 0f32..640.0, y in 0f32..480.0) {
            let c = camera();
            let r = c.ray(x, y);
            let back = c.project(r * 7.0).unwrap();
            prop_assert!((back.x - x).abs() < 0.01 && (back.y - y).abs() < 0.01 && (back.z - 7.0).abs() < 1e-4);
        }
    }

    #[test]
    fn a_picture_around_points_holds_them_with_its_border() {
        let points = [Vec3::new(-1.0, 0.0, -5.0), Vec3::new(2.0, 1.5, -6.0)];
        let c = Camera::around(DVec3::ZERO, -Vec3::Z, points, 100.0, 2, 0.1).unwrap();
        for p in points {
            let px = c.project(p).unwrap();
            assert!(px.x >= 1.99 && px.x <= c.size[0] as f32 - 1.99, "{px}");
            assert!(px.y >= 1.99 && px.y <= c.size[1] as f32 - 1.99, "{px}");
        }
        assert!((c.px_per_tan() - 100.0).abs() < 1e-3);
        assert!(Camera::around(DVec3::ZERO, -Vec3::Z, [Vec3::Z], 100.0, 2, 0.1).is_none());
    }

    #[test]
    fn cube_faces_are_right_handed_and_see_their_axis() {
        for c in Camera::cube(DVec3::ZERO, 4, 0.1) {
            assert!(c.right.cross(c.up).distance(-c.forward) < 1e-6);
            assert!(c.may_see(&Aabb::of([c.forward * 3.0])));
            assert!(!c.may_see(&Aabb::of([c.forward * -3.0])));
        }
    }
}
