//! Whole bakes beside the scene itself: what is missing, what is doubled, what is refused.

use crate::common::*;
use farfield_core::cell::{Active, Cell, Split};
use farfield_core::id::{AssetId, Block, CellId, ChunkId, SectorId, SplitId};
use farfield_core::layered::LayeredPart;
use farfield_core::payload::{Part, Payload};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::{Partition, View};
use farfield_core::{Aabb, Camera};
use farfield_cpu::SplatOrder;
use farfield_partition_hex::HexCells;
use farfield_partition_single_cell::SingleCell;
use glam::Vec3;

const RADIUS: f32 = 6.0;
const WINDOW: f32 = 8.0;

fn layered(payload: &Payload) -> &LayeredPart {
    let [Part::Layered(part)] = payload.parts.as_slice() else { panic!("one layered part") };
    part
}

fn only(kept: &Kept) -> &LayeredPart {
    layered(kept.payloads.values().next().unwrap())
}

#[test]
fn from_the_centre_the_picture_is_the_capture() {
    let (scene, v) = (pipes(1500, 1), views([400, 400]));
    let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    let kept = bake(&scene, &v, &cell, "", 1);
    let part = only(&kept);
    // The image's own camera: samples and pixels coincide.
    let camera = Camera { eye: cell.outline.centre.as_dvec3(), ..part.camera };
    let reference = direct(&scene, &cell.splits[0].far, &[camera]).remove(0);
    let mut apart = Apart::default();
    apart.add(&reference, &warped(&mut loaded(&scene, &kept, SplatOrder::Nearest), &scene, &kept, 0, &camera));
    println!("{apart:?}");
    assert_eq!(apart.holes + apart.extra, 0);
    assert!(apart.share(apart.other) < 1e-3 && apart.albedo / (apart.pixels as f64) < 0.1);
    // Decoded depths are the captured ones to half a step of 1 / depth.
    let first = part.first_samples();
    let step = (part.inverse_depth[0] - part.inverse_depth[1]) / 65535.0;
    let mut checked = 0;
    for i in (0..reference.depth.len()).filter(|&i| reference.hit(i)) {
        let decoded = part.depth_at(first[i] as usize);
        assert!((decoded.recip() - reference.depth[i].recip()).abs() <= 0.51 * step, "pixel {i}");
        checked += 1;
    }
    assert!(checked > 10_000);
    // Another camera at the same place: elements are thrown into other pixels.
    let camera = v.camera(camera.eye, 0.05, 0.02);
    let reference = direct(&scene, &cell.splits[0].far, &[camera]).remove(0);
    let mut apart = Apart::default();
    apart.add(&reference, &warped(&mut loaded(&scene, &kept, SplatOrder::Nearest), &scene, &kept, 0, &camera));
    println!("turned: {apart:?}");
    assert!(apart.share(apart.other) < 0.03);
}

/// Holes and the rest over a walk.
fn walked(scene: &Scene, cell: &Cell, kept: &Kept, cameras: &[Camera], order: SplatOrder) -> Apart {
    let mut backend = loaded(scene, kept, order);
    let mut apart = Apart::default();
    for (c, r) in cameras.iter().zip(direct(scene, &cell.splits[0].far, cameras)) {
        apart.add(&r, &warped(&mut backend, scene, kept, 0, c));
    }
    apart
}

#[test]
fn nine_images_leave_few_holes_where_one_leaves_many_and_keep_each_surface_once() {
    let (scene, v) = (pipes(2500, 7), views([320, 320]));
    let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    let cameras = tour(&cell, &v, 12, 3);
    let mut before = f64::INFINITY;
    for n in [1, 5, 9] {
        let kept = bake(&scene, &v, &cell, &format!("construction_images = {n}"), 1);
        let p = &kept.index().pictures[0];
        for order in [SplatOrder::Nearest, SplatOrder::OcclusionCompatible] {
            let apart = walked(&scene, &cell, &kept, &cameras, order);
            let holes = apart.share(apart.holes);
            println!(
                "{n} images, {order:?}: holes {:.3} %, {:.3} % off outlines, too much {:.3} %, another object {:.2} %, {} samples, {:.2} a covered pixel, \
                 {} at most",
                100.0 * holes,
                100.0 * apart.share(apart.inner),
                100.0 * apart.share(apart.extra),
                100.0 * apart.share(apart.other),
                p.samples,
                p.samples as f64 / p.covered as f64,
                p.deepest
            );
            match n {
                1 => assert!(holes > 0.03 && p.samples == p.covered),
                5 => assert!(holes < 0.4 * before),
                _ => assert!(holes < 0.8 * before && holes < 0.01 && apart.share(apart.inner) < 0.002),
            }
            if order == SplatOrder::OcclusionCompatible {
                before = holes;
            }
        }
        assert!(p.samples < 3 * p.covered && p.deepest < 64);
        // No two samples of a pixel within a footprint, but for rounding.
        let part = only(&kept);
        let first = part.first_samples();
        for s in first.windows(2).flat_map(|w| (w[0] as usize + 1..w[1] as usize).collect::<Vec<_>>()) {
            let (a, b) = (part.depth_at(s - 1), part.depth_at(s));
            assert!(b - a > 0.5 * a / part.camera.px_per_tan(), "{a} and {b}");
        }
    }
}

fn inside(scene: &Scene, v: &farfield_core::camera::ViewModel, partition: &dyn Partition, at: Vec3) -> Cell {
    with(scene, 1, |cx| {
        let cells = partition.divide(scene, v, cx).unwrap();
        let id = cells.find(&v.camera(at.as_dvec3(), 0.0, 0.0)).unwrap();
        cells.inside(id, scene, cx).unwrap()
    })
}

/// Single cell: a box around the pipes' origin.
fn boxed(scene: &Scene, v: &farfield_core::camera::ViewModel) -> Cell {
    let (c, r) = (origin(scene), 4.0);
    let region = Some([c.x - r, c.y - r, c.z - r, c.x + r, c.y + r, c.z + r]);
    inside(scene, v, &SingleCell { region }, c)
}

/// Views all round from places in the cell.
fn round(cell: &Cell, v: &farfield_core::camera::ViewModel, seed: u64) -> Vec<Camera> {
    let mut random = Random::new(seed);
    let turns = (0..12).map(|k| (k as f32 * 1.3, 0.4 * ((k % 3) as f32 - 1.0)));
    turns
        .map(|(yaw, pitch)| {
            let at = cell.outline.region.sample([(); 3].map(|()| random.within(0.0, 1.0))).unwrap();
            v.camera(at.as_dvec3(), yaw, pitch)
        })
        .collect()
}

#[test]
fn cells_with_windows_all_round_show_everything_around() {
    let scene = pipes(2500, 5);
    let c = origin(&scene);
    let v = farfield_core::camera::ViewModel { eye_height: [c.y - 0.5, c.y + 0.5], ..views([240, 240]) };
    let hex = inside(&scene, &v, &HexCells { edge: 5.0, margin: None }, c);
    for (name, cell) in [("single-cell", boxed(&scene, &v)), ("hex-cells", hex)] {
        let kept = bake(&scene, &v, &cell, "max_px = 2048", 2);
        let index = kept.index();
        assert!(
            kept.payloads.len() >= 4
                && index
                    .pictures
                    .iter()
                    .all(|p| kept.payloads[&farfield_core::id::LocalPayload(p.payload)].samples() == p.samples)
        );
        let cameras = round(&cell, &v, 9);
        let apart = walked(&scene, &cell, &kept, &cameras, SplatOrder::Nearest);
        println!(
            "{name}: {} images, {:?}, holes {:.3} %, {:.3} % off outlines, too much {:.3} %, another object {:.2} %",
            index.pictures.len(),
            index.pictures.iter().map(|p| p.size).collect::<Vec<_>>(),
            100.0 * apart.share(apart.holes),
            100.0 * apart.share(apart.inner),
            100.0 * apart.share(apart.extra),
            100.0 * apart.share(apart.other)
        );
        let one = bake(&scene, &v, &cell, "max_px = 2048\nconstruction_images = 1", 2);
        let worse = walked(&scene, &cell, &one, &cameras, SplatOrder::Nearest);
        println!(
            "with one image {:.3} %, {:.3} % off outlines",
            100.0 * worse.share(worse.holes),
            100.0 * worse.share(worse.inner)
        );
        assert!(apart.share(apart.inner) < 0.01 && worse.inner > 4 * apart.inner && worse.holes > 2 * apart.holes);
    }
}

#[test]
fn a_bake_is_the_same_for_any_number_of_threads_and_comes_back_from_the_store() {
    let (scene, v) = (pipes(150, 2), views([120, 120]));
    let cell = boxed(&scene, &v);
    let one = bake(&scene, &v, &cell, "", 1);
    assert_eq!(one.payloads.len(), 6);
    for threads in [2, 5] {
        let many = bake(&scene, &v, &cell, "", threads);
        assert!(many.payloads == one.payloads && many.index == one.index && many.left_out == one.left_out);
    }
    for p in one.payloads.values() {
        let bytes = postcard::to_allocvec(p).unwrap();
        assert_eq!(postcard::from_bytes::<Payload>(&bytes).unwrap(), *p);
        let packed = zstd::bulk::compress(&bytes, 3).unwrap();
        assert!((packed.len() as u64) < p.texture_bytes());
    }
    assert!(one.claims.is_empty(), "nothing is promised");
    // Smoothing is left to who draws: the samples are the same.
    let smooth = bake(&scene, &v, &cell, "smooth = true", 2);
    for (a, b) in one.payloads.values().zip(smooth.payloads.values()) {
        assert!(!layered(a).smooth && *layered(b) == LayeredPart { smooth: true, ..layered(a).clone() });
    }
}

#[test]
fn a_view_draws_what_is_there_of_its_own_split_and_counts_the_rest() {
    let (scene, v) = (pipes(150, 2), views([120, 120]));
    let mut cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    // A second split: of the far chunks those to the left.
    let left = |c: &ChunkId| scene.chunks[c.index()].bounds.max.x < cell.outline.centre.x;
    let far: ChunkSet = cell.splits[0].far.iter().filter(left).collect();
    cell.sectors.push(farfield_core::cell::Sector {
        split: SplitId(1),
        seen: cell.splits[0].far.clone(),
        ..cell.sectors[0].clone()
    });
    cell.splits.push(Split { far: far.clone(), near_budget: None });
    let kept = bake(&scene, &v, &cell, "", 2);
    let index = kept.index();
    assert_eq!(index.pictures.iter().map(|p| (p.payload, p.split)).collect::<Vec<_>>(), [(0, 0), (1, 1)]);
    let objects = |k: u32| &layered(&kept.payloads[&farfield_core::id::LocalPayload(k)]).objects;
    assert!(objects(1).len() < objects(0).len());
    assert!(objects(1).iter().all(|o| far.iter().any(|c| scene.chunks[c.index()].object.0 + 1 == *o)));

    let open = ldi("").open(None, (AssetId(3), &kept.index)).unwrap();
    let ahead = v.camera(cell.outline.centre.as_dvec3(), 0.0, 0.0);
    let back = v.camera(cell.outline.centre.as_dvec3(), std::f32::consts::PI, 0.0);
    for (split, camera, there, drawn, missing) in
        [(0, ahead, true, 1, 0), (1, ahead, true, 1, 0), (1, ahead, false, 0, 1), (0, back, true, 0, 0)]
    {
        let at = Active { cell: CellId(0), split: SplitId(split), sectors: vec![SectorId(split)] };
        let view = View {
            scene: &scene,
            camera: &camera,
            at: &at,
            tolerance: &|_| 0.0,
            budget: Default::default(),
            cell: None,
        };
        let (mut draws, mut wanted) = (vec![], vec![]);
        let achieved = open.draw(&|_| there, &view, &mut draws);
        assert_eq!((draws.len(), achieved.missing), (drawn, missing));
        open.wanted(&view, &mut wanted);
        let seen: Vec<Block> = wanted.iter().filter(|c| c.in_view).map(|c| c.block).collect();
        assert_eq!((wanted.len(), seen.len() as u32), (2, drawn as u32 + missing));
        // What it takes where it takes the most: packed, or 16 bytes a sample and 4 an object on a GPU.
        let payload = &kept.payloads[&farfield_core::id::LocalPayload(0)];
        let on_gpu = 16 * payload.samples() + 4 * layered(payload).objects.len() as u64;
        assert!((0..16).contains(&(wanted[0].bytes - on_gpu.max(payload.texture_bytes()))), "{}", wanted[0].bytes);
    }
}

#[test]
fn what_cannot_be_served_is_refused_and_what_needs_nothing_says_so() {
    let (scene, v) = (pipes(60, 3), views([64, 64]));
    let cell = ball(&scene, RADIUS, WINDOW, v.px_per_tan());
    assert!(ldi("").needs(&scene, Some(&cell)).unwrap().cell_asset);
    let refused = |cell: &Cell, settings: &str| ldi(settings).needs(&scene, Some(cell)).unwrap_err().to_string();
    let mut meets = cell.clone();
    meets.outline.region = farfield_core::region::Region::Everywhere;
    assert!(refused(&meets, "").contains("meets the viewpoints of cell 0"));
    let mut blind = cell.clone();
    blind.sectors.clear();
    assert!(refused(&blind, "").contains("no window"));
    for (settings, name) in [
        ("construction_images = 10", "construction_images"),
        ("density = 0.0", "density"),
        ("merge_px = -1.0", "merge_px"),
        ("max_px = 1", "max_px"),
    ] {
        assert!(refused(&cell, settings).contains(name));
    }
    blind.splits = vec![Split::default()];
    let needs = ldi("").needs(&scene, Some(&blind)).unwrap();
    assert!(!needs.cell_asset && !needs.captures && needs.left_out[0].reason.contains("under the budget"));
    let nothing = bake(&scene, &v, &blind, "", 1);
    assert!(nothing.payloads.is_empty() && nothing.index.is_empty());
    assert!(ldi("").open(None, (AssetId(0), b"{}")).is_err());

    let coarse = bake(&scene, &v, &cell, "max_px = 32", 1);
    let size = coarse.index().pictures[0].size;
    assert!(size[0].max(size[1]) <= 32 && coarse.index().pictures[0].coarse > 1.5, "{size:?}");
    assert!(coarse.left_out[0].reason.contains("32 pixels") && coarse.left_out[0].decided == "build");
    let bounds: Aabb = coarse.index().pictures[0].bounds;
    assert!(bounds.max.z < cell.outline.centre.z - WINDOW + 2.0);
}
