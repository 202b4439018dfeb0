//! The bound that `hausdorff` puts on a simplified surface, and with `appearance` on its geometric part, beside an independent sampler: random
//! points of either surface, each with its nearest point of the other one. Sampling can refute the bound, not prove it.

use std::path::Path;

use farfield_core::bvh::TriangleBvh;
use farfield_core::collapse::{LiveMesh, Mode, Settings, collapse};
use farfield_core::scene::{Gathered, Scene, gather};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use farfield_integration_tests::areas::Areas;
use farfield_integration_tests::lab::{Lab, models};
use farfield_metrics::{Appearance, Hausdorff};
use glam::{DVec3, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Points on each surface.
const SAMPLES: usize = 100_000;

fn welded(scene: &Scene) -> (Gathered, Vec<u32>, Vec<Vec3>, Vec<[u8; 4]>) {
    let mesh = gather(scene, scene.all_chunks().iter(), DVec3::ZERO).unwrap();
    let indices = mesh.corners.iter().flat_map(|&c| mesh.vertices(c)).collect();
    let (mut normals, mut albedo) = (vec![Vec3::ZERO; mesh.positions.len()], vec![[0; 4]; mesh.positions.len()]);
    for w in &mesh.wedges {
        normals[w.vertex as usize] += w.normal;
        albedo[w.vertex as usize] = w.albedo;
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Y));
    (mesh, indices, normals, albedo)
}

/// The largest distance of random points of one surface, spread by area, from another.
fn sampled(positions: &[Vec3], from: &[u32], to: &[u32], rng: &mut ChaCha8Rng) -> f32 {
    let bvh = TriangleBvh::build(positions, to);
    let corners = from.as_chunks::<3>().0.iter().map(|t| t.map(|v| positions[v as usize]));
    let areas = Areas::new(corners.collect());
    let points: Vec<Vec3> = (0..SAMPLES).map(|_| areas.point(rng)).collect();
    points.iter().map(|&p| bvh.closest_point(p, f32::INFINITY).unwrap().distance).fold(0.0, f32::max)
}

#[test]
fn no_sampled_point_refutes_the_bound_on_real_meshes() {
    let Some(folder) = models("no_sampled_point_refutes_the_bound_on_real_meshes") else { return };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let hausdorff: &dyn SimplificationMetric = &Hausdorff::default();
    let appearance: &dyn SimplificationMetric = &Appearance::default();
    let (bunny, dragon) = ("statuary/bun_zipper.ply.gz", "statuary/dragon_vrip_res2.ply.gz");
    let mut left = vec![];
    for (file, metric) in [(bunny, hausdorff), (bunny, appearance), (dragon, hausdorff)] {
        let text = format!(
            "[scene]\npath = \"{}\"\n[view]\nresolution = [64, 64]\npath = \"still\"\nframes = 1\n\
             [[pipeline]]\nname = \"all geometry\"\nfar_field = {{ type = \"geometry\" }}\n",
            folder.join(file).display()
        );
        let lab = Lab::new(&text, Path::new("")).unwrap();
        let (mesh, indices, normals, albedo) = welded(&lab.prepared.scene);
        let most = lab.prepared.scene.bounds.size().max_element() / 200.0;
        let view = MeshView { positions: &mesh.positions, normals: &normals, albedo: &albedo, indices: &indices };
        let px = |a: Vec3, b: Vec3| a.distance(b);
        let seen = vec![VertexSeen::default(); mesh.positions.len()];
        let (mut cost, max_cost) = metric.begin(view, &seen, &px, most).unwrap();
        let live = LiveMesh::new(&mesh.positions, &indices, &[]).unwrap();
        let settings = Settings { mode: Mode::Batched, max_cost, ..Settings::default() };
        let out = collapse(live, cost.as_mut(), &settings);
        let there = sampled(&mesh.positions, &indices, &out.indices, &mut rng);
        let back = sampled(&mesh.positions, &out.indices, &indices, &mut rng);
        assert!(out.max_cost <= most);
        assert!(there.max(back) <= out.max_cost * 1.0001, "{file}, {metric:?}: {there}, {back}, {}", out.max_cost);
        left.push(out.indices.len() as f64 / indices.len() as f64);
    }
    // What has to keep its looks keeps more triangles.
    assert!(left[0] < left[1] && left[0] < 0.2 && left[1] < 0.5 && left[2] < 0.2, "{left:?}");
}
