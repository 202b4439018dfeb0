//! Arcs of yaw, in 2^32nds of a turn: whole numbers, so that sweeps over them are exact and wrap round cleanly.

use std::f64::consts::TAU;

/// Closed arcs are widened by this much at each end, radians: a yaw that is read from a camera's 32-bit axes is off by 1e-7.
const WIDEN: f64 = 1e-5;
const TURN: f64 = 4_294_967_296.0;

/// A closed arc that does not pass yaw 0 (-z) inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Arc {
    /// First yaw.
    pub(crate) lo: u32,
    /// Last yaw.
    pub(crate) hi: u32,
}

/// All yaws.
pub(crate) const FULL: Arc = Arc { lo: 0, hi: u32::MAX };

/// A yaw in radians as a part of a turn.
pub(crate) fn turn_of(yaw: f64) -> u32 {
    ((yaw / TAU * TURN).floor() as i64).rem_euclid(1 << 32) as u32
}

/// The yaw in the middle of a closed arc, radians.
pub(crate) fn middle(arc: Arc) -> f64 {
    (0.5 * (f64::from(arc.lo) + f64::from(arc.hi)) + 0.5) / TURN * TAU
}

/// The arc from `lo` to `hi` radians, widened and rounded outwards, as one or two pieces.
pub(crate) fn outer(lo: f64, hi: f64, mut emit: impl FnMut(Arc)) {
    if hi - lo + 2.0 * WIDEN >= TAU {
        return emit(FULL);
    }
    pieces(((lo - WIDEN) / TAU * TURN).floor() as i64, ((hi + WIDEN) / TAU * TURN).ceil() as i64, &mut emit);
}

/// The arc from `lo` to `hi` radians, narrowed and rounded inwards; nothing where nothing is left.
pub(crate) fn inner(lo: f64, hi: f64, mut emit: impl FnMut(Arc)) {
    let (lo, hi) = (((lo + WIDEN) / TAU * TURN).ceil() as i64, ((hi - WIDEN) / TAU * TURN).floor() as i64);
    if lo <= hi {
        pieces(lo, hi, &mut emit);
    }
}

fn pieces(lo: i64, hi: i64, emit: &mut dyn FnMut(Arc)) {
    if hi - lo >= u32::MAX.into() {
        return emit(FULL);
    }
    let (a, b) = (lo.rem_euclid(1 << 32) as u32, hi.rem_euclid(1 << 32) as u32);
    if a <= b {
        emit(Arc { lo: a, hi: b });
    } else {
        emit(Arc { lo: 0, hi: b });
        emit(Arc { lo: a, hi: u32::MAX });
    }
}

/// Sorts arcs and joins those that meet.
pub(crate) fn unite(arcs: &mut Vec<Arc>) {
    arcs.sort_unstable_by_key(|a| (a.lo, a.hi));
    let mut kept = 0;
    for i in 0..arcs.len() {
        if kept > 0 && arcs[i].lo <= arcs[kept - 1].hi.saturating_add(1) {
            arcs[kept - 1].hi = arcs[kept - 1].hi.max(arcs[i].hi);
        } else {
            arcs[kept] = arcs[i];
            kept += 1;
        }
    }
    arcs.truncate(kept);
}

/// What two lists of sorted, disjoint arcs have in common.
pub(crate) fn intersect(a: &[Arc], b: &[Arc], mut emit: impl FnMut(Arc)) {
    let (mut i, mut j) = (0, 0);
    while let (Some(x), Some(y)) = (a.get(i), b.get(j)) {
        let both = Arc { lo: x.lo.max(y.lo), hi: x.hi.min(y.hi) };
        if both.lo <= both.hi {
            emit(both);
        }
        if x.hi <= y.hi { i += 1 } else { j += 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_over_yaw_zero_comes_in_two_pieces_and_a_wide_one_is_full() {
        let mut found = vec![];
        outer(-0.1, 0.2, |a| found.push(a));
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].lo, found[1].hi), (0, u32::MAX));
        let holds = |yaw: f64| found.iter().any(|a| (a.lo..=a.hi).contains(&turn_of(yaw)));
        assert!(holds(-0.1) && holds(0.0) && holds(0.2) && !holds(-0.101) && !holds(0.201) && holds(TAU - 0.05));
        found.clear();
        outer(1.0, 1.0 + TAU, |a| found.push(a));
        assert_eq!(found, [FULL]);
    }

    #[test]
    fn united_arcs_are_disjoint_and_intersections_are_in_both() {
        let a = |lo, hi| Arc { lo, hi };
        let mut list = vec![a(50, 60), a(10, 20), a(15, 30), a(31, 40)];
        unite(&mut list);
        assert_eq!(list, [a(10, 40), a(50, 60)]);
        let mut both = vec![];
        intersect(&list, &[a(0, 12), a(38, 55)], |x| both.push(x));
        assert_eq!(both, [a(10, 12), a(38, 40), a(50, 55)]);
    }
}
