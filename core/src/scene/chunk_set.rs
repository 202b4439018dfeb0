//! Sets of placed chunks.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::id::ChunkId;

/// A set of placed chunks: sorted, disjoint, non-adjacent runs of ids.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ChunkSet {
    runs: Vec<Range<u32>>,
}

impl ChunkSet {
    /// The set of one run of ids.
    pub fn from_range(r: Range<u32>) -> Self {
        Self { runs: if r.is_empty() { vec![] } else { vec![r] } }
    }

    /// Its runs.
    pub fn runs(&self) -> &[Range<u32>] {
        &self.runs
    }

    /// Its members, ascending.
    pub fn iter(&self) -> impl Iterator<Item = ChunkId> + '_ {
        self.runs.iter().cloned().flatten().map(ChunkId)
    }

    /// How many members it has.
    pub fn len(&self) -> usize {
        self.runs.iter().map(|r| r.len()).sum()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Whether `c` is a member. O(log runs).
    pub fn contains(&self, c: ChunkId) -> bool {
        let i = self.runs.partition_point(|r| r.end <= c.0);
        self.runs.get(i).is_some_and(|r| r.start <= c.0)
    }

    /// The ids below `n` that are not members.
    pub fn complement(&self, n: u32) -> Self {
        let mut runs = vec![];
        let mut at = 0;
        for r in &self.runs {
            if r.start > at {
                runs.push(at..r.start.min(n));
            }
            at = r.end;
        }
        if at < n {
            runs.push(at..n);
        }
        Self { runs }
    }

    /// The members that both have.
    pub fn intersection(&self, other: &Self) -> Self {
        let (mut runs, mut i, mut j) = (vec![], 0, 0);
        while let (Some(a), Some(b)) = (self.runs.get(i), other.runs.get(j)) {
            let r = a.start.max(b.start)..a.end.min(b.end);
            if !r.is_empty() {
                runs.push(r);
            }
            if a.end <= b.end { i += 1 } else { j += 1 }
        }
        Self { runs }
    }
}

impl FromIterator<ChunkId> for ChunkSet {
    fn from_iter<I: IntoIterator<Item = ChunkId>>(ids: I) -> Self {
        let mut all: Vec<u32> = ids.into_iter().map(|c| c.0).collect();
        all.sort_unstable();
        all.dedup();
        let mut runs: Vec<Range<u32>> = vec![];
        for i in all {
            match runs.last_mut() {
                Some(r) if r.end == i => r.end += 1,
                _ => runs.push(i..i + 1),
            }
        }
        Self { runs }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    fn set(ids: &BTreeSet<u32>) -> ChunkSet {
        ids.iter().map(|&i| ChunkId(i)).collect()
    }
    fn back(s: &ChunkSet) -> BTreeSet<u32> {
        s.iter().map(|c| c.0).collect()
    }

    proptest! {
        #[test]
        fn behaves_as_a_set(
            a in prop::collection::btree_set(0u32..60, 0..40), b in prop::collection::btree_set(0u32..60, 0..40)
        ) {
            let (x, y) = (set(&a), set(&b));
            prop_assert_eq!(&back(&x), &a);
            prop_assert_eq!(x.len(), a.len());
            prop_assert!((0..60).all(|i| x.contains(ChunkId(i)) == a.contains(&i)));
            prop_assert_eq!(back(&x.intersection(&y)), &a & &b);
            prop_assert_eq!(back(&x.complement(60)), &(0..60).collect() - &a);
            prop_assert_eq!(x.complement(60).complement(60), x);
        }
    }
}
