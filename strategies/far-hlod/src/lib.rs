//! `point-polygon-hlod`: one octree of simplified nodes for near and far, with a bound of the error on screen.
//!
//! For large scanned or generated surfaces seen from any distance, larger than memory: what is drawn is a cut through a hierarchy of levels of
//! detail, loaded node by node. Follows *Real-time appearance preserving out-of-core rendering with shadows* (Guthe, Borodin,
//! Balazs and Klein, 2004), section 3: leaves of at most T_max triangles; a node is simplified from the nodes two levels below,
//!
//! ```text
//! e_simp <= e_node / res - e_prev,    stored error = e_simp + e_prev,
//! ```
//!
//! where e_node is the edge of its cube and e_prev the largest error of what it is made from; section 4: the cut is where errors are at most
//! half a pixel.
//!
//! Deviations, on purpose:
//!
//! * **Borders between nodes do not crack.** The paper simplifies nodes freely and draws lines along the cracks. Here vertices that a node
//!   shares with others stay, with their name, at every level: nodes of any two levels meet. The price: the triangles along borders, most at
//!   coarse levels (the book has figures).
//! * Nodes hold placed chunks whole, so boxes overlap a little instead of cutting triangles.
//! * Any metric that bounds the two-sided distance simplifies (`appearance`, `hausdorff`); others are refused, since a stored error would be no
//!   bound.
//! * Positions and normals are rounded before they are stored; what that moves counts (`grid_steps`).
//! * Textures: vertices carry albedo alone. Where a texture shows more, the distance to the nearest corner counts as error, so that original
//!   chunks, which stand below the leaves, are drawn close by.
//! * Points: see the file `points`.
//!
//! Limits: seams (vertices with several normals or albedos) stay at every level, so models that consist of hard edges are hardly
//! simplified; parts that are not connected never join nor vanish.
//!
//! Bake: O(n log n) for n triangles; memory for the meshes beside a path from the root to a leaf, a thread, and for the subtrees'
//! upper nodes.

mod bake;
mod cone;
mod piece;
mod points;
mod promise;
mod rounding;
mod skeleton;
mod texture;
mod tree;
mod view;

use farfield_core::Fault;
use farfield_core::cell::Cell;
use farfield_core::claim::{Claim, Quantity};
use farfield_core::context::Context;
use farfield_core::id::AssetId;
use farfield_core::scene::Scene;
use farfield_core::strategy::{
    CellJob, Covers, FarField, FarView, LeftOut, Level, Needs, SceneJob, SimplificationMetric, Sink,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use promise::{Promise, promises};
use skeleton::Skeleton;

const NAME: &str = "point-polygon-hlod";

/// Hierarchical levels of detail.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointPolygonHlod {
    /// T_max: leaves have at most as many, unless one chunk has more.
    #[serde(default = "node_triangles")]
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub node_triangles: u64,
    /// The edge of a node's cube over the error that the node may have.
    #[serde(default = "resolution")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub resolution: f32,
    /// What an edge's collapse costs: `appearance` keeps normals and colours, `hausdorff` geometry alone.
    #[serde(default = "metric")]
    #[schemars(with = "Value", extend("strategy" = "simplification_metric"))]
    pub metric: Box<dyn SimplificationMetric>,
    /// The most that a node may be off by where it is drawn.
    #[serde(default = "max_px")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f32,
    /// The smallest error that any node may have, over the step of the grid that positions are rounded to.
    #[serde(default = "grid_steps")]
    #[schemars(range(min = 1))]
    pub grid_steps: u32,
    /// What nodes are drawn as.
    #[serde(default)]
    pub primitives: Primitives,
    /// What a point costs to draw: points replace the small triangles of a node where they are cheaper. The default is that of a software
    /// rasteriser on a processor; `farfield calibrate` measures a backend's.
    #[serde(default = "point_cost")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "unit" = "triangles"))]
    pub point_cost: f32,
    /// Bits of each of the two numbers of a stored normal; 11 turn it by less than half a grey level of shading.
    #[serde(default = "normal_bits")]
    #[schemars(range(min = 8, max = 11))]
    pub normal_bits: u32,
    /// A difference between a texture and the albedo of its triangle's corners, in any channel, that does not count; 255 lets textures go.
    #[serde(default = "max_albedo_off")]
    #[schemars(extend("unit" = "grey levels"))]
    pub max_albedo_off: u8,
}

/// What nodes are drawn as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Primitives {
    /// Small triangles as points where that is cheaper.
    #[default]
    Mixed,
    /// Triangles only.
    Triangles,
    /// Points only, as far apart as the node's error may be: up to twice the square of `resolution` a node. Original chunks, close by, stay
    /// triangles.
    Points,
}

fn node_triangles() -> u64 {
    4096
}
fn resolution() -> f32 {
    512.0
}
/// By name, since strategies do not know each other.
fn metric() -> Box<dyn SimplificationMetric> {
    serde_json::from_str(r#"{"type": "appearance"}"#).expect("the program links farfield-strategies")
}
fn max_px() -> f32 {
    0.5
}
fn grid_steps() -> u32 {
    8
}
/// Measured on lavapipe.
fn point_cost() -> f32 {
    1.5
}
fn normal_bits() -> u32 {
    10
}
fn max_albedo_off() -> u8 {
    16
}

impl PointPolygonHlod {
    fn check(&self) -> Result<(), Fault> {
        let refuse = |why: String| Err(Fault::Refused(format!("{NAME}: {why}")));
        if self.node_triangles == 0 || self.grid_steps == 0 {
            return refuse("node_triangles and grid_steps must be at least 1".into());
        }
        if !(self.resolution.is_finite() && self.resolution > 0.0) {
            return refuse(format!("resolution = {} is no ratio of lengths", self.resolution));
        }
        if !(self.max_px.is_finite() && self.max_px >= 0.0) {
            return refuse(format!("max_px = {} is not a length", self.max_px));
        }
        if !(self.point_cost.is_finite() && self.point_cost > 0.0) {
            return refuse(format!("point_cost = {} is no ratio of costs", self.point_cost));
        }
        if !(8..=11).contains(&self.normal_bits) {
            return refuse(format!("normal_bits = {} is not between 8 and 11", self.normal_bits));
        }
        if !self.metric.bounds_distance() {
            return refuse(
                "its metric bounds no distance, so errors would not be known; take appearance or hausdorff".into(),
            );
        }
        Ok(())
    }
}

#[typetag::serde(name = "point-polygon-hlod")]
impl FarField for PointPolygonHlod {
    fn needs(&self, scene: &Scene, _cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        let one = scene.triangles() <= self.node_triangles || scene.chunks.len() <= 1;
        let left_out = one.then(|| LeftOut {
            stage: "levels of detail".into(),
            reason: format!("all {} triangles are one leaf", scene.triangles()),
            decided: "plan".into(),
        });
        Ok(Needs {
            scene_asset: true,
            cell_asset: false,
            captures: false,
            neighbour_cells: false,
            covers: Covers::Everything,
            left_out: left_out.into_iter().collect(),
        })
    }

    fn census(&self, scene: &Scene, shared: Option<&[u8]>) -> Result<Vec<Level>, Fault> {
        let mut levels: Vec<Level> = vec![];
        let mut count = |depth: u32, drawn: Option<[u32; 2]>| {
            while levels.len() <= depth as usize {
                let none = drawn.map(|_| 0);
                levels.push(Level { level: levels.len() as u32, nodes: 0, triangles: none, points: none });
            }
            let own = &mut levels[depth as usize];
            own.nodes += 1;
            own.triangles = own.triangles.zip(drawn).map(|(all, [n, _])| all + u64::from(n));
            own.points = own.points.zip(drawn).map(|(all, [_, n])| all + u64::from(n));
        };
        match shared {
            Some(bytes) => {
                let skeleton = Skeleton::decode(NAME, bytes)?;
                skeleton.nodes.iter().for_each(|n| count(n.depth.into(), Some([n.triangles, n.points])));
            }
            None => {
                self.check()?;
                let tree = tree::Tree::over(scene, self.node_triangles);
                tree.octree.nodes.iter().for_each(|n| count(n.depth, None));
            }
        }
        Ok(levels)
    }

    fn frame_claims(&self) -> Vec<Claim> {
        vec![Claim { quantity: Quantity::SurfaceDistancePx, payload: None, max: self.max_px.into() }]
    }

    fn frame_settings(&self) -> &'static [&'static str] {
        &["max_px"]
    }

    fn bake_scene(&self, job: &SceneJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        bake::bake(self, job, out, cx)?.encode()
    }

    fn bake_cell(&self, _job: &CellJob<'_>, _out: &dyn Sink, _cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        Ok(vec![])
    }

    fn open(&self, shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        if !cell.1.is_empty() {
            let cause = format!("{} bytes where {NAME} keeps none", cell.1.len());
            return Err(Fault::Data { place: format!("asset {}", cell.0.0), cause });
        }
        let Some((asset, bytes)) = shared else {
            return Err(Fault::Data { place: NAME.into(), cause: "the scene has no nodes".into() });
        };
        let skeleton = Skeleton::decode(&format!("asset {}", asset.0), bytes)?;
        Ok(Box::new(view::Hierarchy { asset, skeleton, max_px: self.max_px }))
    }
}

#[cfg(test)]
mod tests;
