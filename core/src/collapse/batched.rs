//! Batched mode: passes over all edges, each of collapses that do not change each other's price.
//!
//! A pass prices every edge once, sorts the cheaper ones and takes them cheapest first, but none whose price an earlier one of the
//! pass has changed: those wait for the next pass. It ends at a limit, a little above the price of the edge that would be
//! the last one if nothing were refused, so that dear edges are not taken while cheaper ones wait. The idea of passes with
//! an error limit is meshoptimizer's (Kapoulkine, simplifier.cpp); there are no heap and no edge structure to keep up.
//!
//! What limits it: about 10 prices an edge in all, and the random reads of the collapses themselves.

use super::mesh::{LiveMesh, Marks, others};
use super::rules::Rules;
use super::{BLOCK, Candidate, Collapsed, Cost, Reach, Settings, resolve};

/// The share of its edges that a pass looks at.
const SHARE: f32 = 0.3;
/// A pass ends at this multiple of the price of its last wanted edge.
const SLACK: f32 = 1.5;

pub(super) fn run<C: Cost + ?Sized>(mut mesh: LiveMesh, cost: &mut C, settings: &Settings) -> Collapsed {
    let vertices = mesh.positions().len();
    let mut rules = Rules::new(&mesh, settings);
    let mut touched = Marks::new(vertices);
    let mut edges = Edges { marks: Marks::new(vertices), order: Vec::new(), block: Vec::new(), out: Vec::new() };
    let (mut collapses, mut max_cost) = (0, 0f32);
    let mut share = SHARE;
    while mesh.live_triangles() > settings.min_triangles {
        edges.price(&mesh, cost, settings.max_cost);
        // A collapse takes two triangles.
        let wanted = (mesh.live_triangles() - settings.min_triangles).div_ceil(2);
        let limit = edges.cheapest(wanted, share);
        touched.clear();
        let before = collapses;
        for &(price, ends) in &edges.order {
            if mesh.live_triangles() <= settings.min_triangles || price > limit {
                break;
            }
            if touched.has(ends[0]) || touched.has(ends[1]) {
                continue;
            }
            let mut best = [Candidate::FORBIDDEN];
            cost.costs(&mesh, &[ends], &mut best);
            if !(best[0].cost < f32::INFINITY) || !rules.allow(&mesh, ends, best[0].place) {
                continue;
            }
            let (from, onto, at) = resolve(&mesh, ends, best[0].place);
            if cost.reach() == Reach::Ring {
                for v in ends {
                    mesh.triangles_of(v).iter().flat_map(|&t| mesh.corners(t)).for_each(|x| _ = touched.insert(x));
                }
            }
            touched.insert(from);
            touched.insert(onto);
            cost.collapsed(&mesh, from, onto, at);
            mesh.apply(from, onto, at);
            collapses += 1;
            max_cost = max_cost.max(price);
        }
        // Nothing to be had among the cheap ones: look at all, then give up.
        if collapses > before {
            share = SHARE;
        } else if share < 1.0 {
            share = 1.0;
        } else {
            break;
        }
    }
    mesh.finish(collapses, max_cost)
}

struct Edges {
    marks: Marks,
    /// Price and ends.
    order: Vec<(f32, [u32; 2])>,
    block: Vec<[u32; 2]>,
    out: Vec<Candidate>,
}

impl Edges {
    /// Fills `order` with every edge that may be collapsed.
    fn price<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32) {
        self.order.clear();
        self.block.clear();
        for v in 0..mesh.positions().len() as u32 {
            self.marks.clear();
            for &t in mesh.triangles_of(v) {
                for x in others(mesh.corners(t), v) {
                    if x > v && self.marks.insert(x) {
                        self.block.push([v, x]);
                    }
                }
            }
            if self.block.len() >= BLOCK {
                self.ask(mesh, cost, max_cost);
            }
        }
        self.ask(mesh, cost, max_cost);
    }

    fn ask<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32) {
        self.out.clear();
        self.out.resize(self.block.len(), Candidate::FORBIDDEN);
        cost.costs(mesh, &self.block, &mut self.out);
        for (ends, c) in self.block.drain(..).zip(&self.out) {
            if c.cost <= max_cost && c.cost < f32::INFINITY {
                self.order.push((c.cost, ends));
            }
        }
    }

    /// Keeps the cheapest `share` in `order`, sorted, and returns the price at which the pass should end.
    fn cheapest(&mut self, wanted: usize, share: f32) -> f32 {
        let keep = ((self.order.len() as f32 * share) as usize).max(64).min(self.order.len());
        let by_price = |a: &(f32, [u32; 2]), b: &(f32, [u32; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if keep < self.order.len() {
            self.order.select_nth_unstable_by(keep, by_price);
            self.order.truncate(keep);
        }
        self.order.sort_unstable_by(by_price);
        match self.order.get(wanted.min(keep).saturating_sub(1)) {
            Some(&(price, _)) if share < 1.0 && wanted < keep => price * SLACK,
            _ => f32::MAX,
        }
    }
}
