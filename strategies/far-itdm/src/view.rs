//! Run time: which scan cubes a view is put together from.
//!
//! Follows Wilson and Manocha 2003, section 4.3: the cube whose sample is nearest to the eye is chosen with all its ancestors, the intra
//! cube first and down the tree to it, then the next nearest with its own, until a budget of cubes, or of triangles in the view frustum, is
//! spent; where the budget ends within a line of ancestors, its rest is left out. Cubes are drawn with their projected textures.
//! A cube's parts are culled to the frustum one by one. O(cubes log cubes + parts) a frame.

use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef};
use farfield_core::strategy::{Achieved, Candidate, DrawBudget, FarView, View};

use crate::index::{Cube, Index};

/// An opened cell.
pub(crate) struct Cubes {
    pub(crate) asset: AssetId,
    pub(crate) index: Index,
    /// The settings' budget; a view may have a lower one.
    pub(crate) budget: DrawBudget,
    /// Pixels that surfaces may be off by.
    pub(crate) error_px: f32,
}

/// The cubes that a view is put together from, in the order of drawing, and whether a budget cut them short.
struct Chosen {
    cubes: Vec<usize>,
    budget_hit: bool,
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

    fn choose(&self, view: &View<'_>) -> Chosen {
        let least = |a: Option<u64>, b: Option<u64>| a.into_iter().chain(b).min();
        let most_cubes = least(self.budget.payloads.map(u64::from), view.budget.payloads.map(u64::from));
        let most_triangles = least(self.budget.triangles, view.budget.triangles);
        let mut chosen = Chosen { cubes: vec![], budget_hit: false };
        let mut triangles = 0;
        for nearest in self.nearest(view) {
            let mut line = vec![nearest];
            while let Some(parent) = self.index.cubes[line[line.len() - 1]].parent {
                line.push(parent as usize);
            }
            for cube in line.into_iter().rev() {
                if chosen.cubes.contains(&cube) {
                    continue;
                }
                triangles += in_view(&self.index.cubes[cube], view).map(|p| p.triangles).sum::<u64>();
                let over = |most: Option<u64>, now: u64| most.is_some_and(|m| now > m);
                if over(most_cubes, chosen.cubes.len() as u64 + 1) || over(most_triangles, triangles) {
                    chosen.budget_hit = true;
                    return chosen;
                }
                chosen.cubes.push(cube);
            }
        }
        chosen
    }
}

/// A cube's parts that the view may see.
fn in_view<'a>(cube: &'a Cube, view: &'a View<'_>) -> impl Iterator<Item = &'a crate::index::Piece> + 'a {
    cube.pieces.iter().filter(|p| view.camera.may_see(&p.bounds))
}

impl FarView for Cubes {
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>) {
        let chosen = self.choose(view).cubes;
        let rest = self.nearest(view).into_iter().filter(|i| !chosen.contains(i));
        for (rank, cube) in chosen.iter().copied().chain(rest).enumerate() {
            let c = &self.index.cubes[cube];
            out.push(Candidate {
                block: Block::Payload(self.payload(cube)),
                bytes: c.bytes,
                bounds: c.bounds,
                // The first cubes show most: what is missing without a cube falls with its rank.
                error_px_without: view.camera.size[1] as f32 / (rank + 1) as f32,
                in_view: rank < chosen.len(),
                after: c.parent.map(|p| Block::Payload(self.payload(p as usize))),
            });
        }
    }

    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved {
        let chosen = self.choose(view);
        let mut achieved = Achieved { budget_hit: chosen.budget_hit, ..Achieved::default() };
        for cube in chosen.cubes {
            let (id, c) = (self.payload(cube), &self.index.cubes[cube]);
            if !resident(Block::Payload(id)) {
                achieved.missing += 1;
                continue;
            }
            achieved.error_px = self.error_px;
            out.extend(in_view(c, view).map(|p| Draw {
                what: DrawWhat::Payload { id, part: p.part, object: c.object },
                bounds: p.bounds,
                error_px: self.error_px,
            }));
        }
        achieved
    }
}
