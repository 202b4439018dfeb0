//! Which frames a report shows: a few along the path, and each pipeline's worst.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use farfield_core::image::Picture;

use crate::images::write_png;
use crate::measure::FrameErrors;
use crate::report::Shown;
use crate::walk::References;

/// Chooses frames while a path is walked, without knowing how long it is.
pub struct Gallery {
    pictures: usize,
    chosen: BTreeMap<String, Chosen>,
    worst: BTreeMap<String, (f64, usize, Picture)>,
    order: Vec<String>,
}

/// One pipeline's frames along the path; the stride doubles when there are too many.
struct Chosen {
    stride: usize,
    /// Which of the measured frames, the frame's number, its picture.
    kept: Vec<(usize, usize, Picture)>,
}

impl Gallery {
    /// For `pictures` frames a pipeline beside its worst.
    pub fn new(pictures: usize) -> Self {
        Self { pictures, chosen: BTreeMap::new(), worst: BTreeMap::new(), order: vec![] }
    }

    /// Looks at a measured frame, the `nth` of its pipeline; keeps it if it is to be shown as things stand.
    pub fn consider(&mut self, pipeline: &str, frame: usize, nth: usize, errors: &FrameErrors, picture: Picture) {
        if !self.order.iter().any(|p| p == pipeline) {
            self.order.push(pipeline.to_owned());
        }
        let db = errors.luminance.psnr_db();
        if self.worst.get(pipeline).is_none_or(|w| db < w.0) {
            self.worst.insert(pipeline.to_owned(), (db, frame, picture.clone()));
        }
        let chosen = self.chosen.entry(pipeline.to_owned()).or_insert(Chosen { stride: 1, kept: vec![] });
        if self.pictures == 0 || !nth.is_multiple_of(chosen.stride) {
            return;
        }
        chosen.kept.push((nth, frame, picture));
        if chosen.kept.len() > self.pictures {
            chosen.stride *= 2;
            chosen.kept.retain(|k| k.0.is_multiple_of(chosen.stride));
        }
    }

    /// The pictures with their references, also written into `folder` as PNG.
    ///
    /// # Errors
    /// What reading the references and writing gives.
    pub fn finish(self, references: &References, folder: &Path) -> io::Result<Vec<Shown>> {
        let mut out: Vec<Shown> = vec![];
        for name in &self.order {
            let along =
                self.chosen.get(name).into_iter().flat_map(|c| &c.kept).map(|(_, f, p)| (*f, "along the path", p));
            let worst = self.worst.get(name).map(|(_, f, p)| (*f, "worst frame", p));
            for (frame, caption, picture) in along.chain(worst) {
                if out.iter().any(|s| s.pipeline == *name && s.frame == frame) {
                    continue;
                }
                let reference = references.get(frame)?.picture;
                write_png(&folder.join(format!("{}-{frame:05}.png", slug(name))), picture)?;
                write_png(&folder.join(format!("reference-{frame:05}.png")), &reference)?;
                let (pipeline, caption) = (name.clone(), caption.to_owned());
                out.push(Shown { pipeline, frame, caption, reference, candidate: picture.clone() });
            }
        }
        Ok(out)
    }
}

/// A pipeline's name as part of a file's name.
pub fn slug(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.=".contains(c) { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{Metrics, Rendered, frame};

    #[test]
    fn a_few_frames_along_the_path_and_the_worst_are_kept() {
        let picture = |v: u8| Picture { size: [4, 4], rgba: vec![[v, v, v, 255]; 16] };
        let surface = farfield_core::image::SurfaceImage {
            size: [4, 4],
            object: vec![1; 16],
            depth: vec![2.0; 16],
            ..Default::default()
        };
        let rendered = |v: u8| Rendered { picture: picture(v), surface: surface.clone() };
        let references = References::new([4, 4]).unwrap();
        let mut g = Gallery::new(2);
        for i in 0..20usize {
            references.keep(4 * i, &rendered(100)).unwrap();
            let candidate = rendered(if i == 13 { 160 } else { 101 });
            let e = frame(&references.get(4 * i).unwrap(), &candidate, Metrics { ssim: false, flip: false });
            g.consider("a b", 4 * i, i, &e, candidate.picture);
        }
        let dir = tempfile::tempdir().unwrap();
        let shown = g.finish(&references, dir.path()).unwrap();
        let frames: Vec<usize> = shown.iter().map(|s| s.frame).collect();
        assert_eq!(frames, [0, 64, 52]);
        assert_eq!(shown[2].caption, "worst frame");
        assert_eq!((&shown[2].reference, &shown[2].candidate), (&picture(100), &picture(160)));
        assert!(dir.path().join("a-b-00052.png").is_file() && dir.path().join("reference-00052.png").is_file());
    }
}
