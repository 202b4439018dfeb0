//! Meeting a total: each mesh has a level of detail, and all are as fine as the total allows.
//!
//! The common level is the greatest at which everything together stays below the total; then single meshes get finer, one level at a
//! time, as long as they fit, those first that add most. O(meshes x log levels) makings of a mesh, in parallel.

use std::collections::BTreeMap;

use rayon::prelude::*;

/// How many levels one mesh may be finer than another.
const FINER: u32 = 6;

/// The level of each mesh, so that the total is near `asked` and, where a level allows it, not above. `counts[i]` says how often mesh
/// `i` is placed, `triangles(i, level)` how many it has; levels are in `least..=most`.
pub(super) fn levels(
    asked: u64,
    counts: &[u64],
    [least, most]: [u32; 2],
    triangles: impl Fn(usize, u32) -> u64 + Sync,
) -> Vec<u32> {
    let mut known: BTreeMap<u32, Vec<u64>> = BTreeMap::new();
    let mut at = |level: u32| -> Vec<u64> {
        let made = || (0..counts.len()).into_par_iter().map(|i| counts[i] * triangles(i, level)).collect();
        known.entry(level).or_insert_with(made).clone()
    };
    let (mut low, mut high) = (least, most + 1);
    while high - low > 1 {
        let middle = low.midpoint(high);
        if at(middle).iter().sum::<u64>() <= asked { low = middle } else { high = middle }
    }
    let mut levels = vec![low; counts.len()];
    let mut own = at(low);
    let mut total: u64 = own.iter().sum();
    for step in 1..=FINER.min(most.saturating_sub(low)) {
        let finer = at(low + step);
        let mut order: Vec<usize> = (0..counts.len()).filter(|&i| levels[i] + 1 == low + step).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(finer[i].saturating_sub(own[i])), i));
        for i in order {
            let more = total + finer[i] - own[i].min(finer[i]);
            if finer[i] >= own[i] && more <= asked {
                (total, levels[i], own[i]) = (more, low + step, finer[i]);
            }
        }
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_are_neared_from_below() {
        let counts = [3, 40, 1, 7, 90];
        let triangles = |i: usize, level: u32| u64::from(level * level) * (2 + i as u64) + 12;
        let all = |levels: &[u32]| -> u64 { (0..5).map(|i| counts[i] * triangles(i, levels[i])).sum() };
        for asked in [4_000, 20_000, 77_777, 1_000_000] {
            let levels = levels(asked, &counts, [1, 200], triangles);
            let off = 1.0 - all(&levels) as f64 / asked as f64;
            assert!((0.0..0.02).contains(&off), "{asked}: {} by {levels:?}", all(&levels));
            assert!(levels.iter().max().unwrap() - levels.iter().min().unwrap() <= FINER);
        }
        assert_eq!(levels(10, &counts, [1, 200], triangles), [1; 5], "no less than the least");
    }
}
