//! The grid at run time, and the images of its points.

use farfield_core::camera::ViewModel;
use farfield_core::cell::{Active, Cell, Outline, Sector, Split};
use farfield_core::claim::{Claim, Quantity};
use farfield_core::context::Context;
use farfield_core::id::{CellId, SectorId, SplitId};
use farfield_core::region::Region;
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::Cells;
use farfield_core::{Camera, Fault};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::arcs::{middle, turn_of};
use crate::cone::Cone;
use crate::directions::{self, Span};
use crate::lattice::Sites;
use crate::leaves::Leaves;
use crate::placement::{Placed, Search, window};
use crate::settle::{CLEAR, Serves};

/// How far a camera's pitch may miss the view model's range, and its right side the level, radians: its axes have 32 bits.
pub(crate) const TURN_SLACK: f64 = 1e-6;
/// The views that are budgeted for are this much wider, relatively, than the view model's.
pub(crate) const TAN_SLACK: f64 = 1e-6;

/// Which split serves which view directions of a cell, and how its images came out: the cell's own data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Directions {
    /// For each bin of pitches, lowest first, where along the yaws a split begins (2^32nds of a turn from -z, counter-clockwise
    /// seen from above; the first at 0), and which.
    pub bins: Vec<Vec<(u32, u32)>>,
    /// Triangles left to draw in the view that each image was placed for: what is to be compared with the optimisation budget.
    pub left: Vec<u64>,
}

impl Directions {
    /// Those of a cell of this partition.
    ///
    /// # Errors
    /// [`Fault::Data`] where the bytes are not what [`Cells::inside`] wrote.
    pub fn of(cell: &Cell) -> Result<Self, Fault> {
        postcard::from_bytes(&cell.own)
            .map_err(|e| Fault::Data { place: format!("cell {}", cell.outline.id.0), cause: e.to_string() })
    }
}

/// A point in use.
pub(crate) struct Point {
    at: DVec3,
    serves: Serves,
}

/// The grid.
pub(crate) struct Grid {
    /// The model.
    pub(crate) leaves: Leaves,
    /// The bins of pitches.
    pub(crate) cones: Vec<Cone>,
    /// The views' range of pitch, radians.
    pub(crate) pitch: [f64; 2],
    /// The search for images.
    pub(crate) search: Search,
    /// The most triangles of a frame.
    pub(crate) budget: u64,
    /// Pixels a unit of tangent.
    pub(crate) px_per_tan: f32,
    outlines: Vec<Outline>,
    points: Vec<Point>,
    span: [DVec3; 2],
}

impl Grid {
    /// Cells of the points that serve.
    pub(crate) fn of(
        sites: &Sites,
        settled: &[Option<Serves>],
        leaves: Leaves,
        cones: Vec<Cone>,
        search: Search,
        budget: u64,
        views: &ViewModel,
    ) -> Self {
        let mut ids: Vec<Option<CellId>> = Vec::with_capacity(settled.len());
        let (mut outlines, mut points) = (vec![], vec![]);
        for (site, serves) in sites.all.iter().zip(settled) {
            let id = CellId(outlines.len() as u32);
            ids.push(serves.map(|_| id));
            if let Some(serves) = *serves {
                let at = sites.lattice.place(site.key);
                let (centre, radius) = (at.as_vec3(), serves.radius as f32);
                outlines.push(Outline { id, region: Region::Sphere { centre, radius }, centre, neighbours: vec![] });
                points.push(Point { at, serves });
            }
        }
        for (i, site) in sites.all.iter().enumerate() {
            let Some(me) = ids[i] else { continue };
            for level in [site.level.checked_sub(1), Some(site.level)].into_iter().flatten() {
                sites.around(site.key, level, |j| {
                    if let Some(other) = ids[j as usize].filter(|_| sites.all[j as usize].level == level) {
                        outlines[me.index()].neighbours.push(other);
                        outlines[other.index()].neighbours.push(me);
                    }
                });
            }
        }
        for o in &mut outlines {
            o.neighbours.sort_unstable();
            o.neighbours.dedup();
        }
        Self {
            leaves,
            cones,
            pitch: views.pitch_rad.map(f64::from),
            search,
            budget,
            px_per_tan: views.px_per_tan(),
            outlines,
            points,
            span: sites.lattice.span(),
        }
    }

    /// Whether the views that were budgeted for hold the camera's.
    fn holds(&self, camera: &Camera) -> bool {
        let [tx, ty] = self.search.tan;
        f64::from(-camera.left).max(camera.right_tan.into()) <= tx
            && f64::from(-camera.bottom).max(camera.top.into()) <= ty
            && f64::from(camera.right.y).abs() <= TURN_SLACK
            && (self.pitch[0] - TURN_SLACK..=self.pitch[1] + TURN_SLACK).contains(&turned(camera)[1])
    }

    /// The images of a point, with their axes, and which bins of its directions use which.
    fn images(&self, point: &Point, cx: &Context<'_>) -> Result<(Vec<(Placed, DVec3)>, Directions), Fault> {
        let mut images = vec![];
        let cones = if point.serves.images { &self.cones[..] } else { &[] };
        let mut views: Vec<_> = directions::spans(&self.leaves, point.at, cones)
            .into_iter()
            .zip(cones)
            .map(|(spans, cone)| {
                let bins = directions::bins(&self.leaves, &spans);
                let split = vec![0u32; bins.len()];
                (cone, spans, bins, split)
            })
            .collect();
        loop {
            cx.check()?;
            // The costliest bin without an image; the first of equal ones.
            let mut worst: Option<(u64, usize, usize)> = None;
            for (v, (_, _, bins, split)) in views.iter().enumerate() {
                for (b, &(_, weight)) in bins.iter().enumerate() {
                    if split[b] == 0 && weight > worst.map_or(self.budget, |w| w.0) {
                        worst = Some((weight, v, b));
                    }
                }
            }
            let Some((weight, v, b)) = worst else { break };
            let (cone, spans, bins, _) = &views[v];
            let arc = bins[b].0;
            let meets = |s: &&Span| (s.arc.lo..=s.arc.hi).contains(&arc.lo);
            let visible: Vec<u32> = spans.iter().filter(meets).map(|s| s.leaf).collect();
            let axis = cone.axis(middle(arc));
            let depth = point.serves.radius * CLEAR;
            let placed = self.search.place(&self.leaves, point.at, axis, &visible, weight, depth);
            let Some(placed) = placed.filter(|p| p.left <= self.budget) else {
                return Err(Fault::Refused(format!(
                    "adaptive-grid: no image beyond {depth:.3} from {} brings a view of {weight} triangles within budget = {}, \
                     although the point passed",
                    point.at, self.budget
                )));
            };
            images.push((placed, axis));
            let (placed, number) = (&images[images.len() - 1].0, images.len() as u32);
            let mut marked = vec![false; self.leaves.len()];
            placed.leaves.iter().for_each(|&l| marked[l as usize] = true);
            for (_, spans, bins, split) in &mut views {
                directions::without(&self.leaves, spans, &marked, bins, |b, left| {
                    if split[b] == 0 && bins[b].1 > self.budget && left <= self.budget {
                        split[b] = number;
                    }
                });
            }
        }
        let mut bins = vec![];
        for (_, _, parts, split) in &views {
            let mut runs: Vec<(u32, u32)> = vec![];
            for ((arc, _), &s) in parts.iter().zip(split) {
                if runs.last().is_none_or(|r| r.1 != s) {
                    runs.push((arc.lo, s));
                }
            }
            bins.push(runs);
        }
        let left = images.iter().map(|i| i.0.left).collect();
        Ok((images, Directions { bins, left }))
    }
}

impl Cells for Grid {
    fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    /// The closest point in the reverse frustum whose star-shape holds the eye. O(points).
    fn find(&self, camera: &Camera) -> Option<CellId> {
        let eye = camera.eye;
        let outside = self.span[0].cmpgt(eye).any() || self.span[1].cmplt(eye).any();
        if outside || !eye.is_finite() || !self.holds(camera) {
            return None;
        }
        let planes = planes(camera, self.search.tan);
        let (mut nearest, mut found) = (f64::INFINITY, None);
        for (i, p) in self.points.iter().enumerate() {
            let way = eye - p.at;
            let distance = way.length_squared();
            if distance < nearest
                && (!p.serves.images || distance <= p.serves.radius * p.serves.radius)
                && planes.iter().all(|n| n.dot(way) >= 0.0)
            {
                (nearest, found) = (distance, Some(CellId(i as u32)));
            }
        }
        found
    }

    fn inside(&self, id: CellId, scene: &Scene, cx: &Context<'_>) -> Result<Cell, Fault> {
        cx.check()?;
        let Some(point) = self.points.get(id.index()) else {
            return Err(Fault::Refused(format!("adaptive-grid: cell {} of {}", id.0, self.points.len())));
        };
        let (images, directions) = self.images(point, cx)?;
        let split = |far: ChunkSet| Split { far, near_budget: Some(self.budget) };
        let mut splits = vec![split(ChunkSet::default())];
        let mut sectors = vec![];
        for (placed, axis) in &images {
            let chunks = placed.leaves.iter().flat_map(|&l| self.leaves.chunks[l as usize].iter().copied());
            let far: ChunkSet = chunks.filter(|c| c.index() < scene.chunks.len()).collect();
            let seen = far.clone();
            let window = window(placed, *axis, self.px_per_tan);
            sectors.push(Sector { split: SplitId(splits.len() as u32), window, seen });
            splits.push(split(far));
        }
        let own = postcard::to_allocvec(&directions)
            .map_err(|e| Fault::Data { place: format!("cell {}", id.0), cause: e.to_string() })?;
        let claims = vec![Claim { quantity: Quantity::NearTriangles, payload: None, max: self.budget as f64 }];
        Ok(Cell { outline: self.outlines[id.index()].clone(), splits, sectors, own, claims })
    }

    /// The split of the camera's direction, and its image where it has one.
    fn active(&self, cell: &Cell, camera: &Camera) -> Active {
        let split = Directions::of(cell).map_or(0, |d| self.split(&d, camera));
        let sectors = split.checked_sub(1).map(SectorId).into_iter().collect();
        Active { cell: cell.outline.id, split: SplitId(split), sectors }
    }
}

impl Grid {
    fn split(&self, directions: &Directions, camera: &Camera) -> u32 {
        let [yaw, pitch] = turned(camera);
        let count = self.cones.len();
        let part = (pitch - self.pitch[0]) / (self.pitch[1] - self.pitch[0]).max(f64::MIN_POSITIVE);
        let bin = ((part * count as f64).floor().max(0.0) as usize).min(count - 1);
        let Some(runs) = directions.bins.get(bin) else { return 0 };
        let turn = turn_of(yaw);
        runs.get(runs.partition_point(|r| r.0 <= turn).saturating_sub(1)).map_or(0, |r| r.1)
    }
}

/// A level camera's yaw and pitch, radians; above a right angle for one that stands on its head. The right side tells the yaw
/// even straight up or down.
fn turned(camera: &Camera) -> [f64; 2] {
    let (r, f) = (camera.right.as_dvec3(), camera.forward.as_dvec3());
    [(-r.z).atan2(r.x), f.y.atan2(f.x * r.z - f.z * r.x)]
}

/// The side planes of the budgeted frustum in the camera's axes: what the camera sees lies inside.
fn planes(camera: &Camera, [tx, ty]: [f64; 2]) -> [DVec3; 4] {
    let [r, u, f] = [camera.right, camera.up, camera.forward].map(|v| v.as_dvec3());
    [r + f * tx, f * tx - r, u + f * ty, f * ty - u]
}
