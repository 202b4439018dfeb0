//! `hex-cells`: the ground plane in equal hexagons, six windows a cell.
//!
//! For walks over a plane with objects on it. Follows textured LOD meshes (Chen, Lin, Chen and Chuang, 2003, section 3.1.1):
//! N x M hexagonal cells over the scene's footprint; moving over an edge needs three new neighbours at most, and a view
//! of 120, 90, 60, 45, 30 degrees meets at most 5, 4, 3, 3, 2 of the six windows (table 1).
//!
//! Chosen here, where the paper is silent:
//!
//! * A cell is a prism: the hexagon over the range of eye heights. Near is what meets the *column* over the hexagon, whatever
//!   its height, as in the paper's plan view; so each far chunk lies beyond the line of at least one edge and the six
//!   windows are enough, although the prism's top and bottom have none.
//! * The decision is made chunk by chunk: of an object that meets the column, those chunks are near whose boxes meet it.
//! * Windows reach from the lowest to the highest point of scene and eyes: a ray from an eye to a point of the scene crosses a
//!   side of the column between their heights, so nothing is seen past a window's upper or lower edge.
//! * A window's `seen` holds the far chunks whose box reaches beyond its edge's line: what a ray that leaves through the
//!   window can meet, for any eye in the cell.
//! * One cell is centred on the local frame's origin.
//!
//! O(cells) to divide, O(1) to find, O(chunks) for an inside.

mod lattice;

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Cell, Outline, Sector, Split, Window, leaves_at_once, sees};
use farfield_core::context::Context;
use farfield_core::id::{CellId, ChunkId, SectorId, SplitId};
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Cells, Partition};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use lattice::Lattice;

/// More cells than this are a mistake in the edge's unit.
const MAX_CELLS: f64 = 4e6;
/// An eye this many edges from a window's plane stands in the window, where clipping it against the frustum decides nothing.
const IN_WINDOW: f64 = 1e-4;
/// An eye may miss the range of heights by this many edges: positions that went through other units are not turned away.
const HEIGHT_SLACK: f64 = 1e-4;

/// Equal hexagons on the ground plane.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HexCells {
    /// Edge of a hexagon; the paper's cell size c (50 in its park).
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub edge: f32,
    /// How far cells reach beyond the scene's footprint; without it one edge.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "scene units"))]
    pub margin: Option<f32>,
}

struct Hexes {
    lattice: Lattice,
    outlines: Vec<Outline>,
    px_per_tan: f32,
    /// Lowest and highest eye.
    y: [f32; 2],
}

#[typetag::serde(name = "hex-cells")]
impl Partition for HexCells {
    fn divide(&self, scene: &Scene, views: &ViewModel, _cx: &Context<'_>) -> Result<Box<dyn Cells>, Fault> {
        let margin = self.margin.unwrap_or(self.edge);
        if !(self.edge.is_finite() && self.edge > 0.0) {
            return Err(Fault::Refused(format!("hex-cells: edge = {} is not a length above 0", self.edge)));
        }
        if !(margin.is_finite() && margin >= 0.0) {
            return Err(Fault::Refused(format!("hex-cells: margin = {margin} is not a length")));
        }
        let [low, high] = views.eye_height;
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return Err(Fault::Refused(format!("hex-cells: the eye heights {low}..{high} are no range")));
        }
        let flat = |v: Vec3| DVec2::new(f64::from(v.x), f64::from(v.z));
        let (min, max) = (flat(scene.bounds.min) - f64::from(margin), flat(scene.bounds.max) + f64::from(margin));
        let edge = f64::from(self.edge);
        let rough = (max - min) / edge;
        if rough.x * rough.y > MAX_CELLS {
            return Err(Fault::Refused(format!(
                "hex-cells: edge = {} divides a scene of {:.3} x {:.3} into more than {MAX_CELLS:e} cells",
                self.edge,
                max.x - min.x,
                max.y - min.y
            )));
        }
        let lattice = Lattice::covering(edge, min, max);
        let outlines =
            (0..(lattice.count[0] * lattice.count[1]) as u32).map(|i| outline(&lattice, i, views.eye_height)).collect();
        Ok(Box::new(Hexes { lattice, outlines, px_per_tan: views.px_per_tan(), y: views.eye_height }))
    }
}

fn outline(lattice: &Lattice, index: u32, y: [f32; 2]) -> Outline {
    let at = lattice.at(index);
    let centre = lattice.centre(at);
    let polygon = (0..6).map(|k| (centre + lattice.corner(k)).as_vec2().to_array()).collect();
    Outline {
        id: CellId(index),
        region: Region::Prism { polygon, y },
        centre: Vec3::new(centre.x as f32, 0.5 * (y[0] + y[1]), centre.y as f32),
        neighbours: Lattice::around(at).into_iter().filter_map(|n| lattice.index(n)).map(CellId).collect(),
    }
}

impl Cells for Hexes {
    fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    fn find(&self, camera: &Camera) -> Option<CellId> {
        let slack = HEIGHT_SLACK * self.lattice.edge;
        let [low, high] = self.y.map(f64::from);
        if !(low - slack..=high + slack).contains(&camera.eye.y) {
            return None;
        }
        self.lattice.index(self.lattice.nearest(DVec2::new(camera.eye.x, camera.eye.z))).map(CellId)
    }

    fn inside(&self, id: CellId, scene: &Scene, cx: &Context<'_>) -> Result<Cell, Fault> {
        cx.check()?;
        let Some(outline) = self.outlines.get(id.index()) else {
            return Err(Fault::Refused(format!("hex-cells: cell {} of {}", id.0, self.outlines.len())));
        };
        let Region::Prism { polygon, .. } = &outline.region else {
            return Err(Fault::Refused("hex-cells: a cell that is no prism".into()));
        };
        let column = Region::Prism { polygon: polygon.clone(), y: [f32::NEG_INFINITY, f32::INFINITY] };
        let ids = (0..scene.chunks.len() as u32).map(ChunkId);
        let far: ChunkSet = ids.filter(|c| column.distance(&scene.chunks[c.index()].bounds) > 0.0).collect();
        let (low, high) = (self.y[0].min(scene.bounds.min.y), self.y[1].max(scene.bounds.max.y));
        let sectors = (0..6)
            .map(|k| {
                let (a, b) = (polygon[k], polygon[(k + 1) % 6]);
                let corner = |p: [f32; 2], y: f32| Vec3::new(p[0], y, p[1]);
                let axis = Vec3::new(b[1] - a[1], 0.0, a[0] - b[0]).normalize();
                let from = corner(a, 0.0);
                let beyond = |c: &ChunkId| reaches(&scene.chunks[c.index()].bounds, axis, from);
                let window = Window {
                    axis,
                    corners: [corner(a, low), corner(b, low), corner(b, high), corner(a, high)],
                    px_per_tan: self.px_per_tan,
                };
                Sector { split: SplitId(0), window, seen: far.iter().filter(beyond).collect() }
            })
            .collect();
        let splits = vec![Split { far, near_budget: None }];
        Ok(Cell { outline: outline.clone(), splits, sectors, own: vec![], claims: vec![] })
    }

    fn active(&self, cell: &Cell, camera: &Camera) -> Active {
        let meets = |s: &u32| {
            let window = &cell.sectors[*s as usize].window;
            sees(camera, window) || leaves_at_once(camera, window, IN_WINDOW * self.lattice.edge)
        };
        let sectors = (0..cell.sectors.len() as u32).filter(meets).map(SectorId).collect();
        Active { cell: cell.outline.id, split: SplitId(0), sectors }
    }
}

/// Whether a box has a point beyond the plane through `from` with the outward normal `axis`.
fn reaches(b: &Aabb, axis: Vec3, from: Vec3) -> bool {
    let out = Vec3::select(axis.cmpge(Vec3::ZERO), b.max, b.min);
    let v = (out - from).as_dvec3() * axis.as_dvec3();
    // The two horizontal terms only: the axis is level, and heights may be infinite.
    v.x + v.z > 0.0
}

#[cfg(test)]
mod tests;
