//! `adaptive-grid`: a grid of viewpoints, as dense as a triangle budget demands, with at most one image a view.
//!
//! For walks in large models where the number of original triangles in any frame must never pass a budget, whatever the
//! position and the direction. Follows automatic image placement (Aliaga and Lastra 1999, sections 3 and 5): grid points
//! around the model space; at each a finite cover of all view directions; where a direction has more than the budget, part of
//! what is in view is replaced by an image in front of it. A view uses the closest grid point in its *reverse* frustum: its
//! frustum lies in the point's with the same direction, which therefore sees no less. Points whose image would stand where
//! eyes that use it may be are divided, neighbours with them.
//!
//! Chosen here, where the paper is silent or otherwise:
//!
//! * The model space, where eyes may be, is the scene's box in x and z and the view model's range of eye heights in y. Eyes
//!   elsewhere in the inflated grid are served where a point's star-shape holds them, with the same promise.
//! * The radius of a star-shape is computed from fields of view, pitches and the points there are (`star`), not fixed at two
//!   spacings, so fields of view from 45 degrees are served; the paper's bound was 54. `find` turns to the next point where a
//!   radius does not hold the eye. Radii are sampled, with a margin: that every eye finds a point is tested, not proven; the budget
//!   of the views that do is.
//! * A range of pitches is cut into bins; each is budgeted for all views of the bin together. A fixed pitch is exact.
//! * A cell's claim is of the views for which `find` gives it, with the split that `active` gives: a star-shape also holds eyes
//!   whose reverse frustum does not hold the point, and these use another.
//! * Points that no eye of the model space uses are left out. Points that never see more than the budget have no image and serve
//!   any eye; a scene within the budget gives cells without sectors alone.
//! * The optimisation budget is the budget less 5 % of the scene's triangles (the paper's 5 to 10 %), but at least half the budget.
//! * A budget under what meets at one place of the model space is refused at once: it is drawn there whatever is done.
//!
//! Cost: O(points x (leaves log leaves)) to divide; an inside O(leaves log leaves) and a few searches; O(points) to find.

mod arcs;
mod cells;
mod cone;
mod directions;
mod lattice;
mod least;
mod leaves;
mod placement;
mod settle;
mod star;

use farfield_core::Fault;
use farfield_core::camera::ViewModel;
use farfield_core::context::Context;
use farfield_core::scene::Scene;
use farfield_core::strategy::{Cells, Partition};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use cells::Directions;
use cells::{Grid, TAN_SLACK, TURN_SLACK};
use cone::Cone;
use lattice::Lattice;
use leaves::Leaves;
use placement::Search;
use settle::{Judge, settle};
use star::Stars;

/// The narrowest field of view: below, two rings of points around the model space may leave an eye without one.
const NARROWEST_DEG: f64 = 45.0;
/// Octree depths that [`farfield_core::octree`] reaches.
const MAX_LEAF_DEPTH: u32 = 16;

/// A grid of viewpoints for a triangle budget.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdaptiveGrid {
    /// The most original triangles of any frame; the paper's P.
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub budget: u64,
    /// What images are placed for, so that one serves more directions than that it was placed for; the paper's P_opt. Without it
    /// the budget less 5 % of the scene's triangles, at least half the budget.
    #[serde(default)]
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub opt_budget: Option<u64>,
    /// Grid points along the model space's longest axis, before two more at each end and before any is divided.
    #[serde(default = "points")]
    #[schemars(range(min = 3, max = 100))]
    pub points: u32,
    /// Depth of the octree over the chunks at which cells are kept or replaced as a whole.
    #[serde(default = "leaf_depth")]
    #[schemars(range(min = 0, max = 16))]
    pub leaf_depth: u32,
    /// Weights C, B, B1 and B2 of few triangles left, of the benefits together, of a small image and of a distant one.
    #[serde(default = "cost_benefit")]
    pub cost_benefit: [f64; 4],
    /// Steps that the search for an image looks ahead.
    #[serde(default = "look_ahead")]
    #[schemars(range(min = 0, max = 4))]
    pub look_ahead: u32,
    /// How often a point may be divided; two divisions halve the spacing.
    #[serde(default = "max_level")]
    #[schemars(range(min = 0, max = 16))]
    pub max_level: u32,
    /// Width of the bins of pitches, where the views have more than one.
    #[serde(default = "pitch_bin_deg")]
    #[schemars(range(min = 1.0, max = 90.0), extend("unit" = "deg"))]
    pub pitch_bin_deg: f32,
}

fn points() -> u32 {
    3
}

fn leaf_depth() -> u32 {
    5
}

fn cost_benefit() -> [f64; 4] {
    [0.4, 0.6, 0.1, 0.9]
}

fn look_ahead() -> u32 {
    2
}

fn max_level() -> u32 {
    12
}

fn pitch_bin_deg() -> f32 {
    15.0
}

impl AdaptiveGrid {
    /// The defaults for a budget, triangles.
    pub fn new(budget: u64) -> Self {
        Self {
            budget,
            opt_budget: None,
            points: points(),
            leaf_depth: leaf_depth(),
            cost_benefit: cost_benefit(),
            look_ahead: look_ahead(),
            max_level: max_level(),
            pitch_bin_deg: pitch_bin_deg(),
        }
    }

    /// What images are placed for in a scene, triangles.
    pub fn placed_for(&self, scene: &Scene) -> u64 {
        let less = self.budget.saturating_sub(scene.triangles() / 20).max(self.budget.div_ceil(2));
        self.opt_budget.unwrap_or(less)
    }

    fn check(&self) -> Result<(), Fault> {
        let wrong = |what: String| Err(Fault::Refused(format!("adaptive-grid: {what}")));
        if self.budget == 0 {
            return wrong("budget = 0 leaves nothing to draw".into());
        }
        if let Some(opt) = self.opt_budget.filter(|&o| o == 0 || o > self.budget) {
            return wrong(format!("opt_budget = {opt} is not within 1..={}, the budget", self.budget));
        }
        if !(3..=100).contains(&self.points) {
            return wrong(format!("points = {} is not within 3..=100", self.points));
        }
        if self.leaf_depth > MAX_LEAF_DEPTH {
            return wrong(format!("leaf_depth = {} is above {MAX_LEAF_DEPTH}", self.leaf_depth));
        }
        if self.cost_benefit.iter().any(|w| !(w.is_finite() && *w >= 0.0)) {
            return wrong(format!("cost_benefit = {:?} has a weight that is not 0 or more", self.cost_benefit));
        }
        if self.look_ahead > 4 {
            return wrong(format!("look_ahead = {} is above 4", self.look_ahead));
        }
        if self.max_level > 16 {
            return wrong(format!("max_level = {} is above 16", self.max_level));
        }
        if !(1.0..=90.0).contains(&self.pitch_bin_deg) {
            return wrong(format!("pitch_bin_deg = {} is not within 1..=90", self.pitch_bin_deg));
        }
        Ok(())
    }

    /// The bins of pitches. Where there is a range they overlap a little, for cameras between two.
    fn cones(&self, tan: [f64; 2], pitch: [f64; 2]) -> Vec<Cone> {
        if pitch[0] == pitch[1] {
            return vec![Cone::of(tan, pitch)];
        }
        let width = f64::from(self.pitch_bin_deg).to_radians();
        let count = ((pitch[1] - pitch[0]) / width).ceil();
        let border = |i: f64| pitch[0] + (pitch[1] - pitch[0]) * i / count;
        let bin = |i: u32| [border(f64::from(i)) - TURN_SLACK, border(f64::from(i) + 1.0) + TURN_SLACK];
        (0..count as u32).map(|i| Cone::of(tan, bin(i))).collect()
    }
}

#[typetag::serde(name = "adaptive-grid")]
impl Partition for AdaptiveGrid {
    fn divide(&self, scene: &Scene, views: &ViewModel, cx: &Context<'_>) -> Result<Box<dyn Cells>, Fault> {
        self.check()?;
        let tan = tangents(views)?;
        let pitch = views.pitch_rad.map(f64::from);
        let (low, high) = (scene.bounds.min.as_dvec3(), scene.bounds.max.as_dvec3());
        let heights = views.eye_height.map(f64::from);
        let space = [low.with_y(heights[0]), high.with_y(heights[1])];
        let extent = (high.max(space[1]) - low.min(space[0])).max_element();
        let leaves = Leaves::of(scene, self.leaf_depth, extent);
        if leaves.total > self.budget {
            self.feasible(scene, &leaves, space, extent)?;
        }
        let cones = self.cones(tan, pitch);
        let lattice = Lattice::over(space, self.points, self.max_level);
        let judge = Judge {
            leaves: &leaves,
            cones: &cones,
            stars: Stars::of(tan, pitch),
            space,
            budget: self.budget,
            aim: self.placed_for(scene),
            max_level: self.max_level,
        };
        let (sites, settled) = settle(&judge, lattice, cx)?;
        let longest = (space[1] - space[0]).max_element().max(f64::MIN_POSITIVE);
        let search = Search {
            weights: self.cost_benefit,
            look_ahead: self.look_ahead,
            longest,
            tan,
            budget: self.placed_for(scene),
        };
        Ok(Box::new(Grid::of(&sites, &settled, leaves, cones, search, self.budget, views)))
    }
}

impl AdaptiveGrid {
    /// Refuses a budget under what meets at one place of the model space.
    fn feasible(&self, scene: &Scene, leaves: &Leaves, space: [DVec3; 2], extent: f64) -> Result<(), Fault> {
        let heaviest = |leaves: &Leaves, floor: u64| least::heaviest(&least::within(leaves.boxes(), space), floor);
        let Some((triangles, at)) = heaviest(leaves, self.budget) else { return Ok(()) };
        let mut why = format!(
            "adaptive-grid: budget = {}, and at ({:.3}, {:.3}, {:.3}) leaves of {triangles} triangles meet, which no image can \
             replace there; give at least that",
            self.budget, at.x, at.y, at.z
        );
        if self.leaf_depth < MAX_LEAF_DEPTH {
            let chunks = heaviest(&Leaves::of(scene, MAX_LEAF_DEPTH, extent), 0).map_or(0, |c| c.0);
            if chunks < triangles {
                why += &format!(" (a larger leaf_depth brings it down to {chunks}, that of single chunks)");
            }
        }
        Err(Fault::Refused(why))
    }
}

/// The tangents of half the fields of view, horizontal and vertical, of views that can be served.
fn tangents(views: &ViewModel) -> Result<[f64; 2], Fault> {
    let fov = [views.fov_x_rad(), views.fov_y_rad].map(|f| f64::from(f).to_degrees());
    if fov.iter().any(|f| !(*f >= NARROWEST_DEG - 1e-4 && *f < 180.0)) {
        return Err(Fault::Refused(format!(
            "adaptive-grid: fields of view of {:.2} x {:.2} degrees; with less than {NARROWEST_DEG} the point behind a viewer \
             may be too far away, and its images nearer than the viewer",
            fov[0], fov[1]
        )));
    }
    let [low, high] = views.eye_height;
    if !(low.is_finite() && high.is_finite() && low <= high) {
        return Err(Fault::Refused(format!("adaptive-grid: the eye heights {low}..{high} are no range")));
    }
    let [down, up] = views.pitch_rad;
    if !(down <= up && down >= -std::f32::consts::FRAC_PI_2 && up <= std::f32::consts::FRAC_PI_2) {
        return Err(Fault::Refused(format!(
            "adaptive-grid: the pitches {down}..{up} are no range of -90 to 90 degrees"
        )));
    }
    let camera = views.camera(DVec3::ZERO, 0.0, 0.0);
    Ok([camera.right_tan, camera.top].map(|t| f64::from(t) * (1.0 + TAN_SLACK)))
}
