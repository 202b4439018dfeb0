//! Cuts of closed surfaces: no border edge, everything once.

use proptest::prelude::*;
use std::sync::LazyLock;

use super::*;
use crate::cut::Cut;

static SMOOTH: LazyLock<Baked> = LazyLock::new(|| baked(&fine(), one(hills(72)), &Serial));
static FACETED: LazyLock<Baked> = LazyLock::new(|| baked(&fine(), one(faceted(hills(48))), &Serial));
static SIDED: LazyLock<Baked> = LazyLock::new(|| baked(&fine(), one(two_sided_above(hills(60))), &Serial));

fn all() -> [(&'static str, &'static Baked); 3] {
    [("smooth", &*SMOOTH), ("faceted", &*FACETED), ("two-sided above", &*SIDED)]
}

/// A tolerance as an eye has it: so much a unit of distance.
fn seen_from(eye: Vec3, a_unit: f32) -> impl Fn(&Aabb) -> f32 + Sync {
    move |b: &Aabb| a_unit * b.distance(eye)
}

/// A tolerance without rhyme or reason: another in every box.
fn wild(seed: u32, size: f32) -> impl Fn(&Aabb) -> f32 + Sync {
    move |b: &Aabb| {
        let bits = b.min.to_array().into_iter().chain(b.max.to_array()).map(f32::to_bits);
        let mixed = bits.fold(seed, |h, x| (h ^ x).wrapping_mul(0x9E37_79B1).rotate_left(13));
        size * (mixed % 1000) as f32 / 1000.0
    }
}

/// Closed, and around its middle once; returns how many triangles.
#[track_caller]
fn check(what: &str, b: &Baked, draws: &[Draw]) -> usize {
    let drawn = triangles(b, draws);
    assert_eq!(border_edges(&drawn), 0, "{what}: border edges among {}", drawn.len());
    for (at, times) in [(Vec3::ZERO, 1.0), (Vec3::new(0.2, -0.3, 0.1), 1.0), (Vec3::new(3.0, 0.1, 0.0), 0.0)] {
        assert!((winding(&drawn, at) - times).abs() < 1e-3, "{what}: {} times around {at}", winding(&drawn, at));
    }
    drawn.len()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_view_from_anywhere_has_no_border_edge(
        eye in prop::array::uniform3(-3f32..3.0).prop_map(Vec3::from_array),
        log in -11f32..0.0,
    ) {
        for (what, b) in all() {
            check(what, b, &draw(&fine(), b, &seen_from(eye, log.exp2()), &|_| true).0);
        }
    }

    #[test]
    fn nor_has_one_whose_tolerance_is_another_in_every_box(seed in any::<u32>(), log in -10f32..0.0) {
        for (what, b) in all() {
            check(what, b, &draw(&fine(), b, &wild(seed, log.exp2()), &|_| true).0);
        }
    }
}

#[test]
fn cuts_go_from_the_original_to_a_few_triangles_and_mix_both_within_one_view() {
    for (what, b) in all() {
        let original = b.scene.triangles() as usize;
        let eye = b.scene.bounds.max + 0.3;
        let counts: Vec<usize> =
            (0..14).map(|k| check(what, b, &draw(&fine(), b, &seen_from(eye, 0.5f32.powi(k)), &|_| true).0)).collect();
        assert!(counts.is_sorted(), "{what}: {counts:?}");
        assert!(counts[0] * 20 < original, "{what}: {counts:?} of {original}");
        assert_eq!(check(what, b, &draw(&fine(), b, &|_| 0.0, &|_| true).0), original);
        let mixed = |k: i32| {
            let (draws, _) = draw(&fine(), b, &seen_from(eye, 0.5f32.powi(k)), &|_| true);
            let chunks = draws.iter().filter(|d| matches!(d.what, DrawWhat::Chunks(_))).count();
            let mut errors: Vec<u32> = draws.iter().map(|d| d.error_px.to_bits()).collect();
            errors.sort_unstable();
            errors.dedup();
            chunks > 0 && errors.len() > 4
        };
        assert!((0..14).any(mixed), "{what}: no view has originals beside several levels");
    }
}

#[test]
fn a_broken_cut_has_border_edges() {
    let b = &*SMOOTH;
    let (object, below) = (&b.index.objects[0], b.index.objects[0].below());
    let mut cut = Cut::allowed(object, &below, |g| object.groups[g as usize].error < 0.01);
    let draws = |cut: &Cut| -> Vec<[Vec3; 3]> {
        let payload = |g: u32, p: usize| DrawWhat::Payload {
            id: farfield_core::id::PayloadRef {
                asset: AssetId(0),
                id: LocalPayload(object.groups[g as usize].payload),
            },
            part: p as u16,
            object: 1,
        };
        let parts = (0..object.groups.len() as u32)
            .flat_map(|g| (0..object.groups[g as usize].parts.len()).map(move |p| (g, p)))
            .filter(|&(g, p)| cut.draws(object, g, p))
            .map(|(g, p)| payload(g, p));
        let chunks = (0..object.chunks.len()).filter(|&c| cut.draws_chunk(object, c)).map(|c| ChunkId(c as u32));
        let chunks = std::iter::once(DrawWhat::Chunks(chunks.collect()));
        let all: Vec<Draw> =
            parts.chain(chunks).map(|what| Draw { what, bounds: Aabb::EMPTY, error_px: 0.0 }).collect();
        triangles(b, &all)
    };
    assert_eq!(border_edges(&draws(&cut)), 0);
    // A group alone decides otherwise than what lies below it allows; or one that is below an applied one steps back.
    let (mut tried, mut torn, groups) = (0, 0, 0..object.groups.len());
    for g in groups {
        let lone_above = !cut.applied[g] && !below[g].iter().all(|&b| cut.applied[b as usize]);
        let lone_below = cut.applied[g]
            && object.groups[g].parts.iter().any(|p| p.replaced_by.is_some_and(|h| cut.applied[h as usize]));
        if lone_above || lone_below {
            cut.applied[g] = !cut.applied[g];
            // Where the whole surface hangs on that one group, it is there twice instead, or not at all.
            let (edges, around) = (border_edges(&draws(&cut)), winding(&draws(&cut), Vec3::ZERO));
            assert!(edges > 0 || (around - 1.0).abs() > 0.9, "group {g}");
            torn += usize::from(edges > 0);
            cut.applied[g] = !cut.applied[g];
            tried += 1;
        }
    }
    assert!(tried > 10 && 2 * torn > tried, "{torn} of {tried}");
    // A missing part is seen, too.
    let mut all = draws(&cut);
    all.truncate(all.len() - 1);
    assert_eq!(border_edges(&all), 3);
}

/// On every way from a chunk up through what replaces it exactly one thing is drawn.
#[track_caller]
fn once(object: &ObjectGroups, cut: &Cut) {
    let mut before: Vec<Option<u32>> = vec![None; object.groups.len()];
    let pass = |before: &mut Vec<Option<u32>>, to: Option<u32>, drawn: u32| match to {
        Some(g) => {
            let known = *before[g as usize].get_or_insert(drawn);
            assert_eq!(known, drawn, "group {g} is reached after {known} and after {drawn} draws");
        }
        None => assert_eq!(drawn, 1, "the top is reached after {drawn} draws"),
    };
    for (c, &to) in object.chunks.iter().enumerate() {
        pass(&mut before, to, u32::from(cut.draws_chunk(object, c)));
    }
    for g in 0..object.groups.len() {
        let drawn = before[g].expect("a group that replaces nothing");
        for (p, part) in object.groups[g].parts.iter().enumerate() {
            pass(&mut before, part.replaced_by, drawn + u32::from(cut.draws(object, g as u32, p)));
        }
    }
}

#[test]
fn every_cut_covers_every_original_triangle_once() {
    for (what, b) in all() {
        let (object, below) = (&b.index.objects[0], b.index.objects[0].below());
        assert_eq!(object.chunks.len(), b.scene.chunks.len());
        assert!(object.groups.len() > 20, "{what}: {} groups", object.groups.len());
        let mut errors: Vec<f32> = object.groups.iter().map(|g| g.error).collect();
        errors.sort_by(f32::total_cmp);
        for most in errors {
            once(object, &Cut::allowed(object, &below, |g| object.groups[g as usize].error <= most));
        }
        for seed in 0..200 {
            let tolerance = wild(seed, 0.1);
            let within = |g: u32| object.groups[g as usize].error <= tolerance(&object.groups[g as usize].bounds);
            once(object, &Cut::allowed(object, &below, within));
        }
    }
}

#[test]
#[should_panic(expected = "is reached after")]
fn a_cut_that_covers_something_twice_is_found() {
    let (object, below) = (&SMOOTH.index.objects[0], SMOOTH.index.objects[0].below());
    let mut cut = Cut::allowed(object, &below, |_| false);
    let above = below.iter().position(|b| b.len() > 1).unwrap();
    cut.applied[below[above][0] as usize] = true;
    cut.applied[above] = true;
    once(object, &cut);
}
