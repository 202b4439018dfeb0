//! `load-on-entry`: what the active cell wants is fetched when the cell is entered, the rest is freed.
//!
//! The baseline without prefetching: simple, least memory, and a pause at every border. Blocks go in the far view's order, those
//! in view first, a block after the one that it is useless without. What does not fit the byte budget is left out from the
//! end and is counted as missing by the far view. O(n log n) for the n blocks of the cell.

use std::collections::BTreeSet;

use farfield_core::id::Block;
use farfield_core::strategy::{Candidate, Demand, Motion, Plan, Planner, Scheduler};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fetches what the active cell wants, evicts the rest.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadOnEntry {}

#[typetag::serde(name = "load-on-entry")]
impl Scheduler for LoadOnEntry {
    fn start(&self) -> Box<dyn Planner> {
        Box::new(OnEntry::default())
    }
}

#[derive(Default)]
struct OnEntry {
    /// Asked for and not called off.
    held: BTreeSet<Block>,
}

impl Planner for OnEntry {
    fn plan(&mut self, motion: &Motion<'_>, demand: &dyn Demand, byte_budget: u64) -> Plan {
        let mut candidates = vec![];
        // Radius 0: the cell that the eye is in, and no other.
        if let Some(&cell) = demand.near(motion.eye, 0.0).first() {
            demand.of(cell, motion.eye, &mut candidates);
        }
        let keep = within(candidates, byte_budget);
        let wanted: BTreeSet<Block> = keep.iter().copied().collect();
        let mut plan = Plan { fetch: keep.into_iter().filter(|b| !demand.resident(*b)).collect(), ..Plan::default() };
        for &b in self.held.difference(&wanted) {
            if demand.resident(b) { plan.evict.push(b) } else { plan.cancel.push(b) }
        }
        self.held = wanted;
        plan
    }
}

/// Blocks in the order of loading, as many as fit.
fn within(mut candidates: Vec<Candidate>, byte_budget: u64) -> Vec<Block> {
    candidates.sort_by_key(|c| !c.in_view);
    let bytes = |b: Block| candidates.iter().find(|c| c.block == b).map_or(0, |c| c.bytes);
    let (mut out, mut taken, mut left) = (vec![], BTreeSet::new(), byte_budget);
    for c in &candidates {
        // What it needs first, itself second; both or neither.
        let mut pair: Vec<Block> = c.after.into_iter().chain([c.block]).collect();
        pair.retain(|b| !taken.contains(b));
        let need: u64 = pair.iter().map(|&b| if b == c.block { c.bytes } else { bytes(b) }).sum();
        if need <= left {
            left -= need;
            taken.extend(pair.iter().copied());
            out.extend(pair);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::id::{AssetId, CellId, LocalPayload, PayloadRef};
    use farfield_core::{Aabb, Camera};
    use glam::{DVec3, Vec3};

    fn block(asset: u32, id: u32) -> Block {
        Block::Payload(PayloadRef { asset: AssetId(asset), id: LocalPayload(id) })
    }
    fn candidate(block: Block, bytes: u64, in_view: bool, after: Option<Block>) -> Candidate {
        Candidate { block, bytes, bounds: Aabb::of([Vec3::ZERO]), error_px_without: 1.0, in_view, after }
    }

    /// Cell 0 left of x = 0, cell 1 right of it.
    #[derive(Default)]
    struct World {
        resident: BTreeSet<Block>,
    }
    impl Demand for World {
        fn near(&self, eye: &Camera, _radius: f32) -> Vec<CellId> {
            vec![CellId(u32::from(eye.eye.x > 0.0))]
        }
        fn of(&self, cell: CellId, _from: &Camera, out: &mut Vec<Candidate>) {
            let atlas = block(cell.0, 0);
            out.push(candidate(block(cell.0, 1), 10, false, Some(atlas)));
            out.push(candidate(block(cell.0, 2), 10, true, Some(atlas)));
            out.push(candidate(atlas, 50, false, None));
        }
        fn resident(&self, block: Block) -> bool {
            self.resident.contains(&block)
        }
    }

    fn walk(budget: u64, eyes: &[f64]) -> Vec<Plan> {
        let (mut world, mut planner) = (World::default(), LoadOnEntry {}.start());
        let plan = |&x: &f64| {
            let eye = Camera::looking(DVec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Y, 1.0, [8, 8], 0.1);
            let motion = Motion { time_s: 0.0, moved: 1.0, turned_rad: 0.0, eye: &eye, lights: &[], future: None };
            let plan = planner.plan(&motion, &world, budget);
            plan.evict.iter().for_each(|b| _ = world.resident.remove(b));
            world.resident.extend(plan.fetch.iter().copied());
            plan
        };
        eyes.iter().map(plan).collect()
    }

    #[test]
    fn a_cell_is_loaded_when_entered_and_freed_when_left() {
        let plans = walk(1000, &[-1.0, -0.5, 1.0]);
        // The one in view first, but after the atlas that it needs.
        assert_eq!(plans[0].fetch, [block(0, 0), block(0, 2), block(0, 1)]);
        assert_eq!(plans[1], Plan::default());
        assert_eq!(plans[2].fetch, [block(1, 0), block(1, 2), block(1, 1)]);
        assert_eq!(plans[2].evict, [block(0, 0), block(0, 1), block(0, 2)]);
    }

    #[test]
    fn what_does_not_fit_stays_out_and_nothing_is_loaded_without_what_it_needs() {
        assert_eq!(walk(60, &[-1.0])[0].fetch, [block(0, 0), block(0, 2)]);
        assert!(walk(40, &[-1.0])[0].fetch.is_empty());
    }
}
