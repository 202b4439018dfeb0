//! What is drawn when not everything is there, and what is asked for.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use farfield_core::strategy::{Candidate, Demand, Motion, Scheduler};
use farfield_schedulers::NearToFarLru;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;
use crate::cut::{Cut, Has};

static BALL: LazyLock<Baked> = LazyLock::new(|| baked(&fine(), one(hills(60)), &Serial));

fn tops(b: &Baked) -> BTreeSet<u32> {
    let top = |g: &&Group| g.parts.iter().any(|p| p.replaced_by.is_none());
    b.index.objects[0].groups.iter().filter(top).map(|g| g.payload).collect()
}

#[test]
fn whatever_is_resident_there_is_no_hole_once_the_top_is() {
    let (b, tops) = (&*BALL, tops(&BALL));
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut coarser = 0;
    for round in 0..150u32 {
        let share = rng.next_u32() % 101;
        let lucky: BTreeSet<Block> = {
            let chunks = b.scene.mesh_chunk_ids().map(Block::Chunk);
            let all = chunks.chain(b.payloads.keys().map(|&id| payload_block(id)));
            all.filter(|_| rng.next_u32() % 100 < share).collect()
        };
        let there = |block: Block| match block {
            Block::Payload(p) if tops.contains(&p.id.0) => true,
            _ => lucky.contains(&block),
        };
        let eye = Vec3::new((round % 5) as f32 - 2.0, 0.4, (round % 7) as f32 - 3.0);
        let tolerance = |a: &Aabb| 0.5f32.powi(6 + round as i32 % 5) * a.distance(eye);
        let (draws, achieved) = draw(&fine(), b, &tolerance, &there);
        assert_eq!(achieved.missing, 0);
        for d in &draws {
            match &d.what {
                DrawWhat::Payload { id, .. } => assert!(there(Block::Payload(*id))),
                DrawWhat::Chunks(set) => {
                    assert!(set.iter().all(|c| there(Block::Chunk(b.scene.chunks[c.index()].source))));
                }
            }
        }
        let drawn = triangles(b, &draws);
        assert_eq!(border_edges(&drawn), 0, "round {round}");
        assert!((winding(&drawn, Vec3::ZERO) - 1.0).abs() < 1e-3);
        let (wanted, _) = draw(&fine(), b, &tolerance, &|_| true);
        coarser += usize::from(triangles(b, &wanted).len() > drawn.len());
    }
    assert!(coarser > 50, "{coarser} rounds drew something coarser");
}

fn payload_block(id: LocalPayload) -> Block {
    Block::Payload(farfield_core::id::PayloadRef { asset: AssetId(0), id })
}

#[test]
fn without_the_top_originals_serve_and_without_both_holes_are_counted_and_nothing_overlaps() {
    let (b, tops) = (&*BALL, tops(&BALL));
    let chunks_only = |block: Block| matches!(block, Block::Chunk(_));
    let (draws, achieved) = draw(&fine(), b, &|_| 1e9, &chunks_only);
    assert_eq!((achieved.missing, triangles(b, &draws).len() as u64), (0, b.scene.triangles()));
    let (draws, achieved) = draw(&fine(), b, &|_| 0.0, &|_| false);
    assert!(draws.is_empty() && achieved.missing > 0);
    let no_top = |block: Block| matches!(block, Block::Payload(p) if !tops.contains(&p.id.0));
    let (draws, achieved) = draw(&fine(), b, &|_| 1e9, &no_top);
    assert_eq!((achieved.missing, border_edges(&triangles(b, &draws))), (0, 0), "the next finer groups serve");
    assert!(!draws.is_empty());
}

/// All cuts of a small hierarchy, by trying every set of groups.
fn all_cuts(below: &[Vec<u32>]) -> Vec<Cut> {
    let closed = |bits: &u32| {
        let is = |g: u32| bits >> g & 1 == 1;
        (0..below.len() as u32).all(|g| !is(g) || below[g as usize].iter().all(|&b| is(b)))
    };
    let applied = |bits: u32| Cut { applied: (0..below.len()).map(|g| bits >> g & 1 == 1).collect() };
    (0..1u32 << below.len()).filter(closed).map(applied).collect()
}

#[test]
fn a_coarser_or_finer_cut_that_is_there_is_found_by_trying_all() {
    let own = ClusterLod { cluster_triangles: 64, group_clusters: 8, least_triangles: 600, ..ClusterLod::default() };
    let b = baked(&own, one(hills(40)), &Serial);
    let (object, below) = (&b.index.objects[0], b.index.objects[0].below());
    let (groups, chunks) = (object.groups.len(), object.chunks.len());
    assert!((8..=18).contains(&groups) && chunks > 2, "{groups} groups, {chunks} chunks");
    let cuts = all_cuts(&below);
    assert!(cuts.len() > 30, "{} cuts", cuts.len());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut outcomes = [0; 3];
    for _ in 0..600 {
        let target = &cuts[rng.next_u32() as usize % cuts.len()];
        let share = rng.next_u32() % 101;
        let mut some = |n: usize| -> Vec<bool> { (0..n).map(|_| rng.next_u32() % 100 < share).collect() };
        let (payloads, originals, seen) = (some(groups), some(chunks), some(chunks + groups));
        let has = Has {
            group: &|g| payloads[g as usize],
            chunk: &|c| originals[c],
            sees_part: &|g, p| seen[chunks + (g as usize + p) % groups],
            sees_chunk: &|c| seen[c],
        };
        let lacks = |cut: &Cut| {
            let parts =
                (0..groups as u32).flat_map(|g| (0..object.groups[g as usize].parts.len()).map(move |p| (g, p)));
            let parts =
                parts.filter(|&(g, p)| cut.draws(object, g, p) && (has.sees_part)(g, p) && !payloads[g as usize]);
            let own = (0..chunks).filter(|&c| cut.draws_chunk(object, c) && seen[c] && !originals[c]);
            parts.count() + own.count()
        };
        let over = |a: &Cut, b: &Cut| a.applied.iter().zip(&b.applied).all(|(a, b)| *a || !*b);
        let coarser = cuts.iter().any(|c| over(c, target) && lacks(c) == 0);
        let finer = cuts.iter().any(|c| over(target, c) && lacks(c) == 0);
        let (settled, missing) = target.clone().settle(object, &below, &has);
        assert!(cuts.contains(&settled), "what is drawn is no cut");
        assert_eq!(missing as usize, lacks(&settled));
        assert_eq!(missing == 0, coarser || finer);
        if missing == 0 {
            assert!(if coarser { over(&settled, target) } else { over(target, &settled) });
            // The nearest: no cut that is there lies between.
            let between = |c: &&Cut| lacks(c) == 0 && over(&settled, c) && over(c, target) && **c != settled;
            assert!(!coarser || !cuts.iter().any(|c| between(&c)));
        }
        outcomes[if missing > 0 {
            0
        } else if coarser {
            1
        } else {
            2
        }] += 1;
    }
    assert!(outcomes.iter().all(|&n| n > 10), "{outcomes:?}");
}

fn wanted(b: &Baked, camera: &Camera, tolerance: &(dyn Fn(&Aabb) -> f32 + Sync)) -> Vec<Candidate> {
    let open = fine().open(Some((AssetId(0), &b.bytes)), (AssetId(1), &[])).unwrap();
    let at = Active { cell: CellId(0), split: SplitId(0), sectors: vec![] };
    let view = View { scene: &b.scene, camera, at: &at, tolerance, budget: Default::default(), cell: None };
    let mut out = vec![];
    open.wanted(&view, &mut out);
    out
}

#[test]
fn what_is_drawn_is_wanted_in_view_after_what_stands_in_for_it() {
    let b = &*BALL;
    for k in 0..12 {
        let tolerance = |a: &Aabb| 0.5f32.powi(k) * a.distance(Vec3::new(0.0, 1.0, 4.0));
        let list = wanted(b, &far_camera(), &tolerance);
        let by_block: BTreeMap<Block, &Candidate> = list.iter().map(|c| (c.block, c)).collect();
        assert_eq!(by_block.len(), list.len(), "each block once");
        let (draws, _) = draw(&fine(), b, &tolerance, &|_| true);
        for d in &draws {
            let blocks: Vec<Block> = match &d.what {
                DrawWhat::Payload { id, .. } => vec![Block::Payload(*id)],
                DrawWhat::Chunks(set) => set.iter().map(|c| Block::Chunk(b.scene.chunks[c.index()].source)).collect(),
            };
            for block in blocks {
                let c = by_block[&block];
                assert!(c.in_view && c.error_px_without >= d.error_px, "{c:?}");
            }
        }
        for (i, c) in list.iter().enumerate() {
            if let Some(after) = c.after {
                let before = list[..i].iter().find(|o| o.block == after).expect("what it needs comes first");
                assert!(before.error_px_without >= c.error_px_without && (before.in_view || !c.in_view));
            }
        }
        assert!(list.iter().filter(|c| c.after.is_none()).all(|c| matches!(c.block, Block::Payload(_))));
    }
    // Turned away nothing is in view, and the same is wanted.
    let mut away = far_camera();
    (away.forward, away.right) = (-away.forward, -away.right);
    let (there, gone) = (wanted(b, &far_camera(), &|_| 0.01), wanted(b, &away, &|_| 0.01));
    assert!(there.iter().any(|c| c.in_view) && gone.iter().all(|c| !c.in_view));
    assert_eq!(there.len(), gone.len());
}

/// A far view as a scheduler sees it.
struct Asked<'a> {
    b: &'a Baked,
    there: BTreeSet<Block>,
    tolerance: f32,
}
impl Demand for Asked<'_> {
    fn near(&self, _eye: &Camera, _radius: f32) -> Vec<CellId> {
        vec![CellId(0)]
    }
    fn of(&self, _cell: CellId, from: &Camera, out: &mut Vec<Candidate>) {
        out.extend(wanted(self.b, from, &|_| self.tolerance));
    }
    fn resident(&self, block: Block) -> bool {
        self.there.contains(&block)
    }
}

#[test]
fn a_scheduler_keeps_its_budget_and_finer_groups_come_with_more_of_it() {
    let b = &*BALL;
    let sizes: BTreeMap<Block, u64> = wanted(b, &far_camera(), &|_| 0.0).iter().map(|c| (c.block, c.bytes)).collect();
    let all: u64 = sizes.values().sum();
    let mut counts = vec![];
    for budget in [all / 16, all / 8, all / 4, all / 2, all] {
        let mut planner = NearToFarLru::default().start();
        let mut asked = Asked { b, there: BTreeSet::new(), tolerance: 0.0 };
        for (frame, tolerance) in [1.0, 0.1, 0.01, 0.001, 0.0, 0.0].into_iter().enumerate() {
            asked.tolerance = tolerance;
            let eye = far_camera();
            let motion =
                Motion { time_s: frame as f64, moved: 0.0, turned_rad: 0.0, eye: &eye, lights: &[], future: None };
            let plan = planner.plan(&motion, &asked, budget);
            plan.evict.iter().for_each(|e| _ = asked.there.remove(e));
            asked.there.extend(plan.fetch);
            assert!(asked.there.iter().map(|x| sizes[x]).sum::<u64>() <= budget);
            let (draws, achieved) = draw(&fine(), b, &|_| tolerance, &|x| asked.there.contains(&x));
            assert_eq!(
                (achieved.missing, border_edges(&triangles(b, &draws))),
                (0, 0),
                "{budget} bytes, frame {frame}"
            );
            if frame == 5 {
                counts.push(triangles(b, &draws).len());
            }
        }
    }
    assert!(counts.is_sorted() && counts[0] < counts[3], "{counts:?}");
    assert_eq!(counts[4] as u64, b.scene.triangles());
}
