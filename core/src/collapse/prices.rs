//! The cheapest of many prices, in order, for a pass of batched mode: a histogram, then a radix sort of what is cheap enough.
//!
//! A price is ordered by the upper 24 bits of its float: sign, exponent and 15 bits of the mantissa. Prices closer than 3e-5 of
//! themselves count as equal, and equal ones come in the order in which they were pushed. O(n): one sweep over all, a few
//! over the cheap ones, no comparison that a processor could guess wrong.

/// A pass ends at this multiple of the price of its last wanted edge.
const SLACK: f32 = 1.5;
/// Leading bits of a price that the histogram tells apart: sign, exponent and three of the mantissa.
const COARSE: u32 = 12;

#[derive(Default)]
pub(super) struct Prices {
    /// Integers that order as the prices do.
    keys: Vec<u32>,
    /// Number of keys with these leading bits.
    histogram: Vec<u32>,
    order: Vec<u32>,
    /// Key and index in one.
    from: Vec<u64>,
    to: Vec<u64>,
}

impl Prices {
    pub(super) fn clear(&mut self) {
        self.keys.clear();
        self.histogram.clear();
        self.histogram.resize(1 << COARSE, 0);
    }

    #[inline]
    pub(super) fn push(&mut self, price: f32) {
        let key = key(price);
        self.keys.push(key);
        self.histogram[(key >> (32 - COARSE)) as usize] += 1;
    }

    /// The price that was pushed as the `i`-th, to the bits that order it.
    pub(super) fn of(&self, i: u32) -> f32 {
        price(self.keys[i as usize])
    }

    /// Indices of the cheapest `share` of all, cheapest first, less those that cost more than the `wanted`-th and some slack; with
    /// a share of 1 all.
    pub(super) fn cheapest(&mut self, wanted: usize, share: f32) -> &[u32] {
        let keep = ((self.keys.len() as f32 * share) as usize).max(64);
        let bits = 32 - COARSE;
        let mut last = self.bucket_of(keep);
        if share < 1.0 && wanted < keep {
            // What the wanted-th price is at most.
            let most = price((self.bucket_of(wanted) << bits) | ((1 << bits) - 1));
            last = last.min(key(most * SLACK) >> bits);
        }
        let Self { keys, order, from, to, .. } = self;
        from.resize(keys.len(), 0);
        let mut filled = 0;
        for (&key, i) in keys.iter().zip(0u64..) {
            // No branch: it would be mispredicted as often as not.
            from[filled] = (key as u64) << 32 | i;
            filled += (key >> bits <= last) as usize;
        }
        from.truncate(filled);
        to.clear();
        to.resize(from.len(), 0);
        for byte in [5, 6, 7] {
            sort_by_byte(from, to, 8 * byte);
            std::mem::swap(from, to);
        }
        let limit = match from.get(wanted) {
            Some(entry) if share < 1.0 => price((entry >> 32) as u32) * SLACK,
            _ => f32::MAX,
        };
        let end = from.partition_point(|entry| price((entry >> 32) as u32) <= limit).min(keep);
        order.clear();
        order.extend(from[..end].iter().map(|&entry| entry as u32));
        order
    }

    /// The leading bits of the `rank`-th key, or of the last one.
    fn bucket_of(&self, rank: usize) -> u32 {
        let mut below = 0;
        for (bucket, count) in self.histogram.iter().enumerate() {
            below += *count as usize;
            if below > rank {
                return bucket as u32;
            }
        }
        (1 << COARSE) - 1
    }
}

/// One stable sweep of a radix sort.
fn sort_by_byte(from: &[u64], to: &mut [u64], shift: u32) {
    let byte = |entry: u64| (entry >> shift) as usize & 255;
    let mut next = [0u32; 256];
    from.iter().for_each(|&entry| next[byte(entry)] += 1);
    let mut sum = 0;
    for n in &mut next {
        (*n, sum) = (sum, sum + *n);
    }
    for &entry in from {
        let at = &mut next[byte(entry)];
        to[*at as usize] = entry;
        *at += 1;
    }
}

/// An integer that orders as prices do.
#[inline]
pub(super) fn key(price: f32) -> u32 {
    // + 0.0: -0 and 0 are one price.
    let bits = (price + 0.0).to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// The price of a key.
#[inline]
pub(super) fn price(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

/// A set of small numbers, a bit each, in order.
#[derive(Default)]
pub(super) struct Bits(Vec<u64>);

impl Bits {
    /// Empties it and makes room for 0..n.
    pub(super) fn clear(&mut self, n: usize) {
        self.0.clear();
        self.0.resize(n.div_ceil(64), 0);
    }

    #[inline]
    pub(super) fn insert(&mut self, i: u32) {
        self.0[i as usize / 64] |= 1 << (i % 64);
    }

    #[inline]
    pub(super) fn remove(&mut self, i: u32) {
        self.0[i as usize / 64] &= !(1 << (i % 64));
    }

    #[inline]
    pub(super) fn has(&self, i: u32) -> bool {
        self.0[i as usize / 64] >> (i % 64) & 1 == 1
    }

    /// Visits the members, smallest first.
    pub(super) fn for_each(&self, mut f: impl FnMut(usize)) {
        for (i, &word) in self.0.iter().enumerate() {
            let mut word = word;
            while word != 0 {
                f(i * 64 + word.trailing_zeros() as usize);
                word &= word - 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_all_or_what_the_wanted_one_allows_comes_cheapest_first() {
        let check = |prices: &[f32], wanted, share, want: &[u32]| {
            let mut all = Prices::default();
            // Twice: what is left of a pass must not show in the next.
            for _ in 0..2 {
                all.clear();
                prices.iter().for_each(|&p| all.push(p));
                assert_eq!(all.cheapest(wanted, share), want);
            }
        };
        check(&[], 5, 0.3, &[]);
        check(&[3.0, -1.0, f32::MAX, 0.0, -2.0, -0.0, 1e-30], 0, 1.0, &[4, 1, 3, 5, 6, 0, 2]);
        // The wanted one is the third, 3.0: half as much more is the limit.
        check(&[1.0, 9.0, 2.0, 4.4, 3.0, 4.6], 2, 0.3, &[0, 2, 4, 3]);
        // More wanted than there are: only the share is a limit, and 64 are always looked at.
        let falling: Vec<f32> = (0..1000).map(|i| (1000 - i) as f32).collect();
        check(&falling, 5000, 0.3, &(700..1000).rev().collect::<Vec<u32>>());
        check(&falling, 5000, 0.01, &(936..1000).rev().collect::<Vec<u32>>());
    }
}
