//! The least feasible budget: leaves that meet at a place where an eye may be are drawn there, whatever is replaced.
//!
//! The heaviest set of boxes with a common point. Boxes have one exactly when every two of them meet, so it is the heaviest
//! clique of the boxes' intersection graph, and a sweep finds it: for each box as the one of the set that starts last
//! along x, for each box that it meets as the one that starts last along y, a sweep along z. Bounds (what a box meets cannot
//! weigh more than all of it) leave little of O(n k^2 log k), k being the most boxes that meet one box.

use glam::DVec3;

/// A closed box and what it weighs.
pub(crate) type Weighted = (DVec3, DVec3, u64);

/// The heaviest set of boxes with a common point, and such a point, where it weighs more than `floor`; else `None`.
pub(crate) fn heaviest(boxes: &[Weighted], floor: u64) -> Option<(u64, DVec3)> {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|&a, &b| boxes[a].0.x.total_cmp(&boxes[b].0.x));
    // Boxes that hold the place where one starts along x and meet it along y and z, with their weight in all.
    let mut sets: Vec<(u64, usize)> = vec![];
    let mut open: Vec<usize> = vec![];
    for &i in &order {
        open.retain(|&j| boxes[j].1.x >= boxes[i].0.x);
        open.push(i);
        let weight = open.iter().filter(|&&j| meets(boxes, i, j)).map(|&j| boxes[j].2).sum();
        if weight > floor {
            sets.push((weight, i));
        }
    }
    sets.sort_by_key(|&(weight, i)| (std::cmp::Reverse(weight), i));
    let rank = ranks(&order);
    let mut best: Option<(u64, DVec3)> = None;
    for (bound, i) in sets {
        let least = best.map_or(floor, |b| b.0);
        if bound <= least {
            break;
        }
        let x = boxes[i].0.x;
        let holds = |j: &usize| rank[*j] <= rank[i] && boxes[*j].1.x >= x && meets(boxes, i, *j);
        let mut set: Vec<usize> = (0..boxes.len()).filter(holds).collect();
        set.sort_by(|&a, &b| boxes[a].0.y.total_cmp(&boxes[b].0.y));
        if let Some((weight, y, z)) = in_plane(boxes, &set, least) {
            best = Some((weight, DVec3::new(x, y, z)));
        }
    }
    best
}

/// The same in the plane, of boxes sorted by where they start along y: weight, y and z.
fn in_plane(boxes: &[Weighted], set: &[usize], floor: u64) -> Option<(u64, f64, f64)> {
    let mut best = None;
    let mut least = floor;
    let mut open: Vec<usize> = vec![];
    let mut ends: Vec<(f64, bool, u64)> = vec![];
    for &j in set {
        let y = boxes[j].0.y;
        open.retain(|&k| boxes[k].1.y >= y);
        open.push(j);
        let along = |k: &&usize| boxes[**k].0.z <= boxes[j].1.z && boxes[**k].1.z >= boxes[j].0.z;
        if open.iter().filter(along).map(|&k| boxes[k].2).sum::<u64>() <= least {
            continue;
        }
        ends.clear();
        for &k in open.iter().filter(along) {
            ends.push((boxes[k].0.z, false, boxes[k].2));
            ends.push((boxes[k].1.z, true, boxes[k].2));
        }
        // Closed boxes: at one place, starts come before ends.
        ends.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut now = 0;
        for &(z, end, weight) in &ends {
            if end {
                now -= weight;
                continue;
            }
            now += weight;
            if now > least {
                least = now;
                best = Some((now, y, z));
            }
        }
    }
    best
}

fn meets(boxes: &[Weighted], i: usize, j: usize) -> bool {
    let ((a0, a1, _), (b0, b1, _)) = (boxes[i], boxes[j]);
    a0.y <= b1.y && a1.y >= b0.y && a0.z <= b1.z && a1.z >= b0.z
}

fn ranks(order: &[usize]) -> Vec<usize> {
    let mut rank = vec![0; order.len()];
    order.iter().enumerate().for_each(|(r, &i)| rank[i] = r);
    rank
}

/// The boxes' parts in a region; those that do not meet it are left out.
pub(crate) fn within(boxes: impl Iterator<Item = Weighted>, region: [DVec3; 2]) -> Vec<Weighted> {
    boxes
        .map(|(lo, hi, weight)| (lo.max(region[0]), hi.min(region[1]), weight))
        .filter(|(lo, hi, _)| lo.cmple(*hi).all())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_trying_every_corner_finds(
            at in prop::collection::vec(((0i8..9, 0i8..9, 0i8..9), (0i8..5, 0i8..5, 0i8..5), 1u64..9), 0..14), floor in 0u64..30
        ) {
            let v = |(x, y, z): (i8, i8, i8)| DVec3::new(x.into(), y.into(), z.into());
            let boxes: Vec<Weighted> = at.iter().map(|&(a, s, w)| (v(a), v(a) + v(s), w)).collect();
            let holding = |p: DVec3| -> u64 {
                boxes.iter().filter(|b| b.0.cmple(p).all() && b.1.cmpge(p).all()).map(|b| b.2).sum()
            };
            let mut most = 0;
            for x in &boxes { for y in &boxes { for z in &boxes {
                most = most.max(holding(DVec3::new(x.0.x, y.0.y, z.0.z)));
            }}}
            match heaviest(&boxes, floor) {
                Some((weight, place)) => {
                    prop_assert_eq!(weight, most);
                    prop_assert_eq!(holding(place), most);
                    prop_assert!(most > floor);
                }
                None => prop_assert!(most <= floor),
            }
        }
    }

    #[test]
    fn only_places_of_the_region_count() {
        let boxes = [(DVec3::ZERO, DVec3::splat(2.0), 5), (DVec3::ONE, DVec3::splat(3.0), 7)];
        let region = |a: f64, b: f64| within(boxes.into_iter(), [DVec3::splat(a), DVec3::splat(b)]);
        assert_eq!(heaviest(&region(0.0, 3.0), 0), Some((12, DVec3::ONE)));
        assert_eq!(heaviest(&region(2.5, 3.0), 0), Some((7, DVec3::splat(2.5))));
        assert_eq!(heaviest(&region(4.0, 5.0), 0), None);
    }
}
