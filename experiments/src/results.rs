//! What a run leaves behind, as data: `summary.json` and `frames.csv`. Every number has its unit in its name.

use farfield_core::backend::DeviceInfo;
use farfield_core::claim::Quantity;
use farfield_core::strategy::{LeftOut, Level};
use serde::{Deserialize, Serialize};

/// The version of [`Summary`]'s layout.
pub const SCHEMA: u32 = 1;

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The machine: processor cores and operating system.
    pub device: Machine,
    /// What was rendered.
    pub scene: SceneFacts,
    /// The pipeline that pictures were compared with.
    pub reference: String,
    /// How frames equal to the reference enter a mean of PSNRs.
    pub equal_frames_note: String,
    /// The process's peak resident set until the walks' end, bytes; 0 where the system does not tell.
    #[serde(default)]
    pub peak_rss_bytes: u64,
    /// One a pipeline, in the order of the experiment file.
    pub pipelines: Vec<PipelineSummary>,
}

/// The machine that a run was made on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Processor cores that the run could use.
    pub cores: usize,
    /// Operating system and processor architecture.
    pub system: String,
}

/// The scene in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// Where it came from.
    pub source: String,
    /// Triangles over all objects.
    pub triangles: u64,
    /// Placed meshes.
    pub objects: usize,
    /// Placed chunks.
    pub chunks: usize,
    /// Frames of the path.
    pub frames: usize,
    /// Width and height of a frame, pixels.
    pub resolution_px: [u32; 2],
}

/// One pipeline's results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PipelineSummary {
    /// Its name in the experiment file.
    pub name: String,
    /// Its strategies with resolved settings.
    pub strategies: serde_json::Value,
    /// What drew it.
    pub device: DeviceInfo,
    /// What building it cost.
    pub preprocess: Preprocess,
    /// Time to render a frame, milliseconds; reading back not included.
    pub frame_ms: Times,
    /// The floor on the same device in the same run, median, milliseconds: one quadrilateral that textures every pixel by
    /// projection.
    pub floor_ms: f64,
    /// What `frame_ms` was measured by: `gpu timestamps` or `wall clock`.
    pub frame_ms_source: String,
    /// Triangles a frame.
    pub triangles: TriangleCounts,
    /// Points a frame: samples of layered depth images, and points of payloads.
    pub points: MeanMax,
    /// Lines a frame, of payloads; 0 in files of before there were any.
    #[serde(default)]
    pub lines: MeanMax,
    /// Texels resident, bytes, at most.
    pub texture_bytes: u64,
    /// Payload and geometry blocks resident, bytes, at most.
    pub resident_bytes: u64,
    /// What was held at most, under which limit, and what could not be had.
    #[serde(default)]
    pub memory: MemoryUse,
    /// The largest error that the far field states of what a frame draws, pixels.
    #[serde(default)]
    pub far_error_px: MeanMax,
    /// Frames whose eye was in no cell: plain geometry was drawn.
    pub frames_outside_cells: usize,
    /// Original triangles over triangles drawn in a cell, near and far together, not culled to the frustum; mean over the
    /// frames' cells. The papers' "simplified : original" is 1 over this. 0 where nothing is simplified, or where what is far depends on
    /// the view's direction.
    pub original_over_simplified: f64,
    /// Error over the measured frames; `None` for the reference itself.
    pub error: Option<ErrorSummary>,
    /// Claims against measurements.
    pub bounds: Vec<BoundAudit>,
    /// What was left out.
    pub left_out: Vec<LeftOut>,
    /// Levels of detail, where there is a hierarchy of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<Level>,
}

/// What a walk held of blocks, original chunks and payloads alike, and what it could not have. Audits, which come after it and draw
/// everything, are not counted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MemoryUse {
    /// `[budget] memory_bytes`; none for the reference.
    pub limit_bytes: Option<u64>,
    /// The most at any moment, bytes: blocks on the device, blocks read and waiting with the place kept for them, a block being read, a block
    /// being uploaded.
    pub peak_bytes: u64,
    /// What the smallest of all blocks takes while it is loaded, bytes: under a limit below that nothing is drawn.
    pub smallest_block_bytes: u64,
    /// What the largest takes: under a limit below that it never comes.
    pub largest_block_bytes: u64,
    /// Blocks that never fit the limit.
    pub blocks_too_large: u64,
    /// Reads that failed; each block is tried three times.
    pub failed_reads: u64,
    /// Blocks that were given up.
    pub blocks_given_up: u64,
    /// All that in words, with files and blocks; at most a hundred lines.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub troubles: Vec<String>,
}

/// What building cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Preprocess {
    /// Time of this run's building, seconds: 0 where all was in the store. On demand: the sum over the walk.
    pub seconds: f64,
    /// Cells built in this run.
    pub cells_built: usize,
    /// Cells that the path needs.
    pub cells_needed: usize,
    /// Cells of the partition.
    pub cells_total: usize,
    /// Bytes in the store for the cells needed.
    pub bytes_stored: u64,
    /// The process's peak resident set until the build's end, bytes.
    pub peak_rss_bytes: u64,
}

/// A distribution of times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Arithmetic mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// Mean and largest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeanMax {
    /// Arithmetic mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// Mean and smallest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeanMin {
    /// Arithmetic mean.
    pub mean: f64,
    /// Smallest.
    pub min: f64,
}

/// Triangles a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleCounts {
    /// Original geometry.
    pub near: MeanMax,
    /// Payloads.
    pub far: MeanMax,
    /// Shadow passes.
    pub shadow: MeanMax,
    /// All.
    pub total: MeanMax,
}

/// Image error over the measured frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorSummary {
    /// Frames measured.
    pub frames: usize,
    /// Of these, frames equal to the reference in every pixel's luminance.
    pub equal_frames: usize,
    /// PSNR on luminance over the whole frame, decibels.
    pub psnr_y_db: MeanMin,
    /// PSNR of the mean squared error pooled over all frames, decibels.
    pub psnr_y_pooled_db: f64,
    /// PSNR on luminance over pixels where the reference or the candidate shows an object, decibels.
    pub psnr_y_object_db: MeanMin,
    /// Structural similarity on luminance, 8 x 8 windows.
    pub ssim: Option<MeanMin>,
    /// FLIP, mean over a frame's pixels.
    pub flip: Option<MeanMax>,
    /// Pixels where the reference shows an object and the candidate the background, over all pixels.
    pub hole_fraction: MeanMax,
    /// Pixels whose depth differs from the reference's by more than 1 %, or where only one of the two shows a surface, over all
    /// pixels.
    #[serde(default)]
    pub depth_off_fraction: Option<MeanMax>,
    /// Distances between the surfaces that the candidate and the reference show, where `[measure] surface_distance` asks for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface_distance: Option<SurfaceDistance>,
    /// Pairs of frames that follow each other over which change was measured.
    #[serde(default)]
    pub frame_pairs: usize,
    /// Change of the error from frame to frame, over these pairs: mean over pixels of |E_i - E_(i-1)|, E = the candidate's luminance
    /// less the reference's, grey levels.
    #[serde(default)]
    pub temporal_change_grey_levels: Option<MeanMax>,
    /// Of the pairs, those whose two frames are served by different cells.
    #[serde(default)]
    pub frame_pairs_at_borders: usize,
    /// The same over those.
    #[serde(default)]
    pub temporal_change_at_borders_grey_levels: Option<MeanMax>,
}

/// How far what the candidate shows lies from the original surface, and the other way round, over the measured frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceDistance {
    /// The largest, pixels.
    pub max_px: f64,
    /// The largest 99.9th percentile of a frame, pixels.
    pub p999_px: f64,
    /// Pixels beyond what the far field claims; 0 where it claims nothing.
    pub pixels_beyond: u64,
    /// Pixels looked at, of both pictures.
    pub pixels: u64,
}

/// A claim against what was measured. Measuring samples: it can refute, not prove.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundAudit {
    /// Who claims.
    pub claimant: String,
    /// Of what.
    pub quantity: Quantity,
    /// The largest bound claimed.
    pub predicted_max: f64,
    /// The largest value measured.
    pub measured_max: f64,
    /// The 99th percentile of the values measured.
    pub measured_p99: f64,
    /// Values measured.
    pub samples: usize,
    /// Values above their own bound.
    pub violations: usize,
    /// What the measurement means and what explains its violations.
    pub note: String,
}

/// One frame of one pipeline: a row of `frames.csv`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameRow {
    /// The pipeline.
    pub pipeline: String,
    /// The frame's number on the path.
    pub frame: usize,
    /// The cell that served it; empty outside all cells.
    pub cell: Option<u32>,
    /// Render time, milliseconds.
    pub frame_ms: f64,
    /// Original triangles.
    pub near_triangles: u64,
    /// Payload triangles.
    pub far_triangles: u64,
    /// Samples of layered depth images, and points of payloads.
    pub points: u64,
    /// Lines of payloads.
    pub lines: u64,
    /// Far blocks that were not resident.
    pub missing_blocks: u32,
    /// The error that its far field believes in, pixels.
    pub far_error_px: f32,
    /// Reads of blocks that failed.
    pub failed_reads: u64,
    /// Bytes of blocks that the scheduler had uploaded for it.
    pub uploaded_bytes: u64,
    /// Texels resident, bytes.
    pub texture_bytes: u64,
    /// Whole-frame PSNR, decibels; empty where the frame was not measured.
    pub psnr_y_db: Option<f64>,
    /// Object-pixel PSNR, decibels.
    pub psnr_y_object_db: Option<f64>,
    /// Structural similarity.
    pub ssim: Option<f64>,
    /// Mean FLIP.
    pub flip: Option<f64>,
    /// Hole pixels over all pixels.
    pub hole_fraction: Option<f64>,
    /// Pixels whose depth is off, over all pixels.
    pub depth_off_fraction: Option<f64>,
    /// The largest distance between the surfaces that the frame and the reference show, pixels.
    pub surface_distance_max_px: Option<f64>,
    /// Change of the error since the frame before, grey levels; empty where one of the two was not read.
    pub temporal_change_grey_levels: Option<f64>,
}

impl Times {
    /// The distribution of `values`; zeros where there are none.
    pub fn of(values: &[f64]) -> Self {
        let mut v = values.to_vec();
        v.sort_by(f64::total_cmp);
        Self {
            mean: mean(&v),
            p50: percentile(&v, 0.5),
            p95: percentile(&v, 0.95),
            p99: percentile(&v, 0.99),
            max: v.last().copied().unwrap_or(0.0),
        }
    }
}

impl MeanMax {
    /// Mean and largest of `values`; zeros where there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let v: Vec<f64> = values.into_iter().collect();
        Self { mean: mean(&v), max: v.iter().copied().fold(0.0, f64::max) }
    }
}

impl MeanMin {
    /// Mean and smallest of `values`; zeros where there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let v: Vec<f64> = values.into_iter().collect();
        let min = v.iter().copied().fold(f64::INFINITY, f64::min);
        Self { mean: mean(&v), min: if min.is_finite() { min } else { 0.0 } }
    }
}

fn mean(v: &[f64]) -> f64 {
    if v.is_empty() { 0.0 } else { v.iter().sum::<f64>() / v.len() as f64 }
}

/// Nearest-rank percentile of sorted values; 0 where there are none.
pub fn percentile(sorted: &[f64], p: f64) -> f64 {
    let rank = (p * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distributions_are_nearest_rank() {
        let t = Times::of(&(1..=100).map(f64::from).collect::<Vec<_>>());
        assert_eq!((t.p50, t.p95, t.p99, t.max, t.mean), (50.0, 95.0, 99.0, 100.0, 50.5));
        assert_eq!(Times::of(&[]), Times::default());
        assert_eq!(MeanMin::of([3.0, 1.0, 2.0]), MeanMin { mean: 2.0, min: 1.0 });
    }
}
