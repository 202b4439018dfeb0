//! Worlds of boxes: order, budgets, borders.

use super::*;
use crate::movement::tests::{tried_turn_rad, tried_way};
use farfield_core::Aabb;
use farfield_core::id::{AssetId, LocalPayload, PayloadRef};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

fn block(id: u32) -> Block {
    Block::Payload(PayloadRef { asset: AssetId(0), id: LocalPayload(id) })
}

/// Something that stands there: its box, bytes, how long what is missing without it is, scene units, and what it needs.
#[derive(Clone, Copy, Debug)]
struct Thing {
    bounds: Aabb,
    bytes: u64,
    length: f32,
    after: Option<u32>,
    cell: u32,
}

impl Thing {
    fn at(place: Vec3) -> Self {
        Self { bounds: Aabb { min: place - 0.5, max: place + 0.5 }, bytes: 10, length: 1.0, after: None, cell: 0 }
    }
}

/// Cell 0 is where x < 100; farther cells are 100 wide.
#[derive(Default)]
struct World {
    things: Vec<Thing>,
    resident: BTreeSet<Block>,
}

impl Demand for World {
    fn near(&self, eye: &Camera, radius: f32) -> Vec<CellId> {
        let mut cells: Vec<CellId> = (0..4).map(CellId).filter(|c| self.distance(*c, eye) <= radius).collect();
        cells.sort_by(|a, b| self.distance(*a, eye).total_cmp(&self.distance(*b, eye)));
        cells
    }
    fn of(&self, cell: CellId, from: &Camera, out: &mut Vec<Candidate>) {
        for (i, t) in (0..).zip(&self.things).filter(|(_, t)| t.cell == cell.0) {
            let px = t.length / t.bounds.distance(from.eye.as_vec3()).max(1e-3) * from.px_per_tan();
            out.push(Candidate {
                block: block(i),
                bytes: t.bytes,
                bounds: t.bounds,
                error_px_without: px,
                in_view: px > 1.0 && from.may_see(&t.bounds),
                after: t.after.map(block),
            });
        }
    }
    fn resident(&self, block: Block) -> bool {
        self.resident.contains(&block)
    }
    fn distance(&self, cell: CellId, eye: &Camera) -> f32 {
        let (low, x) = (100.0 * cell.0 as f32, eye.eye.x as f32);
        if cell.0 == 0 { (x - 100.0).max(0.0) } else { (low - x).max(x - low - 100.0).max(0.0) }
    }
}

fn looking(x: f64, yaw_rad: f32) -> Camera {
    let forward = Vec3::new(-yaw_rad.sin(), 0.0, -yaw_rad.cos());
    Camera::looking(DVec3::new(x, 0.0, 0.0), forward, Vec3::Y, 1.0, [100, 100], 0.1)
}

/// Plans frame by frame, a tenth of a second each; holds every plan to the budget, and what is there to what it needs.
struct Walk {
    world: World,
    planner: Box<dyn Planner>,
    budget: u64,
    frame: u32,
    last: Option<Camera>,
}

impl Walk {
    fn new(own: MovementPriority, things: Vec<Thing>, budget: u64) -> Self {
        let world = World { things, ..World::default() };
        Self { world, planner: own.start(), budget, frame: 0, last: None }
    }

    fn step(&mut self, eye: &Camera, lights: &[Camera]) -> Plan {
        let before = self.last.unwrap_or(*eye);
        let motion = Motion {
            time_s: 0.1 * f64::from(self.frame),
            moved: before.eye.distance(eye.eye) as f32,
            turned_rad: before.forward.angle_between(eye.forward),
            eye,
            lights,
            future: None,
        };
        (self.frame, self.last) = (self.frame + 1, Some(*eye));
        let plan = self.planner.plan(&motion, &self.world, self.budget);
        let there = &mut self.world.resident;
        assert!(plan.evict.iter().all(|b| there.remove(b)), "frame {}: freed twice", self.frame);
        for &b in &plan.fetch {
            let Block::Payload(p) = b else { panic!("a chunk") };
            let needs = self.world.things[p.id.index()].after;
            assert!(needs.is_none_or(|n| there.contains(&block(n))), "{b:?} before what it needs");
            assert!(there.insert(b), "fetched twice");
        }
        let bytes: u64 =
            (0..).zip(&self.world.things).filter(|(i, _)| there.contains(&block(*i))).map(|(_, t)| t.bytes).sum();
        assert!(bytes <= self.budget, "frame {}: {bytes} of {}", self.frame, self.budget);
        plan
    }
}

fn fixed(speed: f32, turn_deg_per_s: f32) -> MovementPriority {
    MovementPriority { speed: Some(speed), turn_deg_per_s: Some(turn_deg_per_s), ..MovementPriority::default() }
}

/// Where a thing may stand, all around.
fn around(n: u32, seed: u64) -> Vec<Thing> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut unit = move || rng.next_u32() as f32 / u32::MAX as f32;
    let place = |_: u32| Vec3::new(90.0 * unit() - 45.0, 20.0 * unit() - 10.0, 90.0 * unit() - 45.0);
    let places: Vec<Vec3> = (0..n).map(place).collect();
    places.into_iter().map(Thing::at).collect()
}

#[test]
fn the_largest_errors_come_first_and_count_less_the_longer_the_movement_takes_that_shows_them() {
    let things = around(60, 5);
    let eye = looking(0.0, 0.0);
    for (speed, turn) in [(1.0, 90.0), (20.0, 10.0), (0.0, 45.0), (5.0, 0.0)] {
        let own = fixed(speed, turn);
        let plan = Walk::new(own, things.clone(), 10_000).step(&eye, &[]);
        assert_eq!(plan.fetch.len(), things.len());
        let mut listed = vec![];
        World { things: things.clone(), ..World::default() }.of(CellId(0), &eye, &mut listed);
        let shown = |c: &Candidate| {
            let turned = tried_turn_rad(&eye, &c.bounds) / f64::from(turn).to_radians();
            turned.min(tried_way(&eye, &c.bounds, 100.0) / f64::from(speed))
        };
        let of = |b: &Block| listed.iter().find(|c| c.block == *b).unwrap();
        let fetched: Vec<&Candidate> = plan.fetch.iter().map(of).collect();
        let seen: Vec<f32> = fetched.iter().filter(|c| c.in_view).map(|c| c.error_px_without).collect();
        assert!(seen.len() > 3 && seen.is_sorted_by(|a, b| a >= b));
        // Octaves of pixels, and seconds.
        let measured = |c: &&Candidate| {
            let time_s = if c.in_view { 0.0 } else { shown(c) };
            (f64::from(c.error_px_without).log2() - time_s / HALF_S, time_s)
        };
        let all: Vec<(f64, f64)> = fetched.iter().map(measured).collect();
        let times: Vec<f64> = all.iter().map(|a| a.1).filter(|t| *t > 0.0).collect();
        assert!(times.len() > 30 && times.iter().all(|t| t.is_finite()), "{times:?}");
        let (least, most) = times.iter().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), &t| (l.min(t), m.max(t)));
        assert!(most > 3.0 * least);
        // Lattices are coarse: pairs may be out of order by that much.
        for (i, j) in (0..all.len()).flat_map(|i| (i + 1..all.len()).map(move |j| (i, j))) {
            assert!(all[i].0 + 0.04 * most / HALF_S >= all[j].0, "{speed}, {turn}: {:?} before {:?}", all[i], all[j]);
        }
        // What is out of view and off by much comes before what is in view and off by little.
        let last_seen = fetched.iter().rposition(|c| c.in_view).unwrap();
        assert!(speed == 1.0 || turn == 0.0 || fetched[..last_seen].iter().any(|c| !c.in_view), "{speed}, {turn}");
    }
}

#[test]
fn how_fast_the_viewer_turns_and_goes_decides_which_comes_first() {
    // To the side, close to the frustum by a turn, and far by a way; and behind, near enough to step back over it. Off by as much.
    let beside = Thing::at(Vec3::new(60.0, 0.0, -60.0));
    let away = |t: &Thing| t.bounds.distance(Vec3::ZERO);
    let behind = Thing::at(Vec3::new(0.0, 0.0, 2.0));
    let behind = Thing { length: away(&behind) / away(&beside), ..behind };
    let first = |own| Walk::new(own, vec![beside, behind], 1000).step(&looking(0.0, 0.0), &[]).fetch[0];
    assert_eq!(first(fixed(0.1, 90.0)), block(0));
    assert_eq!(first(fixed(50.0, 1.0)), block(1));
    // Without settings the walk tells: turning so far, or going so far.
    let told = |eyes: [Camera; 2]| {
        let mut walk = Walk::new(MovementPriority::default(), vec![beside, behind], 10);
        eyes.iter().for_each(|e| _ = walk.step(e, &[]));
        walk.world.resident
    };
    assert_eq!(told([looking(0.0, 0.1), looking(0.0, 0.0)]), BTreeSet::from([block(0)]));
    assert_eq!(told([looking(-9.0, 0.0), looking(0.0, 0.0)]), BTreeSet::from([block(1)]));
}

#[test]
fn an_error_too_small_to_see_waits_for_the_way_that_makes_it_matter() {
    // In the frustum; pixels a unit of tangent: 91.5. The second is off by half a pixel at 40, so at 20 by one; the third at 5.
    let near = Thing::at(Vec3::new(0.0, 0.0, -10.0));
    let soon = Thing { length: 0.5 * 39.5 / 91.5, ..Thing::at(Vec3::new(0.0, 0.0, -40.0)) };
    let late = Thing { length: 0.125 * 39.5 / 91.5, ..Thing::at(Vec3::new(1.0, 0.0, -40.0)) };
    let aside = Thing { length: 10.0, ..Thing::at(Vec3::new(-120.0, 0.0, -60.0)) };
    let order = |own| Walk::new(own, vec![late, soon, near, aside], 1000).step(&looking(0.0, 0.0), &[]).fetch;
    // 20 and 35 units to go for the errors; some 35 degrees to turn or 76 units to go for what is aside.
    assert_eq!(order(fixed(10.0, 1.0)), [block(2), block(1), block(0), block(3)]);
    assert_eq!(order(fixed(10.0, 90.0)), [block(2), block(3), block(1), block(0)]);
}

#[test]
fn what_lights_see_comes_before_what_nobody_does_and_other_cells_when_one_may_be_there() {
    let behind = Thing::at(Vec3::new(5.0, 0.0, 20.0));
    let farther = Thing::at(Vec3::new(-5.0, 0.0, 20.0));
    let other = Thing { cell: 1, ..Thing::at(Vec3::new(120.0, 0.0, -20.0)) };
    let light = Camera::looking(DVec3::new(-5.0, 0.0, 10.0), Vec3::Z, Vec3::Y, 0.3, [100, 100], 0.1);
    let things = vec![behind, farther, other];
    let order = |eye: f64, lights: &[Camera], speed: f32| {
        Walk::new(fixed(speed, 90.0), things.clone(), 1000).step(&looking(eye, 0.0), lights).fetch
    };
    assert_eq!(order(-1.0, &[], 1.0), [block(0), block(1)]);
    assert_eq!(order(-1.0, &[light], 1.0), [block(1), block(0)]);
    // The other cell begins at 100: 2 s ahead is too far at 1 unit a second, not at 80.
    assert_eq!(order(0.0, &[], 1.0).len(), 2);
    assert_eq!(order(0.0, &[], 80.0).len(), 3);
    assert_eq!(order(0.0, &[], 80.0)[2], block(2));
}

#[test]
fn jitter_on_the_border_of_view_or_between_two_times_evicts_nothing() {
    // The first frame may load; from then on eyes that shake by a degree and a little way change nothing.
    for budget in [100, 150, 250, 400] {
        let mut walk = Walk::new(fixed(2.0, 60.0), around(60, 9), budget);
        walk.step(&looking(0.0, 0.0), &[]);
        walk.step(&looking(0.02, 0.02), &[]);
        let held = walk.world.resident.clone();
        for i in 0..60 {
            let shake = if i % 2 == 0 { 1.0 } else { -1.0 };
            let plan = walk.step(&looking(0.01 * shake, 0.008 * shake as f32), &[]);
            assert!(plan.evict.is_empty(), "{budget} bytes, frame {i}: {plan:?}");
        }
        assert_eq!(held, walk.world.resident, "{budget} bytes");
        assert_eq!(held.len() as u64, budget / 10);
        // A real turn does change it.
        assert!(!walk.step(&looking(0.0, 2.0), &[]).evict.is_empty());
    }
}

#[test]
fn with_too_small_a_budget_for_what_is_in_view_the_same_set_stays() {
    let things: Vec<Thing> =
        (0..40).map(|i| Thing::at(Vec3::new(i as f32 % 8.0 - 4.0, 0.0, -20.0 - i as f32 / 8.0))).collect();
    let mut walk = Walk::new(fixed(1.0, 10.0), things, 75);
    let first = walk.step(&looking(0.0, 0.0), &[]);
    assert_eq!(first.fetch.len(), 7);
    for _ in 0..50 {
        assert_eq!(walk.step(&looking(0.0, 0.0), &[]), Plan::default());
    }
    // Nothing fits at all: nothing is asked for.
    let mut none = Walk::new(fixed(1.0, 10.0), around(20, 1), 9);
    assert_eq!((0..5).map(|_| none.step(&looking(0.0, 0.0), &[])).collect::<Vec<_>>(), vec![Plan::default(); 5]);
}

#[test]
fn chains_come_whole_first_to_last_or_not_at_all() {
    let thing = |after: Option<u32>| Thing { after, ..Thing::at(Vec3::new(0.0, 0.0, -10.0)) };
    let behind = |t: Thing| Thing { bounds: Thing::at(Vec3::Z * 30.0).bounds, ..t };
    // 3 needs 2 needs 1; 1 is behind the viewer. 4 needs itself, by way of 5; 6 needs what nobody offers.
    let things = vec![
        thing(None),
        behind(thing(None)),
        thing(Some(1)),
        thing(Some(2)),
        thing(Some(5)),
        thing(Some(4)),
        thing(Some(99)),
    ];
    let mut walk = Walk::new(fixed(1.0, 10.0), things.clone(), 1000);
    assert_eq!(walk.step(&looking(0.0, 0.0), &[]).fetch, [block(0), block(1), block(2), block(3)]);
    let mut little = Walk::new(fixed(1.0, 10.0), things, 35);
    assert_eq!(little.step(&looking(0.0, 0.0), &[]).fetch, [block(0), block(1), block(2)]);
}

#[test]
fn what_never_came_is_called_off_and_the_least_urgent_makes_room() {
    let things = vec![Thing::at(Vec3::Z * -10.0), Thing::at(Vec3::new(40.0, 0.0, -20.0)), Thing::at(Vec3::Z * 40.0)];
    let mut walk = Walk::new(fixed(1.0, 30.0), things, 20);
    assert_eq!(walk.step(&looking(0.0, 0.0), &[]).fetch, [block(0), block(1)]);
    // Turned round: what was in view is now as far behind as can be.
    let plan = walk.step(&looking(0.0, std::f32::consts::PI), &[]);
    assert_eq!((plan.fetch.as_slice(), plan.evict.len()), ([block(2)].as_slice(), 1));
    // Blocks that the loader did not get to.
    walk.world.resident.clear();
    walk.world.things.truncate(1);
    let plan = walk.step(&looking(0.0, 0.0), &[]);
    assert!(plan.cancel.contains(&block(2)) && plan.evict.is_empty(), "{plan:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn no_walk_takes_more_than_the_budget(seed in any::<u64>(), budget in 0u64..900, known in any::<bool>()) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut things = around(50, seed ^ 1);
        for (i, t) in things.iter_mut().enumerate() {
            t.bytes = u64::from(rng.next_u32() % 40);
            t.length = (rng.next_u32() % 100) as f32 / 40.0;
            t.after = (i > 0 && rng.next_u32() % 3 == 0).then(|| rng.next_u32() % i as u32);
        }
        let own = if known { fixed(3.0, 40.0) } else { MovementPriority::default() };
        let mut walk = Walk::new(own, things, budget);
        let (mut x, mut yaw) = (0.0, 0.0f32);
        for _ in 0..60 {
            x += f64::from(rng.next_u32() % 100) / 50.0 - 1.0;
            yaw += (rng.next_u32() % 100) as f32 / 100.0 - 0.5;
            // Now and then the harness has less to give, and the loader does not get to the last blocks.
            walk.step(&looking(x, yaw), &[]);
            if rng.next_u32() % 4 == 0 {
                let lost: Vec<Block> = walk.world.resident.iter().copied().filter(|_| rng.next_u32() % 8 == 0).collect();
                let needed = |b: &Block| (0..).zip(&walk.world.things).any(|(i, t)| {
                    t.after.map(block) == Some(*b) && walk.world.resident.contains(&block(i))
                });
                let lost: Vec<Block> = lost.into_iter().filter(|b| !needed(b)).collect();
                lost.iter().for_each(|b| _ = walk.world.resident.remove(b));
            }
        }
    }
}
