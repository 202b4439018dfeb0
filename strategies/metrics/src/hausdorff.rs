//! `hausdorff`: a bound on how far a collapse leaves the surface that it began with, in both directions.
//!
//! What out-of-core simplification with guaranteed error tolerance steers by (Borodin, Guthe, Klein 2003; Guthe, Borodin, Balazs, Klein
//! 2004, section 3, its purely geometric measure). How the distance is bounded is not printed there; here it is done after Bajaj and
//! Schikore, *Error-bounded reduction of triangle meshes with multivariate data* (1996): where the triangles round the dying vertex
//! and those that take their place project onto one plane without folds, points that project onto the same point correspond, each
//! on one surface to one on the other. Between the projected edges of both the distance of corresponding points is a linear function:
//! its largest value is at the dying vertex or where an old edge crosses a new one. On a border the dying vertex first slides to the
//! nearest point of the edge that replaces its two, which adds that distance. Where nothing projects, the dying vertex's
//! triangles follow it to its new place: no point moves farther than it does.
//!
//! Every triangle remembers the bound of what it stands for; a collapse's cost is the largest one round the dying vertex plus its own
//! distance. By the triangle inequality no point of the new surface is farther from the original one, nor of the original one from the
//! new: a bound, of the two-sided Hausdorff distance, as far as 32-bit arithmetic goes. It is not a tight one: distances add up
//! where they might cancel.
//!
//! Pixels: the largest projection of a segment along x, y or z at the dying vertex, over its length. Where the far field's measure is
//! the same everywhere (an object-space hierarchy) the bound is exact in its unit. O(k^2) a price for k triangles round a vertex.

use farfield_core::Fault;
use farfield_core::collapse::{Candidate, Cost, LiveMesh, Place, Reach};
use farfield_core::strategy::{MeshView, SimplificationMetric, VertexSeen};
use glam::{Vec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::appearance::Looks;
use crate::star::{ROUNDING, Stars};

/// The two-sided distance from the original surface.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hausdorff {}

#[typetag::serde(name = "hausdorff")]
impl SimplificationMetric for Hausdorff {
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        _seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault> {
        Ok((Box::new(Deviation::new(&mesh, px, None, max_px)), max_px))
    }

    fn bounds_distance(&self) -> bool {
        true
    }
}

/// What a collapse moves, beside what its triangles stood for before.
pub(crate) struct Deviation<'a> {
    px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
    /// The bound of each triangle, pixels.
    bounds: Vec<f32>,
    looks: Option<Looks<'a>>,
    /// Costs above it are as good as infinite.
    most: f32,
    patch: Patch,
    stars: Stars,
}

/// The neighbourhood of a dying vertex, in the order of its triangles.
#[derive(Default)]
pub(crate) struct Patch {
    /// The dying vertex' triangles without the survivor: ids, and the two other corners in the triangle's direction.
    pub(crate) moved: Vec<(u32, [u32; 2])>,
    /// Its triangles that vanish.
    pub(crate) gone: Vec<u32>,
    /// Every neighbour but the survivor, each once, with its number of triangles here.
    pub(crate) spokes: Vec<(u32, u32)>,
    /// Unit normal of the plane that all is projected onto; zero where there is none.
    pub(crate) normal: Vec3,
    flat: Vec<(Vec2, f32)>,
}

impl<'a> Deviation<'a> {
    /// `most` is the cost above which nothing is collapsed.
    pub(crate) fn new(
        mesh: &MeshView<'a>,
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        looks: Option<Looks<'a>>,
        most: f32,
    ) -> Self {
        let bounds = vec![0.0; mesh.indices.len() / 3];
        Self { px, bounds, looks, most, patch: Patch::default(), stars: Stars::default() }
    }

    /// Pixels a scene unit at a place, along a segment of some length.
    fn scale(&self, p: Vec3, length: f32) -> f32 {
        if length > 0.0 {
            Vec3::AXES.iter().map(|&x| (self.px)(p, p + x * length)).fold(0.0, f32::max) / length
        } else {
            0.0
        }
    }

    /// The bound after `from` went onto `onto`, the pixels of a scene unit there, and the normal of the plane that was projected onto, zero
    /// where there is none. `None` where the collapse would leave an edge that is no surface.
    fn bound(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> Option<(f32, f32, Vec3)> {
        let (p, length) = (mesh.position(from), mesh.position(from).distance(mesh.position(onto)));
        if let Some(star) = self.stars.of(mesh, from, &self.bounds) {
            let before = star.before;
            let (moved, normal) = match star.distance(onto) {
                Some(d) => (d, star.normal),
                None => (length, Vec3::ZERO),
            };
            let scale = self.scale(p, length);
            return Some((before + moved * scale, scale, normal));
        }
        if !self.patch.gather(mesh, from, onto) {
            return None;
        }
        let moved = self.patch.distance(mesh, from, onto).unwrap_or(length);
        let scale = self.scale(p, length);
        let before = mesh.triangles_of(from).iter().map(|&t| self.bounds[t as usize]).fold(0.0, f32::max);
        Some((before + moved * scale, scale, self.patch.normal))
    }

    /// The cost of `from` going onto `onto`, which counts looks too; pixels.
    fn price(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> f32 {
        let Some((bound, scale, normal)) = self.bound(mesh, from, onto) else { return f32::INFINITY };
        // Looks only make it dearer.
        if bound.is_nan() || bound > self.most {
            return f32::INFINITY;
        }
        let Some(looks) = &mut self.looks else { return bound };
        if !self.patch.gather(mesh, from, onto) {
            return f32::INFINITY;
        }
        self.patch.normal = normal;
        let left = (self.most * self.most - bound * bound).sqrt() / scale;
        let cost = bound.hypot(looks.off(mesh, &self.patch, from, onto, left) * scale);
        if cost.is_finite() { cost } else { f32::INFINITY }
    }
}

impl Cost for Deviation<'_> {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (&[a, b], out) in edges.iter().zip(out) {
            let mut way = |from: u32, onto: u32| {
                if mesh.is_locked(from) { f32::INFINITY } else { self.price(mesh, from, onto) }
            };
            let (first, second) = (way(b, a), way(a, b));
            *out = if first <= second {
                Candidate { cost: first, place: Place::First }
            } else {
                Candidate { cost: second, place: Place::Second }
            };
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, _at: Vec3) {
        let Some((bound, _, normal)) = self.bound(mesh, from, onto) else { return };
        self.patch.gather(mesh, from, onto);
        self.patch.normal = normal;
        self.stars.forget();
        for &(t, _) in &self.patch.moved {
            self.bounds[t as usize] = bound;
        }
        // What a vanishing triangle stood for lies on its neighbours from now on: those that are not in the patch stay as they are
        // where the projection holds; where it does not, they take the bound too.
        if self.patch.normal == Vec3::ZERO {
            for &t in mesh.triangles_of(onto) {
                self.bounds[t as usize] = self.bounds[t as usize].max(bound);
            }
        }
        if let Some(looks) = &mut self.looks {
            looks.collapsed(mesh, &self.patch, from, onto);
        }
    }

    fn reach(&self) -> Reach {
        Reach::Ring
    }
}

impl Patch {
    /// Whether what vanishes stays on the surface, as an edge.
    fn gather(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> bool {
        self.moved.clear();
        self.gone.clear();
        self.spokes.clear();
        for &t in mesh.triangles_of(from) {
            let c = mesh.corners(t);
            let k = c.iter().position(|&v| v == from).unwrap_or_default();
            let [x, y] = [c[(k + 1) % 3], c[(k + 2) % 3]];
            if x == onto || y == onto {
                self.gone.push(t)
            } else {
                self.moved.push((t, [x, y]))
            }
            for v in [x, y] {
                if v != onto {
                    match self.spokes.iter_mut().find(|s| s.0 == v) {
                        Some(s) => s.1 += 1,
                        None => self.spokes.push((v, 1)),
                    }
                }
            }
        }
        self.normal = Vec3::ZERO;
        // A triangle that vanishes becomes an edge: one that nobody else has would be no surface.
        let third = |t: u32| mesh.corners(t).into_iter().find(|&v| v != from && v != onto);
        self.gone.iter().all(|&t| {
            let Some(x) = third(t) else { return false };
            let stays = |&o: &u32| mesh.corners(o).contains(&x) && !self.gone.contains(&o);
            mesh.triangles_of(onto).iter().any(stays) || mesh.triangles_of(from).iter().any(stays)
        })
    }

    /// The largest distance of corresponding points of the old surface and the new one, scene units; `None` where there is no plane
    /// onto which both project without folds.
    fn distance(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> Option<f32> {
        let (p, q) = (mesh.position(from), mesh.position(onto));
        // Inside a surface every spoke has two triangles, and the edge itself; on a border one spoke has one, and so has the edge.
        let mut ends = self.spokes.iter().filter(|s| s.1 == 1).map(|s| s.0);
        let manifold = self.spokes.iter().all(|s| s.1 <= 2);
        let (start, slid) = match (manifold, self.gone.len(), [ends.next(), ends.next()]) {
            (true, 2, [None, _]) => (p, 0.0),
            (true, 1, [Some(end), None]) => {
                let e = mesh.position(end);
                let along = e - q;
                let t = (p - q).dot(along) / along.length_squared();
                if !t.is_finite() {
                    return None;
                }
                let at = q + along * t.clamp(0.0, 1.0);
                (at, at.distance(p))
            }
            _ => return None,
        };
        let area = |[x, y]: [u32; 2], at: Vec3| (mesh.position(x) - at).cross(mesh.position(y) - at);
        let old = mesh.triangles_of(from).iter().map(|&t| {
            let c = mesh.corners(t);
            let k = c.iter().position(|&v| v == from).unwrap_or_default();
            [c[(k + 1) % 3], c[(k + 2) % 3]]
        });
        let normal = old.clone().map(|pair| area(pair, start)).sum::<Vec3>().try_normalize()?;
        let (across, up) = normal.any_orthonormal_pair();
        let flat = |v: Vec3| (Vec2::new((v - start).dot(across), (v - start).dot(up)), (v - start).dot(normal));
        // Without folds: every triangle counter-clockwise, old and new, and the old ones once round.
        let mut crossings = 0;
        for pair in old {
            if area(pair, start).dot(normal) < 0.0 {
                return None;
            }
            let [a, b] = pair.map(|v| flat(mesh.position(v)).0);
            crossings += u32::from(a.y <= 0.0 && b.y > 0.0);
        }
        if self.moved.iter().any(|&(_, pair)| area(pair, q).dot(normal) <= 0.0) || crossings > 1 {
            return None;
        }
        self.flat.clear();
        self.flat.extend(self.spokes.iter().map(|s| flat(mesh.position(s.0))));
        let centre = flat(q);
        let mut most = 0f32;
        // The dying vertex under or over the triangle that covers it, or that, after rounding, comes nearest to it; on a border it lies
        // on a new edge.
        if self.gone.len() == 2 {
            let over = self.moved.iter().map(|&(_, pair)| {
                let [a, b] = pair.map(|v| flat(mesh.position(v)));
                let [u, v] = weights([centre.0, a.0, b.0], Vec2::ZERO);
                (u.min(v).min(1.0 - u - v), (1.0 - u - v) * centre.1 + u * a.1 + v * b.1)
            });
            let (inside, height) = over.max_by(|a, b| a.0.total_cmp(&b.0))?;
            if inside.is_nan() || inside < -ROUNDING {
                return None;
            }
            most = height.abs();
        }
        // Old edges run from the origin, at height 0; new ones from the survivor.
        for (i, &(x, hx)) in self.flat.iter().enumerate() {
            for &(y, hy) in self.flat[..i].iter().chain(&self.flat[i + 1..]) {
                if let Some((s, t)) = crossing(x, centre.0, y) {
                    most = most.max((s * hx - (centre.1 + t * (hy - centre.1))).abs());
                }
            }
        }
        self.normal = normal;
        Some(slid + most)
    }
}

/// The weights of b and c of a point in the plane of a triangle.
pub(crate) fn weights([a, b, c]: [Vec2; 3], p: Vec2) -> [f32; 2] {
    let (u, v, w) = (b - a, c - a, p - a);
    let area = u.perp_dot(v);
    [w.perp_dot(v) / area, u.perp_dot(w) / area]
}

/// Where the segment from the origin to `x` meets that from `c` to `y`, as parts of both; an end that touches counts, whatever is rounded.
fn crossing(x: Vec2, c: Vec2, y: Vec2) -> Option<(f32, f32)> {
    const PART: std::ops::RangeInclusive<f32> = -ROUNDING..=1.0 + ROUNDING;
    let d = y - c;
    let area = x.perp_dot(d);
    let (s, t) = (c.perp_dot(d) / area, c.perp_dot(x) / area);
    (PART.contains(&s) && PART.contains(&t)).then_some((s, t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::bvh::TriangleBvh;
    use farfield_core::collapse::{Collapsed, Mode, Settings, collapse};
    use proptest::prelude::*;

    /// n x n squares over the unit square, at heights.
    fn field(n: u32, height: impl Fn(f32, f32) -> f32) -> (Vec<Vec3>, Vec<u32>) {
        let at = |x: u32, y: u32| x + y * (n + 1);
        let positions = (0..(n + 1) * (n + 1))
            .map(|i| ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32))
            .map(|(x, y)| Vec3::new(x, y, height(x, y)))
            .collect();
        let square = |i: u32| {
            let (x, y) = (i % n, i / n);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
        };
        (positions, (0..n * n).flat_map(square).collect())
    }

    fn simplified(positions: &[Vec3], indices: &[u32], most: f32, settings: Settings) -> Collapsed {
        let normals = vec![Vec3::Z; positions.len()];
        let mesh = MeshView { positions, normals: &normals, albedo: &[], indices };
        let px = |a: Vec3, b: Vec3| a.distance(b);
        let seen = vec![VertexSeen::default(); positions.len()];
        let (mut cost, max_cost) = Hausdorff::default().begin(mesh, &seen, &px, most).unwrap();
        collapse(LiveMesh::new(positions, indices, &[]).unwrap(), cost.as_mut(), &Settings { max_cost, ..settings })
    }

    /// The largest distance of points on one surface from another, on a lattice of k steps a triangle.
    fn sampled(positions: &[Vec3], from: &[u32], to: &[u32], k: u32) -> f32 {
        let bvh = TriangleBvh::build(positions, to);
        let mut most = 0f32;
        for t in from.chunks_exact(3) {
            let p = [0, 1, 2].map(|i| positions[t[i] as usize]);
            for (i, j) in (0..=k).flat_map(|i| (0..=k - i).map(move |j| (i, j))) {
                let (u, v) = (i as f32 / k as f32, j as f32 / k as f32);
                let at = p[0] * (1.0 - u - v) + p[1] * u + p[2] * v;
                most = most.max(bvh.closest_point(at, f32::INFINITY).map_or(f32::INFINITY, |n| n.distance));
            }
        }
        most
    }

    #[test]
    fn a_flat_square_costs_nothing_with_its_border() {
        let (positions, indices) = field(12, |_, _| 0.25);
        let out = simplified(&positions, &indices, 1e-6, Settings::default());
        assert_eq!(out.indices.len(), 6);
        assert!(out.max_cost <= 1e-6);
    }

    #[test]
    fn a_tip_costs_its_height() {
        // A pyramid of four triangles over a square: the tip onto a corner leaves the flat square.
        let positions = [
            Vec3::new(0.0, 0.0, 0.0),
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(2.0, 2.0, 0.0),
            Vec3::new(0.0, 2.0, 0.0),
            Vec3::new(1.0, 1.0, 0.75),
        ];
        let indices = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4];
        assert_eq!(simplified(&positions, &indices, 0.74, Settings::default()).indices.len(), 12);
        let out = simplified(&positions, &indices, 0.76, Settings::default());
        assert_eq!(out.indices.len(), 6);
        assert!((out.max_cost - 0.75).abs() < 1e-6, "{}", out.max_cost);
    }

    #[test]
    fn a_tip_over_a_new_edge_is_never_lost_to_rounding() {
        // A new edge from the survivor to the opposite corner passes right under the tip, whichever way all of it is turned.
        for i in 0..500 {
            let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, i as f32 * 0.37, i as f32 * 0.11, i as f32 * 0.71);
            let offset = Vec3::new(3.0, -7.0, 11.0) * (i % 5) as f32;
            let around = |k: u32| {
                let a = std::f32::consts::TAU * k as f32 / 6.0;
                turn * Vec3::new(a.cos(), a.sin(), 0.0) + offset
            };
            let positions: Vec<Vec3> = (0..6).map(around).chain([turn * (Vec3::Z * 0.2) + offset]).collect();
            let indices: Vec<u32> = (0..6).flat_map(|k| [k, (k + 1) % 6, 6]).collect();
            // The corners are held: the tip alone may go.
            let normals = vec![Vec3::Z; 7];
            let mesh = MeshView { positions: &positions, normals: &normals, albedo: &[], indices: &indices };
            let locked = [true, true, true, true, true, true, false];
            let px = |a: Vec3, b: Vec3| a.distance(b);
            let (mut cost, _) = Hausdorff::default().begin(mesh, &[], &px, 1.0).unwrap();
            let out =
                collapse(LiveMesh::new(&positions, &indices, &locked).unwrap(), cost.as_mut(), &Settings::default());
            assert_eq!(out.indices.len(), 12);
            assert!((out.max_cost - 0.2).abs() < 1e-4, "turned {i}: {}", out.max_cost);
        }
    }

    #[test]
    fn a_surface_never_vanishes() {
        for indices in [&[0u32, 1, 2][..], &[0, 1, 2, 2, 1, 3]] {
            let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
            let settings = Settings { link_condition: false, max_turn_rad: 4.0, ..Settings::default() };
            let out = simplified(&positions, indices, f32::MAX, settings);
            let bound = out.max_cost * (1.0 + 1e-5) + 1e-6;
            assert!(!out.indices.is_empty() && sampled(&positions, indices, &out.indices, 16) <= bound);
        }
    }

    proptest! {
        #[test]
        fn the_fast_way_and_the_general_one_agree(
            heights in prop::collection::vec((0.3f32..1.5, -0.4f32..0.4), 3..16), tip in -0.4f32..0.4, onto in 0usize..16
        ) {
            let n = heights.len();
            let place = |(i, &(r, h)): (usize, &(f32, f32))| {
                let (s, c) = (i as f32 * std::f32::consts::TAU / n as f32).sin_cos();
                Vec3::new(r * c, r * s, h)
            };
            let mut positions: Vec<Vec3> = heights.iter().enumerate().map(place).collect();
            positions.push(Vec3::Z * tip);
            let (from, onto) = (n as u32, (onto % n) as u32);
            let indices: Vec<u32> = (0..n as u32).flat_map(|i| [from, i, (i + 1) % n as u32]).collect();
            let mesh = LiveMesh::new(&positions, &indices, &[]).unwrap();
            let (mut patch, mut stars) = (Patch::default(), Stars::default());
            prop_assert!(patch.gather(&mesh, from, onto) || n == 3);
            let slow = patch.distance(&mesh, from, onto);
            let star = stars.of(&mesh, from, &vec![0.25; n]).unwrap();
            prop_assert_eq!(star.before, 0.25);
            match (star.distance(onto), slow) {
                (None, None) => {}
                (Some(a), Some(b)) => prop_assert!((a - b).abs() <= 1e-4, "{a} {b}"),
                (a, b) => {
                    // On the edge of folding rounding may decide otherwise.
                    let least = (0..n).map(|i| {
                        let p = |k: usize| positions[(onto as usize + k) % n].truncate();
                        (p(i) - p(0)).perp_dot(p(i + 1) - p(0)).abs()
                    });
                    prop_assert!(least.fold(f32::INFINITY, f32::min) < 1e-3, "{a:?} {b:?}");
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn no_point_is_farther_than_the_bound(
            waves in prop::collection::vec((0f32..9.0, 0f32..9.0, -0.1f32..0.1), 1..5), noise in 0f32..0.03,
            most in 0.002f32..0.3, batched: bool, link_condition: bool, fold: bool
        ) {
            let height = |x: f32, y: f32| {
                let rough = (((x * 913.0).sin() + (y * 717.0).cos()) * 4375.5).fract() * noise;
                waves.iter().map(|(a, b, h)| h * (a * x + b * y).sin()).sum::<f32>() + rough
            };
            let (positions, indices) = field(14, height);
            let settings = Settings {
                mode: if batched { Mode::Batched } else { Mode::Exact },
                link_condition,
                max_turn_rad: if fold { 4.0 } else { 1.3 },
                ..Settings::default()
            };
            let out = simplified(&positions, &indices, most, settings);
            let bound = out.max_cost * (1.0 + 1e-4) + 1e-6;
            prop_assert!(out.max_cost <= most && out.indices.len() < indices.len());
            prop_assert!(sampled(&positions, &indices, &out.indices, 4) <= bound);
            prop_assert!(sampled(&positions, &out.indices, &indices, 12) <= bound);
        }
    }
}
