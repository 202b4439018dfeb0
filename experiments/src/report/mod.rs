//! `report.html`: one self-contained page with error against run time as a plot, tables, audits, what was left out, and
//! pictures beside the reference with their differences. Also the joined report of several runs.

mod equal;
mod html;
mod plot;

use std::io;
use std::path::Path;

use farfield_core::image::Picture;

use crate::results::{FrameRow, Summary};

/// One picture for the report.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The pipeline.
    pub pipeline: String,
    /// The frame's number.
    pub frame: usize,
    /// Why it is shown: `first frame`, `worst frame`, ...
    pub caption: String,
    /// What it should look like.
    pub reference: Picture,
    /// What it looks like.
    pub candidate: Picture,
}

/// Writes `report.html`, `summary.json` and `frames.csv` into `dir`, which exists.
///
/// # Errors
/// What writing gives.
pub fn write(dir: &Path, summary: &Summary, frames: &[FrameRow], gallery: &[Shown]) -> io::Result<()> {
    let mut json = serde_json::to_string_pretty(summary)?;
    json.push('\n');
    std::fs::write(dir.join("summary.json"), json)?;
    let mut csv = csv::Writer::from_path(dir.join("frames.csv"))?;
    frames.iter().try_for_each(|f| csv.serialize(f))?;
    csv.flush()?;
    std::fs::write(dir.join("report.html"), html::run(summary, frames, gallery)?)
}

/// Writes the joined report of several runs, each with the name to show it under, and returns their common table as text.
///
/// # Errors
/// What writing gives.
pub fn compare(file: &Path, runs: &[(String, Summary)]) -> io::Result<String> {
    std::fs::write(file, html::compare(runs)?)?;
    Ok(table(runs))
}

/// A table of pipelines as text, for terminals.
pub fn table(runs: &[(String, Summary)]) -> String {
    let with_lines = have_lines(runs.iter().map(|r| &r.1));
    let mut rows = vec![columns(with_lines).into_iter().map(str::to_owned).collect()];
    for (run, s) in runs {
        let name = |p: &str| if runs.len() > 1 { format!("{run}: {p}") } else { p.to_owned() };
        rows.extend(s.pipelines.iter().map(|p| html::row(&name(&p.name), p, with_lines)));
    }
    let width = |c: usize| rows.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let line = |r: &Vec<String>| {
        let cells = r.iter().zip(&widths).enumerate();
        cells
            .map(|(i, (c, &w))| if i == 0 { format!("{c:<w$}") } else { format!("{c:>w$}") })
            .collect::<Vec<_>>()
            .join("  ")
    };
    rows.iter().map(|r| line(r).trim_end().to_owned() + "\n").collect()
}

/// Whether any pipeline drew lines; where none did, tables have no column of them.
fn have_lines<'a>(runs: impl IntoIterator<Item = &'a Summary>) -> bool {
    runs.into_iter().flat_map(|s| &s.pipelines).any(|p| p.lines.max > 0.0)
}

/// The columns that are shown.
fn columns(with_lines: bool) -> Vec<&'static str> {
    COLUMNS.into_iter().filter(|&c| with_lines || c != LINES).collect()
}

/// The column that is shown only where there are any.
const LINES: &str = "lines";

/// The columns of [`table`] and of the report's first table.
const COLUMNS: [&str; 19] = [
    "pipeline",
    "frame ms",
    "p95 ms",
    "x floor",
    "triangles",
    "near",
    "far",
    "points",
    LINES,
    "PSNR-Y dB",
    "pooled dB",
    "objects dB",
    "SSIM",
    "FLIP",
    "holes %",
    "depth off %",
    "change",
    "at borders",
    "built MB",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::*;
    use farfield_core::backend::DeviceInfo;
    use farfield_core::strategy::Level;

    fn summary() -> Summary {
        let pipeline = |name: &str, ms: f64, psnr: Option<f64>| PipelineSummary {
            name: name.into(),
            strategies: serde_json::json!({"far_field": {"type": "geometry"}}),
            device: DeviceInfo { backend: "cpu".into(), device: "test".into(), degraded: vec![] },
            preprocess: Preprocess::default(),
            frame_ms: Times::of(&[ms]),
            floor_ms: 2.0,
            frame_ms_source: "wall clock".into(),
            triangles: TriangleCounts::default(),
            points: MeanMax::default(),
            lines: MeanMax::default(),
            texture_bytes: 0,
            resident_bytes: 0,
            memory: MemoryUse::default(),
            far_error_px: MeanMax::default(),
            frames_outside_cells: 0,
            original_over_simplified: 0.0,
            error: psnr.map(|d| ErrorSummary {
                frames: 1,
                psnr_y_db: MeanMin { mean: d, min: d },
                ..Default::default()
            }),
            bounds: vec![],
            left_out: vec![],
            levels: vec![Level { level: 0, nodes: 3, triangles: Some(1234), points: Some(0) }],
        };
        Summary {
            schema: SCHEMA,
            device: Machine { cores: 2, system: "test".into() },
            scene: SceneFacts {
                source: "a <scene>".into(),
                triangles: 1,
                objects: 1,
                chunks: 1,
                frames: 1,
                resolution_px: [2, 1],
            },
            reference: "all".into(),
            equal_frames_note: crate::measure::EQUAL_FRAMES_NOTE.into(),
            peak_rss_bytes: 0,
            pipelines: vec![pipeline("all", 20.0, None), pipeline("hybrid", 2.5, Some(39.25))],
        }
    }

    #[test]
    fn a_run_is_written_whole_and_escaped() {
        let dir = tempfile::tempdir().unwrap();
        let picture = Picture { size: [2, 1], rgba: vec![[1, 2, 3, 255], [4, 5, 6, 255]] };
        let shown = Shown {
            pipeline: "hybrid".into(),
            frame: 0,
            caption: "first frame".into(),
            reference: picture.clone(),
            candidate: picture,
        };
        let rows = [FrameRow { pipeline: "hybrid".into(), psnr_y_db: Some(39.25), ..Default::default() }];
        write(dir.path(), &summary(), &rows, &[shown]).unwrap();
        let html = std::fs::read_to_string(dir.path().join("report.html")).unwrap();
        assert!(html.contains("a &lt;scene&gt;") && html.contains("39.25") && html.contains("<svg"));
        assert!(html.contains("<h2>Levels of detail</h2>") && html.contains("<td>1234</td><td>411</td>"));
        assert!(html.contains("data:image/png;base64,") && !html.contains("http://localhost"));
        let back: Summary =
            serde_json::from_str(&std::fs::read_to_string(dir.path().join("summary.json")).unwrap()).unwrap();
        assert_eq!(back, summary());
        assert!(std::fs::read_to_string(dir.path().join("frames.csv")).unwrap().contains("39.25"));
    }

    #[test]
    fn several_runs_are_joined_under_their_names() {
        let text = table(&[("a".into(), summary()), ("b".into(), summary())]);
        assert_eq!(text.lines().count(), 5);
        assert!(text.contains("a: hybrid") && text.contains("b: all"));
    }
}
