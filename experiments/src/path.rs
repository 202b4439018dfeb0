//! From `[view]` to a view model and the cameras of a path.

use farfield_core::camera::ViewModel;
use farfield_core::path::{self, Key, PathJob};
use farfield_core::scene::Scene;
use farfield_core::{Aabb, Camera};
use glam::{DVec2, DVec3};
use serde::Deserialize;

use crate::config::ViewSettings;
use crate::failure::Failure;

/// The paths that have names.
pub const PATHS: [&str; 5] = ["line", "orbit", "route", "still", "tour"];

/// The path along the route that a generated scene brings along.
pub const ROUTE: &str = "route";
/// How far before a corner a route starts to round it, scene units at a scale of 1: half a step. Generators keep the corners' triangles free.
pub const ROUNDING: f64 = 0.4;

/// A closed way that is free of a scene's geometry, local frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Corners, (x, z).
    pub points: Vec<DVec2>,
    /// How far before a corner it may be rounded, scene units.
    pub rounding: f64,
}

/// The view model: what is not given follows from the scene's size.
pub fn views(v: &ViewSettings, scene: &Scene) -> ViewModel {
    let side = scene.bounds.size().x.max(scene.bounds.size().z).max(f32::MIN_POSITIVE);
    let eye_height = v.eye_height.unwrap_or([0.01 * side; 2]);
    let eye = 0.5 * (eye_height[0] + eye_height[1]);
    ViewModel {
        fov_y_rad: v.fov_y_deg.to_radians(),
        resolution: v.resolution,
        near: v.near.unwrap_or(if eye > 0.0 { eye / 200.0 } else { side * 1e-4 }),
        eye_height,
        pitch_rad: v.pitch_deg.map(f32::to_radians),
        max_speed: v.max_speed.unwrap_or(side / 60.0),
        max_turn_rad: v.max_turn_deg_per_s.to_radians(),
    }
}

/// The cameras of the path, local frame; `along` is what [`crate::scene::Loaded`] has of a route.
///
/// # Errors
/// [`Failure::Input`] where the scene leaves no way or has no route, or a file of key frames is not what it should be.
pub fn cameras(
    v: &ViewSettings,
    views: &ViewModel,
    scene: &Scene,
    along: Option<&Route>,
) -> Result<Vec<Camera>, Failure> {
    let obstacles: Vec<Aabb> = scene.objects.iter().map(|o| o.bounds).collect();
    let job = PathJob {
        bounds: scene.bounds,
        obstacles: &obstacles,
        views,
        frames_per_s: v.frames_per_s,
        frames: v.frames,
        seed: v.seed,
    };
    let failed = |f| Failure::before(format!("the path \"{}\"", v.path), f);
    match v.path.as_str() {
        "line" => Ok(path::line(&job)),
        "orbit" => Ok(path::orbit(&job)),
        ROUTE => {
            let none =
                || Failure::input("the path \"route\"", "the scene brings no route along; a house and a plant do");
            let route = along.ok_or_else(none)?;
            path::route(&job, &route.points, route.rounding).map_err(failed)
        }
        "still" => Ok(path::still(&job)),
        "tour" => path::tour(&job).map_err(failed),
        file => path::keyed(&job, &keys(file, scene.origin)?).map_err(failed),
    }
}

/// A line of a file of key frames: world coordinates.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    time_s: f64,
    x: f64,
    y: f64,
    z: f64,
    yaw_deg: f64,
    pitch_deg: f64,
}

fn keys(file: &str, origin: DVec3) -> Result<Vec<Key>, Failure> {
    let failed = |e: csv::Error| Failure::input(format!("{file}: key frames were not read"), e);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(file).map_err(failed)?;
    let key = |r: Row| Key {
        time_s: r.time_s,
        eye: DVec3::new(r.x, r.y, r.z) - origin,
        yaw_rad: r.yaw_deg.to_radians(),
        pitch_rad: r.pitch_deg.to_radians(),
    };
    reader.deserialize::<Row>().map(|r| r.map(key).map_err(failed)).collect()
}
