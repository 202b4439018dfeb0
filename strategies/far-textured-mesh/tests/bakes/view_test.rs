//! The void surface as the test between one view and several: far and convex objects pass, near and slotted ones fail.

use crate::common::*;
use farfield_core::id::MaterialId;
use farfield_core::mesh::TriangleMesh;
use farfield_core::payload::Part;
use farfield_core::scene::{Material, Placement, Scene, SceneBuilder};
use glam::{DAffine3, DVec3, Vec3};

const EDGE: f32 = 10.0;

/// Adds a closed box.
fn solid(m: &mut TriangleMesh, min: Vec3, max: Vec3) {
    let (middle, half) = (0.5 * (min + max), 0.5 * (max - min));
    for n in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z] {
        let a = if n.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let b = n.cross(a);
        let first = m.positions.len() as u32;
        m.positions.extend([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(s, t)| {
            let corner: Vec3 = n + s * a + t * b;
            middle + half * corner
        }));
        m.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
}

/// A full box of 6 x 6 x 6.
fn full() -> TriangleMesh {
    let mut m = TriangleMesh::default();
    solid(&mut m, Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 6.0, 3.0));
    m
}

/// The same box with slots towards +z.
fn slotted() -> TriangleMesh {
    let mut m = TriangleMesh::default();
    solid(&mut m, Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 6.0, -2.0));
    for k in 0..4 {
        let x = -3.0 + 1.7 * k as f32;
        solid(&mut m, Vec3::new(x, 0.0, -2.0), Vec3::new(x + 0.9, 6.0, 3.0));
    }
    m
}

fn scene(mut mesh: TriangleMesh, places: &[[f64; 2]]) -> Scene {
    let mut b = SceneBuilder::default();
    b.materials.push(Material::default());
    mesh.sections = vec![(0..mesh.indices.len() as u32, MaterialId(0))];
    let mesh = b.mesh("box", mesh).unwrap();
    for p in places {
        b.place(Placement { mesh, transform: DAffine3::from_translation(DVec3::new(p[0], 0.0, p[1])) });
    }
    b.build().unwrap()
}

fn void(max_sr: f64) -> String {
    format!("view_test = {{ type = \"void-surface\", max_sr = {max_sr:?} }}")
}

/// Objects with one view, and with several.
fn views_of(kept: &Kept) -> [usize; 2] {
    let of = |p: &Part| match p {
        Part::Projected(q) => Some(q.projectors.len() > 1),
        _ => None,
    };
    let several: Vec<bool> = kept.payloads.values().flat_map(|p| p.parts.iter().filter_map(of)).collect();
    [several.iter().filter(|s| !**s).count(), several.iter().filter(|s| **s).count()]
}

/// For an object alone the least number of cells away at which one view serves.
fn first_single(mesh: TriangleMesh, settings: &str) -> u32 {
    let (s, v) = (scene(mesh, &[[0.0, 0.0]]), views(3.0, 768));
    let cells = hexagons(&s, &v, EDGE, 16.0);
    let baker = Baker::new(&s, &v);
    let single: Vec<bool> = (1..=16)
        .map(|k| {
            let cell = baker.inside(&*cells, cell_at(&*cells, &v, EDGE, k));
            let kept = baker.bake(&*textured(settings), &cell, cells.outlines()).unwrap();
            let [one, several] = views_of(&kept);
            assert_eq!(one + several, 1);
            // Solid angles are no widths of holes: nothing is claimed of this mesh.
            assert_eq!(kept.claims.len(), usize::from(one == 1 && !settings.contains("void")));
            one == 1
        })
        .collect();
    let first = single.iter().position(|s| *s).expect("one view serves from afar");
    assert!(single[first..].iter().all(|s| *s), "whoever passes passes farther away too: {single:?}");
    first as u32 + 1
}

#[test]
fn farther_objects_pass_and_slotted_ones_only_from_farther_away() {
    let mut before = [u32::MAX; 2];
    for max_sr in [3e-4, 2e-3, 1e-2] {
        let now = [full(), slotted()].map(|m| first_single(m, &void(max_sr)));
        println!("max_sr {max_sr}: {now:?} cells away");
        assert!(now[0] < now[1], "{now:?}");
        assert!(now[0] <= before[0] && now[1] <= before[1]);
        before = now;
    }
    // By the object's depth alone both are the same.
    let [a, b] = [full(), slotted()].map(|m| first_single(m, ""));
    println!("self-occlusion: {a}, {b}");
    assert_eq!(a, b);
}

#[test]
fn the_number_of_objects_that_pass_grows_with_the_threshold_and_falls_with_nearness() {
    let ring = |r: f64| [[r, 0.0], [-0.6 * r, 0.8 * r], [-0.6 * r, -0.8 * r]];
    let places: Vec<[f64; 2]> = [25.0, 60.0, 130.0, 260.0].into_iter().flat_map(ring).collect();
    let (s, v) = (scene(full(), &places), views(3.0, 256));
    let cells = hexagons(&s, &v, EDGE, 1.0);
    let baker = Baker::new(&s, &v);
    // The middle of the rings in the scene's local frame.
    let at = (-s.origin).with_y(3.0);
    let cell = baker.inside(&*cells, cells.find(&v.camera(at, 0.0, 0.0)).unwrap());
    let mut passing = vec![];
    for max_sr in [0.0, 3e-5, 3e-4, 3e-3, 12.5] {
        let kept = baker.bake(&*textured(&void(max_sr)), &cell, cells.outlines()).unwrap();
        let [one, several] = views_of(&kept);
        println!("{max_sr}: {one} with one view, {several} with several");
        // Of a small far one the several views may texture nothing.
        assert!((places.len() - 1..=places.len()).contains(&(one + several)));
        passing.push(one);
        // What fails at one distance fails nearer too: the farthest of those that fail is nearer than twice the nearest that passes.
        let middle = at.as_vec3().with_y(0.0);
        let (mut fails, mut passes) = (0f32, f32::INFINITY);
        for p in kept.payloads.values() {
            let away = p.bounds.centre().with_y(0.0).distance(middle);
            for part in &p.parts {
                match part {
                    Part::Projected(q) if q.projectors.len() > 1 => fails = fails.max(away),
                    Part::Projected(_) => passes = passes.min(away),
                    _ => {}
                }
            }
        }
        assert!(fails < 2.0 * passes, "{max_sr}: {fails} fails, {passes} passes");
    }
    println!("{passing:?} of {}", places.len());
    // A hole narrower than a pixel is none: the farthest ring may pass at 0.
    assert!(passing.windows(2).all(|w| w[0] <= w[1]) && passing[0] <= 3 && passing[4] == places.len());
    assert!(passing.iter().any(|n| *n > 0 && *n < places.len()));
}
