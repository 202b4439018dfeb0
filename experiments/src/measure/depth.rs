//! Depths: pixels that show a surface somewhere else than the reference does. Skins and holes are found so, whatever their colour.

use farfield_core::image::SurfaceImage;

/// Depths that differ by more than this share of the reference's are off.
pub const DEPTH_OFF: f32 = 0.01;

/// Pixels whose depth is off by more than [`DEPTH_OFF`], or where only one of the two shows a surface, over all pixels.
///
/// # Panics
/// When the two differ in size.
pub fn depth_off_fraction(reference: &SurfaceImage, candidate: &SurfaceImage) -> f64 {
    assert_eq!(reference.size, candidate.size, "surfaces of different size are compared");
    let off = |i: &usize| match (reference.hit(*i), candidate.hit(*i)) {
        (true, true) => (candidate.depth[*i] - reference.depth[*i]).abs() > DEPTH_OFF * reference.depth[*i],
        (r, c) => r != c,
    };
    let all = reference.object.len();
    (0..all).filter(off).count() as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(depth: &[f32]) -> SurfaceImage {
        SurfaceImage {
            size: [depth.len() as u32, 1],
            object: depth.iter().map(|d| u32::from(d.is_finite())).collect(),
            depth: depth.to_vec(),
            ..SurfaceImage::default()
        }
    }

    #[test]
    fn depths_are_off_by_more_than_a_hundredth_or_where_one_sees_nothing() {
        let none = f32::INFINITY;
        let r = surface(&[10.0, 10.0, 10.0, 10.0, none, none, 10.0, 200.0]);
        let c = surface(&[10.0, 10.09, 9.91, 10.11, none, 5.0, none, 197.0]);
        assert_eq!(depth_off_fraction(&r, &c), 4.0 / 8.0);
        assert_eq!(depth_off_fraction(&r, &r), 0.0);
    }
}
