//! `textured-lod-mesh`: distant objects as small meshes that wear pictures of themselves.
//!
//! For walks through many detailed objects: what lies outside a cell is drawn with a hundredth of its triangles and textured by
//! projection from the cell's centre. Follows *textured LOD meshes* (Chen, Lin, Chen and Chuang, 2003): regional back-face culling
//! ([`Facing`], section 3.1.5), the view test between one view and several (3.1.2, a visibility metric), pixel categories
//! ([`DepthMeasure`], 3.1.3.1), vertex weights (3.1.3.2), edge collapse (3.1.3.3, a simplification metric), several views with view
//! sets (3.1.4), view-dependent projective texturing (3.2, done by backends from `ProjectedPart`).
//!
//! Deviations, each said where it is made: categories are measured in pixel footprints; "front-facing to the cell" is read as "to some
//! corner"; of an object with several views edges are measured and vertices weighed from the centre ([`Lengths`], [`Weigh`]: what is
//! printed is a setting, and gives ten times the published counts at one cell); partly hidden polygons are checked on the depth images; texels are dilated past outlines; albedo and normals are captured, not
//! lit colours, so that lights may move. Clustering and regional occlusion culling are not part of this crate yet.
//!
//! A cell costs O(n log n) for n far triangles, most of it in collapse, and its pictures. Limits: the region must not meet far
//! chunks; transparency is not known; an object's interior layers that face the centre are kept although nothing shows them.

mod atlas;
mod bake;
mod category;
mod facing;
mod index;
mod mesh;
mod object;
mod pieces;
mod polygon;
mod shot;
mod view;

use farfield_core::Fault;
use farfield_core::cell::Cell;
use farfield_core::context::Context;
use farfield_core::id::AssetId;
use farfield_core::scene::Scene;
use farfield_core::strategy::{
    CellJob, Covers, FarField, FarView, LeftOut, Needs, SimplificationMetric, Sink, VisibilityMetric,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use category::DepthMeasure;
pub use facing::Facing;
pub use polygon::PolygonViews;

const NAME: &str = "textured-lod-mesh";

/// Textured LOD meshes.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TexturedLodMesh {
    /// The cost above which no edge is collapsed, as an edge's projected length; the paper's Tl (3, 4.5, 6).
    #[serde(default = "defaults::edge_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub edge_px: f32,
    /// Decides whether the view from the centre serves the whole cell. `self-occlusion` knows an object's depth and bounds the holes that
    /// it lets through; `void-surface` judges the picture from the centre, so that slots and gaps count, and bounds no width.
    #[serde(default = "defaults::view_test")]
    #[schemars(with = "Value", extend("strategy" = "visibility_metric"))]
    pub view_test: Box<dyn VisibilityMetric>,
    /// What collapsing an edge costs.
    #[serde(default = "defaults::collapse")]
    #[schemars(with = "Value", extend("strategy" = "simplification_metric"))]
    pub collapse: Box<dyn SimplificationMetric>,
    /// Which polygons of an object that fails the view test are kept.
    #[serde(default)]
    pub facing: Facing,
    /// From where edges of an object that fails the view test are measured.
    #[serde(default)]
    pub lengths: Lengths,
    /// Which pictures weigh the vertices of an object that fails the view test.
    #[serde(default)]
    pub weigh: Weigh,
    /// Which views texture a polygon of an object that fails the view test.
    #[serde(default)]
    pub polygon_views: PolygonViews,
    /// How depth steps are measured.
    #[serde(default)]
    pub depth: DepthMeasure,
    /// Step to a pixel behind that makes an interior silhouette; without it 4 footprints, or the paper's 3.4e-4 for window z.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "footprints, or window z"))]
    pub c0: Option<f32>,
    /// Change of slope that makes a sharp edge; without it 1 footprint, or the paper's 1.28e-4 for window z.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "footprints, or window z"))]
    pub c1: Option<f32>,
    /// Weight of a vertex on the exterior silhouette.
    #[serde(default = "defaults::exterior")]
    #[schemars(range(min = 0.0))]
    pub weight_exterior: f32,
    /// Weight of a vertex on an interior silhouette.
    #[serde(default = "defaults::interior_silhouette")]
    #[schemars(range(min = 0.0))]
    pub weight_interior_silhouette: f32,
    /// Weight of a vertex on a sharp edge.
    #[serde(default = "defaults::sharp")]
    #[schemars(range(min = 0.0))]
    pub weight_sharp: f32,
    /// Weight of any other vertex that is seen.
    #[serde(default = "defaults::interior")]
    #[schemars(range(min = 0.0))]
    pub weight_interior: f32,
    /// Weight of a vertex whose polygons all turn away.
    #[serde(default = "defaults::exterior")]
    #[schemars(range(min = 0.0))]
    pub weight_back: f32,
    /// Weight of a vertex that is hidden.
    #[serde(default = "defaults::hidden")]
    #[schemars(range(min = 0.0))]
    pub weight_hidden: f32,
    /// A vertex counts as seen up to this far behind the captured depth.
    #[serde(default = "defaults::visible_px")]
    #[schemars(range(min = 0.0), extend("unit" = "footprints"))]
    pub visible_px: f32,
    /// The largest turn of a triangle's normal in one collapse; 180 allows all.
    #[serde(default = "defaults::max_turn_deg")]
    #[schemars(range(min = 0.0, max = 180.0), extend("unit" = "deg"))]
    pub max_turn_deg: f32,
    /// Refuse collapses that change the topology of what is kept.
    #[serde(default)]
    pub keep_topology: bool,
    /// Texels of a picture a pixel of the window.
    #[serde(default = "defaults::density")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub density: f32,
    /// Background round an object in its picture.
    #[serde(default = "defaults::border_px")]
    #[schemars(range(min = 1, max = 64), extend("unit" = "px"))]
    pub border_px: u32,
    /// How far texels are continued into the background.
    #[serde(default = "defaults::dilate_px")]
    #[schemars(range(min = 1, max = 1024), extend("unit" = "px"))]
    pub dilate_px: u32,
    /// Side of an atlas's layers, rounded up to a power of two and to the largest picture.
    #[serde(default = "defaults::atlas_px")]
    #[schemars(range(min = 64, max = 16384), extend("unit" = "px"))]
    pub atlas_px: u32,
}

/// "The projected length with respect to the cell" of the paper's MVMesh, which it does not define.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Lengths {
    /// From the cell's centre, as for a single view: gives the published counts.
    #[default]
    Centre,
    /// The longest from any corner of the cell: two to four times the triangles at one and two cells.
    LongestCorner,
}

/// Whose weights count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weigh {
    /// Those of the picture from the cell's centre; the others say what they see. Gives the published counts.
    #[default]
    Centre,
    /// The largest over all pictures, as printed: two to eight times the triangles at one and two cells, since a vertex that turns
    /// away from any one of the views then weighs as much as a silhouette.
    AllViews,
}

mod defaults {
    use super::{SimplificationMetric, VisibilityMetric};

    pub(super) fn edge_px() -> f32 {
        4.5
    }
    /// By name, since strategies do not know each other.
    pub(super) fn view_test() -> Box<dyn VisibilityMetric> {
        serde_json::from_str(r#"{"type": "self-occlusion"}"#).expect("the program links farfield-strategies")
    }
    pub(super) fn collapse() -> Box<dyn SimplificationMetric> {
        serde_json::from_str(r#"{"type": "silhouette-weighted"}"#).expect("the program links farfield-strategies")
    }
    pub(super) fn exterior() -> f32 {
        0.5
    }
    pub(super) fn interior_silhouette() -> f32 {
        0.4
    }
    pub(super) fn sharp() -> f32 {
        0.25
    }
    pub(super) fn interior() -> f32 {
        0.125
    }
    pub(super) fn hidden() -> f32 {
        0.05
    }
    pub(super) fn visible_px() -> f32 {
        2.0
    }
    pub(super) fn max_turn_deg() -> f32 {
        90.0
    }
    pub(super) fn density() -> f32 {
        1.0
    }
    pub(super) fn border_px() -> u32 {
        2
    }
    pub(super) fn dilate_px() -> u32 {
        16
    }
    pub(super) fn atlas_px() -> u32 {
        2048
    }
}

impl TexturedLodMesh {
    fn steps(&self, near: f32) -> category::Steps {
        let (c0, c1) = match self.depth {
            DepthMeasure::Footprint => (4.0, 1.0),
            DepthMeasure::WindowZ => (3.4e-4, 1.28e-4),
        };
        category::Steps {
            measure: self.depth,
            c0: self.c0.map_or(c0, f64::from),
            c1: self.c1.map_or(c1, f64::from),
            near: f64::from(near),
        }
    }

    fn weights(&self) -> shot::Weights {
        shot::Weights {
            exterior: self.weight_exterior,
            interior_silhouette: self.weight_interior_silhouette,
            sharp: self.weight_sharp,
            interior: self.weight_interior,
            back: self.weight_back,
            hidden: self.weight_hidden,
        }
    }

    /// Refuses settings that contradict what they mean.
    fn check(&self) -> Result<(), Fault> {
        let at_least_zero = [
            ("edge_px", self.edge_px),
            ("c0", self.c0.unwrap_or_default()),
            ("c1", self.c1.unwrap_or_default()),
            ("weight_exterior", self.weight_exterior),
            ("weight_interior_silhouette", self.weight_interior_silhouette),
            ("weight_sharp", self.weight_sharp),
            ("weight_interior", self.weight_interior),
            ("weight_back", self.weight_back),
            ("weight_hidden", self.weight_hidden),
            ("visible_px", self.visible_px),
            ("max_turn_deg", self.max_turn_deg),
        ];
        if let Some((name, value)) = at_least_zero.iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
            return Err(Fault::Refused(format!("textured-lod-mesh: {name} = {value} is not a number of at least 0")));
        }
        if !(self.density.is_finite() && self.density > 0.0) {
            return Err(Fault::Refused(format!("textured-lod-mesh: density = {} is not above 0", self.density)));
        }
        if self.border_px == 0 || self.dilate_px == 0 || !(64..=16384).contains(&self.atlas_px) {
            return Err(Fault::Refused(
                "textured-lod-mesh: border_px and dilate_px are at least 1, atlas_px is 64 to 16384".into(),
            ));
        }
        Ok(())
    }
}

#[typetag::serde(name = "textured-lod-mesh")]
impl FarField for TexturedLodMesh {
    fn needs(&self, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        let work = match cell {
            Some(cell) => cell.has_far(scene, NAME)?,
            None => !scene.chunks.is_empty(),
        };
        let left_out =
            |stage: &str, reason: &str| LeftOut { stage: stage.into(), reason: reason.into(), decided: "plan".into() };
        let mut out = vec![];
        if !work {
            out.push(left_out("textured meshes", "nothing lies outside the cell"));
        }
        if scene.materials.iter().all(|m| m.texture.is_none()) {
            out.push(left_out("source textures", "the scene has none"));
        }
        Ok(Needs {
            scene_asset: false,
            cell_asset: work,
            captures: work,
            neighbour_cells: work,
            covers: Covers::Far,
            left_out: out,
        })
    }

    fn bake_cell(&self, job: &CellJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        if !job.cell.has_far(job.scene, NAME)? {
            return Ok(vec![]);
        }
        bake::bake(self, job, out, cx)
    }

    fn open(&self, _shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        let place = format!("index of asset {}", cell.0.0);
        let index = index::Index::decode(&place, cell.1)?;
        Ok(Box::new(view::TexturedView { asset: cell.0, index }))
    }
}
