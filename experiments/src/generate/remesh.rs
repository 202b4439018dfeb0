//! From the raw surface to an even mesh of an exact triangle count that lies on the sculpture.
//!
//! Relaxation moves vertices towards the mean of their neighbours along the tangent plane and then back onto the surface by
//! Newton steps p -= d(p) grad d / |grad d|^2; a move that would turn a triangle over is not made. Splitting puts a vertex in the
//! middle of an edge, which adds exactly two triangles to a closed mesh, worst edges first (long ones, and those far from the
//! surface), in rounds that touch no triangle twice; new vertices go onto the surface. Both keep the mesh a closed manifold.
//! Deterministic: rounds are sorted, vertices are moved from a copy. O(vertices x rounds) evaluations of the distance.

use glam::Vec3;
use rayon::prelude::*;

use super::march::Raw;
use super::sdf::Solid;

/// Evens out the mesh: `rounds` of tangential relaxation and projection.
pub(super) fn relax(raw: &mut Raw, solid: &Solid, rounds: usize) {
    let fans = Fans::of(raw);
    for _ in 0..rounds {
        let positions = &raw.positions;
        let moved: Vec<Vec3> = (0..positions.len())
            .into_par_iter()
            .map(|i| {
                let p = positions[i];
                let (normal, d) = normal_and_distance(solid, p);
                let ring = fans.ring(i);
                let mean = ring.iter().map(|&[a, _]| positions[a as usize]).sum::<Vec3>() / ring.len() as f32;
                let along = (mean - p) - normal * normal.dot(mean - p);
                p + 0.6 * along - normal * d.clamp(-0.5 * solid.spacing(), 0.5 * solid.spacing())
            })
            .collect();
        accept(raw, &fans, moved);
    }
}

/// Puts every vertex onto the surface by `steps` Newton steps, none of which may turn a triangle over.
pub(super) fn project(raw: &mut Raw, solid: &Solid, steps: usize) {
    let fans = Fans::of(raw);
    for _ in 0..steps {
        let moved = raw.positions.par_iter().map(|&p| onto(solid, p, 1)).collect();
        accept(raw, &fans, moved);
    }
}

/// Splits edges until the mesh has exactly `target` triangles (an even number, at least as many as there are).
pub(super) fn split_to(raw: &mut Raw, solid: &Solid, target: usize) {
    while raw.triangles.len() < target {
        let twins = twins(&raw.triangles);
        let mut order: Vec<(f32, u32)> = (0..3 * raw.triangles.len() as u32)
            .into_par_iter()
            .filter(|&h| h < twins[h as usize])
            .map(|h| {
                let [a, b] = ends(&raw.triangles, h).map(|i| raw.positions[i as usize]);
                // Length plus a multiple of the sagitta: curved places are refined first.
                (a.distance(b) + 6.0 * solid.distance(0.5 * (a + b)).abs(), h)
            })
            .collect();
        order.par_sort_unstable_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        // The worst tenth a round: what a split makes comes into the next round's order.
        let quota = ((target - raw.triangles.len()) / 2).min((order.len() / 10).max(1));
        let mut touched = vec![false; raw.triangles.len()];
        let mut done = 0;
        for &(_, h) in &order {
            let (t, u) = (h as usize / 3, twins[h as usize] as usize / 3);
            if done == quota {
                break;
            }
            if touched[t] || touched[u] {
                continue;
            }
            touched[t] = true;
            touched[u] = true;
            split(raw, solid, h, twins[h as usize]);
            done += 1;
        }
    }
}

/// Unit normals from the distance field's gradient.
pub(super) fn normals(raw: &Raw, solid: &Solid) -> Vec<Vec3> {
    raw.positions.par_iter().map(|&p| normal_and_distance(solid, p).0).collect()
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

fn normal_and_distance(solid: &Solid, p: Vec3) -> (Vec3, f32) {
    let (gradient, d) = solid.gradient(p, 0.25 * solid.spacing());
    let length = gradient.length();
    if length < 1e-6 { (Vec3::Y, 0.0) } else { (gradient / length, d / length) }
}

fn onto(solid: &Solid, mut p: Vec3, steps: usize) -> Vec3 {
    let most = 0.5 * solid.spacing();
    for _ in 0..steps {
        let (gradient, _) = solid.gradient(p, 0.1 * solid.spacing());
        let d = solid.distance(p) / gradient.length_squared().max(0.1);
        p -= (gradient * d).clamp_length_max(most);
    }
    p
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

fn ends(triangles: &[[u32; 3]], h: u32) -> [u32; 2] {
    let (t, i) = (h as usize / 3, h as usize % 3);
    [triangles[t][i], triangles[t][(i + 1) % 3]]
}

/// For each half-edge 3 t + i the one that runs the other way.
fn twins(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut named: Vec<(u64, u32)> = (0..3 * triangles.len() as u32)
        .into_par_iter()
        .map(|h| {
            let [a, b] = ends(triangles, h);
            (u64::from(a.min(b)) << 32 | u64::from(a.max(b)), h)
        })
        .collect();
    named.par_sort_unstable();
    let mut out = vec![u32::MAX; named.len()];
    for pair in named.chunks_exact(2) {
        out[pair[0].1 as usize] = pair[1].1;
        out[pair[1].1 as usize] = pair[0].1;
    }
    out
}

fn split(raw: &mut Raw, solid: &Solid, h: u32, g: u32) {
    let [a, b] = ends(&raw.triangles, h);
    let middle = 0.5 * (raw.positions[a as usize] + raw.positions[b as usize]);
    let m = raw.positions.len() as u32;
    raw.positions.push(placed(raw, solid, middle, h, g));
    for (edge, from) in [(h, a), (g, b)] {
        let (t, i) = (edge as usize / 3, edge as usize % 3);
        let (to, apex) = (raw.triangles[t][(i + 1) % 3], raw.triangles[t][(i + 2) % 3]);
        raw.triangles[t] = [from, m, apex];
        raw.triangles.push([m, to, apex]);
    }
}

/// The middle of an edge moved onto the surface, or left where it is if that would turn one of the four triangles over.
fn placed(raw: &Raw, solid: &Solid, middle: Vec3, h: u32, g: u32) -> Vec3 {
    let p = onto(solid, middle, 3);
    let fine = [h, g].into_iter().all(|edge| {
        let (t, i) = (edge as usize / 3, edge as usize % 3);
        let [a, b, c] = [0, 1, 2].map(|k| raw.positions[raw.triangles[t][(i + k) % 3] as usize]);
        let before = (b - a).cross(c - a);
        [(p - a).cross(c - a), (b - p).cross(c - p)]
            .into_iter()
            .all(|n| n.dot(before) > 0.3 * n.length() * before.length() && n.length() > 0.1 * before.length())
    });
    if fine { p } else { middle }
}
