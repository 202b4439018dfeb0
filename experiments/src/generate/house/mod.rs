//! A one-storey house, furnished and textured, in its garden.
//!
//! It stands for the house of Wilson and Manocha 2003 ("Simplifying Complex Environments Using Incremental Textured Depth Meshes"), of which the
//! paper says that it has one storey and 262,879 triangles with colours, normals and texture coordinates at the vertices, and 19
//! megabytes of textures, and that it was divided into regions 2 m wide; everything else is this generator's. Units are metres. Eight
//! rooms of 15 x 11 m are joined by open doorways around a hall ([`plan`]); walls are slabs with holes for doors and windows ([`shell`]), through
//! which the garden is seen ([`garden`]); the rooms are furnished as befits them ([`furniture`]).
//!
//! **Surfaces** are one-sided and closed. Colours at the vertices carry a baked light: dark in corners and on the ground, bright near
//! windows. Ten textures ([`textures`]) are made from the seed and repeat, 19 MiB in all.
//!
//! **Sizes.** Plan and furniture are the same for every total; roundings, leaves, books' covers and the squares of walls get finer
//! ([`super::detail`]). Each room's walls, floor and ceiling are objects of their own. The seed chooses the books, and the textures' grain.
//!
//! **Route.** A closed walk through all rooms that keeps 0.2 m from everything at [`HOUSE_EYE`]. O(triangles): 1 s for the paper's total, most
//! of it for textures and for counting triangles at several levels.

mod furniture;
mod garden;
mod plan;
mod shell;
mod stuff;
#[cfg(test)]
mod tests;
mod textures;

use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Texture};
use glam::{DAffine3, DVec2};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::GenerateError;
use super::detail::levels;

/// The paper's total.
pub const HOUSE_PAPER: u64 = 262_879;
/// Least total.
pub const LEAST_HOUSE: u64 = 45_000;
/// Greatest total.
pub const MOST_HOUSE: u64 = 4_000_000;
/// The eye of a standing person above the scene's lowest point, the underside of the lawn: 1.6 m above the floors.
pub const HOUSE_EYE: f64 = 1.6 - garden::BOTTOM as f64;

/// Lowest and highest level of detail.
const LEVELS: [u32; 2] = [0, 60];

/// What house to make.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct HouseSettings {
    /// Triangles in the scene, all instances counted, 45,000 to 4 million; met within 2 %. The paper's house has 262,879.
    pub triangles: u64,
    /// Seed of books and textures.
    pub seed: u64,
}

impl Default for HouseSettings {
    fn default() -> Self {
        Self { triangles: HOUSE_PAPER, seed: 1 }
    }
}

/// A house as plain data. Metres; the floors are y = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct HouseScene {
    /// Meshes with their names; their sections name [`Self::materials`].
    pub meshes: Vec<(String, TriangleMesh)>,
    /// Which mesh, and from its space to the scene. Turned and moved, never scaled.
    pub placements: Vec<(usize, DAffine3)>,
    /// Materials; one has no texture.
    pub materials: Vec<Material>,
    /// Textures, 19 MiB.
    pub textures: Vec<Texture>,
    /// Corners (x, z) of a closed walk through the rooms.
    pub route: Vec<DVec2>,
}

impl HouseScene {
    /// Triangles of all instances together.
    pub fn triangles(&self) -> u64 {
        self.placements.iter().map(|p| self.meshes[p.0].1.triangles() as u64).sum()
    }
}

/// The house.
///
/// # Errors
/// If the total is out of [`LEAST_HOUSE`]..=[`MOST_HOUSE`].
pub fn house(settings: &HouseSettings) -> Result<HouseScene, GenerateError> {
    let asked = settings.triangles;
    if !(LEAST_HOUSE..=MOST_HOUSE).contains(&asked) {
        return Err(GenerateError::Total { what: "a house", asked, least: LEAST_HOUSE, most: MOST_HOUSE });
    }
    let mut things = shell::shell();
    things.extend(furniture::furniture(settings.seed));
    things.extend(garden::garden());
    let counts: Vec<u64> = things.iter().map(|t| t.at.len() as u64).collect();
    let levels = levels(asked, &counts, LEVELS, |i, level| (things[i].make)(level).triangles() as u64);
    let meshes = things.par_iter().zip(&levels).map(|(t, &level)| (t.name.clone(), (t.make)(level))).collect();
    let placements = things.iter().enumerate().flat_map(|(i, t)| t.at.iter().map(move |&at| (i, at))).collect();
    let (materials, textures) = stuff::materials(settings.seed);
    let route = plan::ROUTE.iter().map(|&[x, z]| DVec2::new(x.into(), z.into())).collect();
    Ok(HouseScene { meshes, placements, materials, textures, route })
}
