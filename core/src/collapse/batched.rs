//! Batched mode: passes over all edges, each of collapses that do not change each other's price.
//!
//! A pass prices every edge once and sorts the cheaper ones. Cheapest first, it chooses edges whose price no chosen one changes, up
//! to a limit a little above the price of the edge that would be the last one if all could be had, so that dear edges are not
//! taken while cheaper ones wait. Then it collapses the chosen in the order of their triangles, which is the order of
//! memory. The idea of passes with an error limit is meshoptimizer's (Kapoulkine, simplifier.cpp); choosing first and
//! collapsing in memory's order is not.
//!
//! A refused edge keeps its vertices from others for the pass. Where that starves a pass, the next one tries one edge after
//! the other, cheapest first, and looks at all of them, but takes few: on coarse meshes this is where quality is kept. The
//! last few edges that are wanted are taken in the same way, among the cheap ones.
//!
//! What limits it: about 3 prices an edge of the input for a reduction to a tenth, then the collapses themselves.

use super::mesh::{LiveMesh, others};
use super::prices::{Bits, Prices};
use super::rules::Rules;
use super::{BLOCK, Candidate, Collapsed, Cost, Reach, Settings, resolve};

/// The share of its edges that a pass looks at.
const SHARE: f32 = 0.3;
/// Of so many edges a pass takes one at once, without choosing first: prices that fall while it lasts must not wait for long.
const FEW: usize = 32;

pub(super) fn run<C: Cost + ?Sized>(mesh: LiveMesh, cost: &mut C, settings: &Settings) -> Collapsed {
    let mut touched = Bits::default();
    let mut edges = Edges::new(&mesh);
    let mut chosen = Bits::default();
    let mut ends_of_chosen: Vec<[u32; 2]> = Vec::new();
    let rules = Rules::new(&mesh, settings);
    let mut state = Batched { mesh, cost, rules, collapses: 0, max_cost: 0.0 };
    let mut starved = false;
    while state.mesh.live_triangles() > settings.min_triangles {
        edges.price(&state.mesh, state.cost, settings.max_cost);
        // A collapse takes two triangles.
        let wanted = (state.mesh.live_triangles() - settings.min_triangles).div_ceil(2);
        let order = edges.prices.cheapest(wanted, if starved { 1.0 } else { SHARE });
        let before = state.collapses;
        // The last few are not worth a pass for those that the rules refuse.
        let at_once = starved || wanted * FEW < edges.ends.len();
        touched.clear(state.mesh.vertices());
        chosen.clear(edges.ends.len());
        let mut found = 0;
        for &e in order {
            let ends = edges.ends[e as usize];
            if touched.has(ends[0]) || touched.has(ends[1]) {
                continue;
            }
            if !at_once {
                // Before the collapse: it changes the rings.
                state.touch(ends, &mut touched);
                chosen.insert(e);
                found += 1;
                if found >= wanted {
                    break;
                }
            } else {
                let mut best = [Candidate::FORBIDDEN];
                state.cost.costs(&state.mesh, &[ends], &mut best);
                if state.take(ends, &best[0]) {
                    state.touch(ends, &mut touched);
                    let enough = (state.collapses - before) * FEW > edges.ends.len();
                    if enough || state.mesh.live_triangles() <= settings.min_triangles {
                        break;
                    }
                }
            }
        }
        ends_of_chosen.clear();
        chosen.for_each(|e| ends_of_chosen.push(edges.ends[e]));
        edges.out.clear();
        edges.out.resize(found, Candidate::FORBIDDEN);
        state.cost.costs(&state.mesh, &ends_of_chosen, &mut edges.out);
        for (&ends, best) in ends_of_chosen.iter().zip(&edges.out) {
            if state.mesh.live_triangles() <= settings.min_triangles {
                break;
            }
            state.take(ends, best);
        }
        let done = state.collapses - before;
        if starved && done == 0 {
            break;
        }
        starved = done * 8 < found || done == 0;
    }
    state.mesh.finish(state.collapses, state.max_cost)
}

struct Batched<'a, C: ?Sized> {
    mesh: LiveMesh,
    cost: &'a mut C,
    rules: Rules,
    collapses: usize,
    max_cost: f32,
}

impl<C: Cost + ?Sized> Batched<'_, C> {
    /// Marks the vertices whose edges change price when this edge is collapsed, or has just been.
    fn touch(&self, ends: [u32; 2], touched: &mut Bits) {
        for v in ends {
            touched.insert(v);
            if self.cost.reach() == Reach::Ring {
                self.mesh.triangles_of(v).iter().flat_map(|&t| self.mesh.corners(t)).for_each(|x| touched.insert(x));
            }
        }
    }

    /// Collapses an edge if it may be.
    fn take(&mut self, ends: [u32; 2], &Candidate { cost, place }: &Candidate) -> bool {
        if cost.is_nan() || cost == f32::INFINITY || !self.rules.allow(&self.mesh, ends, place) {
            return false;
        }
        let (from, onto, at) = resolve(&self.mesh, ends, place);
        self.cost.collapsed(&self.mesh, from, onto, at);
        self.mesh.apply(from, onto, at);
        self.collapses += 1;
        self.max_cost = self.max_cost.max(cost);
        true
    }
}

struct Edges {
    /// Triangles that were alive at the last pass.
    living: Vec<u32>,
    /// The odd vertices.
    odd: Vec<u32>,
    /// Edges that may be collapsed, in the order of their triangles, some twice where the mesh is not a manifold.
    ends: Vec<[u32; 2]>,
    /// What they cost.
    prices: Prices,
    block: Vec<[u32; 2]>,
    out: Vec<Candidate>,
}

impl Edges {
    fn new(mesh: &LiveMesh) -> Self {
        Self {
            living: (0..mesh.all_triangles() as u32).collect(),
            odd: (0..mesh.vertices() as u32).filter(|&v| mesh.is_odd(v)).collect(),
            ends: Vec::new(),
            prices: Prices::default(),
            block: vec![[0; 2]; BLOCK + 3],
            out: Vec::new(),
        }
    }

    /// Prices every edge.
    fn price<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32) {
        self.ends.clear();
        self.prices.clear();
        let mut alive = 0;
        for i in 0..self.living.len() {
            let t = self.living[i];
            self.living[alive] = t;
            alive += mesh.is_alive(t) as usize;
        }
        self.living.truncate(alive);
        let mut filled = 0;
        for i in 0..self.living.len() {
            // A balanced edge runs up its ids in one of its triangles. No branch: it would be mispredicted every other time.
            let [a, b, c] = mesh.corners(self.living[i]);
            for [a, b] in [[a, b], [b, c], [c, a]] {
                self.block[filled] = [a, b];
                filled += (a < b) as usize;
            }
            if filled >= BLOCK {
                self.ask(mesh, cost, max_cost, std::mem::take(&mut filled));
            }
        }
        self.odd.iter_mut().for_each(|v| *v = mesh.survivor(*v));
        self.odd.sort_unstable();
        self.odd.dedup();
        for i in 0..self.odd.len() {
            let a = self.odd[i];
            for &t in mesh.triangles_of(a) {
                let [b, _] = others(mesh.corners(t), a);
                if a > b && mesh.is_odd(b) && !runs(mesh, b, a) {
                    self.block[filled] = [b, a];
                    filled += 1;
                }
                if filled >= BLOCK {
                    self.ask(mesh, cost, max_cost, std::mem::take(&mut filled));
                }
            }
        }
        self.ask(mesh, cost, max_cost, filled);
    }

    /// Prices the first `filled` edges of `block`.
    fn ask<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32, filled: usize) {
        self.out.resize(filled, Candidate::FORBIDDEN);
        cost.costs(mesh, &self.block[..filled], &mut self.out);
        for (&ends, c) in self.block.iter().zip(&self.out) {
            if c.cost <= max_cost && c.cost < f32::INFINITY {
                self.ends.push(ends);
                self.prices.push(c.cost);
            }
        }
    }
}

/// Whether a triangle runs from a to b.
fn runs(mesh: &LiveMesh, a: u32, b: u32) -> bool {
    mesh.triangles_of(a).iter().any(|&t| others(mesh.corners(t), a)[0] == b)
}
