//! What must be true of the plant.

use farfield_core::Aabb;

use super::*;
use crate::generate::solid::check::{closed, sound};

fn of(triangles: u64, seed: u64) -> PlantScene {
    plant(&PlantSettings { triangles, seed }).unwrap()
}

#[test]
fn totals_are_met_within_two_percent() {
    for (asked, seed) in [
        (LEAST_PLANT, 1),
        (LEAST_PLANT, 2),
        (250_000, 3),
        (PLANT_1M, 1),
        (PLANT_1M, 2),
        (4_000_000, 3),
        (MOST_PLANT, 1),
    ] {
        let total = of(asked, seed).triangles();
        let off = total as f64 / asked as f64 - 1.0;
        assert!(off.abs() <= 0.02, "{asked} with seed {seed}: {total} is {:.2} % off", 100.0 * off);
    }
}

#[test]
fn totals_out_of_range_are_refused_with_the_range() {
    let text = |triangles| plant(&PlantSettings { triangles, seed: 1 }).unwrap_err().to_string();
    assert_eq!(text(99_999), "a plant of 99999 triangles: the total must be between 100000 and 12500000");
    assert!(text(u64::MAX).contains("12500000"));
}

#[test]
fn same_settings_same_bytes_on_any_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of(150_000, 4))
    };
    assert_eq!(on(1), on(4));
    assert_ne!(of(150_000, 4).placements, of(150_000, 5).placements, "the seed matters");
}

#[test]
fn meshes_are_sound_and_steel_is_closed() {
    for triangles in [LEAST_PLANT, PLANT_1M, 6_000_000] {
        let scene = of(triangles, 1);
        for (name, mesh) in &scene.meshes {
            sound(mesh).unwrap_or_else(|e| panic!("{triangles}: {name}: {e}"));
        }
        for name in ["beam", "column", "grating", "railing", "stairs", "cabinets", "tube bank", "hopper", "floor"] {
            let Some((_, mesh)) = scene.meshes.iter().find(|m| m.0 == name) else { continue };
            let volume = closed(mesh).unwrap_or_else(|e| panic!("{triangles}: {name}: {e}"));
            assert!(volume > 0.0, "{name} is inside out");
        }
    }
}

#[test]
fn the_building_is_as_large_at_every_total_and_fills_up() {
    let mut before = 0;
    for triangles in [LEAST_PLANT, PLANT_1M, MOST_PLANT] {
        let scene = of(triangles, 1);
        let own: Vec<Aabb> = scene.meshes.iter().map(|m| Aabb::of(m.1.positions.iter().copied())).collect();
        let all = scene.placements.iter().map(|(m, at)| own[*m].transformed(at)).fold(Aabb::EMPTY, Aabb::union);
        let size = all.size();
        assert!(
            (60.0..72.0).contains(&size.x) && (60.0..72.0).contains(&size.z) && (79.0..82.0).contains(&size.y),
            "{size}"
        );
        assert!((f64::from(all.min.y) + GROUND).abs() < 1e-3, "the ground's underside is the lowest point");
        assert!(scene.placements.len() > before, "{triangles}: {} parts", scene.placements.len());
        before = scene.placements.len();
    }
    assert!(before > 10_000, "{before} parts of 12.5 million triangles");
}

/// The eye of the example keeps 0.2 m from every triangle, and leaves the middle for the perimeter.
#[test]
fn the_route_is_free_and_goes_from_the_boiler_to_the_perimeter() {
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/plant.toml"));
    for (triangles, seed) in [(LEAST_PLANT, 1), (PLANT_1M, 1), (PLANT_1M, 2), (4_000_000, 3)] {
        let sets = [
            format!("scene.triangles={triangles}"),
            format!("scene.seed={seed}"),
            "view.frames=1000".into(),
            "view.frames_per_s=8".into(),
        ];
        let (path, origin, nearest) = crate::generate::tests::walked(file, &sets);
        assert!(nearest.0 >= 0.2, "{triangles}: {} m from {} at {}", nearest.0, nearest.1, nearest.2 + origin);
        let far = |c: &farfield_core::Camera| (c.eye + origin).x.abs().max((c.eye + origin).z.abs());
        assert!(path.iter().any(|c| far(c) < 12.0) && path.iter().any(|c| far(c) > 28.0));
    }
}
