//! `layered-depth-image`: what is far as pictures with several samples a pixel, warped to the eye.
//!
//! For walks where part of the scene, seen through a window, is more than a frame can draw: one layered depth image a window
//! replaces it at a cost that depends on pixels only. Follows Aliaga and Lastra ("Automatic image placement to provide a guaranteed
//! frame rate", 1999, section 4): nine construction images per window ([`LayeredDepthImage::construction_images`]), merged so
//! that each surface is kept once; images themselves after Shade, Gortler, He and Szeliski ("Layered depth images", 1998).
//!
//! Deviations, each said where it is made: the central image is merged before the others, so that the warp back to the centre is
//! the capture; a construction image holds all that the layered image can hold, not only the window; a sample stands on its
//! pixel's ray and an element is given to every ray that meets it; images are culled by their own frustum, not by windows,
//! since what the centre sees through one window may be seen through another by a viewer beside it.
//!
//! Beyond the paper, a visibility metric may say when fewer than nine pictures are enough ([`LayeredDepthImage::enough`]).
//!
//! A window costs one picture a construction image, O(pixels * samples a pixel) to merge, and beside the result the memory of one
//! picture and of all elements that their pictures see at a grazing angle. Stored, a sample takes about two bytes (1.1 to 2.3 on scenes of pipes). Limits: the region must not meet far
//! chunks; surfaces that no construction image sees are missing, and so are one-sided ones that the centre sees past from behind:
//! nothing is claimed; things thinner than a pixel are as broken as in a picture; at most 65,536 objects and 255 samples a pixel.

mod bake;
mod enough;
mod frame;
mod index;
mod merge;
mod places;
mod view;

use farfield_core::Fault;
use farfield_core::cell::Cell;
use farfield_core::context::Context;
use farfield_core::id::AssetId;
use farfield_core::scene::Scene;
use farfield_core::strategy::{CellJob, Covers, FarField, FarView, LeftOut, Needs, Sink, VisibilityMetric};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use index::{Index, Picture};

/// Layered depth images, one a window.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LayeredDepthImage {
    /// How many pictures are merged into one: the centre's, four half-way to the window's edges, four mirrored behind the centre.
    #[serde(default = "defaults::construction_images")]
    #[schemars(range(min = 1, max = 9))]
    pub construction_images: u32,
    /// Decides when fewer pictures are enough; without it all are taken. After each picture it judges what those so far show to viewpoints
    /// between the nine places, and while it does not pass one more is taken, nearest to the window first. For `void-surface` on eyes at
    /// many heights: `candidates = "solid"`. Takes longer to build than nine pictures; saves samples.
    #[serde(default)]
    #[schemars(with = "Value", extend("strategy" = "visibility_metric"))]
    pub enough: Option<Box<dyn VisibilityMetric>>,
    /// Pixels of the image a pixel of the window.
    #[serde(default = "defaults::density")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub density: f32,
    /// Samples of one pixel are the same surface up to this far apart in depth, more where it is seen at a slant.
    #[serde(default = "defaults::merge_px")]
    #[schemars(range(min = 0.0), extend("unit" = "footprints"))]
    pub merge_px: f32,
    /// Average the warped picture over three by three pixels.
    #[serde(default)]
    pub smooth: bool,
    /// The largest edge of an image; a window that needs more is taken with fewer pixels, which is reported. GPU backends take at most
    /// 16.7 million samples an image, and as many as one storage binding holds, 16 bytes each.
    #[serde(default = "defaults::max_px")]
    #[schemars(range(min = 16, max = 16384), extend("unit" = "px"))]
    pub max_px: u32,
}

mod defaults {
    pub(super) fn construction_images() -> u32 {
        9
    }
    pub(super) fn density() -> f32 {
        1.0
    }
    pub(super) fn merge_px() -> f32 {
        1.0
    }
    pub(super) fn max_px() -> u32 {
        2048
    }
}

impl LayeredDepthImage {
    /// Refuses settings that contradict what they mean.
    fn check(&self) -> Result<(), Fault> {
        let refuse = |what: String| Err(Fault::Refused(format!("layered-depth-image: {what}")));
        if !(1..=9).contains(&self.construction_images) {
            return refuse(format!("construction_images = {} is not 1 to 9", self.construction_images));
        }
        if self.enough.is_some() && self.construction_images == 1 {
            return refuse("`enough` has nothing to decide where construction_images = 1".into());
        }
        if !(self.density.is_finite() && self.density > 0.0) {
            return refuse(format!("density = {} is not above 0", self.density));
        }
        if !(self.merge_px.is_finite() && self.merge_px >= 0.0) {
            return refuse(format!("merge_px = {} is not a number of at least 0", self.merge_px));
        }
        if !(16..=16384).contains(&self.max_px) {
            return refuse(format!("max_px = {} is not 16 to 16384", self.max_px));
        }
        Ok(())
    }
}

/// Whether some window of the cell shows far chunks.
///
/// An error where a far chunk meets the region, or where a split has far chunks and no window.
fn has_far(cell: &Cell, scene: &Scene) -> Result<bool, Fault> {
    cell.has_far(scene, "layered-depth-image")?;
    for (i, split) in cell.splits.iter().enumerate() {
        if !split.far.is_empty() && cell.sectors.iter().all(|s| s.split.index() != i) {
            return Err(Fault::Refused(format!(
                "layered-depth-image: split {i} of cell {} has far chunks and no window to see them through",
                cell.outline.id.0
            )));
        }
    }
    let shows = |s: &farfield_core::cell::Sector| !s.seen.intersection(&cell.splits[s.split.index()].far).is_empty();
    Ok(cell.sectors.iter().any(shows))
}

#[typetag::serde(name = "layered-depth-image")]
impl FarField for LayeredDepthImage {
    fn needs(&self, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        let work = match cell {
            Some(cell) => has_far(cell, scene)?,
            None => !scene.chunks.is_empty(),
        };
        let reason = match cell {
            _ if work => None,
            Some(cell) if cell.sectors.is_empty() => Some("no images: the scene is under the budget here"),
            _ => Some("no images: no window shows anything far"),
        };
        let left_out = |reason: &str| LeftOut {
            stage: "layered depth images".into(),
            reason: reason.into(),
            decided: "plan".into(),
        };
        Ok(Needs {
            scene_asset: false,
            cell_asset: work,
            captures: work,
            neighbour_cells: false,
            covers: Covers::Far,
            left_out: reason.map(left_out).into_iter().collect(),
        })
    }

    fn bake_cell(&self, job: &CellJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        if !has_far(job.cell, job.scene)? {
            return Ok(vec![]);
        }
        bake::bake(self, job, out, cx)?.encode()
    }

    fn open(&self, _shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        let index = Index::decode(&format!("index of asset {}", cell.0.0), cell.1)?;
        Ok(Box::new(view::Warped { asset: cell.0, index }))
    }
}
