//! How fast the metrics that bound a distance simplify, beside meshoptimizer (whose error is an estimate), in one run on one core.
//!
//! `cargo bench -p farfield-metrics --bench simplify [-- <squares an edge>]`: a rough surface of 2 n^2 triangles, brought to what is off by at most
//! a thousandth of its size. Printed: triangles left, millions of triangles a second, and the ratio to meshoptimizer's rate.

use std::time::Instant;

use farfield_core::collapse::{LiveMesh, Mode, Settings, collapse};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use farfield_metrics::{Appearance, Hausdorff};
use glam::Vec3;

fn main() {
    let n: u32 = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(320);
    let at = |x: u32, y: u32| x + y * (n + 1);
    let height =
        |x: f32, y: f32| 0.05 * (9.0 * x).sin() * (7.0 * y).cos() + 0.002 * (130.0 * x + 90.0 * (5.0 * y).sin()).sin();
    let positions: Vec<Vec3> = (0..(n + 1) * (n + 1))
        .map(|i| ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32))
        .map(|(x, y)| Vec3::new(x, y, height(x, y)))
        .collect();
    let square = |i: u32| {
        let (x, y) = (i % n, i / n);
        [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
    };
    let indices: Vec<u32> = (0..n * n).flat_map(square).collect();
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| positions[t[k] as usize]);
        t.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Z));
    let most = 1e-3;
    let millions = indices.len() as f64 / 3e6;

    let started = Instant::now();
    let bytes = positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let adapter = meshopt::VertexDataAdapter::new(&bytes, 12, 0).expect("three floats a vertex");
    let options = meshopt::SimplifyOptions::ErrorAbsolute;
    let left = meshopt::simplify(&indices, &adapter, 0, most, options, None).len() / 3;
    let peer = millions / started.elapsed().as_secs_f64();
    println!("meshoptimizer {left} of {} triangles, {peer:.3} Mtri/s", indices.len() / 3);

    let metrics: [(&str, &dyn SimplificationMetric); 2] =
        [("hausdorff", &Hausdorff::default()), ("appearance", &Appearance::default())];
    for (name, metric) in metrics {
        let started = Instant::now();
        let view = MeshView { positions: &positions, normals: &normals, albedo: &[], indices: &indices };
        let length = |a: Vec3, b: Vec3| a.distance(b);
        let seen = vec![VertexSeen::default(); positions.len()];
        let (mut cost, max_cost) = metric.begin(view, &seen, &length, most).expect("the mesh is whole");
        let settings = Settings { mode: Mode::Batched, max_cost, ..Settings::default() };
        let out = collapse(LiveMesh::new(&positions, &indices, &[]).expect("whole"), cost.as_mut(), &settings);
        let rate = millions / started.elapsed().as_secs_f64();
        println!(
            "{name} {} triangles, off by at most {:.6}, {rate:.3} Mtri/s, {:.3} of meshoptimizer's",
            out.indices.len() / 3,
            out.max_cost,
            rate / peer
        );
    }
}
