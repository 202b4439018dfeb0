//! What must be true of the house.

use farfield_core::bvh::TriangleBvh;
use glam::{Vec2, Vec3};

use super::*;
use crate::generate::solid::check::{closed, sound};

fn of(triangles: u64, seed: u64) -> HouseScene {
    house(&HouseSettings { triangles, seed }).unwrap()
}

#[test]
fn totals_are_met_within_two_percent() {
    for (asked, seed) in
        [(LEAST_HOUSE, 1), (60_000, 2), (HOUSE_PAPER, 1), (HOUSE_PAPER, 3), (900_000, 2), (MOST_HOUSE, 1)]
    {
        let total = of(asked, seed).triangles();
        let off = total as f64 / asked as f64 - 1.0;
        assert!(off.abs() <= 0.02, "{asked} with seed {seed}: {total} is {:.2} % off", 100.0 * off);
    }
}

#[test]
fn totals_out_of_range_are_refused_with_the_range() {
    let text = |triangles| house(&HouseSettings { triangles, seed: 1 }).unwrap_err().to_string();
    assert!(text(LEAST_HOUSE - 1).contains(&LEAST_HOUSE.to_string()));
    assert!(text(u64::MAX).contains(&MOST_HOUSE.to_string()));
}

#[test]
fn same_settings_same_bytes_on_any_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of(60_000, 4))
    };
    assert_eq!(on(1), on(4));
    let (a, b) = (of(60_000, 4), of(60_000, 5));
    assert_ne!(a.meshes, b.meshes, "the seed chooses the books");
    assert_ne!(a.textures, b.textures, "and the textures");
}

#[test]
fn meshes_are_sound_at_every_fineness() {
    for triangles in [LEAST_HOUSE, HOUSE_PAPER, 1_500_000] {
        let scene = of(triangles, 1);
        for (name, mesh) in &scene.meshes {
            sound(mesh).unwrap_or_else(|e| panic!("{triangles}: {name}: {e}"));
            assert_eq!(mesh.uvs.len(), mesh.positions.len(), "{name} has texture coordinates");
            let covered: u32 = mesh.sections.iter().map(|s| s.0.end - s.0.start).sum();
            assert_eq!(covered as usize, mesh.indices.len(), "{name}: sections cover all");
        }
    }
}

/// All things but the faces of walls are closed and face outward by themselves; the walls of all rooms and the outside are so together.
#[test]
fn things_are_closed_and_face_outward() {
    for triangles in [LEAST_HOUSE, HOUSE_PAPER] {
        let scene = of(triangles, 1);
        let mut walls = TriangleMesh::default();
        for (name, mesh) in &scene.meshes {
            if name.ends_with("walls") {
                let first = walls.positions.len() as u32;
                walls.positions.extend(&mesh.positions);
                walls.indices.extend(mesh.indices.iter().map(|i| i + first));
                continue;
            }
            let volume = closed(mesh).unwrap_or_else(|e| panic!("{triangles}: {name}: {e}"));
            assert!(volume > 0.0, "{triangles}: {name} is inside out: {volume}");
        }
        let volume = closed(&walls).unwrap_or_else(|e| panic!("{triangles}: walls: {e}"));
        // 52 m of 30 cm and 41 m of 12 cm, 3 m high, less a tenth to a third of it for doors and windows.
        assert!((35.0..62.0).contains(&volume), "{volume} m3 of walls");
    }
}

#[test]
fn ten_textures_of_nineteen_megabytes_are_worn() {
    let scene = of(LEAST_HOUSE, 1);
    let bytes: usize = scene.textures.iter().map(|t| 4 * t.rgba.len()).sum();
    assert!((bytes as f64 / 19e6 - 1.0).abs() < 0.06, "{bytes} bytes");
    for (i, m) in scene.materials.iter().enumerate() {
        let wears = |mesh: &TriangleMesh| mesh.sections.iter().any(|s| s.1.index() == i);
        assert!(scene.meshes.iter().any(|m| wears(&m.1)), "nothing is made of {}", m.name);
        let Some(texture) = m.texture else { continue };
        let t = &scene.textures[texture.index()];
        assert_eq!(t.rgba.len(), (t.size[0] * t.size[1]) as usize);
        let different: std::collections::BTreeSet<_> = t.rgba.iter().collect();
        assert!(different.len() > 12, "{} has {} colours", t.name, different.len());
        // No seam: rows and columns go on from the last to the first as from one to the next.
        let at = |x: u32, y: u32| {
            Vec3::from_array(std::array::from_fn(|k| f32::from(t.rgba[(y * t.size[0] + x) as usize][k])))
        };
        let [w, h] = t.size;
        let step = |a: u32, b: u32| (0..h).map(|y| at(a, y).distance(at(b, y))).sum::<f32>() / h as f32;
        let rise = |a: u32, b: u32| (0..w).map(|x| at(x, a).distance(at(x, b))).sum::<f32>() / w as f32;
        if m.name != "books and pictures" {
            let most = |f: &dyn Fn(u32, u32) -> f32, n: u32| (0..n - 1).map(|i| f(i, i + 1)).fold(0.0, f32::max);
            assert!(step(w - 1, 0) <= 1.1 * most(&step, w) + 1.0, "{} has a seam to the right", t.name);
            assert!(rise(h - 1, 0) <= 1.1 * most(&rise, h) + 1.0, "{} has a seam below", t.name);
        }
    }
}

/// The eye of the example keeps 0.2 m from every triangle, and comes into every room.
#[test]
fn the_route_is_free_and_visits_every_room() {
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/house.toml"));
    for triangles in [LEAST_HOUSE, HOUSE_PAPER, 1_000_000] {
        let sets = [format!("scene.triangles={triangles}"), "view.frames=1200".into(), "view.frames_per_s=8".into()];
        let (path, origin, nearest) = crate::generate::tests::walked(file, &sets);
        assert!(nearest.0 >= 0.2, "{triangles}: {} m from {} at {}", nearest.0, nearest.1, nearest.2 + origin);
        let rooms: std::collections::BTreeSet<&str> = path
            .iter()
            .filter_map(|c| {
                let p = (c.eye + origin).as_vec3();
                plan::Room::at(Vec2::new(p.x, p.z)).map(plan::Room::name)
            })
            .collect();
        assert_eq!(rooms.len(), 8, "{rooms:?}");
        assert!(path.iter().all(|c| ((c.eye + origin).y - 1.6).abs() < 1e-3), "1.6 m above the floors");
    }
}

/// A ray from inside a room through the middle of each window meets the garden or the sky, not the wall.
#[test]
fn windows_are_holes() {
    let scene = of(LEAST_HOUSE, 1);
    let mut tested = 0;
    for wall in plan::walls().iter().filter(|w| w.outside()) {
        for o in &wall.openings {
            let inward = if wall.line == 0.0 { 0.5 } else { -0.5 };
            let (u, v) = (o.span[0] + 0.3 * (o.span[1] - o.span[0]), 0.5 * (o.rise[0] + o.rise[1]));
            let (from, to) = (wall.point(u, v, inward), wall.point(u, v, -inward));
            let ray = farfield_core::bvh::Ray::new(from.as_dvec3(), (to - from).normalize(), 0.0, 1.0).unwrap();
            for (name, mesh) in scene.meshes.iter().filter(|m| m.0.ends_with("walls")) {
                let bvh = TriangleBvh::build(&mesh.positions, &mesh.indices);
                assert!(!bvh.any_hit(&ray, |_| true), "{name} closes the opening at {u} of {}", wall.line);
            }
            tested += 1;
        }
    }
    assert!(tested >= 12, "{tested} openings");
}
