//! Whether the pictures that a window has so far are enough: a visibility metric's word.
//!
//! Beyond the paper, which always takes nine. The published places are tried in their order, nearest to the window first, and one
//! more picture is taken while the metric does not pass. What it judges:
//!
//! * *viewpoints*: the smallest upright prism that holds the centre and all eight published places. Nine pictures serve what lies
//!   between them, and so do fewer where less is hidden; a cell's whole region would ask for what nine do not give either. (The
//!   prism of a ball may reach an eighth of its radius over it where places were moved in.)
//! * *samples*: the pictures, one an eye. Every picture holds all that the layered image can hold, so that what lies
//!   beyond a picture's border is known to none and counts for none;
//! * *bounds*: the box of the far chunks seen through the window; *facing*: points that the central picture shows.
//!
//! Cost: each word costs what the metric takes over all pictures so far, which for `void-surface` is more than a
//! picture costs. Fewer pictures make smaller images and faster frames, not faster builds. Beside the layered image
//! all pictures of a window are kept meanwhile, 16 bytes a pixel.

use farfield_core::cell::{Cell, Outline, Sector};
use farfield_core::context::Context;
use farfield_core::id::SplitId;
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::spread;
use farfield_core::region::Region;
use farfield_core::scene::ChunkSet;
use farfield_core::strategy::{CellJob, Subject, VisibilityMetric};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec2, Vec3};

use crate::places;

/// Points of the central picture that stand for all it shows.
const FACING: usize = 4096;

/// A window's pictures before the metric.
pub(crate) struct Enough<'a> {
    metric: &'a dyn VisibilityMetric,
    job: &'a CellJob<'a>,
    /// The viewpoints and the window.
    cell: Cell,
    bounds: Aabb,
    facing: Vec<Vec3>,
    samples: Vec<(Camera, SurfaceImage)>,
}

impl<'a> Enough<'a> {
    /// Begins with the central picture.
    pub(crate) fn new(
        metric: &'a dyn VisibilityMetric,
        job: &'a CellJob<'a>,
        sector: &Sector,
        seen: &ChunkSet,
        central: (Camera, SurfaceImage),
    ) -> Self {
        let outline = &job.cell.outline;
        let around = places::around(job.cell, &sector.window, 8).into_iter().map(|v| outline.centre + v);
        let eyes: Vec<Vec3> = std::iter::once(outline.centre).chain(around).collect();
        let cell = Cell {
            outline: Outline { region: prism(&eyes), ..outline.clone() },
            splits: vec![job.cell.splits[sector.split.index()].clone()],
            sectors: vec![Sector { split: SplitId(0), ..sector.clone() }],
            own: vec![],
            claims: vec![],
        };
        let bounds = seen.iter().fold(Aabb::EMPTY, |b, c| b.union(job.scene.chunks[c.index()].bounds));
        Self {
            metric,
            job,
            cell,
            bounds,
            facing: spread(std::slice::from_ref(&central), FACING),
            samples: vec![central],
        }
    }

    /// Adds a picture.
    pub(crate) fn add(&mut self, camera: Camera, image: SurfaceImage) {
        self.samples.push((camera, image));
    }

    /// The metric's word on the pictures so far.
    pub(crate) fn passes(&self, cx: &Context<'_>) -> Result<bool, Fault> {
        let subject = Subject {
            cell: &self.cell,
            views: self.job.views,
            bounds: self.bounds,
            facing: &self.facing,
            px_per_tan: self.cell.sectors[0].window.px_per_tan,
            samples: &self.samples,
        };
        Ok(self.metric.judge(&subject, cx)?.passes)
    }
}

/// The smallest upright prism that holds points; their box where the prism has no floor.
fn prism(points: &[Vec3]) -> Region {
    let b = Aabb::of(points.iter().copied());
    let polygon = hull(points.iter().map(|p| [p.x, p.z]).collect());
    if polygon.len() < 3 {
        return Region::Box(b);
    }
    Region::Prism { polygon, y: [b.min.y, b.max.y] }
}

/// The corners of the convex hull, counter-clockwise in (x, z); two or fewer where it has no area. Andrew's monotone chain.
fn hull(mut points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = [f32; 2]>| {
        let mut out: Vec<[f32; 2]> = vec![];
        for p in points {
            while let [.., a, b] = out.as_slice() {
                let [a, b, p] = [*a, *b, p].map(|q| DVec2::new(q[0].into(), q[1].into()));
                if (b - a).perp_dot(p - a) > LEFT * (b - a).length() * (p - a).length() {
                    break;
                }
                out.pop();
            }
            out.push(p);
        }
        out.pop();
        out
    };
    let mut out = half(&mut points.iter().copied());
    out.extend(half(&mut points.iter().rev().copied()));
    out
}

/// The least sine of a turn to the left: places that stand in one line in exact numbers do so after 32-bit rounding.
const LEFT: f64 = 1e-5;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_places_is_what_stands_around_all_of_them() {
        let inner = [[0.0, 0.0], [0.5, 0.25], [-0.5, 0.0]];
        let outer = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let between = [[0.0, -1.0], [1.0, 0.3]];
        let all: Vec<[f32; 2]> = inner.iter().chain(&outer).chain(&between).chain(&outer).copied().collect();
        assert_eq!(hull(all), outer);
        assert!(hull(vec![[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]]).len() < 3);
        assert!(hull(vec![[2.0, 3.0]]).len() < 3);
    }

    #[test]
    fn viewpoints_reach_from_the_lowest_place_to_the_highest() {
        let places = [Vec3::ZERO, Vec3::new(2.0, -1.0, 0.0), Vec3::new(0.0, 3.0, 2.0)];
        let Region::Prism { polygon, y } = prism(&places) else { panic!("a prism") };
        assert_eq!((polygon.len(), y), (3, [-1.0, 3.0]));
        assert!(places.iter().all(|p| prism(&places).contains(*p)));
        let line = prism(&[Vec3::ZERO, Vec3::X]);
        assert_eq!(line, Region::Box(Aabb { min: Vec3::ZERO, max: Vec3::X }));
    }
}
