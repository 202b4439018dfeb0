//! `octree-regions`: cubes of an octree, each as large as the triangles inside it allow.
//!
//! For scenes that are dense here and empty there, and that are walked through: regions are large where little stands.
//! Follows incremental textured depth meshes (Wilson and Manocha 2003): an octree "until cells contain no more than a
//! specified number of polygons; each cell is treated as a separate region" (section 3.1.1), regions "as large as possible while
//! enclosing no more than a user-specified number of polygons", 2 to 30 m in its power plant, uniformly 2 m in its house (section
//! 5.1: `min_size = max_size = 2`). What is inside is drawn as it is, what is not completely inside is far.
//!
//! Chosen here, where the paper is silent:
//!
//! * The root's edge is `min_size` times a power of two, so cells have edges of exactly `min_size`, twice it, ... It stands over
//!   the middle of the scene's footprint, its floor at the scene's lowest point: heights are cut at multiples of
//!   `min_size` over that floor, not through the middle of the eyes.
//! * *Inside* is decided chunk by chunk: a cell encloses the placed chunks whose boxes meet it, and their triangles are its
//!   polygons. A chunk has up to 4096, so a `max_triangles` under that divides most of a dense scene down to `min_size`. So
//!   chunks that lie partly inside are near, where the paper has them in both.
//! * The paper's navigable region is a rectangle at eye height: a cell's viewpoints are its cube cut down to the range of eye
//!   heights, and cubes beside that range are left out; with `three_dimensional` they are the whole cube. Near is what meets
//!   the *cube* either way, as in the paper, so that the floor under a viewer is near.
//! * The six windows are the cube's faces, so no window is flat, however narrow the range of heights. What is far lies
//!   beyond at least one of them; a window's `seen` holds what reaches beyond its plane.
//! * Viewpoints are served as far as `margin` beyond the scene's footprint.
//!
//! Costs: see [`tree`]; O(chunks) for an inside. Nothing is claimed: `max_triangles` is no promise where cells are of
//! `min_size`.

mod tree;

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Cell, Outline, Sector, Split, Window, leaves_at_once, sees};
use farfield_core::context::Context;
use farfield_core::id::{CellId, ChunkId, SectorId, SplitId};
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Cells, Partition};
use farfield_core::{Aabb, Camera, Fault};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use tree::{Rules, Tree, meets};

/// More cells than this are a mistake in a length's unit: their outlines alone would take some 100 MB.
const MAX_CELLS: usize = 1_000_000;
/// More halvings than this leave too few of a coordinate's 24 bits for positions inside the smallest cube.
const MAX_LEVELS: u32 = 16;
/// An eye this many edges from a window's plane stands in the window.
const IN_WINDOW: f32 = 1e-4;
/// An eye may miss the range of heights by this many least edges: positions that went through other units are not turned away.
const HEIGHT_SLACK: f64 = 1e-4;

/// Cubes of an octree.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OctreeRegions {
    /// A cell with more triangles inside is halved, down to `min_size`. The default is about five of the largest chunks.
    #[serde(default = "twenty_thousand")]
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub max_triangles: u64,
    /// Edge of the smallest cell; the paper's 2 m.
    #[serde(default = "two")]
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub min_size: f32,
    /// The largest edge of a cell, whatever it holds; rounded down to `min_size` times a power of two. Without it the scene's.
    #[serde(default)]
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub max_size: Option<f32>,
    /// Viewpoints are the whole cubes, at any height, and not the range of eye heights in them.
    #[serde(default)]
    pub three_dimensional: bool,
    /// How far viewpoints are served beyond the scene's footprint; without it `min_size`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "scene units"))]
    pub margin: Option<f32>,
}

fn twenty_thousand() -> u64 {
    20_000
}
fn two() -> f32 {
    2.0
}

impl Default for OctreeRegions {
    fn default() -> Self {
        Self {
            max_triangles: twenty_thousand(),
            min_size: two(),
            max_size: None,
            three_dimensional: false,
            margin: None,
        }
    }
}

struct Regions {
    tree: Tree,
    outlines: Vec<Outline>,
    px_per_tan: f32,
    /// Lowest and highest eye, where only those are served.
    heights: Option<[f32; 2]>,
    slack: f64,
}

#[typetag::serde(name = "octree-regions")]
impl Partition for OctreeRegions {
    fn divide(&self, scene: &Scene, views: &ViewModel, cx: &Context<'_>) -> Result<Box<dyn Cells>, Fault> {
        cx.check()?;
        let margin = self.checked(views)?;
        let (root, rules) = self.root(scene, views, margin)?;
        let chunks: Vec<(Aabb, u32)> = scene.chunks.iter().map(|c| (c.bounds, c.triangles)).collect();
        let tree = Tree::over(root, &rules, &chunks)?;
        let heights = (!self.three_dimensional).then_some(views.eye_height);
        let outline = |(i, neighbours): (usize, Vec<u32>)| {
            let mut region = tree.cells[i];
            if let Some([low, high]) = heights {
                (region.min.y, region.max.y) = (region.min.y.max(low), region.max.y.min(high));
            }
            let neighbours = neighbours.into_iter().map(CellId).collect();
            Outline { id: CellId(i as u32), region: Region::Box(region), centre: region.centre(), neighbours }
        };
        let outlines = tree.neighbours().into_iter().enumerate().map(outline).collect();
        let slack = HEIGHT_SLACK * f64::from(self.min_size);
        Ok(Box::new(Regions { tree, outlines, px_per_tan: views.px_per_tan(), heights, slack }))
    }
}

impl OctreeRegions {
    /// The margin, once all settings make sense.
    fn checked(&self, views: &ViewModel) -> Result<f32, Fault> {
        let refuse = |why: String| Err(Fault::Refused(format!("octree-regions: {why}")));
        let (least, margin) = (self.min_size, self.margin.unwrap_or(self.min_size));
        if self.max_triangles == 0 {
            return refuse("max_triangles = 0; a cell that encloses anything would be too full".into());
        }
        if !(least.is_finite() && least > 0.0) {
            return refuse(format!("min_size = {least} is not a length above 0"));
        }
        if let Some(most) = self.max_size.filter(|m| !(m.is_finite() && *m >= least)) {
            return refuse(format!("max_size = {most} is not a length of at least min_size = {least}"));
        }
        if !(margin.is_finite() && margin >= 0.0) {
            return refuse(format!("margin = {margin} is not a length"));
        }
        let [low, high] = views.eye_height;
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return refuse(format!("the eye heights {low}..{high} are no range"));
        }
        Ok(margin)
    }

    /// The root's cube, and when cubes are halved.
    fn root(&self, scene: &Scene, views: &ViewModel, margin: f32) -> Result<(Aabb, Rules), Fault> {
        let [low, high] = views.eye_height;
        let around = if scene.bounds.is_empty() { Aabb::of([Vec3::ZERO]) } else { scene.bounds };
        let (floor, ceiling) = (around.min.y.min(low), around.max.y.max(high));
        let heights = if self.three_dimensional { [floor, ceiling] } else { [low, high] };
        let grow = Vec3::new(margin, 0.0, margin);
        let space = Aabb { min: (around.min - grow).with_y(heights[0]), max: (around.max + grow).with_y(heights[1]) };
        let flat = space.size();
        let extent = flat.x.max(flat.z).max(heights[1] - floor);
        // Half-open cubes: the root has to reach beyond the last viewpoint, not just to it.
        let levels = (0..=MAX_LEVELS).find(|&k| self.min_size * ((1u64 << k) as f32) > extent * 1.000_01);
        let Some(levels) = levels else {
            return Err(Fault::Refused(format!(
                "octree-regions: min_size = {} halves a scene of {extent:.3} across more than {MAX_LEVELS} times",
                self.min_size
            )));
        };
        let edge = self.min_size * (1u64 << levels) as f32;
        let middle = space.centre();
        let min = Vec3::new(middle.x - edge / 2.0, floor, middle.z - edge / 2.0);
        // 1.000 001: a max_size that came by way of other units still means its own power of two.
        let allowed = |k: &u32| self.max_size.is_none_or(|m| edge / (1u64 << k) as f32 <= m * 1.000_001);
        let forced = (0..=levels).find(allowed).unwrap_or(levels);
        let rules = Rules { max_triangles: self.max_triangles, levels, forced, space, max_cells: MAX_CELLS };
        Ok((Aabb { min, max: min + edge }, rules))
    }
}

impl Cells for Regions {
    fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    fn find(&self, camera: &Camera) -> Option<CellId> {
        let mut eye = camera.eye;
        if let Some([low, high]) = self.heights.map(|h| h.map(f64::from)) {
            if !(low - self.slack..=high + self.slack).contains(&eye.y) {
                return None;
            }
            eye.y = eye.y.clamp(low, high);
        }
        self.tree.find(eye).map(CellId)
    }

    fn inside(&self, id: CellId, scene: &Scene, cx: &Context<'_>) -> Result<Cell, Fault> {
        cx.check()?;
        let Some((outline, cube)) = self.outlines.get(id.index()).zip(self.tree.cells.get(id.index())) else {
            return Err(Fault::Refused(format!("octree-regions: cell {} of {}", id.0, self.outlines.len())));
        };
        let ids = (0..scene.chunks.len() as u32).map(ChunkId);
        let far: ChunkSet = ids.filter(|c| !meets(&scene.chunks[c.index()].bounds, cube)).collect();
        let sectors = Window::faces(cube, self.px_per_tan)
            .map(|window| {
                let seen = far.iter().filter(|c| window.is_before(&scene.chunks[c.index()].bounds)).collect();
                Sector { split: SplitId(0), window, seen }
            })
            .to_vec();
        let splits = vec![Split { far, near_budget: None }];
        Ok(Cell { outline: outline.clone(), splits, sectors, own: vec![], claims: vec![] })
    }

    /// An eye on the border of its region stands in a window.
    fn active(&self, cell: &Cell, camera: &Camera) -> Active {
        let edge = self.tree.cells.get(cell.outline.id.index()).map_or(0.0, |c| c.size().x);
        let meets = |s: &u32| {
            let window = &cell.sectors[*s as usize].window;
            sees(camera, window) || leaves_at_once(camera, window, f64::from(IN_WINDOW * edge))
        };
        let sectors = (0..cell.sectors.len() as u32).filter(meets).map(SectorId).collect();
        Active { cell: cell.outline.id, split: SplitId(0), sectors }
    }
}

#[cfg(test)]
mod tests;
