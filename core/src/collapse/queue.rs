//! The priority queue of exact mode: what is cheap lies sorted, the rest where it is.
//!
//! When nothing is ready, about the cheapest eighth of all that wait is sorted into a run that is then read from front to back,
//! and the limit rises. A price that falls below the limit later goes into a small heap beside the run. Neither is ever
//! searched: an entry whose edge has another price or other ends by the time that its turn comes is dropped. The order that
//! edges come out in is exactly that of one big heap, but a change of price is one store, and one push where it falls below
//! the limit. Costs are compared as numbers, ties by the smaller vertex ids.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::prices::{key, price};

#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Forbidden, too dear, dead or just popped.
    Out,
    /// Above the limit.
    Waiting,
    /// In the run or in the heap.
    Ready,
    /// Refused by the rules for now.
    Held,
}

#[derive(Clone, Copy)]
struct Edge {
    /// Smaller id first.
    ends: [u32; 2],
    cost: f32,
    state: State,
}

/// Cost, ends and id of an edge in one integer that orders as they do.
#[inline]
fn entry(e: &Edge, id: u32) -> u128 {
    let [a, b] = e.ends;
    (key(e.cost) as u128) << 96 | (a as u128) << 64 | (b as u128) << 32 | id as u128
}

pub(super) struct Queue {
    edges: Vec<Edge>,
    /// Sorted; read up to `next`.
    run: Vec<u128>,
    next: usize,
    heap: BinaryHeap<Reverse<u128>>,
    /// What costs at most this is ready.
    limit: f32,
    max_cost: f32,
}

/// Leading bits of a price that tell where the limit may lie: sign, exponent and five of the mantissa.
const COARSE: u32 = 14;
/// At least so many become ready at once.
const FEW: usize = 4096;

impl Queue {
    pub(super) fn new(max_cost: f32) -> Self {
        let heap = BinaryHeap::new();
        Self { edges: Vec::new(), run: Vec::new(), next: 0, heap, limit: f32::NEG_INFINITY, max_cost }
    }

    /// A new edge, not queued yet.
    #[inline]
    pub(super) fn add(&mut self, ends: [u32; 2]) -> u32 {
        self.edges.push(Edge { ends, cost: f32::INFINITY, state: State::Out });
        self.edges.len() as u32 - 1
    }

    pub(super) fn len(&self) -> usize {
        self.edges.len()
    }

    #[inline]
    pub(super) fn ends(&self, edge: u32) -> [u32; 2] {
        self.edges[edge as usize].ends
    }

    /// Puts an edge in, or changes what it costs and joins. Forbidden and too dear ones are taken out.
    #[inline]
    pub(super) fn set(&mut self, edge: u32, ends: [u32; 2], cost: f32) {
        // f32::MAX stands for "no limit", infinity for "forbidden"; NaN is neither below nor above.
        let wanted = cost <= self.max_cost && cost < f32::INFINITY;
        let ready = wanted && cost <= self.limit;
        let state = if wanted { State::Waiting } else { State::Out };
        let new = Edge { ends, cost, state: if ready { State::Ready } else { state } };
        let old = std::mem::replace(&mut self.edges[edge as usize], new);
        if ready && (old.state != State::Ready || old.cost != cost || old.ends != ends) {
            self.heap.push(Reverse(entry(&new, edge)));
        }
    }

    /// Takes an edge out for good.
    #[inline]
    pub(super) fn remove(&mut self, edge: u32) {
        self.edges[edge as usize].state = State::Out;
    }

    /// Sets an edge that was just popped aside until [`Queue::release`].
    pub(super) fn hold(&mut self, edge: u32) {
        self.edges[edge as usize].state = State::Held;
    }

    /// Puts a held edge back at its old cost; others stay as they are.
    #[inline]
    pub(super) fn release(&mut self, edge: u32) {
        let e = self.edges[edge as usize];
        if e.state == State::Held {
            self.set(edge, e.ends, e.cost);
        }
    }

    /// The cheapest edge and its cost.
    pub(super) fn pop(&mut self) -> Option<(u32, f32)> {
        loop {
            let next = match (self.run.get(self.next), self.heap.peek()) {
                (Some(first), top) if top.is_none_or(|top| *first <= top.0) => {
                    self.next += 1;
                    *first
                }
                (_, Some(_)) => self.heap.pop()?.0,
                (_, None) => {
                    self.refill();
                    self.run.first()?;
                    continue;
                }
            };
            let edge = next as u32;
            let e = &mut self.edges[edge as usize];
            if e.state == State::Ready && entry(e, edge) == next {
                e.state = State::Out;
                return Some((edge, e.cost));
            }
        }
    }

    /// Makes the cheapest of those that wait ready.
    fn refill(&mut self) {
        const SHIFT: u32 = 32 - COARSE;
        self.run.clear();
        self.next = 0;
        let mut histogram = vec![0u32; 1 << COARSE];
        let mut all = 0;
        for e in &self.edges {
            let waits = e.state == State::Waiting;
            histogram[(key(e.cost) >> SHIFT) as usize] += waits as u32;
            all += waits as usize;
        }
        if all == 0 {
            return;
        }
        let share = (all / 8).max(FEW).min(all);
        let mut below = 0;
        let reaches = |count: &u32| {
            below += *count as usize;
            below >= share
        };
        let bucket = histogram.iter().position(reaches).unwrap_or_default() as u32;
        self.limit = price(bucket << SHIFT | ((1 << SHIFT) - 1));
        // One more, so that there is always a place to write to.
        let mut taken = vec![0; below + 1];
        let mut filled = 0;
        for (e, id) in self.edges.iter_mut().zip(0..) {
            // No branch: it would be mispredicted at every other edge.
            let take = (e.state == State::Waiting) & (e.cost <= self.limit);
            taken[filled] = id;
            filled += take as usize;
            e.state = if take { State::Ready } else { e.state };
        }
        self.run.extend(taken[..filled].iter().map(|&id| entry(&self.edges[id as usize], id)));
        self.run.sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// What is queued, in order: cost as its key, ends, edge.
    type Model = BTreeMap<(u32, [u32; 2]), u32>;

    #[test]
    fn edges_come_out_as_from_one_sorted_map_whatever_happens_between() {
        for seed in 0..4 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut queue = Queue::new(0.9);
            let mut model = Model::new();
            let mut costs = Vec::new();
            // Few distinct costs in odd runs: ties are common. More edges than become ready at once.
            let any = |rng: &mut ChaCha8Rng| match rng.random_range(0..20) {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => -0.0,
                _ if seed % 2 == 0 => rng.random_range(-1.0..1.0),
                _ => rng.random_range(-10..10) as f32 / 10.0,
            };
            let allowed = |c: f32| c <= 0.9;
            for e in 0..20_000 {
                let ends = [e / 2, e + 1];
                queue.add(ends);
                let cost = any(&mut rng);
                queue.set(e, ends, cost);
                costs.push(cost);
                if allowed(cost) {
                    model.insert((key(cost), ends), e);
                }
            }
            let mut held = Vec::new();
            while let Some((edge, cost)) = queue.pop() {
                let (&(want, ends), &e) = model.first_key_value().unwrap();
                assert_eq!((edge, key(cost), queue.ends(edge)), (e, want, ends), "seed {seed}");
                model.pop_first();
                if rng.random_bool(0.2) {
                    queue.hold(edge);
                    held.push(edge);
                }
                for _ in 0..3 {
                    let e = rng.random_range(0..20_000);
                    let (ends, old) = (queue.ends(e), costs[e as usize]);
                    let was_in = model.get(&(key(old), ends)) == Some(&e);
                    // Edges that are out stay so, or this would never end.
                    if !was_in {
                        continue;
                    }
                    model.remove(&(key(old), ends));
                    if rng.random_bool(0.3) {
                        queue.remove(e);
                        continue;
                    }
                    let (ends, cost) = ([rng.random_range(0..9) + 100_000 + 10 * e, u32::MAX], any(&mut rng));
                    queue.set(e, ends, cost);
                    costs[e as usize] = cost;
                    if allowed(cost) {
                        model.insert((key(cost), ends), e);
                    }
                }
                if rng.random_bool(0.05)
                    && let Some(e) = held.pop()
                {
                    queue.release(e);
                    model.insert((key(costs[e as usize]), queue.ends(e)), e);
                }
            }
            assert!(model.is_empty(), "seed {seed}");
        }
    }
}
