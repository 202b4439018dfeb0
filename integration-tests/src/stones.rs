//! A small scene to test with: bumpy, coloured stones with a waist, which hide parts of themselves.

use std::path::Path;

use farfield_core::id::MaterialId;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::Material;
use farfield_experiments::export::{Export, export};
use glam::{DAffine3, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Height of a stone, scene units.
pub const HEIGHT: f32 = 4.0;

/// A stone of `2 rings sides - 2 sides` triangles that stands on the ground: a sphere of radius r with
///
/// ```text
/// r = 1 + 0.25 cos(2 polar) + 0.12 sin(5 azimuth) sin(polar) + up to 0.02, another for each vertex
/// ```
///
/// scaled to [`HEIGHT`]: two heads and five lobes, so that parts of it hide others; rough, so that no two
/// edges cost the same to collapse.
pub fn stone(rings: u32, sides: u32) -> TriangleMesh {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let rough: Vec<f32> = (0..(rings + 1) * sides).map(|_| rng.random()).collect();
    let at = |r: u32, s: u32| {
        let polar = std::f32::consts::PI * r as f32 / rings as f32;
        let azimuth = std::f32::consts::TAU * (s % sides) as f32 / sides as f32;
        let rough = 0.02 * rough[(r * sides + s % sides) as usize];
        let radius = 1.0 + 0.25 * (2.0 * polar).cos() + 0.12 * (5.0 * azimuth).sin() * polar.sin() + rough;
        let n = Vec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
        // The poles are at 1.25 and a little more, the feet at 0.
        (n * radius + Vec3::Y * 1.25) * (HEIGHT / 2.5)
    };
    // One vertex a pole, `sides` a ring between.
    let mut positions = vec![at(0, 0)];
    (1..rings).for_each(|r| positions.extend((0..sides).map(|s| at(r, s))));
    positions.push(at(rings, 0));
    let (last, id) = (positions.len() as u32 - 1, |r: u32, s: u32| 1 + (r - 1) * sides + s % sides);
    let mut indices = vec![];
    for s in 0..sides {
        indices.extend([0, id(1, s + 1), id(1, s)]);
        for r in 1..rings - 1 {
            let quad = [id(r, s), id(r, s + 1), id(r + 1, s + 1), id(r + 1, s)];
            indices.extend([quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]]);
        }
        indices.extend([id(rings - 1, s), id(rings - 1, s + 1), last]);
    }
    let shade = |p: &Vec3| {
        let band = |x: f32, k: f32| (150.0 + 70.0 * (x * k).sin()) as u8;
        [band(p.x, 2.0), band(p.y, 3.0), band(p.z, 2.5), 255]
    };
    let colors = positions.iter().map(shade).collect();
    let mut mesh = TriangleMesh {
        sections: vec![(0..indices.len() as u32, MaterialId(0))],
        positions,
        indices,
        colors,
        ..TriangleMesh::default()
    };
    mesh.smooth_normals();
    mesh
}

/// Writes a model with one mesh at several places.
///
/// # Panics
/// When it cannot be written.
pub fn write(file: &Path, mesh: TriangleMesh, places: &[DVec3]) {
    let placements: Vec<(usize, DAffine3)> = places.iter().map(|&p| (0, DAffine3::from_translation(p))).collect();
    let materials = [Material { name: "stone".into(), base_color: [1.0; 4], texture: None, two_sided: false }];
    let scene =
        Export { meshes: &[("stone".to_owned(), mesh)], placements: &placements, materials: &materials, textures: &[] };
    export(file, &scene).expect("a model file");
}

/// A folder with `stones.glb`: nine stones in two rows along x, beside the way that a path `line` takes through them.
///
/// # Panics
/// When it cannot be written.
pub fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let place = |i: u32| DVec3::new(f64::from(i / 2) * 12.0, 0.0, if i.is_multiple_of(2) { -8.0 } else { 8.5 });
    write(&dir.path().join("stones.glb"), stone(24, 32), &(0..9).map(place).collect::<Vec<_>>());
    dir
}

/// An experiment in [`folder`]: a walk of nine frames between the rows, pictures of `resolution` pixels, and `pipelines`, the
/// text of their tables.
pub fn experiment(resolution: [u32; 2], pipelines: &str) -> String {
    format!(
        r#"
        [scene]
        path = "stones.glb"
        [view]
        resolution = {resolution:?}
        eye_height = [1.5, 1.5]
        near = 0.05
        path = "line"
        frames = 9
        max_speed = 60.0
        frames_per_s = 10
        {pipelines}
        "#
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn a_stone_is_closed_turned_outwards_and_stands_on_the_ground() {
        let m = stone(12, 20);
        assert_eq!(m.triangles(), 2 * 12 * 20 - 2 * 20);
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        let mut volume = 0.0;
        for t in m.indices.chunks_exact(3) {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| m.positions[i as usize]);
            volume += a.dot(b.cross(c)) / 6.0;
        }
        assert!(edges.values().all(|&n| n == 0), "every edge has a triangle on each side");
        assert!(volume > 10.0, "{volume}");
        assert!(m.positions.iter().all(|p| p.y >= -0.05));
    }
}
