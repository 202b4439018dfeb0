use super::GenerateError;
use farfield_core::mesh::TriangleMesh;
use glam::{DAffine3, DVec2};
pub const PLANT_1M: u64 = 1_000_000;
pub const LEAST_PLANT: u64 = 100_000;
pub const MOST_PLANT: u64 = 12_500_000;
pub const PLANT_EYE: f64 = 31.7;
pub struct PlantSettings {
    pub triangles: u64,
    pub seed: u64,
}
pub struct PlantScene {
    pub meshes: Vec<(String, TriangleMesh)>,
    pub placements: Vec<(usize, DAffine3)>,
    pub route: Vec<DVec2>,
}
pub fn plant(_: &PlantSettings) -> Result<PlantScene, GenerateError> {
    todo!()
}
