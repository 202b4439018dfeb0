//! Exact mode: the cheapest allowed edge, always (Garland and Heckbert 1997, section 4.1).
//!
//! Each triangle knows the ids of its three edges, so edges need no lists of their own and no hashing: a vertex's edges are
//! those of its triangles. After a collapse the survivor's edges are priced anew in one call (with [`Reach::Ring`] its
//! neighbours' too). An edge that the rules refuse is held and comes back when a triangle at one of its ends has changed.
//!
//! What limits it: memory latency. A collapse touches some 12 triangles, 14 vertices and 20 edges that lie where they lay in the
//! input. Loops over rings have no branches that depend on data, beside their ends: those cost as much as memory does.

use super::mesh::{LiveMesh, corner, has};
use super::prices::Bits;
use super::queue::Queue;
use super::rules::Rules;
use super::spots::Spots;
use super::undo::{Log, settle};
use super::{BLOCK, Candidate, Collapsed, Cost, Reach, Settings, resolve};

struct Exact<'a, C: ?Sized> {
    mesh: LiveMesh,
    cost: &'a mut C,
    queue: Queue,
    spots: Spots,
    /// Vertices that may have held edges.
    held: Bits,
    /// Edge k of a triangle joins its corners k and k + 1.
    edges_of: Vec<[u32; 3]>,
    /// Neighbours that the collapse at hand leaves without an edge to the survivor.
    left: Vec<u32>,
    /// The third vertices of the triangles of the edge at hand.
    apexes: Vec<u32>,
    prices: Prices,
}

/// Buffers for one call of [`Cost::costs`].
#[derive(Default)]
struct Prices {
    ids: Vec<u32>,
    ends: Vec<[u32; 2]>,
    out: Vec<Candidate>,
}

impl Prices {
    fn clear(&mut self) {
        self.ids.clear();
        self.ends.clear();
    }

    fn push(&mut self, edge: u32, a: u32, b: u32) {
        self.ids.push(edge);
        self.ends.push([a.min(b), a.max(b)]);
    }

    fn ask<C: Cost + ?Sized>(&mut self, mesh: &LiveMesh, cost: &mut C) {
        self.out.clear();
        self.out.resize(self.ends.len(), Candidate::FORBIDDEN);
        cost.costs(mesh, &self.ends, &mut self.out);
    }
}

pub(super) fn run<C: Cost + ?Sized>(mesh: LiveMesh, cost: &mut C, settings: &Settings) -> Collapsed {
    let mut rules = Rules::new(&mesh, settings);
    let mut state = Exact::new(mesh, cost, settings.max_cost);
    let mut log = state.cost.verifies().then(|| Log::new(&state.mesh));
    let (mut collapses, mut max_cost) = (0, 0f32);
    while state.mesh.live_triangles() > settings.min_triangles
        && let Some((edge, price)) = state.queue.pop()
    {
        let ends = state.queue.ends(edge);
        let mut best = [Candidate::FORBIDDEN];
        state.cost.costs(&state.mesh, &[ends], &mut best);
        if best[0].cost.is_nan() || best[0].cost == f32::INFINITY || !rules.allow(&state.mesh, ends, best[0].place) {
            state.queue.hold(edge);
            ends.iter().for_each(|&v| state.held.insert(v));
            continue;
        }
        let (from, onto, at) = resolve(&state.mesh, ends, best[0].place);
        state.cost.collapsed(&state.mesh, from, onto, at);
        state.merge_edges(edge, from, onto);
        log.iter_mut().for_each(|l| l.collapse(&state.mesh, from));
        state.mesh.apply(from, onto, at);
        state.reprice(onto);
        collapses += 1;
        max_cost = max_cost.max(price);
    }
    if let Some(log) = &mut log {
        (collapses, max_cost) = settle(&mut state.mesh, state.cost, log, settings);
    }
    state.mesh.finish(collapses, max_cost)
}

impl<'a, C: Cost + ?Sized> Exact<'a, C> {
    fn new(mesh: LiveMesh, cost: &'a mut C, max_cost: f32) -> Self {
        let vertices = mesh.vertices();
        let mut edges_of = vec![[0; 3]; mesh.all_triangles()];
        let mut queue = Queue::new(max_cost);
        let mut spots = Spots::new(vertices);
        let mut held = Bits::default();
        held.clear(vertices);
        for v in 0..vertices as u32 {
            spots.clear();
            // The first time that a plain edge is met, if its triangles are looked at in this order, is the one that runs forwards.
            let plain = !mesh.is_odd(v) && !mesh.is_border(v);
            for way in [0, 1] {
                for &t in mesh.triangles_of(v) {
                    let (k, x) = spokes(mesh.corners(t), v)[way];
                    if x < v {
                        continue;
                    }
                    let known = if plain && way == 0 { None } else { spots.get(x) };
                    let edge = known.unwrap_or_else(|| queue.add([v, x]));
                    edges_of[t as usize][k] = edge;
                    if way == 0 || !plain {
                        spots.insert(x, edge);
                    }
                }
            }
        }
        let mut prices = Prices::default();
        let all = queue.len() as u32;
        for first in (0..all).step_by(BLOCK) {
            prices.clear();
            for e in first..(first + BLOCK as u32).min(all) {
                let [a, b] = queue.ends(e);
                prices.push(e, a, b);
            }
            prices.ask(&mesh, cost);
            for (i, &e) in prices.ids.iter().enumerate() {
                queue.set(e, prices.ends[i], prices.out[i].cost);
            }
        }
        Self { mesh, cost, queue, spots, held, edges_of, left: Vec::new(), apexes: Vec::new(), prices }
    }

    /// Gives the edges of `from` over to `onto` before the mesh does so with the triangles: an edge to a common neighbour
    /// becomes the one that `onto` has already.
    fn merge_edges(&mut self, edge: u32, from: u32, onto: u32) {
        let Self { mesh, queue, spots, edges_of, apexes, left, .. } = self;
        queue.remove(edge);
        spots.clear();
        apexes.clear();
        apexes.resize(mesh.triangles_of(onto).len() + 1, 0);
        let mut filled = 0;
        // Balanced edges are met once or more often each way: one way will do.
        let ways = 1 + mesh.is_odd(onto) as usize;
        for &t in mesh.triangles_of(onto) {
            let around = spokes(mesh.corners(t), onto);
            for (k, x) in &around[..ways] {
                spots.insert(*x, edges_of[t as usize][*k]);
            }
            let [x, y] = around.map(|s| s.1);
            apexes[filled] = x ^ y ^ from;
            filled += ((x == from) | (y == from)) as usize;
        }
        apexes.truncate(filled);
        for &t in mesh.triangles_of(from) {
            for (k, x) in spokes(mesh.corners(t), from) {
                // `onto` itself is not on its ring.
                let e = &mut edges_of[t as usize][k];
                if let Some(kept) = spots.get(x)
                    && kept != *e
                {
                    queue.remove(*e);
                    *e = kept;
                }
            }
        }
        // An edge that only dying triangles have dies with them. A balanced one has one more.
        left.clear();
        let twice = || apexes.iter().enumerate().any(|(i, w)| apexes[..i].contains(w));
        if ways == 1 && !twice() {
            return;
        }
        for &w in apexes.iter() {
            let keeps = |v, partner| {
                mesh.triangles_of(v).iter().map(|&t| mesh.corners(t)).any(|c| has(c, w) && !has(c, partner))
            };
            if !keeps(onto, from) && !keeps(from, onto) {
                if let Some(e) = spots.get(w) {
                    queue.remove(e);
                }
                left.push(w);
            }
        }
    }

    /// Asks the costs of all edges that the collapse onto `v` may have changed, and lets held ones near it try again.
    fn reprice(&mut self, v: u32) {
        let Self { mesh, cost, queue, held, edges_of, left, prices, .. } = self;
        prices.clear();
        // Some twice where the mesh is not a manifold.
        let ways = 1 + mesh.is_odd(v) as usize;
        for &t in mesh.triangles_of(v) {
            for (k, x) in &spokes(mesh.corners(t), v)[..ways] {
                prices.push(edges_of[t as usize][*k], v, *x);
            }
        }
        let own = prices.ids.len();
        let reach = cost.reach();
        for i in 0..own + left.len() {
            let w = if i < own { other(prices.ends[i], v) } else { left[i - own] };
            if reach == Reach::Ring {
                for &t in mesh.triangles_of(w) {
                    for (k, x) in spokes(mesh.corners(t), w) {
                        if x != v {
                            prices.push(edges_of[t as usize][k], w, x);
                        }
                    }
                }
            } else if held.has(w) {
                held.remove(w);
                for &t in mesh.triangles_of(w) {
                    spokes(mesh.corners(t), w).iter().for_each(|&(k, _)| queue.release(edges_of[t as usize][k]));
                }
            }
        }
        prices.unique(own);
        prices.ask(mesh, *cost);
        for (i, &e) in prices.ids.iter().enumerate() {
            queue.set(e, prices.ends[i], prices.out[i].cost);
        }
    }
}

impl Prices {
    /// Drops repeated edges from `first` on.
    fn unique(&mut self, first: usize) {
        if self.ids.len() == first {
            return;
        }
        let mut tail: Vec<(u32, [u32; 2])> = self.ids.drain(first..).zip(self.ends.drain(first..)).collect();
        tail.sort_unstable();
        tail.dedup();
        for (e, ends) in tail {
            self.ids.push(e);
            self.ends.push(ends);
        }
    }
}

/// The end of an edge beside `v`.
#[inline]
fn other(ends: [u32; 2], v: u32) -> u32 {
    ends[0] ^ ends[1] ^ v
}

/// The two edges of a triangle at its corner `v`, each with its other end.
#[inline]
fn spokes(corners: [u32; 3], v: u32) -> [(usize, u32); 2] {
    let [at, next, last] = corner(corners, v);
    [(at, corners[next]), (last, corners[last])]
}
