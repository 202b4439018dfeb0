//! What backends give back: captured surfaces and lit pictures. Rows run from the top, pixels from the left.

use glam::Vec3;

/// The surface that a camera sees, pixel by pixel, before any light falls on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceImage {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// sRGB albedo; alpha is 255 where something was hit and 0 elsewhere.
    pub albedo: Vec<[u8; 4]>,
    /// Unit normal in the local frame as an octahedral pair of signed 16-bit fractions (x in the low half).
    pub normal: Vec<u32>,
    /// Distance along the camera's forward axis, scene units; infinite where nothing was hit.
    pub depth: Vec<f32>,
    /// Object number + 1; 0 where nothing was hit.
    pub object: Vec<u32>,
}

/// A lit picture, sRGB, 8 bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// sRGB colours.
    pub rgba: Vec<[u8; 4]>,
}

impl SurfaceImage {
    /// The index of pixel (x, y) in every plane.
    pub fn at(&self, x: u32, y: u32) -> usize {
        (y * self.size[0] + x) as usize
    }

    /// Whether a surface was hit at index `i`.
    pub fn hit(&self, i: usize) -> bool {
        self.object[i] != 0
    }
}

/// Octahedral encoding of a unit vector: two 16-bit signed fractions, x in the low half (Cigolle et al. 2014).
/// The same arithmetic stands in the shaders.
pub fn octahedral(n: Vec3) -> u32 {
    let s = n.x.abs() + n.y.abs() + n.z.abs();
    if !(s > 0.0 && s.is_finite()) {
        return octahedral(Vec3::Y);
    }
    let (mut x, mut y) = (n.x / s, n.y / s);
    if n.z < 0.0 {
        let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
        (x, y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
    }
    let q = |v: f32| (v.clamp(-1.0, 1.0) * 32767.0 + 0.5).floor() as i32 as u32 & 0xffff;
    q(x) | q(y) << 16
}

/// The unit vector of [`octahedral`].
pub fn from_octahedral(p: u32) -> Vec3 {
    let f = |v: u32| (f32::from(v as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (f(p), f(p >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    Vec3::new(x - t.copysign(x), y - t.copysign(y), z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn octahedral_round_trip_is_within_a_ten_thousandth(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            prop_assume!(Vec3::new(x, y, z).length() > 1e-3);
            let n = Vec3::new(x, y, z).normalize();
            prop_assert!(from_octahedral(octahedral(n)).distance(n) < 1e-4);
        }
    }

    #[test]
    fn a_vector_without_direction_becomes_up() {
        assert!(from_octahedral(octahedral(Vec3::ZERO)).distance(Vec3::Y) < 1e-4);
        assert!(from_octahedral(octahedral(Vec3::NAN)).distance(Vec3::Y) < 1e-4);
    }
}
