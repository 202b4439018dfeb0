//! Temporal change: how much a candidate's *error* changes from one frame to the next, grey levels. Popping, where representations are
//! exchanged; flicker elsewhere.
//!
//! With C the candidate's and R the reference's luminance,
//!
//! ```text
//! E_i = C_i - R_i,   change = mean over pixels of |E_i - E_(i-1)| = mean |(C_i - C_(i-1)) - (R_i - R_(i-1))|
//! ```
//!
//! What moves in the reference too cancels, so that it is 0 for a candidate that equals the reference, however fast the viewer is. An error
//! that stays on its surface moves over the picture with it and counts: changes over a border between cells are therefore reported beside
//! those within cells, and only their difference is the border's. O(pixels).

use farfield_core::color::luma;
use farfield_core::id::CellId;
use farfield_core::image::Picture;

/// The error of each pixel's luminance: candidate minus reference, grey levels.
///
/// # Panics
/// When the two differ in size.
pub fn error_luma(reference: &Picture, candidate: &Picture) -> Vec<f32> {
    assert_eq!(reference.size, candidate.size, "frames of different size are compared");
    reference.rgba.iter().zip(&candidate.rgba).map(|(&r, &c)| luma(c) - luma(r)).collect()
}

/// The change between two frames' errors, grey levels.
pub fn temporal_change(before: &[f32], after: &[f32]) -> f64 {
    let sum: f64 = before.iter().zip(after).map(|(a, b)| f64::from((b - a).abs())).sum();
    sum / after.len().max(1) as f64
}

/// The change between two frames that follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Grey levels, mean over the pixels.
    pub grey_levels: f64,
    /// The two frames are served by different cells, or one of them by none.
    pub at_border: bool,
}

/// Which frames of a walk are read back.
#[derive(Clone, Debug)]
pub struct Reads {
    every: usize,
    /// Whether frame i is compared with the one before it.
    pairs: Vec<bool>,
}

impl Reads {
    /// Of a walk through these cells: every n-th frame is measured; with `temporal` those before measured frames and on both sides of
    /// a border are read too, else pairs are made of what is read anyway.
    pub fn new(every: usize, temporal: bool, path: &[Option<CellId>]) -> Self {
        let measured = |i: usize| i.is_multiple_of(every);
        let pair = |i: usize| {
            let border = || path[i] != path[i - 1];
            i > 0 && (measured(i) && measured(i - 1) || temporal && (measured(i) || border()))
        };
        Self { every, pairs: (0..path.len()).map(pair).collect() }
    }

    /// All metrics are taken.
    pub fn measured(&self, frame: usize) -> bool {
        frame.is_multiple_of(self.every)
    }

    /// The frame is compared with the one before it.
    pub fn pair(&self, frame: usize) -> bool {
        self.pairs.get(frame).copied().unwrap_or(false)
    }

    /// The frame is needed for one or the other.
    pub fn read(&self, frame: usize) -> bool {
        self.measured(frame) || self.pair(frame) || self.pair(frame + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: &[u8]) -> Picture {
        Picture { size: [values.len() as u32, 1], rgba: values.iter().map(|&v| [v, v, v, 255]).collect() }
    }

    #[test]
    fn what_changes_in_the_reference_too_does_not_count() {
        let (r0, r1) = (grey(&[10, 20, 30, 40]), grey(&[90, 80, 70, 60]));
        let change = |c0: &[u8], c1: &[u8]| temporal_change(&error_luma(&r0, &grey(c0)), &error_luma(&r1, &grey(c1)));
        // Equal frames, and an error that stays as it is.
        assert!(change(&[10, 20, 30, 40], &[90, 80, 70, 60]) < 1e-5);
        assert!(change(&[15, 20, 30, 40], &[95, 80, 70, 60]) < 1e-5);
        // One of four pixels is off by 5, then by -3; another pops up by 12.
        assert!((change(&[15, 20, 30, 40], &[87, 80, 70, 72]) - (8.0 + 12.0) / 4.0).abs() < 1e-5);
    }

    #[test]
    fn measured_frames_have_their_predecessors_and_borders_both_sides() {
        let c = |k: u32| Some(CellId(k));
        let path = [c(0), c(0), c(0), c(0), c(0), c(0), c(1), c(1), c(1), None, None, None];
        let of = |reads: &Reads, f: fn(&Reads, usize) -> bool| (0..12).filter(|&i| f(reads, i)).collect::<Vec<_>>();
        let all = Reads::new(4, true, &path);
        assert_eq!(of(&all, Reads::pair), [4, 6, 8, 9]);
        assert_eq!(of(&all, Reads::read), [0, 3, 4, 5, 6, 7, 8, 9]);
        assert_eq!(of(&all, Reads::measured), [0, 4, 8]);
        let few = Reads::new(4, false, &path);
        assert_eq!((of(&few, Reads::pair), of(&few, Reads::read)), (vec![], vec![0, 4, 8]));
        let each = Reads::new(1, false, &path);
        assert_eq!(of(&each, Reads::pair), (1..12).collect::<Vec<_>>());
    }
}
