//! How fast meshes come out of the store, and how small they are, beside meshoptimizer's codecs with zstd, in one run on one core.
//!
//! `cargo bench -p farfield-experiments --bench store [-- <squares an edge>]`: a rough surface of 2 n^2 triangles with positions on a grid of 2^-13 of
//! its edge and normals of 2 x 10 bits. Printed: bytes a triangle, megabytes of the mesh (floats, as a payload holds it) a second, the ratio to the peer's.

use std::time::{Duration, Instant};

use farfield_core::octahedral;
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::{Aabb, Fault};
use farfield_experiments::store::{pack, unpack};
use glam::{DVec3, Vec3};

/// What the store uses.
const LEVEL: i32 = 3;
const BITS: u32 = 10;
const STEP: f32 = 1.0 / 8192.0;

fn main() -> Result<(), Fault> {
    let n: u32 = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(90);
    let mesh = surface(n);
    let triangles = mesh.indices.len() as f64 / 3.0;
    let bytes = mesh.bytes() as f64;
    println!("{triangles} triangles, {:.1} MB as a payload", bytes / 1e6);

    let vertices: Vec<[i16; 6]> = (mesh.positions.iter().zip(&mesh.normals))
        .map(|(p, n)| {
            let p = (*p / STEP).as_ivec3();
            let [x, y] = octahedral::code(*n, BITS);
            [p.x as i16, p.y as i16, p.z as i16, 0, x, y]
        })
        .collect();
    let zipped = |b: &[u8]| zstd::bulk::compress(b, LEVEL).expect("memory");
    let whole = |b: &[u8], most: usize| zstd::bulk::decompress(b, most).expect("what was compressed");
    let order = meshopt::optimize_vertex_cache(&mesh.indices, vertices.len());
    let indices = meshopt::encode_index_buffer(&order, vertices.len()).expect("whole");
    let attributes = meshopt::encode_vertex_buffer(&vertices).expect("whole");
    let stored = [zipped(&indices), zipped(&attributes)];
    let peer = rate(bytes, &mut || {
        let (indices, attributes) = (whole(&stored[0], indices.len()), whole(&stored[1], attributes.len()));
        let i: Vec<u32> = meshopt::decode_index_buffer(&indices, mesh.indices.len()).expect("whole");
        let v: Vec<[i16; 6]> = meshopt::decode_vertex_buffer(&attributes, vertices.len()).expect("whole");
        let at = |v: &[i16; 6]| Vec3::new(v[0].into(), v[1].into(), v[2].into()) * STEP;
        let normal = |v: &[i16; 6]| octahedral::vector([v[4], v[5]], BITS);
        let both: (Vec<Vec3>, Vec<Vec3>) = v.iter().map(|v| (at(v), normal(v))).unzip();
        i.len() + both.0.len()
    });
    let size = |b: usize| b as f64 / triangles;
    println!("meshoptimizer and zstd: {:.2} B a triangle, {peer:.0} MB/s", size(stored[0].len() + stored[1].len()));

    let bounds = Aabb::of(mesh.positions.iter().copied());
    let payload = Payload { origin: DVec3::ZERO, bounds, parts: vec![Part::Mesh(mesh)] };
    let packed = pack(&payload)?;
    let stored = zipped(&packed);
    assert!(unpack(&whole(&stored, packed.len())).is_ok());
    let own = rate(bytes, &mut || unpack(&whole(&stored, packed.len())).map_or(0, |p| p.parts.len()));
    println!("store: {:.2} B a triangle, {own:.0} MB/s, {:.2} of meshoptimizer's", size(stored.len()), own / peer);
    Ok(())
}

/// The best of many, megabytes a second.
fn rate(bytes: f64, once: &mut dyn FnMut() -> usize) -> f64 {
    let (mut best, started) = (Duration::MAX, Instant::now());
    while started.elapsed() < Duration::from_secs(2) {
        let began = Instant::now();
        assert!(std::hint::black_box(once()) > 0);
        best = best.min(began.elapsed());
    }
    bytes / 1e6 / best.as_secs_f64()
}

fn surface(n: u32) -> MeshPart {
    let height =
        |x: f32, y: f32| 0.05 * (9.0 * x).sin() * (7.0 * y).cos() + 0.002 * (130.0 * x + 90.0 * (5.0 * y).sin()).sin();
    let at = |i: u32| ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32);
    let rounded = |p: Vec3| (p / STEP).round() * STEP;
    let positions: Vec<Vec3> =
        (0..(n + 1) * (n + 1)).map(at).map(|(x, y)| rounded(Vec3::new(x, y, height(x, y)))).collect();
    let square = |i: u32| {
        let a = i % n + i / n * (n + 1);
        [a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1]
    };
    let indices: Vec<u32> = (0..n * n).flat_map(square).collect();
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| positions[t[k] as usize]);
        t.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    let normals = normals.iter().map(|n| octahedral::rounded(n.normalize_or(Vec3::Z), BITS)).collect();
    let albedo = vec![[128, 128, 128, 255]; positions.len()];
    MeshPart { positions, normals, albedo, indices, two_sided: false }
}
