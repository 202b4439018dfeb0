//! Audits: claims held against measurements at viewpoints that nothing was built from.
//!
//! For each quantity there is one measurement. A *hole width* is measured on one object alone: its original far
//! geometry against its payloads, both seen by a camera of the view model that stands at a random viewpoint of the cell and
//! turns the object to a random place of its picture (so the stretch towards the picture's corners is in it). A pixel is
//! the measurement's resolution: a slit of any width may catch one row of pixel centres, so that a violation is a measured
//! width of more than the claim plus one pixel. *Near triangles* are counted by culling, with the four side planes, every
//! placed chunk that the view's split calls near, for views that the cell serves. An *unseen solid angle* is measured over the six pictures
//! of a cube at a random viewpoint: far surfaces where the far field alone shows nothing, or something farther away (see `unseen`). A *surface
//! distance* is the largest over a part of a picture of the scene, from a random viewpoint of the cell, or, where any viewpoint is one, from the scene's inside to
//! some scene's sizes away (see [`crate::measure::surface_distances`]).
//! Samples can refute a bound, not prove it.

mod surface;
mod unseen;

use std::collections::BTreeMap;

use farfield_core::backend::Backend;
use farfield_core::camera::ViewModel;
use farfield_core::cell::{Cell, Sector};
use farfield_core::claim::{Claim, Quantity};
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{AssetId, LocalPayload, ObjectId, TargetId};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::strategy::Cells;
use farfield_core::{Aabb, Camera, Fault};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::measure::{SURFACE_RESOLUTION_PX, Surface, hole_mask, hole_width_px};
use crate::results::{BoundAudit, percentile};

/// Targets that audits render to.
const REFERENCE: TargetId = TargetId(u32::MAX - 1);
const CANDIDATE: TargetId = TargetId(u32::MAX - 2);

/// Cells may overlap: how many random cameras of a region are tried for one that its cell serves.
const SERVED_TRIES: usize = 64;

/// One built cell with what is claimed of it.
pub struct CellAudit<'a> {
    /// The scene; all of it and the cell's payloads are resident in the backend.
    pub scene: &'a Scene,
    /// The views that claims speak of.
    pub views: &'a ViewModel,
    /// The cell.
    pub cell: &'a Cell,
    /// All cells: they say which one serves a camera, and what the camera uses of it.
    pub cells: &'a dyn Cells,
    /// The cell's opened asset.
    pub asset: AssetId,
    /// What its far field claims.
    pub claims: &'a [Claim],
    /// The far field's draws for a camera in the cell.
    pub draws: &'a dyn Fn(&Camera) -> Vec<Draw>,
    /// The surfaces that a claimed surface distance is held against; without it none is measured.
    pub truth: Option<Truth<'a>>,
}

/// Surfaces to search.
pub struct Truth<'a> {
    /// Of the scene.
    pub original: &'a Surface,
    /// Of what is drawn; `None` where that has none.
    pub drawn: Box<DrawnSurface<'a>>,
}

/// Makes the surface of draws.
pub type DrawnSurface<'a> = dyn Fn(&[Draw]) -> Result<Option<Surface>, Fault> + 'a;

/// An object that is drawn from the cell's centre, with its box and the largest claim of its payloads.
struct Object {
    id: ObjectId,
    bounds: Aabb,
    claimed: f64,
}

/// One measurement beside what was claimed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Of what.
    pub quantity: Quantity,
    /// The bound.
    pub claimed: f64,
    /// The value.
    pub measured: f64,
}

impl Measured {
    /// Whether it refutes the claim, given the measurement's resolution.
    pub fn violates(&self) -> bool {
        self.measured > self.claimed + resolution(self.quantity)
    }
}

/// What a measurement cannot tell from nothing.
fn resolution(q: Quantity) -> f64 {
    match q {
        Quantity::HoleWidthPx => 1.0,
        Quantity::NearTriangles => 0.0,
        Quantity::UnseenSolidAngle => unseen::RESOLUTION_SR,
        Quantity::SurfaceDistancePx => SURFACE_RESOLUTION_PX,
    }
}

impl CellAudit<'_> {
    /// Takes `n` measurements, shared out over what is claimed in turn. The same seed gives the same viewpoints.
    ///
    /// # Errors
    /// What the backend gives.
    pub fn sample(&self, backend: &mut dyn Backend, n: usize, seed: u64) -> Result<Vec<Measured>, Fault> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ u64::from(self.cell.outline.id.0).rotate_left(32));
        // Of a cell as a whole the far field's unseen surfaces are measured, and how far they are off; its holes are measured object by object.
        let of_all = [Quantity::UnseenSolidAngle, Quantity::SurfaceDistancePx];
        let own = self.claims.iter().filter(|c| of_all.contains(&c.quantity));
        let whole = self.cell.claims.iter().chain(own).filter(|c| c.payload.is_none());
        let mut questions: Vec<(Quantity, f64, Option<Object>)> = whole.map(|c| (c.quantity, c.max, None)).collect();
        questions.extend(self.objects().into_iter().map(|o| (Quantity::HoleWidthPx, o.claimed, Some(o))));
        let mut out = vec![];
        for i in 0..n.min(n * questions.len()) {
            let (quantity, claimed, object) = &questions[i % questions.len()];
            let measured = match (quantity, object) {
                (Quantity::NearTriangles, _) => self.near_triangles(&mut rng),
                (Quantity::HoleWidthPx, Some(object)) => self.hole_width(backend, object, &mut rng)?,
                (Quantity::HoleWidthPx, None) => None,
                (Quantity::UnseenSolidAngle, _) => self.unseen_solid_angle(backend, &mut rng)?,
                (Quantity::SurfaceDistancePx, _) => {
                    let all = self.surface_distances(backend, &mut rng)?;
                    all.map(|all| all.last().copied().unwrap_or(0.0).into())
                }
            };
            out.extend(measured.map(|measured| Measured { quantity: *quantity, claimed: *claimed, measured }));
        }
        Ok(out)
    }

    /// The objects all of whose payloads claim a hole width: where one payload is silent, so is the object.
    fn objects(&self) -> Vec<Object> {
        // All round, and along every window's axis: what is far may depend on the direction.
        let centre = self.cell.outline.centre.as_dvec3();
        let axis = |s: &Sector| {
            let (yaw, pitch) = ((-s.window.axis.x).atan2(-s.window.axis.z), s.window.axis.y.clamp(-1.0, 1.0).asin());
            self.views.camera(centre, yaw, pitch)
        };
        let around = Camera::cube(centre, 16, self.views.near).into_iter().chain(self.cell.sectors.iter().map(axis));
        let claimed: BTreeMap<LocalPayload, f64> = self
            .claims
            .iter()
            .filter(|c| c.quantity == Quantity::HoleWidthPx)
            .filter_map(|c| Some((c.payload?, c.max)))
            .collect();
        let mut by: BTreeMap<u32, (Aabb, Option<f64>)> = BTreeMap::new();
        for d in around.flat_map(|c| (self.draws)(&c)) {
            if let DrawWhat::Payload { id, object, .. } = d.what
                && id.asset == self.asset
                && object > 0
            {
                let (bounds, max) = by.entry(object - 1).or_insert((Aabb::EMPTY, Some(0.0)));
                *bounds = bounds.union(d.bounds);
                *max = max.and_then(|m| Some(m.max(*claimed.get(&id.id)?)));
            }
        }
        let object = |(id, (bounds, claimed)): (u32, (Aabb, Option<f64>))| {
            Some(Object { id: ObjectId(id), bounds, claimed: claimed? })
        };
        by.into_iter().filter_map(object).collect()
    }

    /// A camera of the view model at a random viewpoint, with `target` at a random place of its picture, and the same with the
    /// picture cut down to the target's box. `None` when the target lies beside the picture or another cell serves the camera.
    fn aimed(&self, target: Aabb, rng: &mut impl Rng) -> Option<(Camera, Camera)> {
        let eye = self.cell.outline.region.sample(std::array::from_fn(|_| rng.random()))?.as_dvec3();
        let to = (target.centre().as_dvec3() - eye).as_vec3();
        let spread = |fov: f32, r: f32| (r - 0.5) * 0.9 * fov;
        let yaw = (-to.x).atan2(-to.z) + spread(self.views.fov_x_rad(), rng.random());
        let pitch = to.y.atan2(to.x.hypot(to.z)) + spread(self.views.fov_y_rad, rng.random());
        let pitch = pitch.clamp(self.views.pitch_rad[0], self.views.pitch_rad[1]);
        let whole = self.views.camera(eye, yaw, pitch);
        (self.cells.find(&whole) == Some(self.cell.outline.id)).then_some(())?;
        Some((whole, crop(&whole, &target)?))
    }

    fn hole_width(&self, backend: &mut dyn Backend, o: &Object, rng: &mut impl Rng) -> Result<Option<f64>, Fault> {
        let Some((whole, camera)) = (0..SERVED_TRIES).find_map(|_| self.aimed(o.bounds, rng)) else { return Ok(None) };
        let own = ChunkSet::from_range(self.scene.objects[o.id.index()].chunks.clone());
        let split = self.cells.active(self.cell, &whole).split;
        let far = own.intersection(&self.cell.splits[split.index()].far);
        let of_object = |mut d: Draw| {
            match &mut d.what {
                DrawWhat::Payload { object, .. } if *object != o.id.0 + 1 => return None,
                DrawWhat::Payload { .. } => {}
                DrawWhat::Chunks(set) => *set = set.intersection(&own),
            }
            Some(d)
        };
        let reference = vec![Draw { what: DrawWhat::Chunks(far), bounds: o.bounds, error_px: 0.0 }];
        let candidate: Vec<Draw> = (self.draws)(&whole).into_iter().filter_map(of_object).collect();
        let pass = |writes, draws| Pass { kind: PassKind::Surface, camera, writes, draws };
        backend.render(&DrawList { passes: vec![pass(REFERENCE, reference), pass(CANDIDATE, candidate)] })?;
        let (r, c) = (backend.read_surface(REFERENCE)?, backend.read_surface(CANDIDATE)?);
        Ok(Some(hole_width_px(&hole_mask(&r, &c), r.size)))
    }

    /// A random camera of the view model in the cell's region; `None` where another cell serves it.
    fn served(&self, rng: &mut impl Rng) -> Option<Camera> {
        let eye = self.cell.outline.region.sample(std::array::from_fn(|_| rng.random()))?.as_dvec3();
        let [low, high] = self.views.pitch_rad;
        let (yaw, pitch) = (std::f32::consts::TAU * rng.random::<f32>(), low + (high - low) * rng.random::<f32>());
        let camera = self.views.camera(eye, yaw, pitch);
        (self.cells.find(&camera) == Some(self.cell.outline.id)).then_some(camera)
    }

    fn near_triangles(&self, rng: &mut impl Rng) -> Option<f64> {
        let camera = (0..SERVED_TRIES).find_map(|_| self.served(rng))?;
        let split = self.cells.active(self.cell, &camera).split;
        let near = self.cell.splits[split.index()].far.complement(self.scene.chunks.len() as u32);
        Some(self.scene.triangles_of(&self.scene.cull(&near, &camera)) as f64)
    }
}

/// The part of a camera's picture that holds a box, with a border of two pixels, on the same pixel grid; `None` when the
/// box lies beside the picture or reaches behind the eye.
pub fn crop(camera: &Camera, target: &Aabb) -> Option<Camera> {
    let (mut lo, mut hi) = (glam::Vec2::INFINITY, glam::Vec2::NEG_INFINITY);
    for corner in target.corners() {
        let px = camera.project((corner.as_dvec3() - camera.eye).as_vec3())?.truncate();
        (lo, hi) = (lo.min(px), hi.max(px));
    }
    cut(camera, (lo - 2.0).floor(), (hi + 2.0).ceil())
}

/// The part of a camera's picture between two corners, pixels from the top left; `None` where nothing lies between them.
fn cut(camera: &Camera, lo: glam::Vec2, hi: glam::Vec2) -> Option<Camera> {
    let size = glam::Vec2::new(camera.size[0] as f32, camera.size[1] as f32);
    let (lo, hi) = (lo.max(glam::Vec2::ZERO), hi.min(size));
    if !lo.cmplt(hi).all() {
        return None;
    }
    let (sx, sy) = ((camera.right_tan - camera.left) / size.x, (camera.top - camera.bottom) / size.y);
    Some(Camera {
        left: camera.left + lo.x * sx,
        right_tan: camera.left + hi.x * sx,
        top: camera.top - lo.y * sy,
        bottom: camera.top - hi.y * sy,
        size: [(hi.x - lo.x) as u32, (hi.y - lo.y) as u32],
        ..*camera
    })
}

/// Joins measurements into one row a quantity.
pub fn join(claimant: &str, measured: &[Measured]) -> Vec<BoundAudit> {
    let mut by: BTreeMap<Quantity, Vec<&Measured>> = BTreeMap::new();
    measured.iter().for_each(|m| by.entry(m.quantity).or_default().push(m));
    by.into_iter()
        .map(|(quantity, all)| {
            let mut values: Vec<f64> = all.iter().map(|m| m.measured).collect();
            values.sort_by(f64::total_cmp);
            BoundAudit {
                claimant: claimant.to_owned(),
                quantity,
                predicted_max: all.iter().map(|m| m.claimed).fold(0.0, f64::max),
                measured_max: values.last().copied().unwrap_or(0.0),
                measured_p99: percentile(&values, 0.99),
                samples: values.len(),
                violations: all.iter().filter(|m| m.violates()).count(),
                note: match quantity {
                    Quantity::HoleWidthPx => {
                        "a sample violates its own claim when it exceeds it by more than one pixel".into()
                    }
                    Quantity::NearTriangles => String::new(),
                    Quantity::SurfaceDistancePx => format!(
                        "the largest distance over a picture; it violates its claim by more than {SURFACE_RESOLUTION_PX:.3} px"
                    ),
                    Quantity::UnseenSolidAngle => format!(
                        "counted by pixels of cubes of {} px a face: a sample violates its claim by more than one of them",
                        unseen::FACE_PX
                    ),
                },
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    #[test]
    fn a_cropped_camera_keeps_the_pixel_grid() {
        let camera = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [200, 100], 0.1);
        let target = Aabb { min: Vec3::new(1.0, -0.5, -8.0), max: Vec3::new(2.0, 0.5, -7.0) };
        let cut = crop(&camera, &target).unwrap();
        let (whole, part) = (camera.project(target.min).unwrap(), cut.project(target.min).unwrap());
        let shift = whole - part;
        assert!((shift.x - shift.x.round()).abs() < 1e-2 && (shift.y - shift.y.round()).abs() < 1e-2);
        assert!(cut.size[0] < 60 && cut.size[1] < 40);
        assert!(crop(&camera, &Aabb { min: Vec3::splat(3.0), max: Vec3::splat(4.0) }).is_none());
    }

    #[test]
    fn violations_are_counted_against_each_samples_own_claim() {
        let m = |claimed, measured| Measured { quantity: Quantity::HoleWidthPx, claimed, measured };
        let rows = join("x", &[m(1.0, 0.0), m(5.0, 5.9), m(2.0, 3.5)]);
        assert_eq!((rows[0].violations, rows[0].samples), (1, 3));
        assert_eq!((rows[0].predicted_max, rows[0].measured_max), (5.0, 5.9));
    }
}
