//! The void surface against rays: what a viewpoint sees that no sample saw.

mod common;

use common::*;
use farfield_core::claim::Quantity;
use farfield_core::strategy::VisibilityMetric;
use farfield_metrics::{Candidates, VoidSurface};
use glam::Vec3;

/// Edge of the faces in which the void is counted; samples have four times as many pixels, since a surface that a sample saw at a
/// grazing angle is known in longer steps.
const PX: u32 = 64;

/// The solid angle of a pixel in the middle of a face: (2 / PX)^2.
const PIXEL_SR: f64 = 1e-3;

/// F of a viewpoint beside what rays find.
fn look(world: &World, samples: &[Vec3], from: Vec3) -> Compared {
    let pictures = world.samples(samples, 4 * PX);
    let found = world.voids(&pictures).unseen(world.local(from), PX, world.near());
    let c = compare(&found, &world.truly_unseen(from, samples, PX), PX);
    println!("{samples:?} from {from}: {c:?}");
    c
}

/// F equals the count within the perimeter of the region times the size of a pixel of the picture (and half of one of the
/// sample), and no pixel is wrong but along that border.
fn agrees(c: Compared) {
    assert!((c.sr - c.true_sr).abs() <= c.border_sr + PIXEL_SR, "{c:?}");
    assert!(c.apart_sr <= 0.1 * c.border_sr + PIXEL_SR, "{c:?}");
}

#[test]
fn behind_a_wall_with_a_gap_rays_find_the_same_in_all_four_cases() {
    let world = World::new(&pierced(), 1.0);
    // (a) V behind the sample on a line through the gap: it sees less through it.
    let a = look(&world, &[Vec3::new(0.0, 0.0, -2.0)], Vec3::new(0.0, 0.0, 3.0));
    agrees(a);
    assert!(a.true_sr == 0.0 && a.sr < 1e-3);
    // (b) V before the sample: void on both sides of the gap.
    let b = look(&world, &[Vec3::new(0.0, 0.0, 3.0)], Vec3::new(0.1, 0.05, -2.0));
    agrees(b);
    assert!(b.true_sr > 0.1);
    // (c) V beside it: void on one side.
    let c = look(&world, &[Vec3::new(-0.6, 0.0, 0.0)], Vec3::new(0.6, 0.0, 0.0));
    agrees(c);
    assert!(c.true_sr > 0.01);
    // (d) V beyond the critical line: nothing but void behind the gap.
    let d = look(&world, &[Vec3::new(-4.0, 0.0, -2.5)], Vec3::new(4.0, 0.0, -2.5));
    agrees(d);
    let corner = Vec3::new(-7.9, 3.9, -4.99);
    let gap = world.truly_unseen(Vec3::new(4.0, 0.0, -2.5), &[corner], PX);
    let truth = world.truly_unseen(Vec3::new(4.0, 0.0, -2.5), &[Vec3::new(-4.0, 0.0, -2.5)], PX);
    assert_eq!(truth, gap, "the gap is full of void, as for a sample that sees nothing through it");
}

#[test]
fn with_several_samples_rays_find_what_none_of_them_saw() {
    let world = World::new(&pierced(), 1.0);
    let both = [Vec3::new(-2.0, 0.0, -1.0), Vec3::new(2.0, 0.0, -1.0)];
    let one = look(&world, &both[..1], Vec3::new(0.0, 0.0, -3.0));
    let two = look(&world, &both, Vec3::new(0.0, 0.0, -3.0));
    agrees(one);
    agrees(two);
    assert!(two.true_sr < one.true_sr && two.sr < one.sr);
    let world = World::new(&furnished(), 1.0);
    // None of them sees a block's side at less than the angle of the second test.
    let around = [[-2.6, -2.2], [2.6, -2.4], [2.4, 2.6], [-2.8, 2.4], [0.0, 0.5]].map(|p| Vec3::new(p[0], 0.0, p[1]));
    for n in [1, 2, 4, 5] {
        for from in [Vec3::new(0.2, 0.1, -2.5), Vec3::new(2.0, -0.3, 1.0)] {
            agrees(look(&world, &around[..n], from));
        }
    }
}

#[test]
fn among_hanging_blocks_it_is_the_rays_that_pass_through_unknown_space() {
    // Behind it may stand something that was seen: F is then more than what is missing.
    let world = World::new(&hanging(60), 1.0);
    let eyes = [[-3.0, -3.0], [3.0, -3.0], [0.3, 3.0]].map(|p| Vec3::new(p[0], 0.1, p[1]));
    let (from, px) = (Vec3::new(0.7, 0.4, -0.3), 48);
    for n in [1, 2, 3] {
        let found = world.voids(&world.samples(&eyes[..n], 8 * px)).unseen(world.local(from), px, world.near());
        let c = compare(&found, &world.truly_void(from, &eyes[..n], px), px);
        let missing = compare(&found, &world.truly_unseen(from, &eyes[..n], px), px).true_sr;
        println!("{n} samples: {c:?}, {missing} sr missing");
        assert!(missing < c.true_sr);
        agrees(c);
    }
}

#[test]
fn a_sample_misses_nothing_where_it_was_taken_and_more_samples_miss_less() {
    let world = World::new(&furnished(), 1.0);
    let eyes = [[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0], [0.0, 0.0]].map(|p| Vec3::new(p[0], 0.0, p[1]));
    let pictures = world.samples(&eyes, 64);
    let mut last = [f64::INFINITY; 2];
    for n in 1..=eyes.len() {
        let voids = world.voids(&pictures[..6 * n]);
        for e in &eyes[..n] {
            assert_eq!(voids.unseen(world.local(*e), 64, world.near()).sr, 0.0);
        }
        // A hair beside it its walls have next to no area.
        let beside = voids.unseen(world.local(eyes[0] + Vec3::new(1e-4, 1e-4, 0.0)), 64, world.near()).sr;
        assert!(beside < 1e-3, "{beside}");
        let now = [Vec3::new(1.0, 0.0, 0.6), Vec3::new(-2.0, 0.0, 1.0)]
            .map(|v| voids.unseen(world.local(v), 64, world.near()).sr);
        println!("{n} samples: {now:?} sr, {} walls", voids.walls());
        // Another sample's third test may add a skin here and there.
        assert!(now[0] <= last[0] + 2e-3 && now[1] <= last[1] + 2e-3, "{now:?} after {last:?}");
        last = now;
    }
    assert!(last.iter().all(|sr| *sr < 0.2), "{last:?}");
}

#[test]
fn the_scale_of_a_scene_does_not_matter() {
    let at = |scale: f32| {
        let world = World::new(&pierced(), scale);
        look(&world, &[Vec3::new(0.0, 0.0, 3.0)], Vec3::new(0.1, 0.05, -2.0)).sr
    };
    let one = at(1.0);
    for scale in [1e-3, 1e6] {
        assert!((at(scale) / one - 1.0).abs() < 0.02);
    }
}

#[test]
fn only_what_the_void_hides_within_the_bounds_counts() {
    let world = World::new(&pierced(), 1.0);
    let pictures = world.samples(&[Vec3::new(0.0, 0.0, 3.0)], 64);
    let mut before = World::new(&pierced(), 1.0);
    // All that lies before the wall with the gap.
    before.bounds.min.z = world.local(Vec3::new(0.0, 0.0, -4.9)).z as f32;
    let from = world.local(Vec3::new(0.1, 0.05, -2.0));
    assert!(world.voids(&pictures).unseen(from, 64, 0.01).sr > 0.1);
    assert_eq!(before.voids(&pictures).unseen(from, 64, 0.01).sr, 0.0);
}

#[test]
fn it_asks_for_samples_until_no_candidate_sees_much_void_whatever_the_number_of_threads() {
    let world = World::new(&furnished(), 1.0);
    let views = world.views();
    let half = 3.0;
    for (flat, candidates) in [(true, Candidates::Planar), (false, Candidates::Solid)] {
        let metric = VoidSurface { max_sr: 0.1, face_px: 48, alpha_deg: 3.0, candidates, ..VoidSurface::default() };
        let cell = world.cell(Vec3::new(0.0, -0.5, 0.0), half, flat);
        let mut pictures = vec![];
        let mut values = vec![];
        loop {
            let subject = world.subject(&cell, &views, &pictures);
            let (verdict, next) = world
                .with(1, |cx| Ok::<_, farfield_core::Fault>((metric.judge(&subject, cx)?, metric.next(&subject, cx)?)))
                .unwrap();
            let again = world.with(3, |cx| metric.next(&subject, cx)).unwrap();
            assert_eq!(next, again, "the same on three threads");
            assert_eq!((verdict.quantity, verdict.claim), (Quantity::UnseenSolidAngle, verdict.value));
            assert_eq!(verdict.passes, next.is_none());
            values.push(verdict.value);
            let Some(at) = next else { break };
            assert!(cell.outline.region.distance(&farfield_core::Aabb::of([at])) < 1e-4, "{at} is no viewpoint");
            let cube = farfield_core::Camera::cube(at.as_dvec3(), 64, world.near());
            assert!(pictures.iter().all(|(c, _): &(farfield_core::Camera, _)| c.eye != cube[0].eye));
            pictures.extend(world.shoot(&cube));
            assert!(values.len() < 40, "{values:?}");
        }
        println!("{candidates:?}: {values:?}");
        assert_eq!(values[0], 4.0 * std::f64::consts::PI);
        assert!(values.len() > 3 && *values.last().unwrap() <= 0.1);
        // Rays confirm it at viewpoints that were no candidates.
        let eyes: Vec<Vec3> = pictures.chunks(6).map(|p| (p[0].0.eye + world.scene.origin).as_vec3()).collect();
        for from in [Vec3::new(1.3, -0.5, 0.4), Vec3::new(-2.2, -0.5, 1.7), Vec3::new(0.5, -0.5, -2.6)] {
            let truth = world.truly_unseen(from, &eyes, 48);
            let sr = truth.iter().filter(|t| **t).count() as f64 / truth.len() as f64 * 12.566;
            println!("  from {from}: {sr} sr unseen by rays");
            assert!(sr < 0.15, "{sr}");
        }
    }
}

#[test]
fn one_picture_of_one_object_serves_a_far_cell_and_not_a_near_one() {
    let block = sides(Vec3::new(-1.0, -1.0, -3.0), Vec3::new(1.0, 1.0, -1.0));
    let world = World::new(&block, 1.0);
    let views = world.views();
    let value = |distance: f32| {
        let centre = Vec3::new(0.0, 0.0, distance);
        let eye = world.local(centre);
        let corners = world.bounds.corners();
        let camera = farfield_core::Camera::around(eye, -Vec3::Z, corners, 200.0, 2, world.near()).unwrap();
        let pictures = world.shoot(&[camera]);
        let cell = world.cell(centre, 2.5, true);
        let subject = world.subject(&cell, &views, &pictures);
        let metric = VoidSurface { max_sr: 1e-3, ..VoidSurface::default() };
        world.with(1, |cx| metric.judge(&subject, cx)).unwrap()
    };
    let (near, far) = (value(4.0), value(200.0));
    assert!(near.value > 0.01 && !near.passes, "{near:?}");
    assert!(far.value < 1e-3 && far.passes, "{far:?}");
}

#[test]
fn settings_that_are_no_numbers_and_regions_without_bound_are_refused() {
    let world = World::new(&pierced(), 1.0);
    let (views, cell) = (world.views(), world.cell(Vec3::ZERO, 1.0, true));
    let refused = |metric: VoidSurface, cell: &farfield_core::cell::Cell| {
        let subject = world.subject(cell, &views, &[]);
        world.with(1, |cx| metric.judge(&subject, cx)).unwrap_err().to_string()
    };
    let plain = VoidSurface::default;
    for (metric, word) in [
        (VoidSurface { max_sr: f64::NAN, ..plain() }, "max_sr"),
        (VoidSurface { max_sr: 13.0, ..plain() }, "max_sr"),
        (VoidSurface { alpha_deg: -1.0, ..plain() }, "alpha_deg"),
        (VoidSurface { face_px: 4, ..plain() }, "face_px"),
        (VoidSurface { far: Some(0.0), ..plain() }, "far"),
    ] {
        assert!(refused(metric, &cell).contains(word));
    }
    let mut endless = cell.clone();
    endless.outline.region = farfield_core::region::Region::Everywhere;
    assert!(refused(plain(), &endless).contains("no bound"));
}

#[test]
fn a_region_that_is_all_sampled_has_no_void_and_nothing_around_has_none_either() {
    let world = World::new(&pierced(), 1.0);
    let views = world.views();
    // A region of one viewpoint.
    let cell = world.cell(Vec3::new(0.0, 0.0, 1.0), 0.0, true);
    let pictures = world.samples(&[Vec3::new(0.0, 0.0, 1.0)], 16);
    let metric = VoidSurface::default();
    let ask = |subject: &farfield_core::strategy::Subject<'_>| {
        world.with(1, |cx| (metric.judge(subject, cx).unwrap(), metric.next(subject, cx).unwrap()))
    };
    let (verdict, next) = ask(&world.subject(&cell, &views, &pictures));
    assert!(verdict.value == 0.0 && verdict.passes && next.is_none());
    // Samples that see nothing know of no void.
    let cell = world.cell(Vec3::new(0.0, 0.0, 1.0), 1.0, true);
    let empty = |c: &farfield_core::Camera| {
        let n = (c.size[0] * c.size[1]) as usize;
        let depth = vec![f32::INFINITY; n];
        (*c, farfield_core::image::SurfaceImage { size: c.size, depth, object: vec![0; n], ..Default::default() })
    };
    let cube = farfield_core::Camera::cube(world.local(Vec3::new(0.0, 0.0, 1.0)), 16, world.near());
    let blank: Vec<_> = cube.iter().map(empty).collect();
    let (verdict, next) = ask(&world.subject(&cell, &views, &blank));
    assert!(verdict.value == 0.0 && next.is_none());
}

#[test]
fn a_far_threshold_makes_skins_of_what_lies_beyond_it() {
    let world = World::new(&furnished(), 1.0);
    let views = world.views();
    let cell = world.cell(Vec3::ZERO, 3.0, true);
    let pictures = world.samples(&[Vec3::ZERO, Vec3::new(2.0, 0.0, 2.0)], 32);
    let value = |far: Option<f32>, max_sr: f64| {
        let metric = VoidSurface { far, max_sr, face_px: 32, ..VoidSurface::default() };
        world.with(1, |cx| metric.judge(&world.subject(&cell, &views, &pictures), cx)).unwrap()
    };
    let (all, near) = (value(None, 0.2), value(Some(6.0), 0.2));
    assert!(near.value > all.value, "{near:?} {all:?}");
    assert_eq!(value(Some(1e6), 0.2), all);
    assert!(value(None, all.value).passes && !value(None, all.value * 0.99).passes);
}

/// A box with slots that open towards the cell: much of it is seen from beside the middle only.
fn comb() -> Vec<Sheet> {
    let mut out = sides(Vec3::new(-1.0, -1.0, -3.0), Vec3::new(1.0, 1.0, -2.6));
    for k in 0..4 {
        let x = -1.0 + 0.56 * k as f32;
        out.extend(sides(Vec3::new(x, -1.0, -2.6), Vec3::new(x + 0.32, 1.0, -1.0)));
    }
    out
}

/// The two metrics' values of an object whose middle is `distance` ahead of a cell of edge 5: steradians and pixels.
fn two_words(shape: &[Sheet], distance: f32) -> [f64; 2] {
    let world = World::new(shape, 1.0);
    let views = world.views();
    let cell = world.cell(Vec3::new(0.0, 0.0, distance - 2.0), 2.5, true);
    let eye = cell.outline.centre.as_dvec3();
    // Four times as fine as a view: a slot less than a pixel wide is unknown.
    let px = 4.0 * views.px_per_tan();
    let camera = farfield_core::Camera::around(eye, -Vec3::Z, world.bounds.corners(), px, 2, world.near()).unwrap();
    let pictures = world.shoot(&[camera]);
    let corners = cell.outline.region.corners().unwrap();
    let place = |p: Vec3| world.local(p).as_vec3();
    let faces = |[p, a, b]: &&Sheet| corners.iter().any(|c| a.cross(*b).dot(*c - place(*p)) > 0.0);
    let facing: Vec<Vec3> =
        shape.iter().filter(faces).flat_map(|[p, a, b]| [*p, p + a, p + b, p + a + b].map(place)).collect();
    let subject = farfield_core::strategy::Subject { facing: &facing, ..world.subject(&cell, &views, &pictures) };
    let metrics: [Box<dyn VisibilityMetric>; 2] = [
        Box::new(VoidSurface { face_px: 256, ..VoidSurface::default() }),
        Box::new(farfield_metrics::SelfOcclusion::default()),
    ];
    metrics.map(|m| world.with(1, |cx| m.judge(&subject, cx)).unwrap().value)
}

/// Spearman's: the correlation of ranks.
fn rank_correlation(pairs: &[[f64; 2]]) -> f64 {
    let rank = |k: usize, i: usize| pairs.iter().filter(|p| p[k] < pairs[i][k]).count() as f64;
    let n = pairs.len() as f64;
    let apart: f64 = (0..pairs.len()).map(|i| (rank(0, i) - rank(1, i)).powi(2)).sum();
    1.0 - 6.0 * apart / (n * (n * n - 1.0))
}

#[test]
fn objects_come_in_the_order_of_self_occlusion_and_what_is_slotted_has_more_void() {
    let plate = sides(Vec3::new(-1.0, -1.0, -1.2), Vec3::new(1.0, 1.0, -1.0));
    let block = sides(Vec3::new(-1.0, -1.0, -3.0), Vec3::new(1.0, 1.0, -1.0));
    let mut pairs = vec![];
    for distance in [8.0, 16.0, 32.0, 64.0, 128.0] {
        let [plate, block, comb] = [&plate, &block, &comb()].map(|s| two_words(s, distance));
        println!("{distance}: {plate:?} {block:?} {comb:?} sr, px");
        assert!(plate[0] < block[0] && block[0] < comb[0], "at {distance}");
        // Only the void surface tells a slotted box from a full one.
        assert!((block[1] - comb[1]).abs() < 1e-3 * block[1]);
        pairs.extend([plate, block, comb]);
    }
    for shape in 0..3 {
        let of_shape: Vec<[f64; 2]> = pairs.iter().skip(shape).step_by(3).copied().collect();
        assert!(of_shape.windows(2).all(|w| w[1][0] < w[0][0] && w[1][1] < w[0][1]), "{of_shape:?} fall with distance");
        assert_eq!(rank_correlation(&of_shape), 1.0);
        // Strips as high as the object and s wide: F / s falls as the object's height in the view does, far off.
        let [near, far] = [of_shape[2], of_shape[4]].map(|p| p[0] / p[1]);
        println!("shape {shape}: {}", near / far);
        assert!(shape == 0 || (near / far / 4.0 - 1.0).abs() < 0.35, "{near} {far}");
    }
    let all = rank_correlation(&pairs);
    println!("rank correlation over {} objects: {all:.3}", pairs.len());
    assert!(all > 0.9);
}

#[test]
fn of_an_object_rays_find_less_unseen_than_the_void_surface_says() {
    for (shape, most) in [(comb(), 12.0), (sides(Vec3::new(-1.0, -1.0, -3.0), Vec3::new(1.0, 1.0, -1.0)), 40.0)] {
        let world = World::new(&shape, 1.0);
        let (centre, from) = (Vec3::new(0.0, 0.0, 4.0), Vec3::new(2.5, 0.0, 1.5));
        let eye = world.local(centre);
        let camera =
            farfield_core::Camera::around(eye, -Vec3::Z, world.bounds.corners(), 400.0, 2, world.near()).unwrap();
        let found = world.voids(&world.shoot(&[camera])).unseen(world.local(from), 2 * PX, world.near());
        let truth = compare(&found, &world.truly_unseen(from, &[centre], 2 * PX), 2 * PX);
        println!("{truth:?}");
        assert!(truth.true_sr > 20.0 * PIXEL_SR && found.sr > truth.true_sr - truth.border_sr);
        assert!(found.sr < most * truth.true_sr, "{most}");
    }
}
