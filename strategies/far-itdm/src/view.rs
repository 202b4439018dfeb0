//! Run time: which scan cubes a view is put together from.
//!
//! Follows Wilson and Manocha 2003, section 4.3: the cube whose sample is nearest to the eye is chosen with all its ancestors, the intra
//! cube first and down the tree to it, then the next nearest with its own, until a budget of cubes, or of triangles in the view frustum, is
//! spent; where the budget ends within a line of ancestors, its rest is left out. Cubes are drawn with their projected textures.
//! A cube's parts are culled to the frustum one by one. O(cubes log cubes + parts) a frame.

use farfield_core::cell::Cell;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef, SplitId};
use farfield_core::strategy::{Achieved, Candidate, FarView, View};
use glam::DVec3;

use crate::index::{Cube, Index};

/// An opened cell.
pub(crate) struct Cubes {
    pub(crate) asset: AssetId,
    pub(crate) index: Index,
    /// The most cubes that make a picture, whatever the view's budget: of samples that keep their skins the nearest alone.
    pub(crate) most: Option<u64>,
    /// How far surfaces may be off, as a tangent seen from the region's corners and from their sample.
    pub(crate) error_tan: f32,
}

impl Cubes {
    fn payload(&self, cube: usize) -> PayloadRef {
        PayloadRef { asset: self.asset, id: LocalPayload(self.index.cubes[cube].payload) }
    }

    /// All cubes of the active split, nearest to the eye first.
    fn nearest(&self, view: &View<'_>) -> Vec<usize> {
        let cubes = &self.index.cubes;
        let distance = |i: &usize| cubes[*i].eye.distance(view.camera.eye);
        let mut order: Vec<usize> = (0..cubes.len()).filter(|&i| cubes[i].split == view.at.split.0).collect();
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        order
    }

    /// All cubes of the active split in the order in which a view takes them: lines of ancestors, each from its root.
    fn order(&self, view: &View<'_>) -> Vec<usize> {
        let mut order = vec![];
        for nearest in self.nearest(view) {
            let parent = |&i: &usize| self.index.cubes[i].parent.map(|p| p as usize);
            let line: Vec<usize> = std::iter::successors(Some(nearest), parent).collect();
            let new: Vec<usize> = line.into_iter().rev().filter(|i| !order.contains(i)).collect();
            order.extend(new);
        }
        order
    }

    /// How many of the cubes in order the budgets allow.
    fn within_budget(&self, order: &[usize], view: &View<'_>) -> usize {
        let most_cubes = self.most.into_iter().chain(view.budget.payloads.map(u64::from)).min().unwrap_or(u64::MAX);
        let most_triangles = view.budget.triangles.unwrap_or(u64::MAX);
        let mut triangles = 0;
        let fits = |&(n, cube): &(usize, &usize)| {
            triangles += in_view(&self.index.cubes[*cube], view).map(|p| p.triangles).sum::<u64>();
            (n as u64) < most_cubes && triangles <= most_triangles
        };
        order.iter().enumerate().take_while(fits).count()
    }
}

/// A cube's parts that the view may see.
fn in_view<'a>(cube: &'a Cube, view: &'a View<'_>) -> impl Iterator<Item = &'a crate::index::Piece> + 'a {
    cube.pieces.iter().filter(|p| view.camera.may_see(&p.bounds))
}

impl FarView for Cubes {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        let order = self.order(view);
        let chosen = self.within_budget(&order, view);
        for (rank, cube) in order.into_iter().enumerate() {
            let c = &self.index.cubes[cube];
            out.push(Candidate {
                block: Block::Payload(self.payload(cube)),
                bytes: c.bytes,
                bounds: c.bounds,
                // The first cubes show most: what is missing without a cube falls with its rank.
                error_px_without: view.camera.size[1] as f32 / (rank + 1) as f32,
                in_view: rank < chosen,
                after: c.parent.map(|p| Block::Payload(self.payload(p as usize))),
            });
        }
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let order = self.order(view);
        let chosen = self.within_budget(&order, view);
        let mut achieved = Achieved { budget_hit: chosen < order.len(), ..Achieved::default() };
        for &cube in &order[..chosen] {
            let (id, c) = (self.payload(cube), &self.index.cubes[cube]);
            if !resident(Block::Payload(id)) {
                achieved.missing += 1;
                continue;
            }
            let error_px = self.error_tan * view.camera.px_per_tan();
            achieved.error_px = error_px;
            out.extend(in_view(c, view).map(|p| Draw {
                what: DrawWhat::Payload { id, part: p.part, object: c.object },
                bounds: p.bounds,
                error_px,
            }));
        }
        achieved
    }

    fn viewpoints(&self, _cell: &Cell, split: SplitId) -> Vec<DVec3> {
        self.index.cubes.iter().filter(|c| c.split == split.0).map(|c| c.eye).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Piece;
    use farfield_core::cell::{Active, Outline};
    use farfield_core::id::{CellId, MaterialId};
    use farfield_core::mesh::TriangleMesh;
    use farfield_core::region::Region;
    use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
    use farfield_core::strategy::DrawBudget;
    use farfield_core::{Aabb, Camera};
    use glam::{DAffine3, Vec3};

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
        b.place(Placement { mesh, transform: DAffine3::IDENTITY });
        b.build().unwrap()
    }

    /// Five samples along x: 2 is the root, 1 and 3 its children, 0 and 4 theirs. Each has ten triangles ahead and a hundred
    /// behind. Cubes stand in the order of the tree.
    fn cubes() -> Cubes {
        let piece = |part: u16, z: f32, triangles: u64| Piece {
            part,
            triangles,
            bounds: Aabb { min: Vec3::new(-9.0, -1.0, z - 0.1), max: Vec3::new(9.0, 1.0, z) },
        };
        let cube = |payload: u32, x: f64, parent: Option<u32>| Cube {
            payload,
            split: 0,
            eye: DVec3::new(x, 0.0, 0.0),
            parent,
            object: 1,
            bytes: 1000,
            bounds: Aabb { min: Vec3::splat(-9.0), max: Vec3::splat(9.0) },
            pieces: vec![piece(1, -5.0, 10), piece(2, 5.0, 100)],
            points: 0,
            kept: 0,
            mended: 0,
            dense_triangles: 0,
            texels: 0,
        };
        let parts = [(2.0, None), (1.0, Some(0)), (3.0, Some(0)), (0.0, Some(1)), (4.0, Some(2))];
        let cubes = parts.iter().enumerate().map(|(i, (x, p))| cube(i as u32, *x, *p)).collect();
        Cubes { asset: AssetId(7), index: Index { cubes }, most: None, error_tan: 0.01 }
    }

    /// The payloads drawn from an eye at x looking along -z, in order; whether a budget was hit; what is missing.
    fn drawn(budget: (Option<u32>, Option<u64>), x: f64, resident: impl Fn(u32) -> bool) -> (Vec<u32>, bool, u32) {
        let scene = scene();
        let camera = Camera::looking(DVec3::new(x, 0.0, 0.0), -Vec3::Z, Vec3::Y, 1.0, [8, 8], 0.1);
        let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
        let budget = DrawBudget { payloads: budget.0, triangles: budget.1 };
        let far = cubes();
        let view = View { scene: &scene, camera: &camera, at: &at, tolerance: &|_| 0.0, budget, cell: None };
        let (mut draws, mut wanted) = (vec![], vec![]);
        let there = |b: Block| matches!(b, Block::Payload(p) if resident(p.id.0));
        let achieved = far.draw(&there, &view, &mut draws);
        far.wanted(&view, &mut wanted);
        assert_eq!(wanted.len(), 5, "cubes that are not chosen are wanted too, later");
        for (i, c) in wanted.iter().enumerate() {
            assert!(c.after.is_none_or(|b| wanted[..i].iter().any(|w| w.block == b)), "a parent comes first");
        }
        let id = |d: &Draw| match d.what {
            DrawWhat::Payload { id, part: 1, .. } => id.id.0,
            _ => panic!("what stands behind is culled"),
        };
        (draws.iter().map(id).collect(), achieved.budget_hit, achieved.missing)
    }

    #[test]
    fn the_nearest_sample_comes_with_its_ancestors_and_then_the_next_nearest() {
        assert_eq!(drawn((None, None), 3.9, |_| true), (vec![0, 2, 4, 1, 3], false, 0));
        assert_eq!(drawn((None, None), 1.9, |_| true), (vec![0, 1, 2, 3, 4], false, 0));
    }

    #[test]
    fn a_budget_of_cubes_cuts_a_line_of_ancestors_from_its_end() {
        assert_eq!(drawn((Some(3), None), 3.9, |_| true), (vec![0, 2, 4], true, 0));
        assert_eq!(drawn((Some(2), None), 3.9, |_| true), (vec![0, 2], true, 0));
        assert!(!drawn((Some(5), None), 3.9, |_| true).1);
    }

    #[test]
    fn a_budget_of_triangles_counts_those_within_the_frustum() {
        assert_eq!(drawn((None, Some(39)), 3.9, |_| true), (vec![0, 2, 4], true, 0));
        assert_eq!(drawn((None, Some(9)), 3.9, |_| true), (vec![], true, 0));
    }

    #[test]
    fn a_cube_that_is_not_there_is_counted() {
        assert_eq!(drawn((None, None), 3.9, |id| id != 2), (vec![0, 4, 1, 3], false, 1));
    }

    #[test]
    fn viewpoints_are_the_samples_places_split_by_split() {
        let mut far = cubes();
        far.index.cubes[3].split = 1;
        let outline = Outline { id: CellId(0), region: Region::Everywhere, centre: Vec3::ZERO, neighbours: vec![] };
        let cell = Cell { outline, splits: vec![], sectors: vec![], own: vec![], claims: vec![] };
        let x = |split: u32| -> Vec<f64> { far.viewpoints(&cell, SplitId(split)).iter().map(|e| e.x).collect() };
        assert_eq!((x(0), x(1), x(2)), (vec![2.0, 1.0, 3.0, 4.0], vec![0.0], vec![]));
    }
}
