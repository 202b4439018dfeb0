//! Costs at equal image quality: each pipeline beside the curves of the others, interpolated at its own quality.
//!
//! A single pair of pipelines says little where one is better and dearer than the other. A sweep makes a pipeline into a curve, quality
//! against cost, and a curve can be read at the quality that another pipeline reached.

use crate::results::PipelineSummary;

/// A pipeline's cost over that of a curve at the same quality. Over 1: the pipeline is dearer.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ratio {
    /// The pipeline.
    pub name: String,
    /// The swept pipeline that it is compared with.
    pub curve: String,
    /// The quality that both have: mean PSNR on luminance, decibels.
    pub psnr_y_db: f64,
    /// Triangles a frame, time a frame, bytes stored. `None` where one of the two has none.
    pub cost: [Option<f64>; 3],
}

/// What [`Ratio::cost`] holds.
pub(super) const COSTS: [&str; 3] = ["triangles", "frame time", "bytes stored"];

/// Quality, decibels, and costs of the pipelines that a sweep made of one.
type Curve = Vec<(f64, [f64; 3])>;

/// Every pipeline beside every curve of others that spans its quality, in the order of the pipelines.
pub(super) fn ratios<'a>(pipelines: impl IntoIterator<Item = &'a PipelineSummary>) -> Vec<Ratio> {
    let points: Vec<_> = pipelines.into_iter().filter_map(point).collect();
    let mut curves: Vec<(&str, Curve)> = vec![];
    for (name, psnr, cost) in &points {
        match curves.iter_mut().find(|c| c.0 == curve(name)) {
            Some(c) => c.1.push((*psnr, *cost)),
            None => curves.push((curve(name), vec![(*psnr, *cost)])),
        }
    }
    curves.iter_mut().for_each(|c| c.1.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let mut out = vec![];
    for (name, psnr, cost) in &points {
        for (other, line) in curves.iter().filter(|c| c.0 != curve(name)) {
            let Some(theirs) = at(line, *psnr) else { continue };
            let over = |k: usize| (cost[k] > 0.0 && theirs[k] > 0.0).then(|| cost[k] / theirs[k]);
            out.push(Ratio {
                name: (*name).into(),
                curve: (*other).into(),
                psnr_y_db: *psnr,
                cost: [0, 1, 2].map(over),
            });
        }
    }
    out
}

/// Its quality and its costs; none for the reference and for what equals it in every frame, whose quality has no bound.
fn point(p: &PipelineSummary) -> Option<(&str, f64, [f64; 3])> {
    let e = p.error.as_ref().filter(|e| e.equal_frames < e.frames)?;
    Some((&p.name, e.psnr_y_db.mean, [p.triangles.total.mean, p.frame_ms.mean, p.preprocess.bytes_stored as f64]))
}

/// The name of the pipeline that a sweep was made of: without the settings that the sweep put behind it.
fn curve(name: &str) -> &str {
    let mut name = name;
    while let Some((before, last)) = name.rsplit_once(' ')
        && last.contains('=')
    {
        name = before;
    }
    name
}

/// The costs on a curve, sorted by quality, at a quality: their logarithms are interpolated linearly over decibels. None beyond its ends.
fn at(line: &[(f64, [f64; 3])], psnr: f64) -> Option<[f64; 3]> {
    let (a, b) = line.windows(2).map(|w| (w[0], w[1])).find(|(a, b)| a.0 <= psnr && psnr <= b.0)?;
    let t = if b.0 > a.0 { (psnr - a.0) / (b.0 - a.0) } else { 0.5 };
    Some([0, 1, 2].map(|k| ((1.0 - t) * a.1[k].ln() + t * b.1[k].ln()).exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_is_known_by_what_it_put_behind_the_name() {
        assert_eq!(curve("levels of detail max_px=4 seed=1"), "levels of detail");
        assert_eq!(curve("one word"), "one word");
    }

    #[test]
    fn costs_lie_between_the_neighbours_and_nothing_is_said_beyond_the_ends() {
        let line = [(20.0, [100.0, 1.0, 0.0]), (30.0, [400.0, 4.0, 5.0])];
        let [triangles, ms, bytes] = at(&line, 25.0).unwrap();
        assert!((triangles - 200.0).abs() < 1e-9 && (ms - 2.0).abs() < 1e-12 && bytes == 0.0);
        assert!(at(&line, 19.9).is_none() && at(&line, 30.1).is_none() && at(&line[..1], 20.0).is_none());
    }
}
