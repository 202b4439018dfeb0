//! A coal-fired power plant: an open steel building around a boiler, full of walkways, machines and pipes.
//!
//! It stands for the power plant of the University of North Carolina, which Wilson and Manocha 2003 ("Simplifying Complex Environments Using
//! Incremental Textured Depth Meshes") and many others measured on: 80 m tall, 12.5 million triangles, colours and normals at the
//! vertices, objects of very different sizes and density. Everything else is this generator's. Units are metres.
//!
//! **Building** ([`layout`]). 60 x 60 x 80 m at every total: columns each 10 m, 16 storeys of 5 m, beams ([`steel`]); in the middle a
//! boiler whose walls are parallel tubes ([`boiler`]), ducts to a stack, mills under coal bunkers, turbines; walkways of grating with railings
//! along the lines of columns; tanks, heat exchangers, pumps, tube banks, headers, cabinets and fans in the bays ([`machines`]); and
//! through what is left, pipes of twelve bores in bundles with bends, flanges, valves and tees ([`super::pipes`]).
//!
//! **Sizes.** From a total to one twice as large the share of walkways and machines, the number of pipes and the fineness of all parts
//! ([`super::detail`]) grow together. Each part is made once and placed many times. Totals are met within 2 %.
//!
//! **Route.** A closed way along the walkways of one storey, beside the boiler and out to the perimeter, at [`PLANT_EYE`].
//! O(parts + cells of the pipes' lattice), seconds for 12.5 million triangles.

mod boiler;
mod layout;
mod machines;
mod model;
mod steel;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use farfield_core::mesh::TriangleMesh;
use glam::{DAffine3, DVec2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::GenerateError;
use super::detail::levels;
use super::pipes::{Part, part_mesh, pipework};
use model::Placed;

/// The total where nothing is said.
pub const PLANT_1M: u64 = 1_000_000;
/// Least total.
pub const LEAST_PLANT: u64 = 100_000;
/// Greatest total: the original's.
pub const MOST_PLANT: u64 = 12_500_000;
/// Thickness of the ground, whose underside is the scene's lowest point.
const GROUND: f64 = 0.5;
/// The eye of someone on the route's walkway, above the scene's lowest point.
pub const PLANT_EYE: f64 = GROUND + 5.0 * layout::ROUTE_STOREY as f64 + 1.7;

/// Lowest and highest level of detail.
const LEVELS: [u32; 2] = [0, 80];
/// Cells of pipe at [`PLANT_1M`], and how their number goes with the total below and above it: small totals go to the steel first.
const PIPE_CELLS_1M: f64 = 7_000.0;
const PIPE_POWERS: [f64; 2] = [1.4, 0.75];
/// How the share of walkways and machines goes with the total.
const SHARE_POWER: f64 = 0.5;

/// What plant to make.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlantSettings {
    /// Triangles in the scene, all instances counted, 100,000 to 12.5 million; met within 2 %. The original has 12.5 million.
    pub triangles: u64,
    /// Seed of walkways, machines and pipes.
    pub seed: u64,
}

impl Default for PlantSettings {
    fn default() -> Self {
        Self { triangles: PLANT_1M, seed: 1 }
    }
}

/// A plant as plain data. Metres; the ground is y = 0, the middle x = z = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantScene {
    /// The meshes of the parts that occur, with their names.
    pub meshes: Vec<(String, TriangleMesh)>,
    /// The parts: which mesh, and from its space to the scene. Turned and moved, never scaled.
    pub placements: Vec<(usize, DAffine3)>,
    /// Corners (x, z) of a closed way along walkways.
    pub route: Vec<DVec2>,
}

impl PlantScene {
    /// Triangles of all instances together.
    pub fn triangles(&self) -> u64 {
        self.placements.iter().map(|p| self.meshes[p.0].1.triangles() as u64).sum()
    }
}

/// The plant.
///
/// # Errors
/// If the total is out of [`LEAST_PLANT`]..=[`MOST_PLANT`].
pub fn plant(settings: &PlantSettings) -> Result<PlantScene, GenerateError> {
    let asked = settings.triangles;
    if !(LEAST_PLANT..=MOST_PLANT).contains(&asked) {
        return Err(GenerateError::Total { what: "a plant", asked, least: LEAST_PLANT, most: MOST_PLANT });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let share = (asked as f64 / MOST_PLANT as f64).powf(SHARE_POWER);
    let (mut parts, space) = layout::layout(share, &mut rng);
    parts.extend(pipes(asked, &space, &mut rng));
    parts.retain(|p| !p.at.is_empty());
    let counts: Vec<u64> = parts.iter().map(|p| p.at.len() as u64).collect();
    let levels = levels(asked, &counts, LEVELS, |i, level| (parts[i].make)(level).triangles() as u64);
    let meshes = parts.par_iter().zip(&levels).map(|(p, &level)| (p.name.clone(), (p.make)(level))).collect();
    let placements = parts.iter().enumerate().flat_map(|(i, p)| p.at.iter().map(move |&at| (i, at))).collect();
    let route = layout::ROUTE.map(|[x, z]| DVec2::new(x.into(), z.into())).to_vec();
    Ok(PlantScene { meshes, placements, route })
}

/// Pipes through what is free, each kind of piece with its places.
fn pipes(asked: u64, space: &layout::Space, rng: &mut ChaCha8Rng) -> Vec<Placed> {
    let times = asked as f64 / PLANT_1M as f64;
    let cells = PIPE_CELLS_1M * times.powf(PIPE_POWERS[usize::from(times > 1.0)]);
    let mut kinds: BTreeMap<Part, Vec<DAffine3>> = BTreeMap::new();
    for (part, at) in pipework(layout::CELLS, |c| space.taken(c), cells as usize, rng) {
        kinds.entry(part).or_default().push(at);
    }
    let placed = |(part, at): (Part, Vec<DAffine3>)| Placed {
        name: part.name(),
        // Three sides more than other things have of levels: pipes are what one looks at.
        make: Box::new(move |level| part_mesh(part, 3 + level)),
        at,
    };
    kinds.into_iter().map(placed).collect()
}
