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
//!
//! **Mending**, beyond the paper: a point that an ancestor has may still lie beside what the ancestor's mesh covers, seen from the
//! sample, at the mesh's borders. So the ancestors' meshes are drawn from the sample's eye, and every pixel that they leave open is
//! put back: from the sample points, with all ancestors drawn, there is no crack before meshes are simplified.
//!
//! O(pixels * ancestors), most often one or two.

use farfield_core::Camera;
use farfield_core::panorama::raster::DepthCube;
use farfield_core::panorama::{Panorama, Place, Surface};

use crate::dense::split;

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

/// A sample with what it keeps.
#[derive(Clone, Copy)]
pub(crate) struct Sample<'a> {
    pub(crate) panorama: &'a Panorama<'a>,
    pub(crate) surface: &'a Surface,
    pub(crate) keep: &'a [bool],
}

/// Puts back the pixels that the ancestors' meshes leave open, and says how many there were.
pub(crate) fn mend(own: &Panorama<'_>, keep: &mut [bool], ancestors: &[Sample<'_>], same_px: f32) -> u64 {
    let cameras: Vec<Camera> = own.views().iter().map(|v| v.0).collect();
    let mut seen = DepthCube::new(&cameras);
    for a in ancestors {
        let moved = (a.panorama.eye() - own.eye()).as_vec3();
        for pixel in (0..a.panorama.pixels()).filter(|&p| a.keep[p as usize]) {
            let Some(quad) = a.surface.quad(pixel).map(|q| q.map(|p| p + moved)) else { continue };
            for t in split(quad) {
                let [a, b, c] = t.map(|k| quad[k]);
                // What turns away from the eye is not drawn.
                if (b - a).cross(c - a).dot(a) < 0.0 {
                    seen.draw_triangle([a, b, c]);
                }
            }
        }
    }
    let delta = pixel_tan(own);
    let mut mended = 0;
    for pixel in 0..own.pixels() {
        let s = own.point(pixel);
        let open = |p: u32| seen.depth()[p as usize] > own.depth(p) + same_px * delta * s.length();
        if !keep[pixel as usize] && s.is_finite() && open(pixel) {
            keep[pixel as usize] = true;
            mended += 1;
        }
    }
    mended
}
