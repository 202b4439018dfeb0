//! Depth meshes of panoramic samples: `incremental-tdm` and its plain predecessor `textured-depth-mesh`.
//!
//! For walks where what lies around a region is large and complex, and visibility changes slowly within the region: what is far is
//! sampled from a few of its viewpoints, and the samples' depth becomes meshes that wear their colours. Follows Wilson and Manocha
//! ("Simplifying complex environments using incremental textured depth meshes", 2003): samples are taken where most is unseen
//! (section 3, by a visibility metric); edges where depth jumps are found and left open instead of being covered by skins (3.3.3); samples form
//! a tree in which each stores only what its ancestors have not seen (4.1); meshes are simplified with borders and silhouettes kept
//! within half a pixel (4.2); a view is put together from the nearest samples with their ancestors (4.3).
//!
//! Deviations, each said where it is made: places are chosen on smaller samples than meshes are made of; corners are shared by all pixels of a
//! surface, over the faces of the cube too, so that there are no seams to close; a sample's meshes are simplified as one, not
//! object by object; merges go onto existing vertices; texels that no triangle shows are not stored; normals are kept beside colours,
//! so that lights may move (the paper's future work).
//!
//! A sample of n pixels costs six pictures, O(n) look-ups a sample for skins and an ancestor for redundancy, and
//! O(n log n) for its meshes; memory: 16 bytes a pixel for all samples of a region, and about 400 bytes a pixel that is kept for those being
//! simplified. Limits: the region must not meet far chunks; what no sample sees is missing; seams between the meshes of different samples close
//! within about a pixel and are not sewn; a pixel shows one object's name for a whole cube.

mod bake;
mod dense;
mod index;
mod places;
mod redundancy;
mod samples;
mod simplify;
#[cfg(test)]
mod tests;
mod texels;
mod tree;
mod view;

use farfield_core::Fault;
use farfield_core::cell::Cell;
use farfield_core::claim::{Claim, Quantity};
use farfield_core::context::Context;
use farfield_core::id::AssetId;
use farfield_core::panorama::SkinTests;
use farfield_core::scene::Scene;
use farfield_core::strategy::{CellJob, Covers, DrawBudget, FarField, FarView, LeftOut, Needs, Sink, VisibilityMetric};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use index::{Cube, Index, Piece};
pub use places::Corners;

use bake::{Making, bake};
use samples::{Sampling, choose};
use simplify::Limits;

const INCREMENTAL: &str = "incremental-tdm";
const PLAIN: &str = "textured-depth-mesh";

/// 2: cubes of nothing have boxes that can be read back; what turns away mends nothing.
const VERSION: u32 = 3;

/// Incremental textured depth meshes.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IncrementalTdm {
    /// Decides where samples are taken and when they are enough.
    #[serde(default = "defaults::sampling")]
    #[schemars(with = "Value", extend("strategy" = "visibility_metric"))]
    pub sampling: Box<dyn VisibilityMetric>,
    /// Which corners of the region are sampled first.
    #[serde(default)]
    pub corners: Corners,
    /// No more samples than these, whatever the metric says; but always the corners.
    #[serde(default = "defaults::max_samples")]
    #[schemars(range(min = 1))]
    pub max_samples: u32,
    /// Side of a sample's faces while places are chosen.
    #[serde(default = "defaults::sampling_px")]
    #[schemars(range(min = 8, max = 4096), extend("unit" = "px"))]
    pub sampling_px: u32,
    /// Side of a sample's faces; the paper's 512.
    #[serde(default = "defaults::face_px")]
    #[schemars(range(min = 8, max = 4096), extend("unit" = "px"))]
    pub face_px: u32,
    /// An edge nearer to the view ray than this is a skin.
    #[serde(default = "defaults::alpha_deg")]
    #[schemars(range(min = 0.0, max = 90.0), extend("unit" = "deg"))]
    pub alpha_deg: f32,
    /// Surfaces beyond this depth join nothing; without it there is no such limit.
    #[serde(default)]
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub far: Option<f32>,
    /// Leave to a sample only what no ancestor shows; without it every sample keeps all its points.
    #[serde(default = "defaults::yes")]
    pub incremental: bool,
    /// A point is one that an ancestor has, up to this far apart.
    #[serde(default = "defaults::same_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub same_px: f32,
    /// How far borders and silhouettes may move; the paper's half a pixel.
    #[serde(default = "defaults::border_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub border_px: f32,
    /// How far other surfaces may move.
    #[serde(default = "defaults::interior_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub interior_px: f32,
    /// The merge tree ends at so many triangles a sample.
    #[serde(default = "defaults::tree_triangles")]
    #[schemars(range(min = 1))]
    pub tree_triangles: u32,
    /// Side of an atlas's layers, rounded up to a power of two and to the largest piece.
    #[serde(default = "defaults::atlas_px")]
    #[schemars(range(min = 64, max = 16384), extend("unit" = "px"))]
    pub atlas_px: u32,
    /// The most scan cubes of a frame; without it all of the region's.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub scan_budget: Option<u32>,
    /// The most triangles of a frame, of scan cubes within the view frustum; without it no limit.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub triangle_budget: Option<u64>,
}

/// Plain textured depth meshes: the baseline of the incremental ones.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TexturedDepthMesh {
    /// Samples along each side of the region, on a uniform grid; the nearest one is drawn.
    #[serde(default = "defaults::one")]
    #[schemars(range(min = 1, max = 64))]
    pub grid: u32,
    /// Side of a sample's faces.
    #[serde(default = "defaults::face_px")]
    #[schemars(range(min = 8, max = 4096), extend("unit" = "px"))]
    pub face_px: u32,
    /// How far borders and silhouettes may move.
    #[serde(default = "defaults::border_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub border_px: f32,
    /// How far other surfaces, skins among them, may move.
    #[serde(default = "defaults::interior_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub interior_px: f32,
    /// The merge tree ends at so many triangles a sample.
    #[serde(default = "defaults::tree_triangles")]
    #[schemars(range(min = 1))]
    pub tree_triangles: u32,
    /// Side of an atlas's layers, rounded up to a power of two and to the largest piece.
    #[serde(default = "defaults::atlas_px")]
    #[schemars(range(min = 64, max = 16384), extend("unit" = "px"))]
    pub atlas_px: u32,
}

mod defaults {
    use super::VisibilityMetric;

    /// By name, since strategies do not know each other.
    pub(super) fn sampling() -> Box<dyn VisibilityMetric> {
        serde_json::from_str(r#"{"type": "void-surface"}"#).expect("the program links farfield-strategies")
    }
    pub(super) fn max_samples() -> u32 {
        20
    }
    pub(super) fn sampling_px() -> u32 {
        128
    }
    pub(super) fn face_px() -> u32 {
        512
    }
    pub(super) fn alpha_deg() -> f32 {
        5.0
    }
    pub(super) fn yes() -> bool {
        true
    }
    pub(super) fn one() -> u32 {
        1
    }
    pub(super) fn same_px() -> f32 {
        2.0
    }
    pub(super) fn border_px() -> f32 {
        0.5
    }
    pub(super) fn interior_px() -> f32 {
        1.0
    }
    pub(super) fn tree_triangles() -> u32 {
        300
    }
    pub(super) fn atlas_px() -> u32 {
        2048
    }
}

/// Pixels of a face as a tangent: a face spans two.
fn error_tan(px: f32, face_px: u32) -> f32 {
    2.0 * px / face_px as f32
}

/// Refuses settings that contradict what they mean.
fn check(who: &str, sizes: &[(&str, u32)], atlas_px: u32, at_least_zero: &[(&str, f32)]) -> Result<(), Fault> {
    if let Some((name, v)) = sizes.iter().find(|(_, v)| !(8..=4096).contains(v)) {
        return Err(Fault::Refused(format!("{who}: {name} = {v} is not 8 to 4096")));
    }
    if !(64..=16384).contains(&atlas_px) {
        return Err(Fault::Refused(format!("{who}: atlas_px = {atlas_px} is not 64 to 16384")));
    }
    match at_least_zero.iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
        Some((name, v)) => Err(Fault::Refused(format!("{who}: {name} = {v} is not a number of at least 0"))),
        None => Ok(()),
    }
}

/// What either far field needs.
fn needs(who: &str, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault> {
    let work = match cell {
        Some(cell) => cell.has_far(scene, who)?,
        None => !scene.chunks.is_empty(),
    };
    let none = LeftOut {
        stage: "depth meshes".into(),
        reason: "nothing lies outside the cell".into(),
        decided: "plan".into(),
    };
    Ok(Needs {
        scene_asset: false,
        cell_asset: work,
        captures: work,
        neighbour_cells: false,
        covers: Covers::Far,
        left_out: if work { vec![] } else { vec![none] },
    })
}

impl IncrementalTdm {
    fn check(&self) -> Result<(), Fault> {
        let numbers = [
            ("alpha_deg", self.alpha_deg),
            ("far", self.far.unwrap_or_default()),
            ("same_px", self.same_px),
            ("border_px", self.border_px),
            ("interior_px", self.interior_px),
        ];
        let sizes = [("face_px", self.face_px), ("sampling_px", self.sampling_px)];
        check(INCREMENTAL, &sizes, self.atlas_px, &numbers)?;
        if self.alpha_deg > 90.0 || self.far == Some(0.0) {
            let (a, f) = (self.alpha_deg, self.far.unwrap_or_default());
            return Err(Fault::Refused(format!("{INCREMENTAL}: alpha_deg = {a} is at most 90, far = {f} above 0")));
        }
        if self.max_samples == 0 || self.scan_budget == Some(0) || self.triangle_budget == Some(0) {
            let what = "max_samples, scan_budget and triangle_budget are at least 1";
            return Err(Fault::Refused(format!("{INCREMENTAL}: {what}")));
        }
        Ok(())
    }
}

#[typetag::serde(name = "incremental-tdm")]
impl FarField for IncrementalTdm {
    fn needs(&self, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        needs(INCREMENTAL, scene, cell)
    }

    fn bake_cell(&self, job: &CellJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        let mut index = Index::default();
        if !job.cell.has_far(job.scene, INCREMENTAL)? {
            return Ok(vec![]);
        }
        let making = Making {
            face_px: self.face_px,
            skins: Some(SkinTests { far: self.far.unwrap_or(f32::INFINITY), alpha_rad: self.alpha_deg.to_radians() }),
            same_px: self.incremental.then_some(self.same_px),
            limits: Limits {
                border_px: self.border_px,
                interior_px: self.interior_px,
                tree_triangles: self.tree_triangles,
            },
            atlas_px: self.atlas_px,
        };
        let sampling = Sampling {
            metric: &*self.sampling,
            first: places::first(job.cell, self.corners)?,
            max_samples: self.max_samples as usize,
            face_px: self.sampling_px,
        };
        let mut unseen = None;
        for (i, split) in job.cell.splits.iter().enumerate().filter(|(_, s)| !s.far.is_empty()) {
            let chosen = choose(&sampling, job, &split.far, cx)?;
            if chosen.verdict.quantity == Quantity::UnseenSolidAngle {
                unseen = Some(chosen.verdict.claim.max(unseen.unwrap_or(0.0)));
            }
            if !chosen.verdict.passes {
                let (n, v) = (chosen.eyes.len(), chosen.verdict);
                let why = if n >= self.max_samples as usize { "max_samples" } else { "its metric asks for no more" };
                let reason = format!("{n} samples ({why}) leave {} = {:.3}", v.quantity.name(), v.value);
                out.left_out(LeftOut { stage: "samples".into(), reason, decided: "build".into() });
            }
            bake(&making, job, (i as u32, &split.far), &chosen.eyes, &mut index, out, cx)?;
        }
        if let Some(max) = unseen {
            out.claim(Claim { quantity: Quantity::UnseenSolidAngle, payload: None, max });
        }
        index.encode()
    }

    fn open(&self, _shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        let index = Index::decode(&format!("index of asset {}", cell.0.0), cell.1)?;
        Ok(Box::new(view::Cubes {
            asset: cell.0,
            index,
            most: None,
            error_tan: error_tan(self.border_px.max(self.interior_px), self.face_px),
        }))
    }

    fn draw_budget(&self) -> DrawBudget {
        DrawBudget { payloads: self.scan_budget, triangles: self.triangle_budget }
    }

    fn frame_settings(&self) -> &'static [&'static str] {
        &["scan_budget", "triangle_budget"]
    }

    fn version(&self) -> u32 {
        VERSION
    }
}

#[typetag::serde(name = "textured-depth-mesh")]
impl FarField for TexturedDepthMesh {
    fn needs(&self, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        needs(PLAIN, scene, cell)
    }

    fn bake_cell(&self, job: &CellJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        let mut index = Index::default();
        if !job.cell.has_far(job.scene, PLAIN)? {
            return Ok(vec![]);
        }
        let making = Making {
            face_px: self.face_px,
            skins: None,
            same_px: None,
            limits: Limits {
                border_px: self.border_px,
                interior_px: self.interior_px,
                tree_triangles: self.tree_triangles,
            },
            atlas_px: self.atlas_px,
        };
        let eyes = places::grid(job.cell, self.grid);
        for (i, split) in job.cell.splits.iter().enumerate().filter(|(_, s)| !s.far.is_empty()) {
            bake(&making, job, (i as u32, &split.far), &eyes, &mut index, out, cx)?;
        }
        index.encode()
    }

    fn open(&self, _shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        let index = Index::decode(&format!("index of asset {}", cell.0.0), cell.1)?;
        Ok(Box::new(view::Cubes {
            asset: cell.0,
            index,
            most: Some(1),
            error_tan: error_tan(self.border_px.max(self.interior_px), self.face_px),
        }))
    }

    fn version(&self) -> u32 {
        VERSION
    }
}

impl TexturedDepthMesh {
    fn check(&self) -> Result<(), Fault> {
        if !(1..=64).contains(&self.grid) {
            return Err(Fault::Refused(format!("{PLAIN}: grid = {} is not 1 to 64", self.grid)));
        }
        let numbers = [("border_px", self.border_px), ("interior_px", self.interior_px)];
        check(PLAIN, &[("face_px", self.face_px)], self.atlas_px, &numbers)
    }
}
