//! Whole bakes of small scenes: the same bytes for any number of threads, the same mesh at any scale, the reference's picture
//! from the cell's centre, and what is refused or left out.

use crate::common::*;
use farfield_core::Camera;
use farfield_core::backend::{Backend, BlockData};
use farfield_core::context::{Capture, Shot};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, Block, CellId, MaterialId, PayloadRef, TargetId};
use farfield_core::image::SurfaceImage;
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::Part;
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use farfield_core::strategy::View;
use farfield_cpu::{CpuBackend, CpuOptions};
use glam::{DAffine3, DVec3, Vec3};

/// A closed ball with bumps and a colour that varies, 2 n^2 triangles, resting on the ground.
fn statue(n: u32, r: f32) -> TriangleMesh {
    let mut m = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..n {
            let (a, b) = (i as f32 / n as f32 * std::f32::consts::TAU, j as f32 / n as f32 * std::f32::consts::PI);
            let bump = 1.0 + 0.25 * (3.0 * a).sin() * (2.0 * b).sin().powi(2);
            m.positions.push(r * (Vec3::Y * 1.3 + bump * Vec3::new(b.sin() * a.cos(), b.cos(), -b.sin() * a.sin())));
            let wave = |k: f32| (127.0 + 100.0 * (k * a).cos() * (k * b).sin()) as u8;
            m.colors.push([wave(2.0), wave(3.0), wave(5.0), 255]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let at = |i: u32, j: u32| i % n + j * n;
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
            m.indices.extend([a, b, c, c, b, d]);
        }
    }
    m.sections = vec![(0..m.indices.len() as u32, MaterialId(0))];
    m
}

fn scene(places: &[[f64; 2]], scale: f64) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material { base_color: [1.0; 4], ..Material::default() });
    let mesh = b.mesh("statue", statue(60, 5.0)).unwrap();
    for p in places {
        let transform =
            DAffine3::from_scale(DVec3::splat(scale)) * DAffine3::from_translation(DVec3::new(p[0], 0.0, p[1]));
        b.place(Placement { mesh, transform });
    }
    b.build().unwrap()
}

/// Statues round the cell in the middle: one in it, some beside it, some far off.
const PLACES: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [18.0, 5.0],
    [-20.0, 9.0],
    [45.0, -30.0],
    [-60.0, -60.0],
    [80.0, 75.0],
    [-120.0, 90.0],
    [120.0, -110.0],
];

fn bake(scene: &Scene, scale: f32, settings: &str, threads: usize) -> Kept {
    let mut v = views(4.0 * scale, 512);
    v.near *= scale;
    let cells = hexagons(scene, &v, 10.0 * scale, 1.0);
    let baker = Baker { threads, ..Baker::new(scene, &v) };
    let cell = baker.inside(&*cells, cell_at(&*cells, &v, 10.0 * scale, 0));
    baker.bake(&*textured(settings), &cell, cells.outlines()).unwrap()
}

#[test]
fn a_bake_is_the_same_for_any_number_of_threads() {
    let s = scene(&PLACES, 1.0);
    let one = bake(&s, 1.0, "", 1);
    assert!(one.payloads.len() >= 7 && triangles(&one) > 100);
    for threads in [2, 5] {
        let many = bake(&s, 1.0, "", threads);
        assert!(many.payloads == one.payloads, "payloads differ on {threads} threads");
        assert_eq!(
            (many.index, many.claims, many.left_out),
            (one.index.clone(), one.claims.clone(), one.left_out.clone())
        );
    }
}

#[test]
fn scenes_a_thousandth_and_a_million_times_the_size_have_the_same_meshes() {
    let home = bake(&scene(&PLACES, 1.0), 1.0, "", 2);
    for k in [1e-3f32, 1e6] {
        let scaled = bake(&scene(&PLACES, f64::from(k)), k, "", 2);
        assert_eq!(scaled.payloads.len(), home.payloads.len());
        assert_eq!(scaled.claims.len(), home.claims.len());
        let (a, b) = (triangles(&scaled) as f64, triangles(&home) as f64);
        assert!((a / b - 1.0).abs() <= 0.01, "{a} triangles at scale {k}, {b} at home");
    }
}

/// What the draws of a cell show through a camera.
fn drawn(scene: &Scene, kept: &Kept, camera: &Camera, settings: &str) -> SurfaceImage {
    let asset = AssetId(3);
    let mut backend = CpuBackend::new(scene, CpuOptions::default()).unwrap();
    for (id, payload) in &kept.payloads {
        let block = Block::Payload(PayloadRef { asset, id: *id });
        farfield_core::backend::validate(block, &BlockData::Payload(payload)).unwrap();
        backend.upload(block, &BlockData::Payload(payload)).unwrap();
    }
    let open = textured(settings).open(None, (asset, &kept.index)).unwrap();
    let sectors = (0..6).map(farfield_core::id::SectorId).collect();
    let at = farfield_core::cell::Active { cell: CellId(0), split: farfield_core::id::SplitId(0), sectors };
    let view = View { scene, camera, at: &at, tolerance: &|_| 0.0, budget: Default::default(), cell: None };
    let (mut draws, mut wanted): (Vec<Draw>, Vec<_>) = (vec![], vec![]);
    let achieved = open.draw(&|_| true, &view, &mut draws);
    open.wanted(&view, &mut wanted);
    assert_eq!(achieved.missing, 0);
    // Whatever is drawn is wanted, and nothing comes before what it needs.
    for (i, c) in wanted.iter().enumerate() {
        assert!(c.after.is_none_or(|b| wanted[..i].iter().any(|w| w.block == b)));
    }
    for d in &draws {
        if let DrawWhat::Payload { id, .. } = &d.what {
            assert!(wanted.iter().any(|c| c.in_view && c.block == Block::Payload(*id)));
        }
    }
    assert_eq!(open.draw(&|_| false, &view, &mut vec![]).missing as usize, draws.len());
    let pass = Pass { kind: PassKind::Surface, camera: *camera, writes: TargetId(0), draws };
    backend.render(&DrawList { passes: vec![pass] }).unwrap();
    backend.read_surface(TargetId(0)).unwrap()
}

#[test]
fn from_the_cells_centre_the_picture_is_the_references_but_for_silhouettes() {
    let s = scene(&[[0.0, 0.0]], 1.0);
    let v = views(6.0, 512);
    let cells = hexagons(&s, &v, 10.0, 12.0);
    let baker = Baker::new(&s, &v);
    for (k, single) in [(2, false), (10, true)] {
        let cell = baker.inside(&*cells, cell_at(&*cells, &v, 10.0, k));
        let kept = baker.bake(&*textured(""), &cell, cells.outlines()).unwrap();
        assert_eq!(kept.claims.len() == 1, single, "{k} cells");
        assert!(triangles(&kept) * 5 < s.triangles(), "{} triangles", triangles(&kept));

        // The capture's own camera, so that texels and pixels coincide.
        let eye = cell.outline.centre.as_dvec3();
        let mut points = vec![];
        for id in s.mesh_chunk_ids() {
            let place = |p: &Vec3| s.objects[0].placement.transform_point3(p.as_dvec3()).as_vec3();
            s.geometry.with(id, &mut |c| points.extend(c.positions.iter().map(place))).unwrap();
        }
        let axis = s.objects[0].bounds.centre() - cell.outline.centre;
        let camera = Camera::around(eye, axis, points, v.px_per_tan(), 2, v.near).unwrap();
        let shot = Shot { chunks: s.all_chunks(), camera };
        let reference = baker.capture.shoot(&[shot]).unwrap().remove(0);
        let picture = drawn(&s, &kept, &camera, "");

        let (mut hit, mut both, mut same, mut extra, mut difference) = (0, 0, 0, 0, 0u32);
        for i in 0..reference.depth.len() {
            let (r, p) = (reference.hit(i), picture.hit(i));
            hit += u32::from(r);
            extra += u32::from(p && !r);
            if r && p {
                both += 1;
                let apart = |k: usize| reference.albedo[i][k].abs_diff(picture.albedo[i][k]);
                same += u32::from((0..3).all(|k| apart(k) <= 2));
                difference += (0..3).map(|k| u32::from(apart(k))).sum::<u32>();
                assert_eq!(picture.object[i], 1);
            }
        }
        let mean = f64::from(difference) / f64::from(both * 3);
        println!(
            "{k} cells: {hit} pixels, {both} covered, {same} the same, mean difference {mean:.2}, {extra} too many"
        );
        // Silhouettes: a ring of some pixels' circumference and a pixel or two in width.
        let ring = (f64::from(hit) * std::f64::consts::PI * 4.0).sqrt() * 2.0;
        assert!(f64::from(hit - both) < ring && f64::from(extra) < ring, "{ring}");
        // What is covered shows the captured texel itself where one view serves. Where several do, polygons that stand partly behind
        // others from the centre wear another view, resampled.
        let (least, most) = if single { (0.99, 0.5) } else { (0.85, 4.0) };
        assert!(mean < most, "{mean}");
        assert!(f64::from(same) >= least * f64::from(both), "{same} of {both} pixels are the same");
    }
}

#[test]
fn near_objects_take_several_views_far_ones_one_and_every_polygon_names_views_that_are_there() {
    let kept = bake(&scene(&PLACES, 1.0), 1.0, "", 2);
    let (mut single, mut several) = (0, 0);
    for (id, p) in &kept.payloads {
        for part in &p.parts {
            let Part::Projected(q) = part else { continue };
            assert!(q.projectors.iter().all(|pr| {
                let Some(Part::Atlas(a)) = kept.payloads[&pr.atlas].parts.first() else { return false };
                pr.layer < a.layers && pr.rect[0] + pr.rect[2] <= a.size[0] && pr.rect[1] + pr.rect[3] <= a.size[1]
            }));
            assert!(q.projectors.len() > 1 || !q.views.is_empty());
            if q.projectors.len() == 1 {
                single += 1
            } else {
                several += 1
            }
            // Mostly textured: vertex attributes are for what no view sees.
            let bare = q.views.iter().filter(|v| **v == 0).count();
            assert!(bare * 2 < q.views.len(), "{id:?}: {bare} of {} polygons have no view", q.views.len());
        }
    }
    assert!(single > 0 && several > 0, "{single} and {several}");
    assert!(kept.claims.iter().all(|c| c.max.is_finite() && c.payload.is_some_and(|p| kept.payloads.contains_key(&p))));
}

#[test]
fn other_settings_are_read_and_other_metrics_take_their_place() {
    let s = scene(&PLACES, 1.0);
    let base = triangles(&bake(&s, 1.0, "", 2));
    assert!(triangles(&bake(&s, 1.0, "edge_px = 1.0", 2)) > base);
    assert!(triangles(&bake(&s, 1.0, "facing = \"all-corners\"", 2)) < base);
    assert!(triangles(&bake(&s, 1.0, "collapse = { type = \"silhouette-weighted\", cost_scale = 1.0 }", 2)) < base);
    assert_ne!(triangles(&bake(&s, 1.0, "collapse = { type = \"quadric\" }", 2)), base);
    let never = bake(&s, 1.0, "view_test = { type = \"self-occlusion\", max_px = 0.0 }", 2);
    assert!(never.claims.is_empty());
    let always = bake(&s, 1.0, "view_test = { type = \"self-occlusion\", max_px = 1e9 }", 2);
    assert!(always.claims.len() == always.payloads.len() - 1, "one claim a mesh, none of the atlas");
    assert!(always.left_out.iter().any(|l| l.stage.contains("neighbouring") && l.decided == "build"));
}

#[test]
fn a_region_that_meets_far_geometry_is_refused_and_nothing_far_is_nothing_to_do() {
    let s = scene(&PLACES, 1.0);
    let v = views(4.0, 64);
    let baker = Baker::new(&s, &v);
    let cells = |table: &str| {
        let p: Box<dyn farfield_core::strategy::Partition> = toml::from_str(table).unwrap();
        baker.with(|cx| p.divide(&s, &v, cx).unwrap())
    };
    let everywhere = cells("type = \"single-cell\"");
    let far = textured("");
    let refused = far.needs(&s, Some(&baker.inside(&*everywhere, CellId(0)))).unwrap_err().to_string();
    assert!(refused.contains("meets the viewpoints of cell 0"), "{refused}");
    let holds_all = cells("type = \"single-cell\"\nregion = [-500.0, -9.0, -500.0, 500.0, 99.0, 500.0]");
    let cell = baker.inside(&*holds_all, CellId(0));
    let needs = far.needs(&s, Some(&cell)).unwrap();
    assert!(!needs.cell_asset && !needs.captures && needs.left_out.iter().any(|l| l.decided == "plan"));
    let kept = baker.bake(&*far, &cell, holds_all.outlines()).unwrap();
    assert!(kept.payloads.is_empty() && kept.index.is_empty());
    assert!(textured("density = 0.0").needs(&s, None).unwrap_err().to_string().contains("density"));
    assert!(far.open(None, (AssetId(0), b"{}")).is_err());
    // A box of viewpoints: no neighbours, so corners of the box take their place.
    let boxed = cells("type = \"single-cell\"\nregion = [-9.0, 3.0, -9.0, 9.0, 5.0, 9.0]");
    let kept = baker.bake(&*far, &baker.inside(&*boxed, CellId(0)), boxed.outlines()).unwrap();
    let several = |p: &Part| matches!(p, Part::Projected(q) if q.projectors.len() > 1);
    assert!(kept.payloads.values().any(|p| p.parts.iter().any(several)));
}
