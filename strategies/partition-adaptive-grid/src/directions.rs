//! The view-directions set of a grid point: an exact finite cover of all yaws, and what each part of it sees.
//!
//! From yaw 0 (-z) on, the set of visible leaves changes where a leaf's arc begins or ends; between two changes it is the same.
//! For each bin of pitches these parts are bins of yaws. The weights of all bins come from one sweep over the sorted ends:
//! O(leaves log leaves).

use glam::DVec3;

use crate::arcs::{self, Arc};
use crate::cone::{Cone, Scratch, Seen};
use crate::leaves::Leaves;

/// A leaf's arc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    /// The yaws.
    pub(crate) arc: Arc,
    /// The leaf.
    pub(crate) leaf: u32,
}

/// All leaves' arcs from a point for every bin of pitches, those of a leaf together.
pub(crate) fn spans(leaves: &Leaves, at: DVec3, cones: &[Cone]) -> Vec<Vec<Span>> {
    let mut out: Vec<Vec<Span>> = cones.iter().map(|_| Vec::with_capacity(leaves.len() + leaves.len() / 4)).collect();
    let mut scratch = Scratch::default();
    for i in 0..leaves.len() {
        let (lo, hi) = (leaves.min[i] - at, leaves.max[i] - at);
        let seen = Seen::of(lo, hi);
        for (cone, out) in cones.iter().zip(&mut out) {
            cone.sees(lo, hi, seen.as_ref(), &mut scratch, |arc| out.push(Span { arc, leaf: i as u32 }));
        }
    }
    out
}

/// A change of weight: the yaw in the high bits, then what changes (twice the leaf, and one for less).
type Event = u64;

fn events(spans: &[Span], less: u64, out: &mut Vec<Event>) {
    for s in spans {
        let what = u64::from(s.leaf) << 1;
        out.push(u64::from(s.arc.lo) << 32 | what | less);
        if s.arc.hi < u32::MAX {
            out.push(u64::from(s.arc.hi + 1) << 32 | what | (1 - less));
        }
    }
}

/// Calls `each` with the yaws and the weight of every part, in order.
fn sweep(leaves: &Leaves, events: &mut [Event], mut each: impl FnMut(Arc, i64)) {
    events.sort_unstable();
    let (mut weight, mut from) = (0i64, 0u32);
    for e in events.iter() {
        let yaw = (e >> 32) as u32;
        if yaw > from {
            each(Arc { lo: from, hi: yaw - 1 }, weight);
            from = yaw;
        }
        let triangles = i64::from(leaves.triangles[(*e as u32 >> 1) as usize]);
        weight += if e & 1 == 0 { triangles } else { -triangles };
    }
    each(Arc { lo: from, hi: u32::MAX }, weight);
}

/// The bins of yaws and the triangles that each sees.
pub(crate) fn bins(leaves: &Leaves, spans: &[Span]) -> Vec<(Arc, u64)> {
    let mut all = Vec::with_capacity(2 * spans.len());
    events(spans, 0, &mut all);
    let mut out = Vec::with_capacity(all.len() + 1);
    sweep(leaves, &mut all, |arc, weight| out.push((arc, weight as u64)));
    out
}

/// The most triangles that any yaw sees.
pub(crate) fn most(leaves: &Leaves, spans: &[Span]) -> u64 {
    let mut all = Vec::with_capacity(2 * spans.len());
    events(spans, 0, &mut all);
    let mut most = 0;
    sweep(leaves, &mut all, |_, weight| most = most.max(weight));
    most as u64
}

/// The most triangles that any yaw sees when all leaves wholly beyond `depth` are left out.
pub(crate) fn most_before(leaves: &Leaves, spans: &[Span], at: DVec3, cone: &Cone, depth: f64) -> u64 {
    let mut all = Vec::with_capacity(4 * spans.len());
    events(spans, 0, &mut all);
    let mut hidden = vec![];
    let (mut leaf, mut beyond) = (u32::MAX, vec![]);
    for s in spans {
        if s.leaf != leaf {
            leaf = s.leaf;
            beyond.clear();
            let i = leaf as usize;
            cone.beyond(leaves.min[i] - at, leaves.max[i] - at, depth, |a| beyond.push(a));
        }
        arcs::intersect(&[s.arc], &beyond, |arc| hidden.push(Span { arc, leaf }));
    }
    events(&hidden, 1, &mut all);
    let mut most = 0;
    sweep(leaves, &mut all, |_, weight| most = most.max(weight));
    most as u64
}

/// What is left of the bins' triangles without the leaves that are marked.
pub(crate) fn without(
    leaves: &Leaves,
    spans: &[Span],
    marked: &[bool],
    bins: &[(Arc, u64)],
    mut each: impl FnMut(usize, u64),
) {
    let chosen: Vec<Span> = spans.iter().filter(|s| marked[s.leaf as usize]).copied().collect();
    let mut all = Vec::with_capacity(2 * chosen.len());
    events(&chosen, 0, &mut all);
    let mut at = 0;
    // Ends of the chosen arcs are ends of bins.
    sweep(leaves, &mut all, |arc, weight| {
        while at < bins.len() && bins[at].0.lo <= arc.hi {
            each(at, bins[at].1 - weight as u64);
            at += 1;
        }
    });
}
