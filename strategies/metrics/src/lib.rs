//! Metrics: whether one viewpoint's samples serve a whole cell (visibility), and what collapsing an edge costs
//! (simplification).

mod appearance;
pub mod candidates;
mod deviation;
mod hausdorff;
mod measured;
mod quadric;
mod self_occlusion;
mod silhouette_weighted;
mod void_surface;

pub use appearance::Appearance;
pub use hausdorff::Hausdorff;
pub use quadric::Quadric;
pub use self_occlusion::SelfOcclusion;
pub use silhouette_weighted::{Normals, SilhouetteWeighted};
pub use void_surface::{Candidates, Unseen, VoidSurface, Voids};
