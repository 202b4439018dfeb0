//! `movement-priority`: blocks are fetched in the order of the movement that the viewer would need before they matter.
//!
//! Follows the prefetching of the point-polygon hierarchy (Guthe, Borodin, Balazs and Klein, "Real-time appearance preserving out-of-core
//! rendering with shadows", 2004, section 4.3): "the loading priority of a cell's geometry depends on the viewer's movement that is
//! necessary for the cell to become visible", and the same for the frusta of lights. The paper gives no formula. Here:
//!
//! ```text
//! time = max( min(turn / turn rate, way / speed),        until the view may see the block: turning alone or going alone (see `movement`)
//!             d (1 - e / max_px) / speed,                until its error without it exceeds max_px: e px now, at distance d, grows as 1 / d
//!             way to its cell / speed )                  blocks of other cells: until the viewer is there
//! ```
//!
//! in seconds, and the priority of a block
//!
//! ```text
//! priority = e 2^(-time / HALF_S)            what is in view: e
//! ```
//!
//! so that what would be off by far, were it seen in a moment, comes before what is seen and off by little: where the budget is too small for
//! all that is in view, a turn does not uncover what is hardly there. The rates are settings, or the largest that the walk has shown so far;
//! while there are none, the turn decides, then the way. Of several frusta that want a block (the eye's, the lights') the one that needs it first counts.
//!
//! * A block comes after the one that it is useless without, and neither without the other.
//! * Nothing is evicted but for room, and then what is needed last, or is no longer asked for at all.
//! * *Hysteresis*: what is there is only pushed out by what is more urgent by the factor [`MARGIN`], and what was in view counts as in view
//!   for [`LINGER_S`] longer. So on a border nothing goes back and forth, and where the budget is too small for what is in view, the same set
//!   stays.
//!
//! Limits: turning and going at once takes less time than either alone; a movement is a straight one. O(n log n) a frame for n blocks.

use std::collections::{BTreeMap, BTreeSet};

use farfield_core::Camera;
use farfield_core::id::{Block, CellId};
use farfield_core::strategy::{Candidate, Demand, Motion, Plan, Planner, Scheduler};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::movement::{turn_rad, way};

/// How much more urgent a block has to be than one that it pushes out.
const MARGIN: f64 = 1.25;
/// In so much time until it matters a block's priority halves, seconds. On walks along a model too large for its budget 0.1 to 1 made no
/// difference.
const HALF_S: f64 = 0.5;
/// How long a block counts as in view after it was, seconds: longer than a jitter of the head.
const LINGER_S: f64 = 0.5;

/// Fetches in the order of the movement that is needed before a block matters.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MovementPriority {
    /// The viewer's greatest speed; without it the greatest that the walk has shown.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "scene units/s"))]
    pub speed: Option<f32>,
    /// The viewer's greatest turn rate; without it the greatest that the walk has shown.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("unit" = "deg/s"))]
    pub turn_deg_per_s: Option<f32>,
    /// The error from which a block is needed: that of the far field.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f32,
    /// Other cells are asked for their blocks where the viewer may be there so soon.
    #[serde(default = "two")]
    #[schemars(range(min = 0.0), extend("unit" = "s"))]
    pub ahead_s: f32,
}

fn one() -> f32 {
    1.0
}
fn two() -> f32 {
    2.0
}

impl Default for MovementPriority {
    fn default() -> Self {
        Self { speed: None, turn_deg_per_s: None, max_px: one(), ahead_s: two() }
    }
}

#[typetag::serde(name = "movement-priority")]
impl Scheduler for MovementPriority {
    fn start(&self) -> Box<dyn Planner> {
        Box::new(Movement { own: self.clone(), ..Movement::default() })
    }
}

/// What the viewer may do, a second.
#[derive(Clone, Copy, Debug, Default)]
struct Rates {
    speed: f64,
    turn_rad: f64,
}

/// How soon a block matters, and how much; less is sooner.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Urgency {
    /// 1 / priority, 1/px.
    main: f64,
    /// 0: in view; 1: not.
    rank: u8,
    /// Radians, then scene units: where nothing is known of rates.
    movement: (f64, f64),
}

impl Urgency {
    /// For what is not there and might push something out.
    fn delayed(self) -> Self {
        let (turn, way) = self.movement;
        Self { main: self.main * MARGIN, rank: self.rank, movement: (turn * MARGIN, way * MARGIN) }
    }
}

/// A block that some frustum wants.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    bytes: u64,
    after: Option<Block>,
    urgency: Urgency,
}

#[derive(Default)]
struct Movement {
    own: MovementPriority,
    /// The largest rates so far.
    seen: Rates,
    /// Time of the last frame, seconds.
    before: Option<f64>,
    /// Asked for, neither freed nor called off, with bytes.
    held: BTreeMap<Block, u64>,
    /// When a block was in view last, seconds.
    in_view: BTreeMap<Block, f64>,
}

impl Planner for Movement {
    fn plan(&mut self, motion: &Motion<'_>, demand: &dyn Demand, byte_budget: u64) -> Plan {
        let rates = self.rates(motion);
        let wanted = self.wanted(motion, demand, rates);
        let chosen = self.choose(&wanted, demand, byte_budget);
        let mut plan = self.make_room(&chosen, &wanted, demand, byte_budget);
        self.held.extend(chosen.iter().map(|b| (*b, wanted[b].bytes)));
        plan.fetch = chosen.into_iter().filter(|b| !demand.resident(*b)).collect();
        plan
    }
}

impl Movement {
    fn rates(&mut self, motion: &Motion<'_>) -> Rates {
        let passed_s = self.before.map_or(0.0, |t| motion.time_s - t);
        self.before = Some(motion.time_s);
        if passed_s > 0.0 {
            self.seen.speed = self.seen.speed.max(f64::from(motion.moved) / passed_s);
            self.seen.turn_rad = self.seen.turn_rad.max(f64::from(motion.turned_rad) / passed_s);
        }
        Rates {
            speed: self.own.speed.map_or(self.seen.speed, f64::from),
            turn_rad: self.own.turn_deg_per_s.map_or(self.seen.turn_rad, |d| f64::from(d).to_radians()),
        }
    }

    /// All blocks that any frustum wants, each as urgent as the one that needs it first says.
    fn wanted(&mut self, motion: &Motion<'_>, demand: &dyn Demand, rates: Rates) -> BTreeMap<Block, Wanted> {
        let here = demand.near(motion.eye, 0.0).first().copied();
        let ahead = demand.near(motion.eye, (rates.speed * f64::from(self.own.ahead_s)) as f32);
        let cells: Vec<CellId> = here.into_iter().chain(ahead.into_iter().filter(|c| Some(*c) != here)).collect();
        let mut out: BTreeMap<Block, Wanted> = BTreeMap::new();
        let mut candidates = vec![];
        for cell in cells {
            let way_there = if Some(cell) == here { 0.0 } else { f64::from(demand.distance(cell, motion.eye)) };
            for view in std::iter::once(motion.eye).chain(motion.lights) {
                candidates.clear();
                demand.of(cell, view, &mut candidates);
                for c in &candidates {
                    if c.in_view && Some(cell) == here {
                        self.in_view.insert(c.block, motion.time_s);
                    }
                    let lingers = self.in_view.get(&c.block).is_some_and(|t| motion.time_s - t <= LINGER_S);
                    let seen = Some(cell) == here && (c.in_view || lingers && demand.resident(c.block));
                    let urgency = self.urgency(c, seen, view, way_there, rates);
                    let one = Wanted { bytes: c.bytes, after: c.after, urgency };
                    let known = out.entry(c.block).or_insert(one);
                    if urgency < known.urgency {
                        *known = one;
                    }
                }
            }
        }
        self.in_view.retain(|_, t| motion.time_s - *t <= LINGER_S);
        out
    }

    /// See the module.
    fn urgency(&self, c: &Candidate, seen: bool, view: &Camera, way_there: f64, rates: Rates) -> Urgency {
        // Finite, so that of two infinite ones the movement decides.
        let error_px = f64::from(c.error_px_without).clamp(0.0, f32::MAX.into());
        if seen {
            return Urgency { main: 1.0 / error_px, rank: 0, movement: (0.0, 0.0) };
        }
        let (turn, go) = (turn_rad(view, &c.bounds), way(view, &c.bounds));
        let distance = f64::from(c.bounds.distance(view.eye.as_vec3()));
        let share = error_px / f64::from(self.own.max_px);
        let near = if share < 1.0 { distance * (1.0 - share) } else { 0.0 };
        let time = |movement: f64, rate: f64| if movement > 0.0 { movement / rate } else { 0.0 };
        let shown = time(turn, rates.turn_rad).min(time(go, rates.speed));
        let time_s = shown.max(time(near, rates.speed)).max(time(way_there, rates.speed));
        let main = (time_s / HALF_S).exp2() / error_px;
        Urgency { main, rank: 1, movement: (turn, go.min(near.max(way_there))) }
    }

    /// As much of what is wanted as fits, most urgent first, each after what it needs.
    fn choose(&self, wanted: &BTreeMap<Block, Wanted>, demand: &dyn Demand, byte_budget: u64) -> Vec<Block> {
        let there = |b: &Block| self.held.contains_key(b) && demand.resident(*b);
        let mut order: Vec<(Urgency, bool, Block)> = wanted
            .iter()
            .map(|(b, w)| if there(b) { (w.urgency, false, *b) } else { (w.urgency.delayed(), true, *b) })
            .collect();
        order.sort_by(|a, b| a.0.cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let (mut out, mut taken, mut left) = (vec![], BTreeSet::new(), byte_budget);
        for (.., block) in order {
            // What it needs first, back to the first of all; all or none.
            let Some(chain) = chain(block, wanted, &taken) else { continue };
            let need: u64 = chain.iter().map(|b| wanted[b].bytes).sum();
            if need <= left {
                left -= need;
                taken.extend(chain.iter().copied());
                out.extend(chain);
            }
        }
        out
    }

    /// Lets go what is needed last until the chosen blocks fit, and calls off what is not chosen and never came.
    fn make_room(
        &mut self,
        chosen: &[Block],
        wanted: &BTreeMap<Block, Wanted>,
        demand: &dyn Demand,
        byte_budget: u64,
    ) -> Plan {
        let mut plan = Plan::default();
        let keep: BTreeSet<Block> = chosen.iter().copied().collect();
        let mut spare: BTreeMap<Block, Option<Urgency>> = BTreeMap::new();
        self.held.retain(|b, _| {
            let stays = keep.contains(b) || demand.resident(*b);
            if !stays {
                plan.cancel.push(*b);
            } else if !keep.contains(b) {
                spare.insert(*b, wanted.get(b).map(|w| w.urgency));
            }
            stays
        });
        // What others need is as urgent as they are.
        let needed: Vec<(Block, Urgency)> = spare
            .iter()
            .filter_map(|(b, u)| Some((chain(*b, wanted, &BTreeSet::new())?, (*u)?)))
            .flat_map(|(chain, u)| chain.into_iter().map(move |b| (b, u)))
            .collect();
        for (b, u) in needed {
            if let Some(Some(own)) = spare.get_mut(&b) {
                *own = if u < *own { u } else { *own };
            }
        }
        let mut last: Vec<(Option<Urgency>, Block)> = spare.into_iter().map(|(b, u)| (u, b)).collect();
        // Those that nobody asks for first; then the least urgent.
        last.sort_by(|a, b| match (a.0, b.0) {
            (Some(x), Some(y)) => y.cmp(&x).then(b.1.cmp(&a.1)),
            (x, y) => x.is_some().cmp(&y.is_some()).then(b.1.cmp(&a.1)),
        });
        let old = self.held.iter().filter(|(b, _)| !keep.contains(b)).map(|(_, bytes)| bytes).sum::<u64>();
        let mut bytes = old + chosen.iter().map(|b| wanted[b].bytes).sum::<u64>();
        for (_, b) in last {
            if bytes <= byte_budget {
                break;
            }
            bytes -= self.held.remove(&b).unwrap_or(0);
            plan.evict.push(b);
        }
        plan
    }
}

impl Urgency {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let Self { main, rank, movement: (turn, way) } = *self;
        main.total_cmp(&other.main)
            .then(rank.cmp(&other.rank))
            .then(turn.total_cmp(&other.movement.0))
            .then(way.total_cmp(&other.movement.1))
    }
}

/// A block behind all that it needs and that is not `taken` yet, first to last; `None` where something that it needs is not wanted, or needs
/// itself.
fn chain(block: Block, wanted: &BTreeMap<Block, Wanted>, taken: &BTreeSet<Block>) -> Option<Vec<Block>> {
    let (mut out, mut next) = (vec![], Some(block));
    while let Some(b) = next.filter(|b| !taken.contains(b)) {
        if out.contains(&b) {
            return None;
        }
        next = wanted.get(&b)?.after;
        out.push(b);
    }
    out.reverse();
    Some(out)
}
#[cfg(test)]
mod tests;
