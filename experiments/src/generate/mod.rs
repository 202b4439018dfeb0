//! Scenes made from nothing but a seed, for those who have no models at hand.
//!
//! [`park`] is a statuary park after the one that system T was measured on: eight kinds of procedurally sculpted statues with
//! that scene's triangle counts, sizes, numbers and area, at any total from 100,000 to 64 million triangles; or the same
//! park from mesh files, fitted to the same boxes ([`fit`]). [`pipes`] is a box full of pipework, from 10,000 to 16 million.
//! [`house`] is a furnished and textured house in its garden, from 45,000 to 4 million; [`plant`] a power plant, from 100,000 to 12.5 million; both
//! bring a route along. [`mod@asteroid`] is one closed surface, from 768 triangles to a billion, for tests of models larger than memory.
//! Everything here is a pure function of its settings: the same settings give the same bytes, whatever the number of threads.

pub mod asteroid;
mod creatures;
mod detail;
mod figures;
pub mod fit;
mod forms;
pub mod house;
mod kind;
mod march;
mod noise;
pub mod park;
pub mod pipes;
pub mod plant;
mod quadrupeds;
mod remesh;
mod sculpt;
mod sdf;
mod shade;
mod shapes;
mod solid;
#[cfg(test)]
mod tests;

pub use asteroid::{ASTEROID_1M, AsteroidSettings, LEAST_ASTEROID, MOST_ASTEROID, asteroid};
pub use fit::{Up, fit_to_box};
pub use house::{HOUSE_EYE, HOUSE_PAPER, HouseScene, HouseSettings, LEAST_HOUSE, MOST_HOUSE, house};
pub use kind::{Kind, PAPER_MODELS, PaperModel};
pub use park::{Layout, PARK_2M, PARK_4M, PARK_8M, ParkScene, ParkSettings, Placement, layout, park, park_of};
pub use pipes::{LEAST_PIPES, MOST_PIPES, PIPES_1M, PipesScene, PipesSettings, gallery_height, pipes};
pub use plant::{LEAST_PLANT, MOST_PLANT, PLANT_1M, PLANT_EYE, PlantScene, PlantSettings, plant};
pub use sculpt::{LEAST_TRIANGLES, MOST_TRIANGLES, sculpt};

/// Why a scene could not be generated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// A scene's total is out of range.
    #[error("{what} of {asked} triangles: the total must be between {least} and {most}")]
    Total {
        /// What scene.
        what: &'static str,
        /// What was asked for.
        asked: u64,
        /// Least total.
        least: u64,
        /// Greatest total.
        most: u64,
    },
    /// A statue's triangle count is out of range.
    #[error("a {kind} of {asked} triangles: the count must be between {least} and {most}")]
    Triangles {
        /// Name of the kind.
        kind: &'static str,
        /// What was asked for.
        asked: u32,
        /// Least count.
        least: u32,
        /// Greatest count.
        most: u32,
    },
    /// A mesh cannot be fitted to a box.
    #[error("the mesh cannot be fitted to a box: {cause}")]
    Fit {
        /// What is wrong with it.
        cause: &'static str,
    },
    /// The collapse refused the mesh.
    #[error("sculpting: {0}")]
    Collapse(String),
}

impl From<farfield_core::Fault> for GenerateError {
    fn from(fault: farfield_core::Fault) -> Self {
        GenerateError::Collapse(fault.to_string())
    }
}
