//! The priority queue of exact mode: an indexed heap over the cheapest edges only, the rest in an unsorted stock.
//!
//! Every edge has a slot: in the heap, in the stock (its cost is above the heap's limit), held (its rules forbid it for
//! now) or nowhere. When the heap runs dry, the cheapest eighth of the stock moves in and the limit rises. The order that edges
//! come out in is exactly that of one big heap, but the heap fits the cache, and a change of price above the limit, which
//! most are, is one store. Costs are compared as numbers, ties by the smaller vertex ids.

const NOWHERE: u32 = u32::MAX;
const STOCK: u32 = u32::MAX - 1;
const HELD: u32 = u32::MAX - 2;
/// Children of a heap's node: four share one or two cache lines.
const ARITY: usize = 4;

#[derive(Clone, Copy)]
struct Edge {
    /// Smaller id first.
    ends: [u32; 2],
    cost: f32,
    /// Index into the heap, or one of the constants above.
    slot: u32,
}

#[derive(Clone, Copy)]
struct Entry {
    cost: f32,
    edge: u32,
}

/// Scratch of a vertex, together because it is read together.
#[derive(Clone, Copy)]
struct Spot {
    mark: u32,
    edge: u32,
    held: u32,
}

pub(super) struct Queue {
    edges: Vec<Edge>,
    heap: Vec<Entry>,
    /// Edges of slot `STOCK`, each at least once, and some that have left.
    stock: Vec<u32>,
    /// Scratch of a refill.
    seen: Vec<Entry>,
    /// What costs at most this is in the heap.
    limit: f32,
    max_cost: f32,
    spots: Vec<Spot>,
    mark: u32,
}

impl Queue {
    pub(super) fn new(vertices: usize, max_cost: f32) -> Self {
        Self {
            edges: Vec::new(),
            heap: Vec::new(),
            stock: Vec::new(),
            seen: Vec::new(),
            limit: f32::NEG_INFINITY,
            max_cost,
            spots: vec![Spot { mark: 0, edge: 0, held: 0 }; vertices],
            mark: 0,
        }
    }

    /// A new edge, not queued yet.
    pub(super) fn add(&mut self, ends: [u32; 2]) -> u32 {
        self.edges.push(Edge { ends, cost: f32::INFINITY, slot: NOWHERE });
        self.edges.len() as u32 - 1
    }

    pub(super) fn len(&self) -> usize {
        self.edges.len()
    }

    #[inline]
    pub(super) fn ends(&self, edge: u32) -> [u32; 2] {
        self.edges[edge as usize].ends
    }

    /// Number of held edges at a vertex.
    #[inline]
    pub(super) fn held_at(&self, vertex: u32) -> u32 {
        self.spots[vertex as usize].held
    }

    /// Forgets all marks.
    pub(super) fn unmark(&mut self) {
        if self.mark == u32::MAX {
            self.spots.iter_mut().for_each(|s| s.mark = 0);
            self.mark = 0;
        }
        self.mark += 1;
    }

    /// Marks a vertex with an edge; the one that it is marked with already, if it is, stays and is returned.
    #[inline]
    pub(super) fn mark(&mut self, vertex: u32, edge: u32) -> Option<u32> {
        let spot = &mut self.spots[vertex as usize];
        if spot.mark == self.mark {
            return Some(spot.edge);
        }
        (spot.mark, spot.edge) = (self.mark, edge);
        None
    }

    /// Puts an edge in, or changes what it costs and joins. Forbidden and too dear ones are taken out.
    pub(super) fn set(&mut self, edge: u32, ends: [u32; 2], cost: f32) {
        let e = &mut self.edges[edge as usize];
        let (slot, old_ends) = (e.slot, e.ends);
        (e.ends, e.cost) = (ends, cost);
        if slot == HELD {
            old_ends.iter().for_each(|&v| self.spots[v as usize].held -= 1);
        }
        // f32::MAX stands for "no limit", infinity for "forbidden"; NaN is neither below nor above.
        let wanted = cost <= self.max_cost && cost < f32::INFINITY;
        if wanted && cost <= self.limit {
            let at = if slot < HELD {
                slot as usize
            } else {
                self.heap.push(Entry { cost, edge });
                self.heap.len() - 1
            };
            self.settle(at, Entry { cost, edge });
            return;
        }
        if slot < HELD {
            self.take_out(slot as usize);
        }
        if wanted && slot != STOCK {
            self.stock.push(edge);
        }
        self.edges[edge as usize].slot = if wanted { STOCK } else { NOWHERE };
    }

    /// Takes an edge out for good.
    pub(super) fn remove(&mut self, edge: u32) {
        let ends = self.ends(edge);
        self.set(edge, ends, f32::INFINITY);
    }

    /// Sets an edge that was just popped aside until [`Queue::release`].
    pub(super) fn hold(&mut self, edge: u32) {
        let e = &mut self.edges[edge as usize];
        e.slot = HELD;
        e.ends.iter().for_each(|&v| self.spots[v as usize].held += 1);
    }

    /// Puts a held edge back at its old cost; others stay as they are.
    pub(super) fn release(&mut self, edge: u32) {
        let e = self.edges[edge as usize];
        if e.slot == HELD {
            self.set(edge, e.ends, e.cost);
        }
    }

    /// The cheapest edge and its cost.
    pub(super) fn pop(&mut self) -> Option<(u32, f32)> {
        if self.heap.is_empty() {
            self.refill();
        }
        let top = *self.heap.first()?;
        self.take_out(0);
        self.edges[top.edge as usize].slot = NOWHERE;
        Some((top.edge, top.cost))
    }

    fn refill(&mut self) {
        let mut seen = std::mem::take(&mut self.seen);
        for &edge in &self.stock {
            let e = &mut self.edges[edge as usize];
            if e.slot == STOCK {
                seen.push(Entry { cost: e.cost, edge });
                // Once only, should the stock name it again.
                e.slot = NOWHERE;
            }
        }
        self.stock.clear();
        if seen.is_empty() {
            return;
        }
        let share = (seen.len() / 8).max(4096).min(seen.len()) - 1;
        self.limit = seen.select_nth_unstable_by(share, |a, b| a.cost.total_cmp(&b.cost)).1.cost;
        for entry in seen.drain(..) {
            let e = &mut self.edges[entry.edge as usize];
            if entry.cost <= self.limit {
                e.slot = self.heap.len() as u32;
                self.heap.push(entry);
            } else {
                e.slot = STOCK;
                self.stock.push(entry.edge);
            }
        }
        self.seen = seen;
        for at in (0..self.heap.len().div_ceil(ARITY)).rev() {
            self.sink(at, self.heap[at]);
        }
    }

    #[inline]
    fn before(&self, a: Entry, b: Entry) -> bool {
        if a.cost != b.cost { a.cost < b.cost } else { self.ends(a.edge) < self.ends(b.edge) }
    }

    #[inline]
    fn put(&mut self, at: usize, entry: Entry) {
        self.heap[at] = entry;
        self.edges[entry.edge as usize].slot = at as u32;
    }

    /// Removes the heap's entry `at`; its edge's slot is the caller's to change.
    fn take_out(&mut self, at: usize) {
        if let Some(last) = self.heap.pop()
            && at < self.heap.len()
        {
            self.settle(at, last);
        }
    }

    /// Finds the place of `entry` from the free place `at`.
    fn settle(&mut self, mut at: usize, entry: Entry) {
        let start = at;
        while at > 0 && self.before(entry, self.heap[(at - 1) / ARITY]) {
            let up = (at - 1) / ARITY;
            self.put(at, self.heap[up]);
            at = up;
        }
        if at == start { self.sink(at, entry) } else { self.put(at, entry) }
    }

    fn sink(&mut self, mut at: usize, entry: Entry) {
        loop {
            let first = at * ARITY + 1;
            let mut least = at;
            let mut best = entry;
            for child in first..(first + ARITY).min(self.heap.len()) {
                if self.before(self.heap[child], best) {
                    (least, best) = (child, self.heap[child]);
                }
            }
            if least == at {
                return self.put(at, entry);
            }
            self.put(at, best);
            at = least;
        }
    }
}
