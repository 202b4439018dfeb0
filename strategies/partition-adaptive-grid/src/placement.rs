//! Image placement for one view: which leaves an image replaces, and where it stands.
//!
//! The leaves in view are told apart by six borders in the picture of the point that looks along the view's axis: left, right,
//! bottom and top as tangents, near and far as depths. Six sorted lists of borders and six indices into them name a contiguous
//! subset: all leaves whose borders lie within. The search starts with all leaves beyond the point's star-shape and takes
//! away from the near, top, bottom, right or left side (far never changes an image), first half of what is between two opposite
//! borders, then a quarter, down to single entries, as long as what is left to draw stays within the optimisation budget. Of
//! the five it takes the one from which the best cost-benefit value is reached within a few more steps:
//!
//! CB = C (1 - g_c/G_c) + B (B1 (1 - max(Iw, Ih)/max(Sw, Sh)) + B2 d/A)
//!
//! with g_c the triangles left to draw, G_c those in view, Iw x Ih the subset's part of the picture, Sw x Sh the picture, d the
//! distance to the subset's nearest corner and A the model space's longest edge. Ties go to the order above, which is the paper's.
//! O(entries x 5^(look-ahead + 1)) a step, and about log(entries) steps of each size.

use farfield_core::cell::Window;
use glam::DVec3;

use crate::leaves::Leaves;

/// What the search is told.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    /// C, B, B1 and B2.
    pub(crate) weights: [f64; 4],
    /// Steps looked ahead.
    pub(crate) look_ahead: u32,
    /// A, scene units.
    pub(crate) longest: f64,
    /// Tangents of half the fields of view.
    pub(crate) tan: [f64; 2],
    /// Triangles left to draw at most.
    pub(crate) budget: u64,
}

/// A leaf in the picture.
#[derive(Clone, Copy, Debug)]
struct Entry {
    leaf: u32,
    triangles: u64,
    /// Left, bottom, near; right, top, far.
    lo: DVec3,
    hi: DVec3,
    /// Distance of its nearest corner.
    distance: f64,
    /// Places of left, bottom and near in their lists.
    from: [u32; 3],
    /// Places of right and top in their lists.
    to: [u32; 2],
}

/// An image: what it replaces and where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// The leaves, ascending.
    pub(crate) leaves: Vec<u32>,
    /// The quadrilateral.
    pub(crate) window: [DVec3; 4],
    /// Triangles left to draw in the view that it was placed for.
    pub(crate) left: u64,
}

/// The indices of a subset: lists of left, bottom, near from; of right, top to.
#[derive(Clone, Copy, Debug)]
struct Tuple {
    from: [u32; 3],
    to: [u32; 2],
}

/// What an index is moved along.
#[derive(Clone, Copy)]
enum Side {
    Near,
    Top,
    Bottom,
    Right,
    Left,
}

const SIDES: [Side; 5] = [Side::Near, Side::Top, Side::Bottom, Side::Right, Side::Left];

/// Sorted borders; equal ones are one entry, named by its first (lower borders) or last place.
struct Lists {
    from: [Vec<f64>; 3],
    to: [Vec<f64>; 2],
}

impl Search {
    /// Places an image for the view from `at` along `axis` (unit length), which sees `visible` with `seen` triangles in all, no
    /// nearer than `depth`. `None` where nothing lies beyond it.
    pub(crate) fn place(
        &self,
        leaves: &Leaves,
        at: DVec3,
        axis: DVec3,
        visible: &[u32],
        seen: u64,
        depth: f64,
    ) -> Option<Placed> {
        let side = axis.cross(DVec3::Y);
        let right = if side.length_squared() > 1e-18 { side.normalize() } else { DVec3::X };
        let up = right.cross(axis);
        let mut entries: Vec<Entry> =
            visible.iter().filter_map(|&leaf| entry(leaves, leaf, at, [right, up, axis], depth)).collect();
        if entries.is_empty() {
            return None;
        }
        let lists = rank(&mut entries);
        let picture = Picture { entries, lists };
        let most = picture.entries.len() as u32 - 1;
        let mut step = 1;
        while most >> step > 0 {
            step += 1;
        }
        let mut shift = 1;
        let mut members: Vec<u32> = (0..=most).collect();
        let mut levels = vec![vec![]; self.look_ahead as usize + 1];
        while shift <= step {
            match self.best(&picture, &members, seen, shift, 0, &mut levels) {
                Some((_, next)) => members.retain(|&i| next.holds(&picture.entries[i as usize])),
                None => shift += 1,
            }
        }
        let (mut lo, mut hi, mut taken) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0);
        for e in members.iter().map(|&i| &picture.entries[i as usize]) {
            (lo, hi, taken) = (lo.min(e.lo), hi.max(e.hi), taken + e.triangles);
        }
        let corner = |x: f64, y: f64| at + (axis + right * x + up * y) * lo.z;
        let mut chosen: Vec<u32> = members.iter().map(|&i| picture.entries[i as usize].leaf).collect();
        chosen.sort_unstable();
        Some(Placed {
            leaves: chosen,
            window: [corner(lo.x, lo.y), corner(hi.x, lo.y), corner(hi.x, hi.y), corner(lo.x, hi.y)],
            left: seen - taken,
        })
    }

    /// The best of the five subsets a step further, by the best value within `look_ahead` more steps.
    fn best(
        &self,
        picture: &Picture,
        members: &[u32],
        seen: u64,
        shift: u32,
        ahead: u32,
        levels: &mut [Vec<u32>],
    ) -> Option<(f64, Tuple)> {
        let (mine, deeper) = levels.split_first_mut()?;
        let tuple = picture.around(members);
        let mut best: Option<(f64, Tuple)> = None;
        for side in SIDES {
            let Some(next) = tuple.moved(side, shift, &picture.lists) else { continue };
            mine.clear();
            let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (mut taken, mut distance) = (0, f64::INFINITY);
            for &i in members {
                let e = &picture.entries[i as usize];
                if !next.holds(e) {
                    continue;
                }
                mine.push(i);
                (lo, hi) = (lo.min(e.lo), hi.max(e.hi));
                taken += e.triangles;
                distance = distance.min(e.distance);
            }
            if mine.is_empty() || seen - taken > self.budget {
                continue;
            }
            let mut value = self.value(seen - taken, seen, lo, hi, distance);
            if ahead < self.look_ahead
                && let Some((later, _)) = self.best(picture, mine, seen, shift, ahead + 1, deeper)
            {
                value = value.max(later);
            }
            if best.is_none_or(|(v, _)| value > v) {
                best = Some((value, next));
            }
        }
        best
    }

    fn value(&self, left: u64, seen: u64, lo: DVec3, hi: DVec3, distance: f64) -> f64 {
        let [c, b, b1, b2] = self.weights;
        let [sx, sy] = self.tan;
        let extent = |a: f64, b: f64, s: f64| (b.min(s) - a.max(-s)).max(0.0);
        let part = extent(lo.x, hi.x, sx).max(extent(lo.y, hi.y, sy)) / (2.0 * sx.max(sy));
        c * (1.0 - left as f64 / seen as f64) + b * (b1 * (1.0 - part) + b2 * distance / self.longest)
    }
}

/// A leaf in the picture, where all of it lies beyond `depth`.
fn entry(leaves: &Leaves, leaf: u32, at: DVec3, [right, up, axis]: [DVec3; 3], depth: f64) -> Option<Entry> {
    let (a, b) = (leaves.min[leaf as usize] - at, leaves.max[leaf as usize] - at);
    let least = DVec3::select(axis.cmpge(DVec3::ZERO), a, b);
    if axis.dot(least) < depth {
        return None;
    }
    let (mut lo, mut hi, mut nearest) = (DVec3::INFINITY, DVec3::NEG_INFINITY, f64::INFINITY);
    for i in 0..8 {
        let pick = |k: usize| if i >> k & 1 == 0 { a[k] } else { b[k] };
        let p = DVec3::new(pick(0), pick(1), pick(2));
        let z = axis.dot(p);
        let q = DVec3::new(right.dot(p) / z, up.dot(p) / z, z);
        (lo, hi, nearest) = (lo.min(q), hi.max(q), nearest.min(p.length_squared()));
    }
    let triangles = u64::from(leaves.triangles[leaf as usize]);
    Some(Entry { leaf, triangles, lo, hi, distance: nearest.sqrt(), from: [0; 3], to: [0; 2] })
}

/// Fills in the entries' places and gives the lists.
fn rank(entries: &mut [Entry]) -> Lists {
    let sorted = |key: &dyn Fn(&Entry) -> f64| {
        let mut list: Vec<f64> = entries.iter().map(key).collect();
        list.sort_unstable_by(f64::total_cmp);
        list
    };
    let lists = Lists {
        from: std::array::from_fn(|k| sorted(&|e: &Entry| e.lo[k])),
        to: std::array::from_fn(|k| sorted(&|e: &Entry| e.hi[k])),
    };
    for e in entries {
        e.from = std::array::from_fn(|k| lists.from[k].partition_point(|&v| v < e.lo[k]) as u32);
        e.to = std::array::from_fn(|k| lists.to[k].partition_point(|&v| v <= e.hi[k]) as u32 - 1);
    }
    lists
}

/// The leaves in the picture and their borders.
struct Picture {
    entries: Vec<Entry>,
    lists: Lists,
}

impl Picture {
    /// The closest indices that name a subset.
    fn around(&self, members: &[u32]) -> Tuple {
        let mut tuple = Tuple { from: [u32::MAX; 3], to: [0; 2] };
        for e in members.iter().map(|&i| &self.entries[i as usize]) {
            (0..3).for_each(|k| tuple.from[k] = tuple.from[k].min(e.from[k]));
            (0..2).for_each(|k| tuple.to[k] = tuple.to[k].max(e.to[k]));
        }
        tuple
    }
}

impl Tuple {
    fn holds(&self, e: &Entry) -> bool {
        (0..3).all(|k| e.from[k] >= self.from[k]) && (0..2).all(|k| e.to[k] <= self.to[k])
    }

    /// The tuple with one border moved by a 2^shift-th of the places between it and the opposite one, at least one, and on to
    /// the next border that differs. `None` at the end of the list.
    fn moved(mut self, side: Side, shift: u32, lists: &Lists) -> Option<Self> {
        let last = lists.from[0].len() as u32 - 1;
        let (axis, upper) = match side {
            Side::Near => (2, false),
            Side::Top => (1, true),
            Side::Bottom => (1, false),
            Side::Right => (0, true),
            Side::Left => (0, false),
        };
        let (from, to) = (self.from[axis], if axis == 2 { last } else { self.to[axis] });
        let by = to.saturating_sub(from).div_ceil(1 << shift).max(1);
        if upper {
            let list = &lists.to[axis];
            // Down to the last entry of the border there: entries of one border leave together.
            let place = to.checked_sub(by)? as usize;
            let end = list.partition_point(|&v| v <= list[place]) as u32 - 1;
            let end =
                if end < to { end } else { (list.partition_point(|&v| v < list[place]) as u32).checked_sub(1)? };
            self.to[axis] = end;
        } else {
            let list = &lists.from[axis];
            let place = (from + by) as usize;
            if place > last as usize {
                return None;
            }
            let start = list.partition_point(|&v| v < list[place]) as u32;
            let start = if start > from { start } else { list.partition_point(|&v| v <= list[place]) as u32 };
            if start > last {
                return None;
            }
            self.from[axis] = start;
        }
        Some(self)
    }
}

/// The window of an image, for far fields.
pub(crate) fn window(placed: &Placed, axis: DVec3, px_per_tan: f32) -> Window {
    Window { axis: axis.as_vec3(), corners: placed.window.map(|c| c.as_vec3()), px_per_tan }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_subset_is_contiguous_within_the_budget_and_no_side_can_be_moved_further(
            at in prop::collection::vec((-9f64..9.0, -5f64..5.0, -30f64..-3.0, 0.1f64..2.0, 1u32..100), 1..60),
            share in 0.0f64..1.0, look_ahead in 0u32..3
        ) {
            let mut leaves = Leaves::default();
            for (x, y, z, s, n) in &at {
                // Some borders are the same.
                let c = DVec3::new(x.round(), *y, z.round());
                leaves.min.push(c - *s);
                leaves.max.push(c + *s);
                leaves.triangles.push(*n);
            }
            let visible: Vec<u32> = (0..at.len() as u32).collect();
            let seen: u64 = leaves.triangles.iter().map(|&t| u64::from(t)).sum();
            let budget = (share * seen as f64) as u64;
            let search = Search { weights: [0.4, 0.6, 0.1, 0.9], look_ahead, longest: 30.0, tan: [0.6, 0.5], budget };
            let frame = [DVec3::X, DVec3::Y, DVec3::NEG_Z];
            let entries: Vec<Entry> =
                visible.iter().filter_map(|&l| entry(&leaves, l, DVec3::ZERO, frame, 4.0)).collect();
            let placed = search.place(&leaves, DVec3::ZERO, DVec3::NEG_Z, &visible, seen, 4.0);
            prop_assert_eq!(placed.is_none(), entries.is_empty());
            let Some(placed) = placed else { return Ok(()) };
            let member = |e: &&Entry| placed.leaves.contains(&e.leaf);
            let taken = |of: &dyn Fn(&Entry) -> bool| -> u64 {
                entries.iter().filter(member).filter(|e| of(e)).map(|e| e.triangles).sum()
            };
            prop_assert_eq!(placed.left, seen - taken(&|_| true));
            let all: u64 = entries.iter().map(|e| e.triangles).sum();
            if seen - all > budget {
                prop_assert_eq!(placed.leaves.len(), entries.len());
                return Ok(());
            }
            prop_assert!(placed.left <= budget);
            let (lo, hi) = entries.iter().filter(member).fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |b, e| (b.0.min(e.lo), b.1.max(e.hi)));
            for e in &entries {
                let within = e.lo.cmpge(lo).all() && e.hi.truncate().cmple(hi.truncate()).all();
                prop_assert_eq!(within, member(&e), "{:?}", e);
            }
            prop_assert!(placed.window.iter().all(|c| (-c.z - lo.z).abs() < 1e-9));
            // Without the entries of any one border, too much is left, or nothing is taken.
            for k in 0..3 {
                let kept = taken(&|e| e.lo[k] > lo[k]);
                prop_assert!(kept == 0 || seen - kept > budget);
            }
            for k in 0..2 {
                let kept = taken(&|e| e.hi[k] < hi[k]);
                prop_assert!(kept == 0 || seen - kept > budget);
            }
        }
    }
}
