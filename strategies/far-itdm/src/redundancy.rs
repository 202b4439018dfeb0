//! Which points of a sample an ancestor has already.
//!
//! Follows Wilson and Manocha 2003, section 4.1.2. A surface point s of a sample is redundant when some ancestor, looking at it, finds a
//! point t of its own within a tolerance that grows with the distance from the sample's eye E:
//!
//! ```text
//! |s - t| <= same_px * delta * |s - E|,  delta = the tangent that a pixel spans
//! ```
//!
//! Measured at the sample's own pixels: what an ancestor has more coarsely, because it stands farther away or looks along it, is kept.
//! O(pixels * ancestors), most often one or two.

use farfield_core::panorama::{Panorama, Place};

/// For each pixel whether it shows a surface that no ancestor has.
pub(crate) fn kept(own: &Panorama<'_>, ancestors: &[&Panorama<'_>], same_px: f32) -> Vec<bool> {
    let delta = pixel_tan(own);
    let moved: Vec<_> = ancestors.iter().map(|a| (own.eye() - a.eye()).as_vec3()).collect();
    let keeps = |pixel: u32| {
        let s = own.point(pixel);
        if !s.is_finite() {
            return false;
        }
        let tolerance = same_px * delta * s.length();
        let has = |(a, moved): (&&Panorama<'_>, &glam::Vec3)| {
            let towards = s + *moved;
            a.look(towards).is_some_and(|at: Place| a.point(a.pixel(at)).distance(towards) <= tolerance)
        };
        !ancestors.iter().zip(&moved).any(has)
    };
    (0..own.pixels()).map(keeps).collect()
}

/// The tangent that a pixel of a panorama spans.
pub(crate) fn pixel_tan(p: &Panorama<'_>) -> f32 {
    let c = &p.views()[0].0;
    (c.right_tan - c.left) / c.size[0] as f32
}
