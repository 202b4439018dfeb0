//! Surface distances from random viewpoints.

use farfield_core::backend::Backend;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::{Camera, Fault};
use glam::{Quat, Vec2, Vec3};
use rand::{Rng, RngExt};

use super::{CANDIDATE, CellAudit, REFERENCE, SERVED_TRIES, cut};
use crate::measure::surface_distances;

/// Where any place is a viewpoint: from how near to how far off a place of the scene, over half the diagonal of its box.
const AWAY: [f32; 2] = [0.02, 8.0];

/// Of a picture a window of at most this many pixels is looked at, around the place that it looks for.
const WINDOW_PX: Vec2 = Vec2::new(160.0, 120.0);

impl CellAudit<'_> {
    /// The distances of a picture from a random viewpoint, sorted, pixels (see [`surface_distances`]); `None` where nothing was drawn that could be
    /// near to anything, or no viewpoint was found that the cell serves.
    ///
    /// # Errors
    /// What the backend gives, and reading payloads.
    pub fn surface_distances(&self, backend: &mut dyn Backend, rng: &mut impl Rng) -> Result<Option<Vec<f32>>, Fault> {
        let Some(truth) = &self.truth else { return Ok(None) };
        let Some((whole, camera)) = (0..SERVED_TRIES).find_map(|_| self.towards_the_scene(rng)) else {
            return Ok(None);
        };
        let split = self.cells.active(self.cell, &whole).split;
        let far = DrawWhat::Chunks(self.cell.splits[split.index()].far.clone());
        let reference = vec![Draw { what: far, bounds: self.scene.bounds, error_px: 0.0 }];
        let candidate = (self.draws)(&camera);
        let Some(drawn) = (truth.drawn)(&candidate)? else { return Ok(None) };
        let pass = |writes, draws| Pass { kind: PassKind::Surface, camera, writes, draws };
        backend.render(&DrawList { passes: vec![pass(REFERENCE, reference), pass(CANDIDATE, candidate)] })?;
        let (r, c) = (backend.read_surface(REFERENCE)?, backend.read_surface(CANDIDATE)?);
        Ok(Some(surface_distances(&camera, [&r, &c], truth.original, &drawn)))
    }

    /// A camera that has a random place of the scene's box at a random place of its picture, since distances look larger beside the middle,
    /// and the same with a window round that place; `None` where another cell serves it.
    fn towards_the_scene(&self, rng: &mut impl Rng) -> Option<(Camera, Camera)> {
        let mut random = || Vec3::from(std::array::from_fn(|_| rng.random::<f32>()));
        let (bounds, v) = (&self.scene.bounds, self.views);
        let place = bounds.min + bounds.size() * random();
        let away = AWAY[0] * (AWAY[1] / AWAY[0]).powf(random().x) * 0.5 * bounds.size().length();
        let (z, (s, c)) = (1.0 - 2.0 * random().x, (std::f32::consts::TAU * random().y).sin_cos());
        let flat = (1.0 - z * z).max(0.0).sqrt();
        let eye = self.cell.outline.region.sample(random().to_array());
        let eye = eye.unwrap_or(place + Vec3::new(flat * c, z, flat * s) * away);
        let to = (place - eye).try_normalize()?;
        let at = |forward| Camera::looking(eye.as_dvec3(), forward, Vec3::Y, v.fov_y_rad, v.resolution, v.near);
        let (middle, aside) = (at(to), random());
        let ray = middle.ray(aside.x * v.resolution[0] as f32, aside.y * v.resolution[1] as f32);
        let whole = at(Quat::from_rotation_arc(ray.normalize(), to) * to);
        (self.cells.find(&whole) == Some(self.cell.outline.id)).then_some(())?;
        let corner = (whole.project(to)?.truncate() - 0.5 * WINDOW_PX).round();
        Some((whole, cut(&whole, corner, corner + WINDOW_PX)?))
    }
}
