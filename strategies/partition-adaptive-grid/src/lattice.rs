//! The lattice of grid points: where they may stand, and what dividing one adds.
//!
//! Points are named by whole numbers at the finest spacing that the greatest level can reach. Level 2k is a cubic lattice of
//! spacing r/2^k; dividing one of its points adds the mid-points of the edges and the centres of the cubes around it (14 new
//! ones, level 2k+1); dividing a point of level 2k+1 adds what is missing around it of the cubic lattice of half the
//! spacing (level 2k+2): twelve points around one of the even lattice, as in the paper's figure 6, and around the mid-points and
//! centres, which the paper does not show, the six next to them of which some are there already.

use std::collections::HashMap;

use glam::DVec3;

/// A position, in units of the finest spacing.
pub(crate) type Key = [i32; 3];

/// Rings of points around the model space (the paper's two): eyes at its border have points behind them.
const RINGS: i32 = 2;

/// Where points may stand.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    /// The place of position 0, 0, 0, local frame.
    pub(crate) origin: DVec3,
    /// The finest spacing, scene units.
    pub(crate) unit: f64,
    /// The coarsest spacing is 2^halvings units.
    pub(crate) halvings: u32,
    /// Points of level 0 along each axis.
    pub(crate) count: [i32; 3],
}

impl Lattice {
    /// `points` along the longest axis of the model space and at least three along the others, and two more on all six sides.
    pub(crate) fn over(space: [DVec3; 2], points: u32, max_level: u32) -> Self {
        let size = space[1] - space[0];
        let longest = size.max_element();
        let spacing = if longest > 0.0 { longest / f64::from(points - 1) } else { 1.0 };
        let count = size.to_array().map(|s| ((s / spacing - 1e-9).ceil() as i32 + 1).max(3) + 2 * RINGS);
        let halvings = max_level.div_ceil(2);
        let span = DVec3::from(count.map(|n| f64::from(n - 1))) * spacing;
        Self {
            origin: 0.5 * (space[0] + space[1]) - 0.5 * span,
            unit: spacing / f64::from(1 << halvings),
            halvings,
            count,
        }
    }

    /// Where a position is, local frame.
    pub(crate) fn place(&self, key: Key) -> DVec3 {
        self.origin + DVec3::from(key.map(f64::from)) * self.unit
    }

    /// The lowest and the highest corner of the points of level 0.
    pub(crate) fn span(&self) -> [DVec3; 2] {
        [self.place([0; 3]), self.place(self.count.map(|n| (n - 1) << self.halvings))]
    }

    /// The spacing of the cubic lattice that a level divides, in units.
    pub(crate) fn cube(&self, level: u32) -> i32 {
        1 << (self.halvings - level / 2)
    }

    /// How far a level's points reach for neighbours (Chebyshev), in units: the distance at which a uniform lattice of the
    /// level has its next ones.
    pub(crate) fn reach(&self, level: u32) -> i32 {
        1 << (self.halvings - level.div_ceil(2))
    }
}

/// A grid point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    /// Where.
    pub(crate) key: Key,
    /// How often it has been divided.
    pub(crate) level: u32,
}

/// The grid points there are, in the order in which they came.
#[derive(Debug)]
pub(crate) struct Sites {
    /// Where they may stand.
    pub(crate) lattice: Lattice,
    /// The points.
    pub(crate) all: Vec<Site>,
    index: HashMap<Key, u32>,
}

impl Sites {
    /// The points of level 0.
    pub(crate) fn coarsest(lattice: Lattice) -> Self {
        let mut sites = Self { all: vec![], index: HashMap::new(), lattice };
        let [nx, ny, nz] = sites.lattice.count;
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    sites.add([x, y, z].map(|i| i << sites.lattice.halvings), 0);
                }
            }
        }
        sites
    }

    /// The point at a position.
    pub(crate) fn at(&self, key: Key) -> Option<u32> {
        self.index.get(&key).copied()
    }

    fn add(&mut self, key: Key, level: u32) {
        let next = self.all.len() as u32;
        let i = *self.index.entry(key).or_insert(next);
        if i == next {
            self.all.push(Site { key, level });
        } else {
            let site = &mut self.all[i as usize];
            site.level = site.level.max(level);
        }
    }

    /// Divides a point: it and what comes around it have the next level.
    pub(crate) fn divide(&mut self, i: u32) {
        let Site { key, level } = self.all[i as usize];
        let half = self.lattice.cube(level) / 2;
        let odd = key.iter().filter(|&&c| (c / half) % 2 != 0).count();
        let adds = |steps: usize| match (level % 2, odd % 2) {
            (0, _) => steps == 1 || steps == 3,
            (_, 0) => steps == 2,
            _ => steps == 1,
        };
        self.add(key, level + 1);
        for n in 0..27 {
            let step = [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
            if adds(step.iter().filter(|&&s| s != 0).count()) {
                self.add(std::array::from_fn(|a| key[a] + half * step[a]), level + 1);
            }
        }
    }

    /// The points that a point of this level at `key` has as neighbours, itself left out.
    pub(crate) fn around(&self, key: Key, level: u32, mut each: impl FnMut(u32)) {
        let reach = self.lattice.reach(level);
        let first = |c: i32| (c - reach).div_euclid(reach) * reach;
        let [x0, y0, z0] = key.map(first);
        for n in 0..64 {
            let at = [x0 + n % 4 * reach, y0 + n / 4 % 4 * reach, z0 + n / 16 * reach];
            if at != key
                && (0..3).all(|a| (at[a] - key[a]).abs() <= reach)
                && let Some(i) = self.at(at)
            {
                each(i);
            }
        }
    }

    /// Divides coarse points until none has a neighbour two levels finer or more.
    pub(crate) fn balance(&mut self) {
        loop {
            let mut coarse: Vec<u32> = vec![];
            for site in &self.all {
                for level in 0..site.level.saturating_sub(1) {
                    self.around(site.key, level, |i| {
                        if self.all[i as usize].level == level {
                            coarse.push(i);
                        }
                    });
                }
            }
            if coarse.is_empty() {
                return;
            }
            coarse.sort_unstable();
            coarse.dedup();
            coarse.into_iter().for_each(|i| self.divide(i));
        }
    }
}

/// Points by coarse cubes, for looking around a place; of a moment, since points come.
pub(crate) struct Blocks<'a> {
    sites: &'a Sites,
    blocks: HashMap<Key, Vec<u32>>,
    lo: Key,
    hi: Key,
}

impl<'a> Blocks<'a> {
    /// The points as they are.
    pub(crate) fn of(sites: &'a Sites) -> Self {
        let mut blocks: HashMap<Key, Vec<u32>> = HashMap::new();
        let (mut lo, mut hi) = ([i32::MAX; 3], [i32::MIN; 3]);
        for (i, s) in sites.all.iter().enumerate() {
            let b = s.key.map(|c| c >> sites.lattice.halvings);
            lo = std::array::from_fn(|a| lo[a].min(b[a]));
            hi = std::array::from_fn(|a| hi[a].max(b[a]));
            blocks.entry(b).or_default().push(i as u32);
        }
        Self { sites, blocks, lo, hi }
    }

    /// The ways from the other points within `radius` units to `from`, scene units, nearest first, and whether these are all.
    pub(crate) fn near(&self, from: Key, radius: i32) -> (Vec<(f64, DVec3)>, bool) {
        let block = |c: i32| c >> self.sites.lattice.halvings;
        let lo: Key = std::array::from_fn(|a| block(from[a] - radius).max(self.lo[a]));
        let hi: Key = std::array::from_fn(|a| block(from[a] + radius).min(self.hi[a]));
        let limit = i64::from(radius) * i64::from(radius);
        let mut found: Vec<(i64, Key)> = vec![];
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    for &i in self.blocks.get(&[x, y, z]).into_iter().flatten() {
                        let k = self.sites.all[i as usize].key;
                        let w: Key = std::array::from_fn(|a| from[a] - k[a]);
                        let d = w.iter().map(|&c| i64::from(c) * i64::from(c)).sum::<i64>();
                        if d > 0 && d <= limit {
                            found.push((d, w));
                        }
                    }
                }
            }
        }
        found.sort_unstable();
        let unit = self.sites.lattice.unit;
        let complete = found.len() + 1 == self.sites.all.len();
        let way = |(d, w): (i64, Key)| ((d as f64).sqrt() * unit, DVec3::from(w.map(f64::from)) * unit);
        (found.into_iter().map(way).collect(), complete)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sites(max_level: u32) -> Sites {
        Sites::coarsest(Lattice::over([DVec3::ZERO, DVec3::new(4.0, 2.0, 0.0)], 5, max_level))
    }

    #[test]
    fn the_coarsest_points_are_centred_and_inflated_by_two() {
        let s = sites(4);
        assert_eq!(s.lattice.count, [9, 7, 7]);
        assert_eq!(s.lattice.span(), [DVec3::new(-2.0, -2.0, -3.0), DVec3::new(6.0, 4.0, 3.0)]);
    }

    #[test]
    fn dividing_adds_fourteen_then_twelve_and_everywhere_gives_the_finer_lattice() {
        let mut s = sites(4);
        let (before, middle) = (s.all.len(), s.at([16, 12, 12]).unwrap());
        s.divide(middle);
        assert_eq!(s.all.len(), before + 14);
        s.divide(middle);
        assert_eq!(s.all.len(), before + 26);
        let mut s = sites(4);
        for level in 0..2 {
            (0..s.all.len() as u32)
                .filter(|&i| s.all[i as usize].level == level)
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|i| s.divide(i));
        }
        for x in 0..=16 {
            for y in 0..=12 {
                for z in 0..=12 {
                    assert_eq!(s.at([2 * x, 2 * y, 2 * z]).map(|i| s.all[i as usize].level), Some(2));
                }
            }
        }
    }

    #[test]
    fn neighbours_differ_by_one_level_at_most() {
        let mut s = sites(12);
        for _ in 0..10 {
            // The point nearest the middle, over and over.
            let middle = s.at([4 << 6, 3 << 6, 3 << 6]).unwrap();
            s.divide(middle);
            s.balance();
        }
        assert_eq!(s.all.iter().map(|p| p.level).max(), Some(10));
        for (i, p) in s.all.iter().enumerate() {
            for q in &s.all[..i] {
                let apart = (0..3).map(|a| (p.key[a] - q.key[a]).abs()).max().unwrap();
                if apart <= s.lattice.reach(p.level.min(q.level)) {
                    assert!(p.level.abs_diff(q.level) <= 1, "{p:?} {q:?}");
                }
            }
        }
    }
}
