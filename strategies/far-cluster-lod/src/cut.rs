//! A cut through one object's hierarchy: which groups are applied, that is, stand for what they replace.
//!
//! A set of groups is a cut when each comes with all groups below it; then the clusters of applied groups and the chunks that no applied
//! group replaces cover the object once, without cracks: groups were simplified with their borders locked.
//!
//! [`Cut::allowed`] applies what the view's tolerance allows. Errors and bounds grow upwards, so that with a tolerance that does not grow
//! with the box this alone is a cut; that all groups below are applied is asked for all the same, so that it is one whatever the
//! tolerance says. [`Cut::settle`] then changes it for what is resident: it goes up from what is missing to the next group that is there, or,
//! where the top is missing, down to finer ones. O(groups).

use crate::index::ObjectGroups;

/// Which groups stand for what they replace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Cut {
    /// Of each group of the object.
    pub(crate) applied: Vec<bool>,
}

/// What one can see and has of an object.
pub(crate) struct Has<'a> {
    /// Whether a group's payload is there.
    pub(crate) group: &'a dyn Fn(u32) -> bool,
    /// Whether a chunk is there.
    pub(crate) chunk: &'a dyn Fn(usize) -> bool,
    /// Whether the view may see a group's part.
    pub(crate) sees_part: &'a dyn Fn(u32, usize) -> bool,
    /// Whether the view may see a chunk.
    pub(crate) sees_chunk: &'a dyn Fn(usize) -> bool,
}

impl Cut {
    /// Every group that `within` lets through and that is above none that is not applied.
    pub(crate) fn allowed(object: &ObjectGroups, below: &[Vec<u32>], within: impl Fn(u32) -> bool) -> Self {
        let mut applied = vec![false; object.groups.len()];
        for (g, own) in below.iter().enumerate() {
            applied[g] = own.iter().all(|&b| applied[b as usize]) && within(g as u32);
        }
        Self { applied }
    }

    fn is(&self, group: Option<u32>) -> bool {
        group.is_some_and(|g| self.applied[g as usize])
    }

    /// Whether a group's part is drawn.
    pub(crate) fn draws(&self, object: &ObjectGroups, group: u32, part: usize) -> bool {
        self.is(Some(group)) && !self.is(object.groups[group as usize].parts[part].replaced_by)
    }

    /// Whether a chunk is drawn.
    pub(crate) fn draws_chunk(&self, object: &ObjectGroups, chunk: usize) -> bool {
        !self.is(object.chunks[chunk])
    }

    /// The nearest coarser cut that can be drawn, else the nearest finer one, and 0; where neither can, the coarser one and how many of
    /// its visible parts and chunks are missing.
    pub(crate) fn settle(self, object: &ObjectGroups, below: &[Vec<u32>], has: &Has<'_>) -> (Self, u32) {
        let (up, missing) = self.clone().up(object, below, has);
        match missing {
            0 => (up, 0),
            _ => self.down(object, below, has).map_or((up, missing), |down| (down, 0)),
        }
    }

    /// Applies what replaces a missing part, until all that is seen is there or at the top.
    fn up(mut self, object: &ObjectGroups, below: &[Vec<u32>], has: &Has<'_>) -> (Self, u32) {
        let mut missing = 0;
        for c in 0..object.chunks.len() {
            if self.draws_chunk(object, c) && (has.sees_chunk)(c) && !(has.chunk)(c) {
                match object.chunks[c] {
                    Some(g) => _ = self.raise(below, g),
                    None => missing += 1,
                }
            }
        }
        let mut open: Vec<u32> = (0..object.groups.len() as u32).filter(|&g| self.is(Some(g))).collect();
        while let Some(g) = open.pop() {
            if (has.group)(g) {
                continue;
            }
            for (p, part) in object.groups[g as usize].parts.iter().enumerate() {
                if self.draws(object, g, p) && (has.sees_part)(g, p) {
                    match part.replaced_by {
                        Some(h) => open.extend(self.raise(below, h)),
                        None => missing += 1,
                    }
                }
            }
        }
        (self, missing)
    }

    /// Applies a group and all below it; those that were not.
    fn raise(&mut self, below: &[Vec<u32>], group: u32) -> Vec<u32> {
        let (mut raised, mut open) = (vec![], vec![group]);
        while let Some(g) = open.pop() {
            if !std::mem::replace(&mut self.applied[g as usize], true) {
                raised.push(g);
                open.extend(&below[g as usize]);
            }
        }
        raised
    }

    /// Takes back groups that are missing, until all that is seen is there; `None` where a chunk is not.
    fn down(mut self, object: &ObjectGroups, below: &[Vec<u32>], has: &Has<'_>) -> Option<Self> {
        loop {
            let lacks = |&g: &u32| {
                let seen = |p: usize| self.draws(object, g, p) && (has.sees_part)(g, p);
                (0..object.groups[g as usize].parts.len()).any(seen) && !(has.group)(g)
            };
            let lacking: Vec<u32> = (0..object.groups.len() as u32).filter(lacks).collect();
            if lacking.is_empty() {
                break;
            }
            lacking.into_iter().for_each(|g| self.applied[g as usize] = false);
            for (g, own) in below.iter().enumerate() {
                self.applied[g] &= own.iter().all(|&b| self.applied[b as usize]);
            }
        }
        let there = |c: usize| !self.draws_chunk(object, c) || !(has.sees_chunk)(c) || (has.chunk)(c);
        (0..object.chunks.len()).all(there).then_some(self)
    }
}
