//! Image error: what a candidate frame differs from its reference by, in display space (sRGB, 8 bit), as the papers do.
//!
//! PSNR is on luminance (textured LOD meshes, 2003, section 4.2), over the frame and over object pixels; SSIM and FLIP come
//! from libraries that follow their papers; a hole is a pixel where the reference shows an object and the candidate shows
//! the background; depths are compared too, and errors from frame to frame. O(pixels).

mod depth;
mod holes;
mod psnr;
mod surface;
mod temporal;

pub use depth::{DEPTH_OFF, depth_off_fraction};
pub use holes::{hole_mask, hole_width_px};
pub use psnr::{SquaredError, cap_db};
pub use surface::{Nearest, Piece, Pieces, SURFACE_RESOLUTION_PX, Surface, SurfaceErrors, surface_distances};
pub use temporal::{Change, Reads, error_luma, temporal_change};

use farfield_core::image::{Picture, SurfaceImage};
use image::GrayImage;

use crate::results::{ErrorSummary, MeanMax, MeanMin, SurfaceDistance};

/// A frame read back: its picture and the surface under it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// The lit picture.
    pub picture: Picture,
    /// What was seen.
    pub surface: SurfaceImage,
}

/// Which of the costly metrics to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Metrics {
    /// Structural similarity.
    pub ssim: bool,
    /// FLIP.
    pub flip: bool,
}

/// One frame's errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameErrors {
    /// Over the frame.
    pub luminance: SquaredError,
    /// Over pixels where either shows an object.
    pub luminance_on_objects: SquaredError,
    /// Mean structural similarity, 1 for equal frames.
    pub ssim: Option<f64>,
    /// Mean FLIP, 0 for equal frames.
    pub flip: Option<f64>,
    /// Hole pixels over all pixels.
    pub hole_fraction: f64,
    /// Pixels whose depth is off by more than 1 %, or where only one of the two shows a surface, over all pixels.
    pub depth_off_fraction: f64,
    /// Distances between the surfaces that the two show, where they are measured.
    pub surface: Option<SurfaceErrors>,
}

/// Says in words how equal frames enter a mean.
pub const EQUAL_FRAMES_NOTE: &str = "a frame equal to the reference has infinite PSNR; it enters means and minima with the PSNR of \
     a single pixel that differs by one grey level, the least difference that 8-bit frames of this size can have \
     (108.3 dB at 1024 x 1024), and is counted in equal_frames; psnr_y_pooled_db is the PSNR of the mean squared error over \
     all frames, where equal frames weigh as zeros";

/// Measures a frame.
///
/// # Panics
/// When the two differ in size.
pub fn frame(reference: &Rendered, candidate: &Rendered, metrics: Metrics) -> FrameErrors {
    assert_eq!(reference.picture.size, candidate.picture.size, "frames of different size are compared");
    let pixels = reference.picture.rgba.iter().zip(&candidate.picture.rgba);
    let shows = |i: usize| reference.surface.hit(i) || candidate.surface.hit(i);
    let mut luminance = SquaredError::default();
    let mut luminance_on_objects = SquaredError::default();
    for (i, (&a, &b)) in pixels.enumerate() {
        luminance.add(a, b);
        if shows(i) {
            luminance_on_objects.add(a, b);
        }
    }
    let holes = hole_mask(&reference.surface, &candidate.surface).iter().filter(|&&h| h).count();
    FrameErrors {
        luminance,
        luminance_on_objects,
        ssim: metrics.ssim.then(|| ssim(&reference.picture, &candidate.picture)),
        flip: metrics.flip.then(|| flip(&reference.picture, &candidate.picture).0),
        hole_fraction: holes as f64 / reference.picture.rgba.len().max(1) as f64,
        depth_off_fraction: depth_off_fraction(&reference.surface, &candidate.surface),
        surface: None,
    }
}

/// Joins measured frames, and changes between frames, into a summary.
pub fn summary(frames: &[FrameErrors], changes: &[Change]) -> ErrorSummary {
    let pooled = frames.iter().fold(SquaredError::default(), |s, f| s.joined(f.luminance));
    let of = |pick: fn(&FrameErrors) -> Option<f64>| -> Option<Vec<f64>> { frames.iter().map(pick).collect() };
    let some = |values: Vec<f64>| (!values.is_empty()).then(|| MeanMax::of(values));
    ErrorSummary {
        frames: frames.len(),
        equal_frames: frames.iter().filter(|f| f.luminance.sum == 0.0).count(),
        psnr_y_db: MeanMin::of(frames.iter().map(|f| f.luminance.psnr_db())),
        psnr_y_pooled_db: pooled.psnr_db(),
        psnr_y_object_db: MeanMin::of(
            frames.iter().map(|f| f.luminance_on_objects).filter(|e| e.pixels > 0).map(|e| e.psnr_db()),
        ),
        ssim: of(|f| f.ssim).filter(|v| !v.is_empty()).map(MeanMin::of),
        flip: of(|f| f.flip).filter(|v| !v.is_empty()).map(MeanMax::of),
        hole_fraction: MeanMax::of(frames.iter().map(|f| f.hole_fraction)),
        surface_distance: frames.iter().filter_map(|f| f.surface).reduce(SurfaceErrors::joined).map(|s| {
            SurfaceDistance { max_px: s.max_px, p999_px: s.p999_px, pixels_beyond: s.beyond, pixels: s.pixels }
        }),
        depth_off_fraction: some(frames.iter().map(|f| f.depth_off_fraction).collect()),
        frame_pairs: changes.len(),
        temporal_change_grey_levels: some(changes.iter().map(|c| c.grey_levels).collect()),
        frame_pairs_at_borders: changes.iter().filter(|c| c.at_border).count(),
        temporal_change_at_borders_grey_levels: some(
            changes.iter().filter(|c| c.at_border).map(|c| c.grey_levels).collect(),
        ),
    }
}

/// Mean structural similarity of luminance (Wang et al. 2004, uniform 8 x 8 windows). A dimension under 8 pixels gives 1
/// for equal and 0 for different pictures.
pub fn ssim(a: &Picture, b: &Picture) -> f64 {
    let gray = |p: &Picture| {
        let luma = p.rgba.iter().map(|&c| (farfield_core::color::luma(c) + 0.5) as u8).collect();
        GrayImage::from_raw(p.size[0], p.size[1], luma)
    };
    let score = gray(a).zip(gray(b)).and_then(|(x, y)| {
        image_compare::gray_similarity_structure(&image_compare::Algorithm::MSSIMSimple, &x, &y).ok()
    });
    score.map_or(f64::from(u8::from(a == b)), |s| s.score)
}

/// FLIP (Andersson et al. 2020) at 67 pixels a degree: its mean, and the error of every pixel.
pub fn flip(reference: &Picture, candidate: &Picture) -> (f64, Vec<f32>) {
    let rgb = |p: &Picture| {
        let bytes = p.rgba.iter().flat_map(|c| [c[0], c[1], c[2]]).collect::<Vec<u8>>();
        flip_rs::RgbImage::new(p.size[0] as usize, p.size[1] as usize, bytes)
    };
    let map = rgb(reference).and_then(|a| flip_rs::ldr_flip(&a, &rgb(candidate)?, flip_rs::DEFAULT_PPD));
    let map = map.map(|m| m.pixels().to_vec()).unwrap_or_default();
    let sum: f64 = map.iter().map(|&e| f64::from(e)).sum();
    (sum / map.len().max(1) as f64, map)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rendered(value: impl Fn(u32, u32) -> u8, hit: impl Fn(u32, u32) -> bool) -> Rendered {
        let size = [32, 32];
        let at = |i: u32| (i % 32, i / 32);
        Rendered {
            picture: Picture {
                size,
                rgba: (0..1024).map(at).map(|(x, y)| [value(x, y); 3]).map(|[r, g, b]| [r, g, b, 255]).collect(),
            },
            surface: SurfaceImage {
                size,
                object: (0..1024).map(at).map(|(x, y)| u32::from(hit(x, y))).collect(),
                depth: (0..1024).map(at).map(|(x, y)| if hit(x, y) { 3.0 } else { f32::INFINITY }).collect(),
                ..Default::default()
            },
        }
    }
    const ALL: Metrics = Metrics { ssim: true, flip: true };

    #[test]
    fn equal_frames_are_perfect_and_enter_at_the_cap() {
        let a = rendered(|x, y| (x * 7 + y) as u8, |x, _| x < 16);
        let e = frame(&a, &a, ALL);
        assert_eq!((e.ssim, e.flip, e.hole_fraction, e.depth_off_fraction), (Some(1.0), Some(0.0), 0.0, 0.0));
        let s = summary(&[e, e], &[]);
        assert_eq!(s.equal_frames, 2);
        assert!((s.psnr_y_db.mean - 10.0 * (255.0f64 * 255.0 * 1024.0).log10()).abs() < 1e-9);
    }

    #[test]
    fn a_uniform_offset_has_the_psnr_of_the_formula() {
        let (a, b) = (rendered(|_, _| 100, |x, _| x < 8), rendered(|_, _| 110, |_, _| false));
        let e = frame(&a, &b, ALL);
        assert!((e.luminance.psnr_db() - 10.0 * (255.0f64 * 255.0 / 100.0).log10()).abs() < 1e-3);
        assert_eq!(e.luminance_on_objects.pixels, 8 * 32);
        assert_eq!((e.hole_fraction, e.depth_off_fraction), (0.25, 0.25));
        assert!(e.flip.unwrap() > 0.0 && e.ssim.unwrap() < 1.0);
    }

    #[test]
    fn changes_at_borders_are_told_apart() {
        let change = |grey_levels: f64, at_border: bool| Change { grey_levels, at_border };
        let s = summary(&[], &[change(1.0, false), change(5.0, true), change(3.0, true), change(1.0, false)]);
        assert_eq!((s.frame_pairs, s.frame_pairs_at_borders), (4, 2));
        assert_eq!(s.temporal_change_grey_levels, Some(MeanMax { mean: 2.5, max: 5.0 }));
        assert_eq!(s.temporal_change_at_borders_grey_levels, Some(MeanMax { mean: 4.0, max: 5.0 }));
        assert_eq!(summary(&[], &[]).depth_off_fraction, None, "what is not measured is not said to be perfect");
    }

    #[test]
    fn flip_and_ssim_order_a_small_and_a_large_error() {
        let a = rendered(|x, y| ((x ^ y) * 8) as u8, |_, _| true);
        let near = rendered(|x, y| ((x ^ y) * 8) as u8 ^ 1, |_, _| true);
        let far = rendered(|x, y| 255 - ((x ^ y) * 8) as u8, |_, _| true);
        let (n, f) = (frame(&a, &near, ALL), frame(&a, &far, ALL));
        assert!(n.ssim > f.ssim && n.flip < f.flip && n.luminance.psnr_db() > f.luminance.psnr_db());
    }
}
