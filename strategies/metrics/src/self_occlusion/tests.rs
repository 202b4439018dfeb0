//! The formula against the paper's, its limits, and the claim against sampled rays.

use std::sync::atomic::AtomicBool;

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Cell, Outline, Split};
use farfield_core::context::{Capture, Forget, Serial, Shot};
use farfield_core::id::CellId;
use farfield_core::image::SurfaceImage;
use farfield_core::region::Region;
use farfield_core::{Aabb, Camera};
use glam::Vec3;
use proptest::prelude::*;

use super::*;

struct Blind;
impl Capture for Blind {
    fn identity(&self) -> &str {
        "none"
    }
    fn shoot(&self, _shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        Err(Fault::Refused("a closed form takes no pictures".into()))
    }
}

fn hexagon(edge: f32) -> Cell {
    let polygon =
        (0..6).map(|k| (k as f32 * std::f32::consts::FRAC_PI_3).sin_cos()).map(|(s, c)| [edge * c, edge * s]).collect();
    Cell {
        outline: Outline {
            id: CellId(0),
            region: Region::Prism { polygon, y: [0.0, 0.0] },
            centre: Vec3::ZERO,
            neighbours: vec![],
        },
        splits: vec![Split::default()],
        sectors: vec![],
        own: vec![],
        claims: vec![],
    }
}

fn views() -> ViewModel {
    ViewModel {
        fov_y_rad: 60f32.to_radians(),
        resolution: [1024, 1024],
        near: 0.1,
        eye_height: [0.0, 0.0],
        pitch_rad: [0.0; 2],
        max_speed: 1.0,
        max_turn_rad: 1.0,
    }
}

fn judge(cell: &Cell, facing: &[Vec3], max_px: f64) -> Verdict {
    sampled(cell, facing, max_px, &[]).0
}

/// The verdict and the next sample when samples were taken at `eyes`.
fn sampled(cell: &Cell, facing: &[Vec3], max_px: f64, eyes: &[Vec3]) -> (Verdict, Option<Vec3>) {
    let (views, go) = (views(), AtomicBool::new(false));
    let taken = |e: &Vec3| (Camera::cube(e.as_dvec3(), 1, 0.1)[0], SurfaceImage::default());
    let samples: Vec<_> = eyes.iter().map(taken).collect();
    let subject = Subject {
        cell,
        views: &views,
        bounds: Aabb::of(facing.iter().copied()),
        facing,
        px_per_tan: views.px_per_tan(),
        samples: &samples,
    };
    let cx = Context { capture: &Blind, run: &Serial, memo: &Forget, cancel: &go };
    let metric = SelfOcclusion { max_px };
    (metric.judge(&subject, &cx).unwrap(), metric.next(&subject, &cx).unwrap())
}

proptest! {
    #[test]
    fn it_is_the_papers_formula_at_sixty_degrees(c in 1f64..200.0, d in 1f64..5000.0, l in 0f64..500.0) {
        let cell = hexagon(c as f32);
        let facing = [Vec3::new(0.0, 0.0, d as f32), Vec3::new(0.0, 0.0, (d + l) as f32)];
        // With the paper's letters, image_res = 1024.
        let s = 3f64.sqrt() * c * l / (2.0 * d * (d + l)) * 1024.0;
        let v = judge(&cell, &facing, 5.0);
        prop_assert!((v.value - s).abs() <= 1e-4 * s + 1e-2 * c / d, "{} {s}", v.value);
        prop_assert!(v.claim >= v.value * 0.999);
        prop_assert_eq!(v.passes, v.value < 5.0);
    }

    #[test]
    fn no_viewpoint_sees_a_hidden_point_farther_from_its_occluder_than_claimed(
        at in [-60f32..60.0, 0f32..20.0, 60f32..200.0], size in 1f32..40.0,
        uv in [0f32..1.0, 0f32..1.0, 0f32..1.0], from in [0f32..1.0, 0f32..1.0, 0f32..1.0],
        ab in [0f32..1.0, 0f32..1.0], yaw in -0.52f32..0.52, pitch in -0.52f32..0.52
    ) {
        let cell = hexagon(10.0);
        let b = Aabb { min: Vec3::from(at) - size / 2.0, max: Vec3::from(at) + size / 2.0 };
        let v = judge(&cell, &b.corners(), 5.0);
        // Two points of the box on one ray from the centre; seen from elsewhere by a camera that has both in its picture.
        let through = b.min + b.size() * Vec3::from(uv);
        let (mut enter, mut leave) = (0f32, f32::INFINITY);
        for k in 0..3 {
            let (p, q) = (b.min[k] / through[k], b.max[k] / through[k]);
            (enter, leave) = (enter.max(p.min(q)), leave.min(p.max(q)));
        }
        prop_assume!(leave > enter);
        let on_ray = |t: f32| through * (enter + (leave - enter) * t);
        let eye = cell.outline.region.sample(from).unwrap();
        let to = (b.centre() - eye).normalize();
        let look = glam::Quat::from_rotation_y(yaw) * glam::Quat::from_rotation_x(pitch) * to;
        let camera = Camera::looking(eye.as_dvec3(), look, Vec3::Y, views().fov_y_rad, [1024, 1024], 0.1);
        let inside = |p: Vec3| camera.project(p - eye).filter(|q| {
            (0.0..1024.0).contains(&q.x) && (0.0..1024.0).contains(&q.y)
        });
        if let (Some(p), Some(q)) = (inside(on_ray(ab[0])), inside(on_ray(ab[1]))) {
            let apart = f64::from(p.truncate().distance(q.truncate()));
            prop_assert!(apart <= v.claim * 1.0001 + 1e-2, "{apart} px, claimed {}", v.claim);
        }
    }
}

#[test]
fn objects_that_touch_or_surround_the_cell_fail_and_are_infinite_not_nan() {
    let cell = hexagon(10.0);
    for facing in [
        [Vec3::new(0.0, 0.0, -5.0), Vec3::new(0.0, 0.0, 40.0)],
        [Vec3::ZERO, Vec3::new(0.0, 0.0, 40.0)],
        [Vec3::new(-9.0, -1.0, -9.0), Vec3::new(9.0, 1.0, 9.0)],
        [Vec3::ZERO, Vec3::ZERO],
    ] {
        let v = judge(&cell, &facing, 1e30);
        assert_eq!((v.value, v.passes), (f64::INFINITY, false), "{facing:?}");
    }
    // Touching the border: ahead of the centre, so s is finite, but nothing finite can be claimed.
    let v = judge(&cell, &[Vec3::new(0.0, -1.0, 8.0), Vec3::new(0.0, 1.0, 30.0)], 5.0);
    assert!(v.value.is_finite() && v.claim == f64::INFINITY);
}

#[test]
fn flat_far_and_empty_objects_hide_nothing() {
    let cell = hexagon(10.0);
    let flat = judge(&cell, &[Vec3::new(-3.0, 0.0, 50.0), Vec3::new(3.0, 0.0, 50.0)], 5.0);
    assert!(flat.value == 0.0 && flat.passes);
    let far = judge(&cell, &[Vec3::new(0.0, 0.0, 1e15), Vec3::new(0.0, 0.0, 1.1e15)], 5.0);
    assert!(far.value < 1e-9 && far.claim < 1e-9 && far.passes);
    assert_eq!(judge(&cell, &[], 5.0).value, 0.0);
}

#[test]
fn the_scale_of_a_scene_does_not_matter() {
    let at = |k: f32| {
        let facing = [Vec3::new(3.0, 1.0, 60.0) * k, Vec3::new(-4.0, 9.0, 85.0) * k];
        judge(&hexagon(10.0 * k), &facing, 5.0)
    };
    for k in [1e-3, 1e6] {
        assert!((at(k).value / at(1.0).value - 1.0).abs() < 1e-4);
        assert!((at(k).claim / at(1.0).claim - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_sample_in_the_centre_changes_nothing_and_more_bring_it_under_the_threshold() {
    let cell = hexagon(10.0);
    let facing = [Vec3::new(0.0, 0.0, 60.0), Vec3::new(0.0, 0.0, 70.0), Vec3::new(5.0, 2.0, 66.0)];
    let max_px = 8.0;
    let (alone, first) = sampled(&cell, &facing, max_px, &[]);
    assert_eq!(first, Some(Vec3::ZERO));
    let mut eyes = vec![Vec3::ZERO];
    assert_eq!(sampled(&cell, &facing, max_px, &eyes).0, alone);
    let mut values = vec![alone.value];
    while let (verdict, Some(next)) = sampled(&cell, &facing, max_px, &eyes) {
        assert!(!verdict.passes && cell.outline.region.contains(next * 0.999), "{next}");
        // No viewpoint is farther from the samples than the next one.
        let off = |p: Vec3| eyes.iter().map(|e| e.distance(p)).fold(f32::INFINITY, f32::min);
        for i in 0..400 {
            let u = [(i % 20) as f32 / 19.0, (i / 20) as f32 / 19.0, 0.0];
            assert!(off(cell.outline.region.sample(u).unwrap()) <= off(next) + 1e-3);
        }
        eyes.push(next);
        let (now, _) = sampled(&cell, &facing, max_px, &eyes);
        values.push(now.value);
        assert!(eyes.len() < 60, "{values:?}");
    }
    assert!(values.windows(2).all(|v| v[1] <= v[0]) && values[values.len() - 1] < max_px);
    // s is R times a number that the samples do not change.
    assert!((values[0] / alone.value - 1.0).abs() < 1e-9 && eyes.len() > 4);
}

#[test]
fn the_claim_with_several_samples_holds_for_the_nearest_one() {
    let cell = hexagon(10.0);
    let b = Aabb { min: Vec3::new(-8.0, 0.0, 40.0), max: Vec3::new(8.0, 6.0, 60.0) };
    let eyes = [Vec3::new(5.0, 0.0, -4.0), Vec3::new(-5.0, 0.0, -4.0), Vec3::new(0.0, 0.0, 5.0)];
    let (verdict, _) = sampled(&cell, &b.corners(), 5.0, &eyes);
    let one = judge(&cell, &b.corners(), 5.0);
    assert!(verdict.claim < one.claim && verdict.value < one.value);
    let mut worst = 0f32;
    for i in 0..4000u32 {
        let u = |k: u32| (i.wrapping_mul(2654435761).wrapping_add(k.wrapping_mul(40503)) >> 8) as f32 % 1000.0 / 1000.0;
        let eye = cell.outline.region.sample([u(1), u(2), u(3)]).unwrap();
        let sample = eyes.into_iter().min_by(|p, q| p.distance(eye).total_cmp(&q.distance(eye))).unwrap();
        // Two points of the box on one ray from the sample.
        let through = b.min + b.size() * Vec3::new(u(4), u(5), u(6)) - sample;
        let (mut enter, mut leave) = (0f32, f32::INFINITY);
        for k in 0..3 {
            let (p, q) = ((b.min[k] - sample[k]) / through[k], (b.max[k] - sample[k]) / through[k]);
            (enter, leave) = (enter.max(p.min(q)), leave.min(p.max(q)));
        }
        let camera =
            Camera::looking(eye.as_dvec3(), (b.centre() - eye).normalize(), Vec3::Y, views().fov_y_rad, [1024; 2], 0.1);
        let shown = |q: &Vec3| (0.0..1024.0).contains(&q.x) && (0.0..1024.0).contains(&q.y);
        let at = |t: f32| camera.project(sample + through * t - eye).filter(shown);
        if let (Some(p), Some(q)) = (at(enter), at(leave)) {
            worst = worst.max(p.truncate().distance(q.truncate()));
        }
    }
    assert!(f64::from(worst) <= verdict.claim && f64::from(worst) > 0.1 * verdict.claim);
}
