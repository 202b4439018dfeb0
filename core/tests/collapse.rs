//! The edge-collapse engine beside a slow, obvious reference, and the properties that every result must have.

mod collapse_reference;

use std::collections::{BTreeMap, BTreeSet};

use collapse_reference::{Weighted, reference};
use farfield_core::collapse::{
    Candidate, Collapsed, Cost, LiveMesh, Mode, Place, Placement, QuadricSettings, Quadrics, Settings, collapse,
};
use glam::{DVec3, Vec3, vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Mesh = (Vec<Vec3>, Vec<u32>);

fn noise(rng: &mut ChaCha8Rng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// A torus of n x m quads with noise: closed, genus 1.
fn torus(n: u32, m: u32, rough: f32, rng: &mut ChaCha8Rng) -> Mesh {
    let tau = std::f32::consts::TAU;
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i as f32 / n as f32 * tau, j as f32 / m as f32 * tau);
            let r = 2.0 + b.cos();
            positions.push(vec3(r * a.cos(), r * a.sin(), b.sin()) + rough * noise(rng));
            indices.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (positions, indices)
}

/// A hilly sheet of n x m quads, some of its triangles missing.
fn sheet(n: u32, m: u32, holes: f64, rough: f32, rng: &mut ChaCha8Rng) -> Mesh {
    let at = |i: u32, j: u32| i * (m + 1) + j;
    let mut mesh = Mesh::default();
    for i in 0..=n {
        for j in 0..=m {
            mesh.0.push(vec3(i as f32, j as f32, (i as f32).sin() * (j as f32 * 0.7).cos()) + rough * noise(rng));
        }
    }
    for i in 0..n {
        for j in 0..m {
            for t in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]] {
                if !rng.random_bool(holes) {
                    mesh.1.extend(t);
                }
            }
        }
    }
    mesh
}

/// Triangles that join vertices at random: nothing is manifold, some are degenerate or duplicates.
fn soup(vertices: u32, triangles: u32, rng: &mut ChaCha8Rng) -> Mesh {
    let positions = (0..vertices).map(|_| noise(rng)).collect();
    (positions, (0..triangles * 3).map(|_| rng.random_range(0..vertices)).collect())
}

/// One of the above, and vertices of no triangle far out, so that moving vertices does not change the mesh's size.
fn any_mesh(seed: u64) -> (Mesh, Vec<bool>, ChaCha8Rng) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let [n, m] = [rng.random_range(3..7), rng.random_range(3..7)];
    let mut mesh = match seed % 4 {
        0 => torus(n, m, 0.15, &mut rng),
        1 => sheet(n, m, 0.0, 0.1, &mut rng),
        2 => sheet(n, m, 0.15, 0.2, &mut rng),
        _ => soup(n * 4, n * m * 2, &mut rng),
    };
    mesh.0.extend([vec3(-50.0, -50.0, -50.0), vec3(50.0, 50.0, 50.0)]);
    let locked = mesh.0.iter().map(|_| seed.is_multiple_of(3) && rng.random_bool(0.2)).collect();
    (mesh, locked, rng)
}

fn any_settings(rng: &mut ChaCha8Rng) -> Settings {
    Settings {
        mode: Mode::Exact,
        max_cost: if rng.random() { f32::MAX } else { rng.random_range(0.0..3.0) },
        min_triangles: if rng.random() { 0 } else { rng.random_range(0..40) },
        link_condition: rng.random(),
        max_turn_rad: [0.5, 1.3, 2.0, 4.0][rng.random_range(0..4)],
    }
}

fn quadrics(mesh: &LiveMesh, rng: &mut ChaCha8Rng) -> Quadrics {
    let placement = if rng.random() { Placement::HalfEdge } else { Placement::Optimal };
    Quadrics::new(mesh, QuadricSettings { placement, ..QuadricSettings::default() })
}

fn edges(indices: &[u32]) -> BTreeMap<[u32; 2], usize> {
    let mut count = BTreeMap::new();
    for t in indices.chunks_exact(3) {
        for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            *count.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    count
}

fn euler(indices: &[u32]) -> i64 {
    let vertices = indices.iter().collect::<BTreeSet<_>>().len() as i64;
    vertices - edges(indices).len() as i64 + indices.len() as i64 / 3
}

/// What must hold for every input and every setting.
fn check_sound(input: &Mesh, locked: &[bool], out: &Collapsed) {
    let n = input.0.len();
    assert_eq!((out.positions.len(), out.remap.len()), (n, n));
    assert_eq!(out.indices.len(), out.triangles.len() * 3);
    assert!(out.triangles.is_sorted());
    for (t, &source) in out.indices.chunks_exact(3).zip(&out.triangles) {
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "degenerate triangle {t:?}");
        let source = &input.1[source as usize * 3..][..3];
        assert!(
            t.iter().zip(source).all(|(v, s)| out.remap[*s as usize] == *v),
            "{t:?} is not what became of {source:?}"
        );
    }
    for v in 0..n {
        assert_eq!(out.remap[out.remap[v] as usize], out.remap[v], "a survivor is alive");
        if locked.get(v) == Some(&true) {
            assert_eq!((out.remap[v] as usize, out.positions[v]), (v, input.0[v]), "locked");
        }
    }
    let dead = (0..n).filter(|&v| out.remap[v] as usize != v).count();
    assert_eq!(dead, out.collapses);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn exact_mode_is_the_brute_force_greedy_for_a_weighted_cost(seed in 0u64..1_000_000) {
        let ((positions, indices), locked, mut rng) = any_mesh(seed);
        let settings = any_settings(&mut rng);
        let mut cost = Weighted::new(positions.len(), seed % 2 == 1, &mut rng);
        let want = reference(&positions, &indices, &locked, &mut cost.clone(), &settings);
        let mesh = LiveMesh::new(&positions, &indices, &locked).unwrap();
        let got = collapse(mesh, &mut cost as &mut dyn Cost, &settings);
        check_sound(&(positions, indices), &locked, &got);
        prop_assert_eq!(got, want);
    }

    #[test]
    fn exact_mode_is_the_brute_force_greedy_for_quadrics(seed in 0u64..1_000_000) {
        let ((positions, indices), locked, mut rng) = any_mesh(seed);
        let settings = any_settings(&mut rng);
        let mesh = LiveMesh::new(&positions, &indices, &locked).unwrap();
        let mut cost = quadrics(&mesh, &mut rng.clone());
        let want = reference(&positions, &indices, &locked, &mut quadrics(&mesh, &mut rng), &settings);
        let got = collapse(mesh, &mut cost, &settings);
        check_sound(&(positions, indices), &locked, &got);
        prop_assert_eq!(got, want);
    }

    #[test]
    fn batched_mode_is_sound_and_goes_as_far_as_exact_mode(seed in 0u64..1_000_000) {
        let ((positions, indices), locked, mut rng) = any_mesh(seed);
        let settings = Settings { mode: Mode::Batched, ..any_settings(&mut rng) };
        let mesh = LiveMesh::new(&positions, &indices, &locked).unwrap();
        let mut cost = Weighted::new(positions.len(), seed % 2 == 1, &mut rng);
        let got = collapse(mesh, &mut cost, &settings);
        check_sound(&(positions.clone(), indices), &locked, &got);
        // What is left is done: a second run finds nothing to do. (Borders are found anew, so not with the link condition.)
        if !settings.link_condition {
            let rest = LiveMesh::new(&got.positions, &got.indices, &locked).unwrap();
            let again = collapse(rest, &mut cost, &Settings { mode: Mode::Exact, ..settings });
            prop_assert_eq!(again.collapses, 0);
        }
    }

    #[test]
    fn closed_manifolds_stay_closed_manifolds_of_their_genus(seed in 0u64..1_000_000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Large enough now and then for the lists to be squeezed.
        let mesh = torus(rng.random_range(4..40), rng.random_range(4..30), 0.1, &mut rng);
        for mode in [Mode::Exact, Mode::Batched] {
            let live = LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap();
            let mut cost = quadrics(&live, &mut rng);
            let out = collapse(live, &mut cost, &Settings { mode, max_turn_rad: 4.0, ..Settings::default() });
            prop_assert!(out.collapses > 0);
            prop_assert_eq!(euler(&out.indices), 0);
            prop_assert!(edges(&out.indices).values().all(|&n| n == 2));
        }
    }

    #[test]
    fn sheets_keep_their_border_loops(seed in 0u64..1_000_000) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mesh = sheet(rng.random_range(3..9), rng.random_range(3..9), 0.0, 0.2, &mut rng);
        for mode in [Mode::Exact, Mode::Batched] {
            let live = LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap();
            let mut cost = quadrics(&live, &mut rng);
            let out = collapse(live, &mut cost, &Settings { mode, max_turn_rad: 4.0, ..Settings::default() });
            prop_assert_eq!(euler(&out.indices), 1);
            prop_assert!(edges(&out.indices).values().all(|&n| n <= 2));
        }
    }

    #[test]
    fn hostile_numbers_never_panic(seed in 0u64..1_000_000) {
        let (mut mesh, locked, mut rng) = any_mesh(seed);
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e-45, 0.0, 1e30];
        for p in &mut mesh.0 {
            if rng.random_bool(0.2) {
                p[rng.random_range(0..3)] = bad[rng.random_range(0..bad.len())];
            }
        }
        for mode in [Mode::Exact, Mode::Batched] {
            let live = LiveMesh::new(&mesh.0, &mesh.1, &locked).unwrap();
            let mut cost = quadrics(&live, &mut rng);
            let settings = Settings { mode, ..any_settings(&mut rng) };
            let out = collapse(live, &mut cost, &settings);
            prop_assert_eq!(out.remap.len(), mesh.0.len());
        }
    }
}

/// A cost of hostile answers.
struct Hostile(ChaCha8Rng);

impl Cost for Hostile {
    fn costs(&mut self, _: &LiveMesh, _: &[[u32; 2]], out: &mut [Candidate]) {
        let costs = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, -0.0, 1.0, f32::MAX];
        for c in out {
            let at = Place::At(noise(&mut self.0) * costs[self.0.random_range(0..8)]);
            *c = Candidate { cost: costs[self.0.random_range(0..8)], place: at };
        }
    }
}

/// Quadrics that find at the end that some triangles have become too long.
struct TooLong<'a> {
    quadrics: Quadrics,
    indices: &'a [u32],
    /// How often it was asked.
    rounds: usize,
}

impl TooLong<'_> {
    fn off(&self, t: usize, corners: [u32; 3], at: impl Fn(u32) -> Vec3) -> f32 {
        let [a, b, c] = corners.map(at);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if corners == [0, 1, 2].map(|k| self.indices[3 * t + k]) { 0.0 } else { longest }
    }
}

impl Cost for TooLong<'_> {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.quadrics.costs(mesh, edges, out);
    }
    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        self.quadrics.collapsed(mesh, from, onto, at);
    }
    fn verifies(&self) -> bool {
        true
    }
    fn verify(&mut self, mesh: &LiveMesh) -> Vec<f32> {
        self.rounds += 1;
        let living = |t: usize| mesh.is_alive(t as u32);
        let off = |t: usize| if living(t) { self.off(t, mesh.corners(t as u32), |v| mesh.position(v)) } else { 0.0 };
        (0..mesh.all_triangles()).map(off).collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn what_goes_too_far_is_taken_back_and_leaves_a_sound_mesh(seed in 0u64..1_000_000) {
        let ((positions, indices), locked, mut rng) = any_mesh(seed);
        let batched = rng.random();
        let mode = if batched { Mode::Batched } else { Mode::Exact };
        let settings = Settings { mode, max_cost: rng.random_range(0.3..3.0), ..any_settings(&mut rng) };
        let live = LiveMesh::new(&positions, &indices, &locked).unwrap();
        let half = QuadricSettings { placement: Placement::HalfEdge, ..Default::default() };
        let free = collapse(live.clone(), &mut Quadrics::new(&live, half), &settings);
        let mut cost = TooLong { quadrics: Quadrics::new(&live, half), indices: &indices, rounds: 0 };
        let out = collapse(live, &mut cost, &settings);
        check_sound(&(positions.clone(), indices.clone()), &locked, &out);
        let off = |(t, corners): (&u32, &[u32])| cost.off(*t as usize, [0, 1, 2].map(|k| corners[k]), |v| positions[v as usize]);
        let all = out.triangles.iter().zip(out.indices.chunks_exact(3)).map(off);
        let most = all.fold(0f32, f32::max);
        prop_assert!(most <= out.max_cost.max(0.0) && out.max_cost <= settings.max_cost, "{most} {}", out.max_cost);
        prop_assert!(out.collapses <= free.collapses && (cost.rounds > 1) == (out.collapses < free.collapses));
        // Edges have as many triangles as before, closed surfaces stay closed.
        if seed % 4 == 0 && settings.link_condition {
            prop_assert!(edges(&out.indices).values().all(|&n| n == 2) && euler(&out.indices) == 0);
        }
    }
}

#[test]
fn costs_that_answer_nonsense_are_survived() {
    for seed in 0..200 {
        let (mesh, locked, mut rng) = any_mesh(seed);
        for mode in [Mode::Exact, Mode::Batched] {
            let live = LiveMesh::new(&mesh.0, &mesh.1, &locked).unwrap();
            let settings = Settings { mode, ..any_settings(&mut rng) };
            let out = collapse(live, &mut Hostile(rng.clone()), &settings);
            check_sound(&mesh, &locked, &out);
        }
    }
}

#[test]
fn long_runs_without_topology_rules_leave_sound_lists() {
    // Thousands of collapses squeeze the lists of triangles again and again, with vertices of no triangle among them.
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mesh = sheet(60, 40, 0.3, 0.3, &mut rng);
        for mode in [Mode::Exact, Mode::Batched] {
            let live = LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap();
            let mut cost = quadrics(&live, &mut rng);
            let settings = Settings { mode, link_condition: false, max_turn_rad: 4.0, ..Settings::default() };
            let out = collapse(live, &mut cost, &settings);
            check_sound(&mesh, &[], &out);
            assert!(out.indices.is_empty(), "nothing forbids the last collapse");
        }
    }
}

#[test]
fn scale_and_place_change_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mesh = torus(100, 60, 0.02, &mut rng);
    for mode in [Mode::Exact, Mode::Batched] {
        for placement in [Placement::HalfEdge, Placement::Optimal] {
            let run = |scale: f32, shift: f32| {
                let positions: Vec<Vec3> = mesh.0.iter().map(|p| *p * scale + Vec3::splat(shift)).collect();
                let live = LiveMesh::new(&positions, &mesh.1, &[]).unwrap();
                let mut cost = Quadrics::new(&live, QuadricSettings { placement, ..QuadricSettings::default() });
                collapse(live, &mut cost, &Settings { mode, max_cost: 0.03 * scale, ..Settings::default() })
            };
            let home = run(1.0, 0.0);
            assert!(home.indices.len() * 2 < mesh.1.len());
            assert_eq!(run(2f32.powi(-40), 0.0).indices, home.indices, "a power of two changes no digit");
            assert_eq!(run(2f32.powi(40), 0.0).indices, home.indices);
            for (scale, shift) in [(1e-3, 0.0), (1e6, 0.0), (1.0, 100.0)] {
                let (a, b) = (run(scale, shift).triangles.len() as f64, home.triangles.len() as f64);
                assert!((a / b - 1.0).abs() < 0.01, "{mode:?} {placement:?} {scale} {shift}: {a} and {b} triangles");
            }
        }
    }
}

#[test]
fn flat_and_collinear_neighbourhoods_collapse_for_nothing() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut flat = sheet(12, 9, 0.0, 0.0, &mut rng);
    flat.0.iter_mut().for_each(|p| p.z = 0.0);
    let mut line = flat.clone();
    line.0.iter_mut().for_each(|p| *p = vec3(p.x + 0.1 * p.y, 0.0, 0.0));
    for mode in [Mode::Exact, Mode::Batched] {
        for placement in [Placement::HalfEdge, Placement::Optimal] {
            let run = |mesh: &Mesh, max_cost| {
                let live = LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap();
                let settings = QuadricSettings { placement, shape_weight: 0.0, ..QuadricSettings::default() };
                let mut cost = Quadrics::new(&live, settings);
                collapse(live, &mut cost, &Settings { mode, max_cost, ..Settings::default() })
            };
            // The corners of the rectangle stay, and with them two triangles at least.
            let out = run(&flat, 1e-4);
            assert!(out.triangles.len() <= 8, "{mode:?} {placement:?}: {}", out.triangles.len());
            let area: f32 = out
                .indices
                .chunks_exact(3)
                .map(|t| {
                    let [a, b, c] = [0, 1, 2].map(|k| out.positions[t[k] as usize]);
                    (b - a).cross(c - a).z / 2.0
                })
                .sum();
            assert!((area - 108.0).abs() < 0.01, "{area}");
            assert!(run(&line, 1e-4).triangles.len() <= 8);
        }
    }
}

/// Quadrics, and beside them every vertex's planes as a plain list: unit normal, a point, and the area as weight.
struct Planes {
    quadrics: Quadrics,
    of: Vec<Vec<(DVec3, DVec3, f64)>>,
    checked: usize,
}

impl Planes {
    fn error(&self, ends: &[u32], at: Vec3) -> f64 {
        let planes = || ends.iter().flat_map(|&v| &self.of[v as usize]);
        let sum: f64 = planes().map(|(n, p, area)| area * n.dot(at.as_dvec3() - *p).powi(2)).sum();
        (sum / planes().map(|p| p.2).sum::<f64>()).sqrt()
    }
}

impl Cost for Planes {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        self.quadrics.costs(mesh, edges, out);
        for (&[a, b], c) in edges.iter().zip(out) {
            let (want, others) = match c.place {
                Place::First => (self.error(&[b], mesh.position(a)), vec![self.error(&[a], mesh.position(b))]),
                Place::Second => (self.error(&[a], mesh.position(b)), vec![self.error(&[b], mesh.position(a))]),
                Place::At(p) => {
                    let around = Vec3::AXES.iter().flat_map(|&x| [p + 0.05 * x, p - 0.05 * x]);
                    let ends = [mesh.position(a), mesh.position(b)];
                    (self.error(&[a, b], p), around.chain(ends).map(|p| self.error(&[a, b], p)).collect())
                }
            };
            assert!((c.cost as f64 - want).abs() < 1e-4 + 1e-3 * want, "{} is not {want}", c.cost);
            assert!(others.iter().all(|o| want < o + 1e-3), "{want} is not the least of {others:?}");
            self.checked += 1;
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        self.quadrics.collapsed(mesh, from, onto, at);
        let moved = std::mem::take(&mut self.of[from as usize]);
        self.of[onto as usize].extend(moved);
    }
}

#[test]
fn quadrics_are_the_mean_squares_over_all_planes_gathered() {
    for placement in [Placement::HalfEdge, Placement::Optimal] {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mesh = torus(20, 15, 0.1, &mut rng);
        let live = LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap();
        let settings = QuadricSettings { placement, border_weight: 0.0, shape_weight: 0.0 };
        let plane = |&t: &u32| {
            let [a, b, c] = live.corners(t).map(|v| live.position(v).as_dvec3());
            let n = (b - a).cross(c - a);
            (n.normalize(), a, n.length() / 2.0)
        };
        let of = (0..live.vertices() as u32).map(|v| live.triangles_of(v).iter().map(plane).collect()).collect();
        let mut cost = Planes { quadrics: Quadrics::new(&live, settings), of, checked: 0 };
        let out = collapse(live, &mut cost, &Settings { min_triangles: 100, ..Settings::default() });
        assert!(out.collapses > 200 && cost.checked > 2000, "{} {}", out.collapses, cost.checked);
    }
}

#[test]
fn hubs_collapse_as_the_brute_force_greedy_does() {
    // Two hubs over a ring: each has more neighbours than a small table of a ring holds.
    for seed in 0..8 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let n = 40;
        let mut mesh = Mesh::default();
        mesh.0.extend([vec3(-50.0, -50.0, -50.0), vec3(50.0, 50.0, 50.0), vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0)]);
        for i in 0..n {
            let turn = i as f32 / n as f32 * std::f32::consts::TAU;
            mesh.0.push(3.0 * vec3(turn.cos(), turn.sin(), 0.0) + 0.1 * noise(&mut rng));
            let (a, b) = (4 + i, 4 + (i + 1) % n);
            mesh.1.extend([2, a, b]);
            // Every other sheet has a hole below.
            if i > 0 || seed % 2 == 0 {
                mesh.1.extend([3, b, a]);
            }
        }
        let settings = Settings { max_turn_rad: 4.0, link_condition: seed % 4 < 2, ..Settings::default() };
        let mut cost = Weighted::new(mesh.0.len(), seed >= 4, &mut rng);
        let want = reference(&mesh.0, &mesh.1, &[], &mut cost.clone(), &settings);
        let got = collapse(LiveMesh::new(&mesh.0, &mesh.1, &[]).unwrap(), &mut cost, &settings);
        check_sound(&mesh, &[], &got);
        assert_eq!(got, want, "seed {seed}");
    }
}

#[test]
fn bad_input_is_refused_with_its_place() {
    let check = |indices: &[u32], locked: &[bool], says: &str| {
        let error = LiveMesh::new(&[Vec3::ZERO; 3], indices, locked).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    };
    check(&[0, 1], &[], "2 indices are no triangles");
    check(&[0, 1, 2, 0, 1, 3], &[], "triangle 1 names vertex 3 of 3");
    check(&[0, 1, 2], &[true], "1 lock flags for 3 vertices");
    let empty = LiveMesh::new(&[], &[], &[]).unwrap();
    let mut cost = Quadrics::new(&empty, QuadricSettings::default());
    assert_eq!(collapse(empty, &mut cost, &Settings::default()), Collapsed::default());
}
