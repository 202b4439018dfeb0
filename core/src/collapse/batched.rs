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
//! Prices that depend on whole rings ([`Reach::Ring`]) are dear. An edge keeps its own from pass to pass until something in its rings collapses, and
//! is priced again right before it is taken: then other edges of its rings may be chosen for the same pass, as long as they share
//! no vertex, and what has become dearer than anything that was chosen waits.
//!
//! What limits it: about 3 prices an edge of the input for a reduction to a tenth, then the collapses themselves.

use super::mesh::{LiveMesh, others};
use super::prices::{Bits, Prices};
use super::rules::Rules;
use super::undo::{Log, settle};
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
    let ring = cost.reach() == Reach::Ring;
    let log = cost.verifies().then(|| Log::new(&mesh));
    let mut state = Batched { mesh, cost, rules, ring, stale: Bits::default(), log, collapses: 0, max_cost: 0.0 };
    state.stale.clear(state.mesh.vertices());
    let mut starved = false;
    while state.mesh.live_triangles() > settings.min_triangles {
        if ring {
            edges.price_stale(&state.mesh, state.cost, &mut state.stale, settings.max_cost);
        } else {
            edges.price(&state.mesh, state.cost, settings.max_cost);
        }
        // A collapse takes two triangles.
        let wanted = (state.mesh.live_triangles() - settings.min_triangles).div_ceil(2);
        let Edges { ends: all, prices, .. } = &mut edges;
        let order = prices.cheapest(wanted, if starved { 1.0 } else { SHARE });
        let before = state.collapses;
        // The last few are not worth a pass for those that the rules refuse.
        let at_once = starved || wanted * FEW < all.len();
        touched.clear(state.mesh.vertices());
        chosen.clear(all.len());
        let (mut found, mut dearest) = (0, 0);
        for &e in order {
            let ends = all[e as usize];
            if touched.has(ends[0]) || touched.has(ends[1]) {
                continue;
            }
            if !at_once {
                ends.iter().for_each(|&v| touched.insert(v));
                chosen.insert(e);
                (found, dearest) = (found + 1, e);
                if found >= wanted {
                    break;
                }
            } else {
                let mut best = [Candidate::FORBIDDEN];
                state.cost.costs(&state.mesh, &[ends], &mut best);
                if best[0].cost <= settings.max_cost && state.take(ends, &best[0]) {
                    state.touch(ends, &mut touched);
                    let enough = (state.collapses - before) * FEW > all.len();
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
        let limit = if ring && found > 0 { edges.prices.of(dearest).min(settings.max_cost) } else { settings.max_cost };
        if !ring {
            state.cost.costs(&state.mesh, &ends_of_chosen, &mut edges.out);
        }
        for (&ends, best) in ends_of_chosen.iter().zip(&mut edges.out) {
            if state.mesh.live_triangles() <= settings.min_triangles {
                break;
            }
            if ring {
                state.cost.costs(&state.mesh, &[ends], std::slice::from_mut(best));
            }
            if best.cost <= limit {
                state.take(ends, best);
            }
        }
        let done = state.collapses - before;
        if starved && done == 0 {
            break;
        }
        starved = done * 8 < found || done == 0;
    }
    // Looking over the whole takes memory of its own.
    drop((edges, chosen, touched, ends_of_chosen));
    state.finish(settings)
}

struct Batched<'a, C: ?Sized> {
    mesh: LiveMesh,
    cost: &'a mut C,
    rules: Rules,
    /// Costs depend on rings.
    ring: bool,
    /// Where they do: vertices in whose rings something collapsed since their edges were priced.
    stale: Bits,
    /// Where the cost looks everything over at the end.
    log: Option<Log>,
    collapses: usize,
    max_cost: f32,
}

impl<C: Cost + ?Sized> Batched<'_, C> {
    /// Marks the vertices whose edges have changed price with this edge's collapse.
    fn touch(&self, ends: [u32; 2], touched: &mut Bits) {
        for v in ends {
            touched.insert(v);
            if self.ring {
                self.mesh.triangles_of(v).iter().flat_map(|&t| self.mesh.corners(t)).for_each(|x| touched.insert(x));
            }
        }
    }

    fn finish(mut self, settings: &Settings) -> Collapsed {
        if let Some(log) = &mut self.log {
            (self.collapses, self.max_cost) = settle(&mut self.mesh, self.cost, log, settings);
        }
        self.mesh.finish(self.collapses, self.max_cost)
    }

    /// Collapses an edge if it may be.
    fn take(&mut self, ends: [u32; 2], &Candidate { cost, place }: &Candidate) -> bool {
        if cost.is_nan() || cost == f32::INFINITY || !self.rules.allow(&self.mesh, ends, place) {
            return false;
        }
        let (from, onto, at) = resolve(&self.mesh, ends, place);
        self.cost.collapsed(&self.mesh, from, onto, at);
        self.log.iter_mut().for_each(|l| l.collapse(&self.mesh, from));
        if self.ring {
            // Before it: the third corner of a triangle that vanishes may be no neighbour afterwards.
            for v in [from, onto] {
                self.mesh.triangles_of(v).iter().flat_map(|&t| self.mesh.corners(t)).for_each(|x| self.stale.insert(x));
            }
        }
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
    /// Where prices are kept: for each triangle those of its three edges that run up their ids; NaN before the first.
    kept: Vec<[f32; 3]>,
    /// Where the prices of `block` are kept.
    slots: Vec<[u32; 2]>,
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
            kept: Vec::new(),
            slots: Vec::new(),
            block: vec![[0; 2]; BLOCK + 3],
            out: Vec::new(),
        }
    }

    /// Prices every edge.
    fn price<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32) {
        self.begin(mesh);
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
        self.price_odd(mesh, cost, max_cost, filled);
    }

    /// Prices the edges of stale vertices and those that are new; takes what is kept of the others.
    fn price_stale<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, stale: &mut Bits, max_cost: f32) {
        self.begin(mesh);
        self.kept.resize(mesh.all_triangles(), [f32::NAN; 3]);
        let edges = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
        let mut filled = 0;
        for i in 0..self.living.len() {
            let t = self.living[i];
            for (k, [a, b]) in edges(mesh.corners(t)).into_iter().enumerate() {
                if a < b && (self.kept[t as usize][k].is_nan() || stale.has(a) || stale.has(b)) {
                    self.block[filled] = [a, b];
                    self.slots.push([t, k as u32]);
                    filled += 1;
                }
            }
            if filled >= BLOCK {
                self.keep(mesh, cost, std::mem::take(&mut filled));
            }
        }
        self.keep(mesh, cost, filled);
        stale.clear(mesh.vertices());
        for &t in &self.living {
            for ([a, b], price) in edges(mesh.corners(t)).into_iter().zip(self.kept[t as usize]) {
                if a < b && price <= max_cost && price < f32::INFINITY {
                    self.ends.push([a, b]);
                    self.prices.push(price);
                }
            }
        }
        self.price_odd(mesh, cost, max_cost, 0);
    }

    /// Prices the first `filled` edges of `block` and keeps what they cost; what is not a number is infinite.
    fn keep<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, filled: usize) {
        self.out.resize(filled, Candidate::FORBIDDEN);
        cost.costs(mesh, &self.block[..filled], &mut self.out);
        for ([t, k], c) in self.slots.drain(..).zip(&self.out) {
            self.kept[t as usize][k as usize] = if c.cost.is_nan() { f32::INFINITY } else { c.cost };
        }
    }

    /// At the start of a pass: no edges, and the triangles that are left.
    fn begin(&mut self, mesh: &LiveMesh) {
        self.ends.clear();
        self.prices.clear();
        let mut alive = 0;
        for i in 0..self.living.len() {
            let t = self.living[i];
            self.living[alive] = t;
            alive += mesh.is_alive(t) as usize;
        }
        self.living.truncate(alive);
    }

    /// Prices what is in `block`, and edges of odd vertices that no triangle runs up.
    fn price_odd<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C, max_cost: f32, mut filled: usize) {
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
