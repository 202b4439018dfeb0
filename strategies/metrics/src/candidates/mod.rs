//! Candidate viewpoints: places of a region as far as can be from the samples that were taken.
//!
//! Follows Wilson and Manocha 2003, section 3.5.1: what a viewpoint cannot reconstruct tends to grow with its distance from the
//! samples, so that the candidates for the next sample are the vertices of the samples' Voronoi diagram inside the region and the
//! crossings of its edges with the region's border. [`planar`] is that; [`solid`] is the same in three dimensions, beyond the
//! paper.
//!
//! A deviation: the paper begins with samples in all corners of the region. Where there is none in a corner, the corner is a
//! candidate when it is farther from its nearest sample than everything around it. So the farthest point of the region is always
//! among the candidates: within a Voronoi cell the distance is convex, and the greatest value of a convex function over a convex
//! polygon or polyhedron stands at one of its vertices, which are the points above.
//!
//! Everything is computed around the region's middle in units of its size, so that neither scale nor place matter. Points closer
//! than [`MERGED`] of that size are one. Candidates come sorted by their coordinates, whatever the order of the samples.

mod planar;
mod solid;
#[cfg(test)]
mod tests;

pub use planar::planar;
pub use solid::{HalfSpace, half_spaces, solid};

/// Points closer than this share of the region's size are one: far above the rounding of 64-bit circumcentres, far below what a
/// sample could gain.
pub const MERGED: f64 = 1e-6;

/// How far, in units of the region, a point may lie outside it or nearer to a foreign sample and still count.
const SLACK: f64 = 1e-9;

/// The frame in which a region lies around 0 with size 1.
#[derive(Clone, Copy)]
struct Frame<const N: usize> {
    middle: [f64; N],
    size: f64,
}

impl<const N: usize> Frame<N> {
    /// Around points; `None` without any, or where they are not finite.
    fn around(points: &[[f64; N]]) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; N], [f64::NEG_INFINITY; N]);
        for p in points {
            for k in 0..N {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        let extent = (0..N).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let finite = points.iter().flatten().all(|x| x.is_finite()) && !points.is_empty() && extent.is_finite();
        let size = if extent > 0.0 { extent } else { 1.0 };
        finite.then(|| Self { middle: std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]), size })
    }

    fn into(self, p: [f64; N]) -> [f64; N] {
        // spade refuses numbers too small to be multiplied; nothing that small means anything here.
        let to = |x: f64| if x.abs() < 1e-30 { 0.0 } else { x };
        std::array::from_fn(|k| to((p[k] - self.middle[k]) / self.size))
    }

    fn back(self, p: [f64; N]) -> [f64; N] {
        std::array::from_fn(|k| self.middle[k] + p[k] * self.size)
    }

    /// The samples in this frame: finite ones, coincident ones once.
    fn samples(self, all: impl IntoIterator<Item = [f64; N]>) -> Vec<[f64; N]> {
        let mut out = vec![];
        // Beyond a million sizes a sample is no viewpoint of the region, and its square no good number.
        let sane = |p: &[f64; N]| p.iter().all(|x| x.abs() < 1e6);
        all.into_iter().map(|p| self.into(p)).filter(sane).for_each(|p| push_new(&mut out, p));
        out
    }
}

fn distance2<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (0..N).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

/// The squared distance to the nearest sample; infinite without any.
fn nearest2<const N: usize>(p: [f64; N], samples: &[[f64; N]]) -> f64 {
    samples.iter().map(|&s| distance2(p, s)).fold(f64::INFINITY, f64::min)
}

/// Adds a point unless it is there.
fn push_new<const N: usize>(out: &mut Vec<[f64; N]>, p: [f64; N]) {
    if out.iter().all(|&o| distance2(o, p) > MERGED * MERGED) {
        out.push(p);
    }
}

/// Whether no sample lies nearer to `p` than `r2`, the squared distance of those that it belongs to.
fn empty_ball<const N: usize>(p: [f64; N], r2: f64, samples: &[[f64; N]]) -> bool {
    let least = r2 - SLACK * (1.0 + r2);
    samples.iter().all(|&s| distance2(p, s) >= least)
}

/// Leaves out candidates that are samples and sorts the others.
fn finish<const N: usize>(frame: Frame<N>, found: Vec<[f64; N]>, samples: &[[f64; N]]) -> Vec<[f64; N]> {
    let mut out: Vec<[f64; N]> = vec![];
    let fresh = found.into_iter().filter(|&p| nearest2(p, samples) > MERGED * MERGED);
    fresh.for_each(|p| push_new(&mut out, p));
    out.sort_by(|a, b| {
        a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    });
    out.into_iter().map(|p| frame.back(p)).collect()
}
