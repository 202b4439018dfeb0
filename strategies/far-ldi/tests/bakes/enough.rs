//! A metric decides how many construction images are taken: more where more is hidden, as many as its threshold asks for.

use crate::common::*;
use farfield_core::cell::Cell;
use farfield_core::id::CellId;
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::Partition;
use farfield_cpu::SplatOrder;
use farfield_metrics::{SelfOcclusion, VoidSurface};
use farfield_partition_single_cell::SingleCell;
use glam::{DAffine3, DQuat, DVec3, Vec3};

const RADIUS: f32 = 6.0;
const WINDOW: f32 = 8.0;

/// The settings that make the void surface decide.
fn void(max_sr: f64) -> String {
    assert!(VoidSurface::default().max_sr > 0.0 && SelfOcclusion::default().max_px > 0.0, "both are in the program");
    format!("enough = {{ type = \"void-surface\", max_sr = {max_sr:?}, candidates = \"solid\" }}")
}

/// Boxes of a size each in the middle of a place each, around an origin that the local frame keeps.
fn boxes(all: &[[Vec3; 2]]) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [1.0; 4], ..Material::default() });
    let mesh = b.mesh("box", block()).unwrap();
    let specks = [-40.0, 40.0].map(|y| [Vec3::splat(1e-3), Vec3::Y * y]);
    for [size, at] in specks.iter().chain(all) {
        let (size, at): (DVec3, DVec3) = (size.as_dvec3(), at.as_dvec3());
        let transform = DAffine3::from_scale_rotation_translation(size, DQuat::IDENTITY, at);
        b.place(Placement { mesh, transform });
    }
    b.build().unwrap()
}

const WALL: [Vec3; 2] = [Vec3::new(60.0, 60.0, 1.0), Vec3::new(0.0, 0.0, -25.0)];

/// Screens before the wall, in a row.
fn screens(n: usize) -> Scene {
    let of = |k: usize| [Vec3::new(1.2, 4.0, 0.2), Vec3::new(3.0 * k as f32 - 1.5 * (n as f32 - 1.0), 0.0, -12.0)];
    boxes(&(0..n).map(of).chain([WALL]).collect::<Vec<_>>())
}

/// Hole pixels over a walk, as a share.
fn holes(scene: &Scene, v: &farfield_core::camera::ViewModel, cell: &Cell, kept: &Kept) -> f64 {
    let mut backend = loaded(scene, kept, SplatOrder::Nearest);
    let cameras = tour(cell, v, 10, 3);
    let mut apart = Apart::default();
    for (c, r) in cameras.iter().zip(direct(scene, &cell.splits[0].far, &cameras)) {
        apart.add(&r, &warped(&mut backend, scene, kept, 0, c));
    }
    apart.share(apart.holes)
}

fn taken(kept: &Kept) -> Vec<u32> {
    kept.index().pictures.iter().map(|p| p.taken.unwrap()).collect()
}

#[test]
fn a_bare_wall_takes_one_picture_and_the_more_stands_before_it_the_more_are_taken() {
    let v = views([160, 160]);
    let mut before = (vec![0; 4], -1.0);
    for n in [0, 1, 3] {
        let scene = screens(n);
        let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
        let one = holes(&scene, &v, &cell, &bake(&scene, &v, &cell, "construction_images = 1", 1));
        let baked = [0.3, 0.1, 0.05, 0.012].map(|max_sr| bake(&scene, &v, &cell, &void(max_sr), 1));
        let counts: Vec<u32> = baked.iter().map(|kept| taken(kept)[0]).collect();
        let left = holes(&scene, &v, &cell, &baked[3]);
        println!("{n} screens: {counts:?} pictures, holes {one:.4} of one, {left:.4} of the last");
        if n == 0 {
            assert!(counts == [1; 4] && one == 0.0);
            let said = &baked[0].left_out[0].reason;
            assert!(said.contains("8.00 of 9.00 an image"), "{said}");
        } else {
            // What one picture misses says the same, measured against the scene.
            assert!(one > before.1 && counts.iter().zip(&before.0).all(|(a, b)| a >= b), "{counts:?}");
            assert!(counts.iter().sum::<u32>() > before.0.iter().sum() && left < 0.1 * one);
        }
        before = (counts, one);
    }
}

#[test]
fn the_threshold_leads_from_one_picture_to_all_and_holes_follow() {
    let (scene, v) = (pipes(500, 7), views([128, 128]));
    let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    let mut before = (0, f64::INFINITY);
    let mut counts = vec![];
    let plain = ["construction_images = 1", ""].map(|settings| bake(&scene, &v, &cell, settings, 1));
    assert!(plain.iter().all(|p| !p.index.windows(7).any(|w| w == b"\"taken\"")), "only what a metric decided is told");
    for max_sr in [12.5, 0.25, 0.1, 0.04, 0.0] {
        let kept = bake(&scene, &v, &cell, &void(max_sr), 1);
        let now = (taken(&kept)[0], holes(&scene, &v, &cell, &kept));
        println!("max_sr {max_sr}: {} pictures, holes {:.3} %", now.0, 100.0 * now.1);
        assert!(now.0 >= before.0 && (now.0 == before.0 || now.1 < before.1));
        counts.push(now.0);
        before = now;
        let same = [0, 1].map(|k| plain[k].payloads == kept.payloads);
        assert_eq!(same, [max_sr == 12.5, max_sr == 0.0], "{max_sr}");
    }
    assert!(counts[0] == 1 && counts[4] == 9 && counts.iter().any(|n| (2..9).contains(n)), "{counts:?}");
}

#[test]
fn of_the_windows_of_a_room_only_the_obstructed_takes_more_whatever_the_number_of_threads() {
    let side = |axis: Vec3| [Vec3::splat(41.0) - 40.0 * axis.abs(), 20.0 * axis];
    let walls = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].map(side);
    let screen = [Vec3::new(4.0, 4.0, 0.2), Vec3::new(0.0, 0.0, -12.0)];
    let scene = boxes(&[&walls[..], &[screen]].concat());
    let v = views([96, 96]);
    let (c, r) = (origin(&scene), 3.0);
    let partition = SingleCell { region: Some([c.x - r, c.y - r, c.z - r, c.x + r, c.y + r, c.z + r]) };
    let cell = with(&scene, 1, |cx| partition.divide(&scene, &v, cx).unwrap().inside(CellId(0), &scene, cx).unwrap());
    let kept = bake(&scene, &v, &cell, &void(0.01), 1);
    let index = kept.index();
    let ahead = |payload: u32| cell.sectors[payload as usize].window.axis.dot(-Vec3::Z) > 0.9;
    println!("{:?}", taken(&kept));
    assert_eq!(index.pictures.len(), 6);
    for p in &index.pictures {
        assert_eq!(p.taken.unwrap() > 1, ahead(p.payload), "window {}", p.payload);
    }
    let many = bake(&scene, &v, &cell, &void(0.01), 3);
    assert!(many.payloads == kept.payloads && many.index == kept.index && many.left_out == kept.left_out);
}

#[test]
fn other_metrics_decide_too_and_what_leaves_nothing_to_decide_is_refused() {
    let v = views([120, 120]);
    let count = |scene: &Scene, max_px: f64| {
        let cell = ball(scene, RADIUS, WINDOW, v.px_per_tan());
        let enough = format!("enough = {{ type = \"self-occlusion\", max_px = {max_px:?} }}");
        taken(&bake(scene, &v, &cell, &enough, 1))[0]
    };
    // A plane square to the view hides nothing of itself; pipes reach from near to far.
    assert_eq!((count(&screens(0), 0.5), count(&pipes(150, 2), 0.5), count(&pipes(150, 2), 1e6)), (1, 9, 1));
    let scene = screens(0);
    let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    let settings = format!("construction_images = 1\n{}", void(0.1));
    assert!(ldi(&settings).needs(&scene, Some(&cell)).unwrap_err().to_string().contains("nothing to decide"));
    let five = bake(&scene, &v, &cell, &format!("construction_images = 5\n{}", void(0.1)), 1);
    assert!(five.left_out[0].reason.contains("4.00 of 5.00"));
}
