//! The octree of regions: cubes that are halved while they hold too much, walked down to the one that holds a point.
//!
//! Cubes are half-open, [min, max) on every axis, and a cube and its neighbours share the very numbers of their common faces: each
//! point of the root lies in exactly one leaf. Leaves are numbered in the order of the walk, x fastest.
//!
//! Dividing hands every node the chunks that meet it out of its parent's: O(sum over the nodes of the chunks that meet their
//! parents), O(chunks log(root / least)) where chunks are small. O(depth) to find, O(depth + found) a face for neighbours.

use farfield_core::{Aabb, Fault};
use glam::{BVec3, DVec3, Vec3};

/// What stands in a corner of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Child {
    /// Outside the space of viewpoints.
    Nothing,
    /// A leaf.
    Cell(u32),
    /// Halved again.
    Node(u32),
}

/// A cube that was halved.
#[derive(Clone, Debug)]
struct Node {
    middle: Vec3,
    children: [Child; 8],
}

/// When a cube is halved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// The most triangles of a cell.
    pub(crate) max_triangles: u64,
    /// Halvings from the root to the smallest cube.
    pub(crate) levels: u32,
    /// Halvings that are made whatever a cube holds.
    pub(crate) forced: u32,
    /// Viewpoints are asked for in this box; cubes beside it are left out.
    pub(crate) space: Aabb,
    /// More cells than this are refused.
    pub(crate) max_cells: usize,
}

/// The octree.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    root: Aabb,
    top: Child,
    nodes: Vec<Node>,
    /// The leaves' cubes.
    pub(crate) cells: Vec<Aabb>,
}

/// The part of a halved cube in corner `i`.
fn part(cube: &Aabb, middle: Vec3, i: usize) -> Aabb {
    let high = BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
    Aabb { min: Vec3::select(high, middle, cube.min), max: Vec3::select(high, cube.max, middle) }
}

/// Whether two boxes meet, faces included.
pub(crate) fn meets(a: &Aabb, b: &Aabb) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// Whether a half-open cube holds a point of a closed box.
fn holds_some(cube: &Aabb, space: &Aabb) -> bool {
    cube.min.cmple(space.max).all() && cube.max.cmpgt(space.min).all()
}

impl Tree {
    /// Divides `root`. `chunks` are the placed chunks' boxes and triangles.
    ///
    /// # Errors
    /// [`Fault::Refused`] where more cells would be made than the rules allow.
    pub(crate) fn over(root: Aabb, rules: &Rules, chunks: &[(Aabb, u32)]) -> Result<Self, Fault> {
        let mut tree = Self { root, top: Child::Nothing, nodes: vec![], cells: vec![] };
        let all = (0..chunks.len() as u32).collect();
        tree.top = tree.divide(root, 0, rules, chunks, all)?;
        Ok(tree)
    }

    fn divide(
        &mut self,
        cube: Aabb,
        depth: u32,
        rules: &Rules,
        chunks: &[(Aabb, u32)],
        mut inside: Vec<u32>,
    ) -> Result<Child, Fault> {
        if !holds_some(&cube, &rules.space) {
            return Ok(Child::Nothing);
        }
        inside.retain(|&i| meets(&chunks[i as usize].0, &cube));
        let triangles: u64 = inside.iter().map(|&i| u64::from(chunks[i as usize].1)).sum();
        if depth == rules.levels || (depth >= rules.forced && triangles <= rules.max_triangles) {
            if self.cells.len() == rules.max_cells {
                return Err(Fault::Refused(format!(
                    "octree-regions: more than {} cells; raise min_size or max_triangles",
                    rules.max_cells
                )));
            }
            self.cells.push(cube);
            return Ok(Child::Cell(self.cells.len() as u32 - 1));
        }
        let (id, middle) = (self.nodes.len(), cube.centre());
        self.nodes.push(Node { middle, children: [Child::Nothing; 8] });
        for i in 0..8 {
            let child = self.divide(part(&cube, middle, i), depth + 1, rules, chunks, inside.clone())?;
            self.nodes[id].children[i] = child;
        }
        Ok(Child::Node(id as u32))
    }

    /// The leaf that holds a point; `None` beside all of them.
    pub(crate) fn find(&self, p: DVec3) -> Option<u32> {
        if !(p.cmpge(self.root.min.as_dvec3()).all() && p.cmplt(self.root.max.as_dvec3()).all()) {
            return None;
        }
        let mut at = self.top;
        loop {
            match at {
                Child::Nothing => return None,
                Child::Cell(c) => return Some(c),
                Child::Node(n) => {
                    let node = &self.nodes[n as usize];
                    at = node.children[p.cmpge(node.middle.as_dvec3()).bitmask() as usize];
                }
            }
        }
    }

    /// For each leaf those that share some of its faces' area, ascending.
    pub(crate) fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut out = vec![vec![]; self.cells.len()];
        let mut found = vec![];
        for i in 0..self.cells.len() {
            for axis in 0..3 {
                self.beyond(self.top, &self.root, &self.cells[i], axis, &mut found);
                for j in found.drain(..) {
                    out[i].push(j);
                    out[j as usize].push(i as u32);
                }
            }
        }
        out.iter_mut().for_each(|n| n.sort_unstable());
        out
    }

    /// The leaves under `at` that lie against the high face of `cell` on an axis.
    fn beyond(&self, at: Child, cube: &Aabb, cell: &Aabb, axis: usize, out: &mut Vec<u32>) {
        let plane = cell.max[axis];
        let beside = |k: usize| cube.min[k] < cell.max[k] && cell.min[k] < cube.max[k];
        if !(cube.min[axis] <= plane && plane < cube.max[axis] && (0..3).all(|k| k == axis || beside(k))) {
            return;
        }
        match at {
            Child::Nothing => {}
            Child::Cell(c) => out.push(c),
            Child::Node(n) => {
                let node = &self.nodes[n as usize];
                for i in 0..8 {
                    self.beyond(node.children[i], &part(cube, node.middle, i), cell, axis, out);
                }
            }
        }
    }
}
