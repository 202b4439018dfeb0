//! From the raw surface to an even mesh of an exact triangle count that lies on the sculpture.
//!
//! Relaxation moves vertices towards the mean of their neighbours along the tangent plane and then back onto the surface by
//! Newton steps p -= d(p) grad d / |grad d|^2; a move that would turn a triangle over is not made. The even mesh, finer than what is
//! wanted, is then brought down to the very count by quadric edge collapse with the link condition, which puts triangles
//! where the surface bends and keeps the mesh a closed manifold. Deterministic: vertices are moved from a copy.
//! O(vertices x rounds) evaluations of the distance, O(n log n) for the collapse.

use glam::Vec3;
use rayon::prelude::*;

use farfield_core::Fault;
use farfield_core::collapse::{LiveMesh, Placement, QuadricSettings, Quadrics, Settings, collapse};
use farfield_core::mesh::TriangleMesh;

use super::march::Raw;
use super::sdf::Solid;

/// Evens out the mesh: `rounds` of tangential relaxation and projection.
pub(super) fn relax(raw: &mut Raw, solid: &Solid, rounds: usize) {
    let fans = Fans::of(raw);
    let most = 0.5 * solid.spacing();
    for _ in 0..rounds {
        let positions = &raw.positions;
        let moved: Vec<Vec3> = (0..positions.len())
            .into_par_iter()
            .map(|i| {
                let p = positions[i];
                let (mut normal, mut mean) = (Vec3::ZERO, Vec3::ZERO);
                let ring = fans.ring(i);
                for &[a, b] in ring {
                    let (a, b) = (positions[a as usize], positions[b as usize]);
                    normal += (a - p).cross(b - p);
                    mean += a / ring.len() as f32;
                }
                // The mesh's own normal is good enough here and saves the gradient's four evaluations.
                let Some(normal) = normal.try_normalize() else { return p };
                let along = (mean - p) - normal * normal.dot(mean - p);
                p + 0.6 * along - normal * solid.distance(p).clamp(-most, most)
            })
            .collect();
        accept(raw, &fans, moved);
    }
}

/// Puts every vertex onto the surface by `steps` Newton steps, none of which may turn a triangle over.
pub(super) fn project(raw: &mut Raw, solid: &Solid, steps: usize) {
    let fans = Fans::of(raw);
    for _ in 0..steps {
        let moved = raw.positions.par_iter().map(|&p| onto(solid, p)).collect();
        accept(raw, &fans, moved);
    }
}

/// Collapses edges, those that change the shape least first, down to exactly `target` triangles, an even number.
///
/// Each collapse takes two triangles off a closed mesh, so that an even target is met exactly unless the engine refuses all that is left;
/// what comes back then is above the target.
pub(super) fn reduce(raw: Raw, target: usize) -> Result<Raw, Fault> {
    let mesh = LiveMesh::new(&raw.positions, raw.triangles.as_flattened(), &[])?;
    let settings = QuadricSettings { placement: Placement::Optimal, shape_weight: 0.01, ..Default::default() };
    let mut cost = Quadrics::new(&mesh, settings);
    let out = collapse(mesh, &mut cost, &Settings { min_triangles: target, ..Default::default() });
    let mut names = vec![u32::MAX; out.positions.len()];
    let mut positions = Vec::with_capacity(target / 2 + 2);
    let mut name = |c: u32| {
        if names[c as usize] == u32::MAX {
            names[c as usize] = positions.len() as u32;
            positions.push(out.positions[c as usize]);
        }
        names[c as usize]
    };
    let triangles = out.indices.chunks_exact(3).map(|t| [name(t[0]), name(t[1]), name(t[2])]).collect();
    Ok(Raw { positions, triangles })
}

/// Unit normals: the field's, or where they are more than 60 degrees apart (the mesh is too coarse for what is there) the mesh's.
pub(super) fn normals(raw: &Raw, solid: &Solid) -> Vec<Vec3> {
    let mut own = TriangleMesh {
        positions: raw.positions.clone(),
        indices: raw.triangles.as_flattened().to_vec(),
        ..Default::default()
    };
    own.smooth_normals();
    let at = |(&p, &mesh): (&Vec3, &Vec3)| {
        let field = solid.gradient(p, 0.35 * solid.detail()).0.normalize_or_zero();
        if field.dot(mesh) > 0.5 { field } else { mesh }
    };
    raw.positions.par_iter().zip(&own.normals).map(at).collect()
}

/// Triangles around each vertex, as the opposite edges.
struct Fans {
    starts: Vec<u32>,
    edges: Vec<[u32; 2]>,
}

impl Fans {
    fn of(raw: &Raw) -> Self {
        let mut starts = vec![0_u32; raw.positions.len() + 1];
        for &c in raw.triangles.iter().flatten() {
            starts[c as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut fill = starts.clone();
        let mut edges = vec![[0; 2]; 3 * raw.triangles.len()];
        for &[a, b, c] in &raw.triangles {
            for (v, edge) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                edges[fill[v as usize] as usize] = edge;
                fill[v as usize] += 1;
            }
        }
        Self { starts, edges }
    }

    fn ring(&self, i: usize) -> &[[u32; 2]] {
        &self.edges[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}

/// One Newton step: p - d grad d / |grad d|^2, no longer than half a lattice spacing.
fn onto(solid: &Solid, p: Vec3) -> Vec3 {
    let (gradient, d) = solid.gradient(p, 0.1 * solid.spacing());
    p - (gradient * (d / gradient.length_squared().max(0.1))).clamp_length_max(0.5 * solid.spacing())
}

/// Moves the vertices, but for those whose triangles would turn over or vanish.
fn accept(raw: &mut Raw, fans: &Fans, moved: Vec<Vec3>) {
    let old = &raw.positions;
    let good = |at: &[Vec3], i: usize| {
        fans.ring(i).iter().all(|&[a, b]| {
            let (a, b) = (a as usize, b as usize);
            let before = (old[a] - old[i]).cross(old[b] - old[i]);
            let (x, y) = (at[a] - at[i], at[b] - at[i]);
            let after = x.cross(y);
            let longest = x.length_squared().max(y.length_squared()).max((y - x).length_squared());
            let area = after.length();
            area >= (0.05 * longest).min(before.length()) && after.dot(before) >= 0.3 * area * before.length()
        })
    };
    // A vertex held back can spoil a neighbour's triangles in turn: hold back until nothing is spoilt. Where all of a
    // neighbourhood is held back nothing has changed there, so this ends.
    let mut next = moved;
    let mut held = vec![false; old.len()];
    loop {
        let bad: Vec<bool> = (0..old.len()).into_par_iter().map(|i| !good(&next, i)).collect();
        let hold: Vec<usize> = (0..old.len())
            .into_par_iter()
            .filter(|&i| !held[i])
            .filter(|&i| bad[i] || fans.ring(i).iter().any(|&[a, b]| bad[a as usize] || bad[b as usize]))
            .collect();
        if hold.is_empty() {
            break;
        }
        for i in hold {
            held[i] = true;
            next[i] = old[i];
        }
    }
    raw.positions = next;
}
