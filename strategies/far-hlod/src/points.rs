//! Points in place of triangles that are about as small as a pixel wherever a node is drawn (section 3.2).
//!
//! A triangle whose corners lie within 2 e of its barycentre, e being what the node may be off by and so half a pixel at most, is sampled at its
//! corners and at the middles of its sides; samples in one cube of a grid of e become one point with their mean normal and albedo. Nodes are chosen
//! one by one, after everything is simplified, so that levels change from triangles to points and back.
//!
//! Deviations: a point stands where the first of its samples does, on the surface, so that no error is added; samples that face apart are
//! not merged; splats are so large that they cover what they replace whatever the view (the paper's are a pixel).

use std::collections::HashMap;

use farfield_core::payload::PointsPart;
use farfield_core::scene::{Gathered, Wedge};
use glam::{IVec3, Vec3, Vec4};

/// What of a mesh is drawn as points, and what is not.
pub(crate) struct Split {
    /// Triangles that stay, by number.
    pub(crate) kept: Vec<u32>,
    /// One part for each way of being seen from behind.
    pub(crate) points: Vec<PointsPart>,
}

#[derive(Clone, Copy)]
struct Sample {
    at: Vec3,
    normal: Vec3,
    albedo: Vec4,
}

/// Points under way.
#[derive(Default)]
struct Cloud {
    cells: HashMap<(IVec3, u8), u32>,
    /// Where each stands, with the sums of its samples.
    points: Vec<Sample>,
    counts: Vec<f32>,
    /// The largest distance of a sample from its point, and of what lies between samples from them, scene units.
    moved: f32,
    between: f32,
}

/// Splits a mesh. `e`: see above, scene units. With `all` every triangle becomes points, large ones in parts; else those that are small, if a point at
/// `cost` triangles makes that cheaper.
pub(crate) fn split(mesh: &Gathered, e: f32, all: bool, cost: f32) -> Split {
    let triangles = || 0..mesh.corners.len() as u32;
    let whole = || Split { kept: triangles().collect(), points: vec![] };
    if !(e > 0.0 && e.is_finite()) {
        return whole();
    }
    let (replaced, kept): (Vec<u32>, Vec<u32>) =
        triangles().partition(|&t| all || is_small(mesh.places(mesh.corners[t as usize]), e));
    let mut clouds = [Cloud::default(), Cloud::default()];
    for &t in &replaced {
        let sample = |w: u32| {
            let Wedge { vertex, normal, albedo, .. } = mesh.wedges[w as usize];
            Sample { at: mesh.positions[vertex as usize], normal, albedo: Vec4::from(albedo.map(f32::from)) }
        };
        let cloud = &mut clouds[usize::from(mesh.two_sided[t as usize])];
        cloud.add(mesh.corners[t as usize].map(sample), e);
    }
    let points: usize = clouds.iter().map(|c| c.points.len()).sum();
    if !all && points as f32 * cost >= replaced.len() as f32 {
        return whole();
    }
    let parts = clouds.into_iter().zip([false, true]).filter(|(c, _)| !c.points.is_empty());
    Split { kept, points: parts.map(|(c, two_sided)| c.part(two_sided)).collect() }
}

fn is_small(places: [Vec3; 3], e: f32) -> bool {
    let middle = places.iter().sum::<Vec3>() / 3.0;
    places.iter().all(|p| p.distance(middle) <= 2.0 * e)
}

impl Cloud {
    /// Six samples of a small triangle; of a larger one those of its quarters.
    fn add(&mut self, [a, b, c]: [Sample; 3], e: f32) {
        let [ab, bc, ca] = [a.between(&b), b.between(&c), c.between(&a)];
        if !is_small([a.at, b.at, c.at], e) {
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].into_iter().for_each(|t| self.add(t, e));
            return;
        }
        // Samples divide it into four triangles with half its sides; no point of one is farther from a corner than its longest side over sqrt 3.
        let side = [a.at.distance(b.at), b.at.distance(c.at), c.at.distance(a.at)].into_iter().fold(0.0, f32::max);
        self.between = self.between.max(0.5 * side / 3f32.sqrt());
        for s in [a, b, c, ab, bc, ca] {
            self.put(s, e);
        }
    }

    fn put(&mut self, s: Sample, e: f32) {
        let axis = s.normal.abs().max_position();
        let facing = 2 * axis as u8 + u8::from(s.normal[axis] < 0.0);
        let next = self.points.len() as u32;
        let i = *self.cells.entry(((s.at / e).floor().as_ivec3(), facing)).or_insert(next) as usize;
        if i == next as usize {
            self.points.push(Sample { normal: Vec3::ZERO, albedo: Vec4::ZERO, ..s });
            self.counts.push(0.0);
        }
        let own = &mut self.points[i];
        (own.normal, own.albedo) = (own.normal + s.normal, own.albedo + s.albedo);
        self.counts[i] += 1.0;
        self.moved = self.moved.max(own.at.distance(s.at));
    }

    fn part(self, two_sided: bool) -> PointsPart {
        let albedo = self.points.iter().zip(&self.counts).map(|(p, n)| (p.albedo / *n).round().to_array());
        PointsPart {
            albedo: albedo.map(|c| c.map(|v| v as u8)).collect(),
            positions: self.points.iter().map(|p| p.at).collect(),
            normals: self.points.iter().map(|p| p.normal.normalize_or(Vec3::Y)).collect(),
            radius: self.moved + self.between,
            two_sided,
        }
    }
}

impl Sample {
    fn between(&self, other: &Self) -> Self {
        Self {
            at: self.at.midpoint(other.at),
            normal: (self.normal + other.normal).normalize_or(self.normal),
            albedo: 0.5 * (self.albedo + other.albedo),
        }
    }
}

#[cfg(test)]
mod tests {
    use farfield_core::id::ObjectId;
    use proptest::prelude::*;

    use super::*;

    fn mesh(places: &[Vec3]) -> Gathered {
        let n = places.len() as u32;
        let wedge = |vertex: u32| Wedge { vertex, normal: Vec3::Z, albedo: [vertex as u8, 9, 9, 255] };
        Gathered {
            positions: places.to_vec(),
            names: (0..n).map(|v| (ObjectId(0), v)).collect(),
            wedges: (0..n).map(wedge).collect(),
            corners: (0..n / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            two_sided: vec![false; places.len() / 3],
            ..Gathered::default()
        }
    }

    proptest! {
        #[test]
        fn splats_cover_what_they_replace_and_stand_on_it(
            places in prop::collection::vec((-4f32..4.0, -4f32..4.0, -4f32..4.0), 3..24), all: bool, e in 0.3f32..3.0
        ) {
            let places: Vec<Vec3> = places[..places.len() / 3 * 3].iter().map(|&p| Vec3::from(p)).collect();
            let m = mesh(&places);
            let split = split(&m, e, all, 1e-9);
            let small = |t: usize| is_small([0, 1, 2].map(|k| places[3 * t + k]), e);
            for t in 0..m.corners.len() {
                let kept = split.kept.contains(&(t as u32));
                prop_assert_eq!(kept, !all && !small(t));
                for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (i as f32 / 8.0, j as f32 / 8.0))) {
                    let at = places[3 * t] * (1.0 - i - j) + places[3 * t + 1] * i + places[3 * t + 2] * j;
                    let near = split.points.iter().flat_map(|p| p.positions.iter().map(|q| q.distance(at) - p.radius));
                    prop_assert!(kept || near.fold(f32::INFINITY, f32::min) <= 1e-4);
                }
            }
            for p in split.points.iter().flat_map(|p| &p.positions) {
                let on = m.corners.iter().map(|&c| {
                    let t = m.places(c).map(|v| v.as_dvec3());
                    farfield_core::bvh::nearest_on_triangle(p.as_dvec3(), t).0.distance(p.as_dvec3())
                });
                prop_assert!(on.fold(f64::INFINITY, f64::min) < 1e-4);
            }
        }
    }

    #[test]
    fn points_are_taken_where_they_are_cheaper() {
        // 200 triangles in one cube of the grid: at most a few points.
        let places: Vec<Vec3> =
            (0..600).map(|i| Vec3::new(0.1 + (i % 25) as f32 / 100.0, 0.1 + (i % 7) as f32 / 20.0, 0.5)).collect();
        let m = mesh(&places);
        let with = |cost| split(&m, 1.0, false, cost);
        let points: usize = with(1.5).points.iter().map(|p| p.positions.len()).sum();
        assert!(points == 1 && with(1.5).kept.is_empty());
        assert!(with(201.0).points.is_empty() && with(201.0).kept.len() == 200);
        // Attributes are means.
        assert_eq!(with(1.5).points[0].albedo[0][1..], [9, 9, 255]);
    }
}
