//! The greedy edge collapse as one would explain it: find the cheapest allowed edge by asking all, collapse it, begin anew.

use std::collections::BTreeSet;

use farfield_core::collapse::{Candidate, Collapsed, Cost, LiveMesh, Place, Reach, Settings};
use glam::{DVec3, Vec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Length times weights, and the turn between vertex normals with `Reach::Ring`; the lighter vertex dies.
#[derive(Clone)]
pub(super) struct Weighted {
    weights: Vec<f32>,
    reach: Reach,
}

impl Weighted {
    /// Random weights; about one vertex in ten can only be joined by lighter ones.
    pub(super) fn new(vertices: usize, ring: bool, rng: &mut ChaCha8Rng) -> Self {
        let weights = (0..vertices).map(|_| rng.random_range(0.05..0.5)).collect();
        Self { weights, reach: if ring { Reach::Ring } else { Reach::Ends } }
    }

    fn normal(mesh: &LiveMesh, v: u32) -> Vec3 {
        let mut around = mesh.triangles_of(v).to_vec();
        around.sort_unstable();
        let area = |&t: &u32| {
            let [a, b, c] = mesh.corners(t).map(|v| mesh.position(v));
            (b - a).cross(c - a)
        };
        around.iter().map(area).sum::<Vec3>().normalize_or_zero()
    }
}

impl Cost for Weighted {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (&[a, b], out) in edges.iter().zip(out) {
            assert!(a < b);
            let [wa, wb] = [a, b].map(|v| self.weights[v as usize]);
            let turn = match self.reach {
                Reach::Ends => 1.0,
                Reach::Ring => (1.5 - Self::normal(mesh, a).dot(Self::normal(mesh, b))).powi(2),
            };
            *out = Candidate {
                cost: turn * mesh.position(a).distance(mesh.position(b)) * (wa + wb),
                place: if wa <= wb { Place::Second } else { Place::First },
            };
            if (a + b) % 11 == 0 {
                *out = Candidate::FORBIDDEN;
            }
        }
    }

    fn collapsed(&mut self, _: &LiveMesh, from: u32, onto: u32, _: Vec3) {
        self.weights[onto as usize] += 0.1 * self.weights[from as usize];
    }

    fn reach(&self) -> Reach {
        self.reach
    }
}

/// Exact greedy collapse in O(collapses * edges * triangles).
pub(super) fn reference(
    positions: &[Vec3],
    indices: &[u32],
    locked: &[bool],
    cost: &mut dyn Cost,
    settings: &Settings,
) -> Collapsed {
    let mut positions = positions.to_vec();
    let mut triangles: Vec<[u32; 3]> = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.iter_mut().filter(|t| t[0] == t[1] || t[1] == t[2] || t[2] == t[0]).for_each(|t| *t = [0; 3]);
    let alive = |t: &&[u32; 3]| t[0] != t[1];
    let mut out = Collapsed { remap: (0..positions.len() as u32).collect(), ..Collapsed::default() };
    let start = Complex::of(&triangles);
    let mut border: Vec<bool> = (0..positions.len() as u32)
        .map(|v| start.edges.iter().any(|e| e.contains(&v) && start.apexes(e[0], e[1]).len() != 2))
        .collect();
    while triangles.iter().filter(alive).count() > settings.min_triangles {
        let complex = Complex::of(&triangles);
        let mesh = LiveMesh::new(&positions, triangles.as_flattened(), locked).unwrap();
        let edges: Vec<[u32; 2]> = complex.edges.iter().copied().collect();
        let mut prices = vec![Candidate::FORBIDDEN; edges.len()];
        cost.costs(&mesh, &edges, &mut prices);
        let ends = |e: [u32; 2], place| match place {
            Place::First | Place::At(_) => (e[1], e[0]),
            Place::Second => (e[0], e[1]),
        };
        let best = edges
            .iter()
            .zip(&prices)
            .filter(|(e, c)| {
                let (from, onto) = ends(**e, c.place);
                let is_locked = |v: u32| locked.get(v as usize) == Some(&true);
                let (at, moves) = match c.place {
                    Place::At(p) => (p, true),
                    _ => (positions[onto as usize], false),
                };
                c.cost < f32::INFINITY
                    && c.cost <= settings.max_cost
                    && !is_locked(from)
                    && !(moves && is_locked(onto))
                    && turn(&triangles, &positions, from, onto, at) <= settings.max_turn_rad as f64
                    && (!moves || turn(&triangles, &positions, onto, from, at) <= settings.max_turn_rad as f64)
                    && (!settings.link_condition || complex.links_meet_in_the_edge(from, onto, &border))
            })
            .min_by(|a, b| (a.1.cost, a.0).partial_cmp(&(b.1.cost, b.0)).unwrap());
        let Some((&edge, &Candidate { cost: price, place })) = best else { break };
        let (from, onto) = ends(edge, place);
        let at = if let Place::At(p) = place { p } else { positions[onto as usize] };
        cost.collapsed(&mesh, from, onto, at);
        positions[onto as usize] = at;
        border[onto as usize] |= border[from as usize];
        for t in &mut triangles {
            t.iter_mut().filter(|v| **v == from).for_each(|v| *v = onto);
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                *t = [0; 3];
            }
        }
        out.remap.iter_mut().filter(|v| **v == from).for_each(|v| *v = onto);
        out.collapses += 1;
        out.max_cost = out.max_cost.max(price);
    }
    for (i, t) in triangles.iter().enumerate().filter(|(_, t)| alive(t)) {
        out.indices.extend(t);
        out.triangles.push(i as u32);
    }
    out.positions = positions;
    out
}

/// The largest turn of a triangle of `moving` that survives, radians; pi where one loses its area.
fn turn(triangles: &[[u32; 3]], positions: &[Vec3], moving: u32, partner: u32, at: Vec3) -> f64 {
    let normal = |p: [DVec3; 3]| (p[1] - p[0]).cross(p[2] - p[0]);
    let survives = |t: &&[u32; 3]| t[0] != t[1] && t.contains(&moving) && !t.contains(&partner);
    let turns = triangles.iter().filter(survives).map(|t| {
        let before = normal(t.map(|v| positions[v as usize].as_dvec3()));
        let after = normal(t.map(|v| if v == moving { at } else { positions[v as usize] }.as_dvec3()));
        match (before == DVec3::ZERO, after == DVec3::ZERO) {
            (true, _) => 0.0,
            (_, true) => std::f64::consts::PI,
            _ => before.angle_between(after),
        }
    });
    turns.fold(0.0, f64::max)
}

struct Complex {
    edges: BTreeSet<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
}

impl Complex {
    fn of(triangles: &[[u32; 3]]) -> Self {
        let triangles: Vec<[u32; 3]> = triangles.iter().copied().filter(|t| t[0] != t[1]).collect();
        let sides = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        Self { edges: sides.map(|[a, b]| [a.min(b), a.max(b)]).collect(), triangles }
    }

    /// The third vertices of an edge's triangles, with repetitions.
    fn apexes(&self, a: u32, b: u32) -> Vec<u32> {
        let has = self.triangles.iter().filter(|t| t.contains(&a) && t.contains(&b));
        has.map(|t| *t.iter().find(|&&v| v != a && v != b).unwrap()).collect()
    }

    fn neighbours(&self, v: u32) -> BTreeSet<u32> {
        let at = self.edges.iter().filter(|e| e.contains(&v));
        at.map(|e| if e[0] == v { e[1] } else { e[0] }).collect()
    }

    /// Edges opposite to a vertex.
    fn rim(&self, v: u32) -> BTreeSet<[u32; 2]> {
        let at = self.triangles.iter().filter(|t| t.contains(&v));
        at.map(|t| {
            let rest: Vec<u32> = t.iter().copied().filter(|&x| x != v).collect();
            [rest[0].min(rest[1]), rest[0].max(rest[1])]
        })
        .collect()
    }

    fn links_meet_in_the_edge(&self, a: u32, b: u32, border: &[bool]) -> bool {
        let apexes = self.apexes(a, b);
        let common: BTreeSet<u32> = self.neighbours(a).intersection(&self.neighbours(b)).copied().collect();
        let lone = |x: u32| self.apexes(x, apexes[0]).len() == 1;
        common == apexes.iter().copied().collect()
            && self.rim(a).is_disjoint(&self.rim(b))
            && !(apexes.len() == 2 && border[a as usize] && border[b as usize])
            && !(apexes.len() == 1 && lone(a) && lone(b))
    }
}
