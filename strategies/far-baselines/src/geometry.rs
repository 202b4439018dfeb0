//! `geometry`: no far field at all, the baselines that others are measured against.
//!
//! Follows the comparison of textured LOD meshes (2003, section 4): configuration A draws all polygons of the scene,
//! configuration B those that view-frustum culling leaves. Here culling goes by chunk: O(chunks) a frame. Nothing is built and
//! nothing is claimed: what is drawn is the scene.

use farfield_core::Fault;
use farfield_core::cell::Cell;
use farfield_core::context::Context;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Achieved, Candidate, CellJob, Covers, FarField, FarView, LeftOut, Needs, Sink, View};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// All geometry, near and far.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AllGeometry {
    /// Draw only the chunks that the view may see (B) instead of all of them (A).
    #[serde(default = "culling")]
    pub frustum_culling: bool,
}

fn culling() -> bool {
    true
}

struct Plain {
    frustum_culling: bool,
}

#[typetag::serde(name = "geometry")]
impl FarField for AllGeometry {
    fn needs(&self, _scene: &Scene, _cell: Option<&Cell>) -> Result<Needs, Fault> {
        Ok(Needs {
            scene_asset: false,
            cell_asset: false,
            captures: false,
            neighbour_cells: false,
            covers: Covers::Everything,
            left_out: vec![LeftOut {
                stage: "preprocessing".into(),
                reason: "geometry is drawn as it is".into(),
                decided: "plan".into(),
            }],
        })
    }

    fn bake_cell(&self, _job: &CellJob<'_>, _out: &dyn Sink, _cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        Ok(vec![])
    }

    fn open(&self, _shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        if !cell.1.is_empty() {
            let cause = format!("{} bytes where plain geometry keeps none", cell.1.len());
            return Err(Fault::Data { place: format!("asset {}", cell.0.0), cause });
        }
        Ok(Box::new(Plain { frustum_culling: self.frustum_culling }))
    }
}

impl Plain {
    fn chosen(&self, view: &View<'_>) -> ChunkSet {
        let all = view.scene.all_chunks();
        if self.frustum_culling { view.scene.cull(&all, view.camera) } else { all }
    }
}

impl FarView for Plain {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        // Objects that share a mesh share its chunks: one block each, at the first object that places it.
        let mut told = std::collections::BTreeSet::new();
        for c in &view.scene.chunks {
            if told.insert(c.source) {
                let info = &view.scene.meshes[c.source.mesh.index()].chunks[c.source.chunk as usize];
                out.push(Candidate {
                    block: Block::Chunk(c.source),
                    bytes: info.bytes(),
                    bounds: c.bounds,
                    error_px_without: f32::INFINITY,
                    in_view: !self.frustum_culling || view.camera.may_see(&c.bounds),
                    after: None,
                });
            }
        }
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let wanted = self.chosen(view);
        let there: ChunkSet =
            wanted.iter().filter(|c| resident(Block::Chunk(view.scene.chunks[c.index()].source))).collect();
        let missing = (wanted.len() - there.len()) as u32;
        if !there.is_empty() {
            out.push(Draw { what: DrawWhat::Chunks(there), bounds: view.scene.bounds, error_px: 0.0 });
        }
        Achieved { error_px: 0.0, missing, budget_hit: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Camera;
    use farfield_core::cell::Active;
    use farfield_core::id::{CellId, MaterialId, SplitId};
    use farfield_core::mesh::TriangleMesh;
    use farfield_core::scene::{Material, Placement, SceneBuilder};
    use glam::{DAffine3, DVec3, Vec3};

    fn scene() -> Scene {
        let mut b = SceneBuilder::default();
        b.materials.push(Material::default());
        let shape = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![0, 1, 2],
            sections: vec![(0..3, MaterialId(0))],
            ..Default::default()
        };
        let mesh = b.mesh("speck", shape).unwrap();
        for x in [-50.0, 0.0, 50.0] {
            b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)) });
        }
        b.build().unwrap()
    }

    fn drawn(frustum_culling: bool, resident: bool) -> (usize, u32, usize) {
        let scene = scene();
        let far = AllGeometry { frustum_culling };
        let open = far.open(None, (AssetId(0), &[])).unwrap();
        let camera = Camera::looking(DVec3::new(0.0, 0.5, 10.0), -Vec3::Z, Vec3::Y, 1.0, [8, 8], 0.1);
        let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
        let view = View {
            scene: &scene,
            camera: &camera,
            at: &at,
            tolerance: &|_| 0.0,
            budget: Default::default(),
            cell: None,
        };
        let (mut draws, mut wanted) = (vec![], vec![]);
        let achieved = open.draw(&|_| resident, &view, &mut draws);
        open.wanted(&view, &mut wanted);
        let count = |d: &Draw| match &d.what {
            DrawWhat::Chunks(c) => c.len(),
            DrawWhat::Payload { .. } => panic!("plain geometry has no payloads"),
        };
        (draws.iter().map(count).sum(), achieved.missing, wanted.len())
    }

    #[test]
    fn all_or_what_the_view_may_see_is_drawn_and_what_is_not_there_is_counted() {
        assert_eq!(drawn(false, true), (3, 0, 1));
        assert_eq!(drawn(true, true), (1, 0, 1));
        assert_eq!(drawn(false, false), (0, 3, 1));
    }

    #[test]
    fn an_index_that_it_did_not_write_is_refused() {
        assert!(AllGeometry { frustum_culling: true }.open(None, (AssetId(4), &[1])).is_err());
    }
}
