//! `near-to-far-lru`: what stands within a radius is fetched near to far; what was used longest ago makes room.
//!
//! The cache of image placement (Aliaga and Lastra, "Automatic image placement to provide a guaranteed frame rate", 1999, section 5):
//! all images within a radius of the eye are loaded in near to far order, least recently used ones are dropped. Chosen here:
//!
//! * The order: the eye's cell, what is in view first; then the other cells within the radius, near to far. A block is
//!   fetched after the one that it is useless without, and both or neither.
//! * What the eye's cell wants may push out anything else. What other cells want, in advance, pushes out only what no cell
//!   within the radius wants: on the border between two distances nothing goes back and forth.
//! * Nothing is evicted but for room. Of equally recent blocks those of farther cells go first.
//! * Without a radius it is what the viewer covers in [`AHEAD_S`] seconds at the frame's speed; a viewer who stands still has the
//!   time to load when setting out.
//!
//! O(n log n) a frame for the n blocks within the radius and in the cache.

use std::collections::{BTreeMap, BTreeSet};

use farfield_core::id::Block;
use farfield_core::strategy::{Candidate, Demand, Motion, Plan, Planner, Scheduler};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How far ahead in time is loaded without a radius, seconds.
const AHEAD_S: f64 = 2.0;

/// Fetches near to far, evicts what was used longest ago.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NearToFarLru {
    /// Cells this near are loaded in advance; without it what the viewer covers in two seconds at its present speed.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "scene units"))]
    pub radius: Option<f32>,
}

#[typetag::serde(name = "near-to-far-lru")]
impl Scheduler for NearToFarLru {
    fn start(&self) -> Box<dyn Planner> {
        Box::new(Cache { radius: self.radius, ..Cache::default() })
    }
}

#[derive(Clone, Copy, Debug)]
struct Held {
    bytes: u64,
    /// The frame that last chose it, and how many blocks of that frame came after it.
    used: (u64, usize),
}

#[derive(Default)]
struct Cache {
    radius: Option<f32>,
    frame: u64,
    /// Time of the last frame, seconds.
    before: Option<f64>,
    /// Asked for, neither freed nor called off.
    held: BTreeMap<Block, Held>,
}

impl Planner for Cache {
    fn plan(&mut self, motion: &Motion<'_>, demand: &dyn Demand, byte_budget: u64) -> Plan {
        let radius = self.radius.unwrap_or_else(|| self.ahead(motion));
        (self.frame, self.before) = (self.frame + 1, Some(motion.time_s));
        let here = demand.near(motion.eye, 0.0).first().copied();
        let mut own = vec![];
        here.iter().for_each(|&c| demand.of(c, motion.eye, &mut own));
        own.sort_by_key(|c| !c.in_view);
        let mut others = vec![];
        for cell in demand.near(motion.eye, radius).into_iter().filter(|c| Some(*c) != here) {
            let first = others.len();
            demand.of(cell, motion.eye, &mut others);
            others[first..].sort_by_key(|c| !c.in_view);
        }
        let chosen = self.choose(&own, &others, byte_budget);
        for (i, &(b, bytes)) in chosen.iter().enumerate() {
            self.held.insert(b, Held { bytes, used: (self.frame, chosen.len() - i) });
        }
        let mut plan = self.make_room(demand, byte_budget);
        plan.fetch = chosen.into_iter().map(|c| c.0).filter(|b| !demand.resident(*b)).collect();
        plan
    }
}

impl Cache {
    /// What the viewer covers in [`AHEAD_S`] at its speed since the last frame.
    fn ahead(&self, motion: &Motion<'_>) -> f32 {
        let passed = self.before.map_or(0.0, |t| motion.time_s - t);
        if passed > 0.0 { (f64::from(motion.moved) * AHEAD_S / passed) as f32 } else { 0.0 }
    }

    /// What the frame wants and the budget allows, in the order of loading, with bytes: all that the eye's cell wants, then of the
    /// other cells what is held, then the rest.
    fn choose(&self, own: &[Candidate], others: &[Candidate], byte_budget: u64) -> Vec<(Block, u64)> {
        let bytes: BTreeMap<Block, u64> = own.iter().chain(others).map(|c| (c.block, c.bytes)).collect();
        let (mut taken, mut left) = (BTreeSet::new(), byte_budget);
        let mut take = |c: &Candidate| {
            let mut pair: Vec<Block> = c.after.into_iter().chain([c.block]).collect();
            pair.retain(|b| !taken.contains(b));
            let need: u64 = pair.iter().map(|b| bytes.get(b).copied().unwrap_or(0)).sum();
            if need <= left {
                left -= need;
                taken.extend(pair);
            }
        };
        let held = |c: &&Candidate| self.held.contains_key(&c.block);
        own.iter().chain(others.iter().filter(held)).chain(others.iter().filter(|c| !held(c))).for_each(&mut take);
        let mut out = vec![];
        for c in own.iter().chain(others) {
            for b in c.after.into_iter().chain([c.block]) {
                if taken.remove(&b) {
                    out.push((b, bytes.get(&b).copied().unwrap_or(0)));
                }
            }
        }
        out
    }

    /// Lets go what was used longest ago until the rest fits, and calls off what this frame no longer wants and that never came.
    fn make_room(&mut self, demand: &dyn Demand, byte_budget: u64) -> Plan {
        let mut plan = Plan::default();
        let mut old: Vec<((u64, usize), Block)> =
            self.held.iter().filter(|(_, h)| h.used.0 < self.frame).map(|(&b, h)| (h.used, b)).collect();
        old.retain(|&(_, b)| {
            let there = demand.resident(b);
            if !there {
                self.held.remove(&b);
                plan.cancel.push(b);
            }
            there
        });
        old.sort_unstable();
        let mut bytes: u64 = self.held.values().map(|h| h.bytes).sum();
        for (_, b) in old {
            if bytes <= byte_budget {
                break;
            }
            bytes -= self.held.remove(&b).map_or(0, |h| h.bytes);
            plan.evict.push(b);
        }
        plan
    }
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

    /// Cells of edge 10 in a row along x, each with two images of 10 bytes, the second in view, and 5 bytes that both need.
    #[derive(Default)]
    struct Row {
        resident: BTreeSet<Block>,
    }
    impl Demand for Row {
        fn near(&self, eye: &Camera, radius: f32) -> Vec<CellId> {
            let distance = |c: u32| {
                let (low, x) = (10.0 * f64::from(c), eye.eye.x);
                (low - x).max(x - low - 10.0).max(0.0)
            };
            let here = (eye.eye.x / 10.0).floor() as u32;
            let mut cells: Vec<u32> = (0..10).filter(|&c| c == here || distance(c) <= f64::from(radius)).collect();
            cells.sort_by(|&a, &b| (a != here).cmp(&(b != here)).then(distance(a).total_cmp(&distance(b))));
            cells.into_iter().map(CellId).collect()
        }
        fn of(&self, cell: CellId, _from: &Camera, out: &mut Vec<Candidate>) {
            let one = |id: u32, bytes: u64, in_view: bool, after: Option<Block>| Candidate {
                block: block(cell.0, id),
                bytes,
                bounds: Aabb::of([Vec3::ZERO]),
                error_px_without: 1.0,
                in_view,
                after,
            };
            let needed = Some(block(cell.0, 0));
            out.extend([one(1, 10, false, needed), one(2, 10, true, needed), one(0, 5, false, None)]);
        }
        fn resident(&self, block: Block) -> bool {
            self.resident.contains(&block)
        }
    }

    /// Walks at a frame a second; checks at every step that no more is held than allowed, nor evicted than there is.
    fn walk(settings: NearToFarLru, budget: u64, places: &[f64]) -> Vec<Plan> {
        let (mut world, mut planner) = (Row::default(), settings.start());
        let bytes = |b: &Block| if matches!(b, Block::Payload(p) if p.id.0 == 0) { 5 } else { 10 };
        let mut at = places[0];
        let step = |(i, &x): (usize, &f64)| {
            let eye = Camera::looking(DVec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Y, 1.0, [8, 8], 0.1);
            let moved = (x - at).abs() as f32;
            at = x;
            let motion = Motion { time_s: i as f64, moved, turned_rad: 0.0, eye: &eye, lights: &[], future: None };
            let plan = planner.plan(&motion, &world, budget);
            assert!(plan.evict.iter().all(|b| world.resident.remove(b)));
            assert!(plan.fetch.iter().all(|b| world.resident.insert(*b)));
            assert!(world.resident.iter().map(bytes).sum::<u64>() <= budget, "frame {i}");
            plan
        };
        places.iter().enumerate().map(step).collect()
    }

    fn radius(r: f32) -> NearToFarLru {
        NearToFarLru { radius: Some(r) }
    }

    fn all_of(cell: u32) -> [Block; 3] {
        [block(cell, 0), block(cell, 2), block(cell, 1)]
    }

    #[test]
    fn cells_within_the_radius_come_near_to_far_what_is_in_view_first_after_what_it_needs() {
        let plans = walk(radius(6.0), 1000, &[36.0, 37.0]);
        assert_eq!(plans[0].fetch, [all_of(3), all_of(4), all_of(2)].concat());
        assert_eq!(plans[1], Plan::default());
    }

    #[test]
    fn nothing_goes_without_need_and_then_what_was_used_longest_ago() {
        // Room for three cells of 25 bytes.
        let plans = walk(radius(0.5), 75, &[5.0, 15.0, 25.0, 5.0, 35.0, 5.0, 25.0]);
        assert!(plans[..4].iter().all(|p| p.evict.is_empty()));
        // Cell 0 was seen again: cell 1 is the oldest; what its images need goes last.
        assert_eq!(plans[4].evict, [block(1, 1), block(1, 2), block(1, 0)]);
        assert_eq!(plans[4].fetch, all_of(3));
        assert!(plans[5..].iter().all(|p| *p == Plan::default()));
    }

    #[test]
    fn only_as_much_goes_as_is_needed() {
        let plans = walk(radius(0.5), 65, &[5.0, 15.0, 25.0]);
        assert_eq!(plans[2].evict, [block(0, 1)]);
    }

    #[test]
    fn on_a_border_nothing_goes_back_and_forth() {
        // Room for one cell and a half: the neighbours on both sides compete for the rest.
        let jitter = [15.4, 14.6, 15.4, 14.6, 15.4];
        let plans = walk(radius(8.0), 40, &jitter);
        assert!(plans[0].fetch.len() > 3 && plans[1..].iter().all(|p| *p == Plan::default()), "{plans:?}");
        // Over the border itself, with room for both.
        let plans = walk(radius(2.0), 50, &[9.5, 10.5, 9.5, 10.5]);
        assert!(plans[1..].iter().all(|p| *p == Plan::default()));
    }

    #[test]
    fn the_cell_of_the_eye_has_precedence_over_what_was_loaded_in_advance() {
        let plans = walk(radius(3.0), 35, &[8.0, 13.5]);
        // Of the neighbour only what its images need fits beside it.
        assert_eq!(plans[0].fetch, [block(0, 0), block(0, 2), block(0, 1), block(1, 0)]);
        assert_eq!(plans[1].fetch, [block(1, 2), block(1, 1)]);
        assert_eq!(plans[1].evict, [block(0, 1), block(0, 2)]);
    }

    #[test]
    fn what_never_came_and_is_no_longer_wanted_is_called_off() {
        let (world, mut planner) = (Row::default(), radius(0.0).start());
        let mut plan = |x: f64| {
            let eye = Camera::looking(DVec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Y, 1.0, [8, 8], 0.1);
            let motion = Motion { time_s: 0.0, moved: 0.0, turned_rad: 0.0, eye: &eye, lights: &[], future: None };
            planner.plan(&motion, &world, 1000)
        };
        assert_eq!(plan(5.0).fetch, all_of(0));
        let next = plan(25.0);
        assert_eq!((next.fetch, next.cancel.len(), next.evict.len()), (all_of(2).to_vec(), 3, 0));
    }

    #[test]
    fn without_a_radius_a_fast_viewer_loads_farther_ahead_than_a_slow_one() {
        let cells = |plan: &Plan| plan.fetch.iter().filter(|b| matches!(b, Block::Payload(p) if p.id.0 == 0)).count();
        // From the first place nothing is known of speed.
        let slow = walk(NearToFarLru::default(), 1000, &[44.0, 45.0]);
        let fast = walk(NearToFarLru::default(), 1000, &[38.0, 45.0]);
        assert_eq!((cells(&slow[0]), cells(&slow[1])), (1, 0));
        assert_eq!((cells(&fast[0]), cells(&fast[1])), (1, 2));
    }
}
