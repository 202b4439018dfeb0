//! Camera paths: pure functions of a seed, the scene's bounds and the view model. Used to walk a scene in experiments.
//!
//! A **tour** is a closed Catmull-Rom curve (centripetal, Catmull and Rom 1974; Yuksel et al. 2009) through seeded waypoints
//! in the scene's footprint, at eye height, walked at constant speed: at most `max_speed`, and slower where the tangent turns
//! faster than `max_turn_rad` a second, so that both limits hold at every pair of frames. Legs never enter an obstacle's box
//! inflated by the clearance: a leg that would is led around it, and what is left is checked, not assumed. **orbit** circles the
//! bounds, **line** crosses them, **still** stands; **keyed** paths follow given key frames; a **route** is a closed way that a scene
//! brings along.
//!
//! Limits: a tour repeats nothing within `frames`; how much of the scene it sees is its length, at most
//! frames * max_speed / frames_per_s. O(waypoints * obstacles + frames).

mod route;

pub use route::route;

use glam::{DVec2, DVec3, Vec3};

use crate::camera::ViewModel;
use crate::{Aabb, Camera, Fault};

/// What paths need to know.
pub struct PathJob<'a> {
    /// The scene's bounds, local frame.
    pub bounds: Aabb,
    /// The boxes that a tour goes around, local frame.
    pub obstacles: &'a [Aabb],
    /// The views, with the limits on speed and turn.
    pub views: &'a ViewModel,
    /// Frames a second.
    pub frames_per_s: f32,
    /// How many frames.
    pub frames: usize,
    /// The seed.
    pub seed: u64,
}

/// A key frame of a given path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// When, seconds from the start.
    pub time_s: f64,
    /// Where, local frame.
    pub eye: DVec3,
    /// 0 = -z, counter-clockwise seen from above, radians.
    pub yaw_rad: f64,
    /// 0 is level, positive looks up, radians.
    pub pitch_rad: f64,
}

impl PathJob<'_> {
    fn eye_y(&self) -> f64 {
        let [low, high] = self.views.eye_height.map(f64::from);
        0.5 * (low + high)
    }

    fn pitch(&self) -> f64 {
        let [low, high] = self.views.pitch_rad.map(f64::from);
        0.5 * (low + high)
    }

    /// A distance that an eye keeps from boxes: enough that the picture's corners at the near plane stay outside, twice.
    fn clearance(&self) -> f64 {
        let reach = f64::from(self.views.near) / f64::from(self.views.half_diagonal_rad()).cos();
        2.0 * reach
    }

    fn camera(&self, eye: DVec3, yaw_rad: f64, pitch_rad: f64) -> Camera {
        self.views.camera(eye, yaw_rad as f32, pitch_rad as f32)
    }
}

/// One camera, in the middle of the bounds, for all frames. Obstacles are not looked at.
pub fn still(job: &PathJob<'_>) -> Vec<Camera> {
    let c = job.bounds.centre();
    let yaw = unit(&mut job.seed.clone()) * std::f64::consts::TAU;
    vec![job.camera(DVec3::new(f64::from(c.x), job.eye_y(), f64::from(c.z)), yaw, job.pitch()); job.frames]
}

/// Once around the bounds at one and a half times their half diagonal, looking at their centre; slower than once where the limits
/// ask for it.
pub fn orbit(job: &PathJob<'_>) -> Vec<Camera> {
    let (c, half) = (job.bounds.centre().as_dvec3(), job.bounds.size().as_dvec3() * 0.5);
    let radius = 1.5 * half.x.hypot(half.z).max(half.y).max(f64::from(job.views.near) * 4.0);
    let most =
        (f64::from(job.views.max_speed) / radius).min(f64::from(job.views.max_turn_rad)) / f64::from(job.frames_per_s);
    let step = (std::f64::consts::TAU / job.frames as f64).min(most);
    let start = unit(&mut job.seed.clone()) * std::f64::consts::TAU;
    let [low, high] = job.views.eye_height.map(f64::from);
    let y = c.y.clamp(low, high);
    (0..job.frames)
        .map(|i| {
            let (s, k) = (start + step * i as f64).sin_cos();
            let eye = DVec3::new(c.x + radius * s, y, c.z + radius * k);
            let to = c - eye;
            job.camera(eye, (-to.x).atan2(-to.z), to.y.atan2(to.x.hypot(to.z)))
        })
        .collect()
}

/// Straight through the middle of the bounds along their longer horizontal side, looking ahead. Obstacles are not looked at.
pub fn line(job: &PathJob<'_>) -> Vec<Camera> {
    let (c, size) = (job.bounds.centre().as_dvec3(), job.bounds.size().as_dvec3());
    let along = if size.x >= size.z { DVec3::X } else { DVec3::Z };
    let length = size.x.max(size.z);
    let most = f64::from(job.views.max_speed) / f64::from(job.frames_per_s);
    let step = (length / job.frames.max(2).saturating_sub(1) as f64).min(most);
    let first = DVec3::new(c.x, job.eye_y(), c.z) - along * (0.5 * step * (job.frames.max(1) - 1) as f64);
    let yaw = (-along.x).atan2(-along.z);
    (0..job.frames).map(|i| job.camera(first + along * (step * i as f64), yaw, job.pitch())).collect()
}

/// Through key frames, linearly in time; yaw takes the shorter way. Frames beyond the last key stay there.
///
/// # Errors
/// [`Fault::Refused`] where there is no key, one is not finite, or times do not rise.
pub fn keyed(job: &PathJob<'_>, keys: &[Key]) -> Result<Vec<Camera>, Fault> {
    let refuse = |why: String| Err(Fault::Refused(why));
    if keys.is_empty() {
        return refuse("a path needs at least one key frame".into());
    }
    for (i, k) in keys.iter().enumerate() {
        if !(k.eye.is_finite() && k.time_s.is_finite() && k.yaw_rad.is_finite() && k.pitch_rad.abs() < 1.5) {
            return refuse(format!("key frame {i} is not finite, or looks straight up or down"));
        }
    }
    if let Some(i) = (1..keys.len()).find(|&i| keys[i].time_s <= keys[i - 1].time_s) {
        return refuse(format!("key frame {i} is not later than the one before it"));
    }
    let at = |i: usize| {
        let t = keys[0].time_s + i as f64 / f64::from(job.frames_per_s);
        let n = keys.partition_point(|k| k.time_s <= t);
        let (a, b) = (keys[n.max(1) - 1], keys[n.min(keys.len() - 1)]);
        let f = if b.time_s > a.time_s { ((t - a.time_s) / (b.time_s - a.time_s)).clamp(0.0, 1.0) } else { 0.0 };
        let yaw = a.yaw_rad + wrapped(b.yaw_rad - a.yaw_rad) * f;
        job.camera(a.eye.lerp(b.eye, f), yaw, a.pitch_rad + (b.pitch_rad - a.pitch_rad) * f)
    };
    Ok((0..job.frames).map(at).collect())
}

/// Tries before a tour is refused. A crowded park (230 statues on the paper's area) may need more than fifty.
const TRIES: usize = 1000;

/// A closed tour.
///
/// # Errors
/// [`Fault::Refused`] where obstacles leave no way within [`TRIES`] seeded tries.
pub fn tour(job: &PathJob<'_>) -> Result<Vec<Camera>, Fault> {
    let blocked = blocks(job);
    let mut state = job.seed;
    for _ in 0..TRIES {
        if let Some(curve) = curve(job, &blocked, &mut state) {
            return Ok(walk(job, &curve));
        }
    }
    Err(Fault::Refused(format!(
        "no tour at eye height {} leads between {} objects; try another path, seed or eye height",
        job.eye_y(),
        job.obstacles.len()
    )))
}

/// The footprints of what stands at eye height, grown by the clearance: lowest and highest (x, z).
fn blocks(job: &PathJob<'_>) -> Vec<[DVec2; 2]> {
    let (grow, y) = (job.clearance(), job.eye_y());
    let stands = |b: &&Aabb| !b.is_empty() && f64::from(b.min.y) - grow <= y && y <= f64::from(b.max.y) + grow;
    let flat = |v: Vec3| DVec2::new(f64::from(v.x), f64::from(v.z));
    job.obstacles.iter().filter(stands).map(|b| [flat(b.min) - grow, flat(b.max) + grow]).collect()
}

fn hits(blocked: &[[DVec2; 2]], a: DVec2, b: DVec2) -> bool {
    blocked.iter().any(|r| meets(r, a, b))
}

/// Whether a segment meets a rectangle (slabs).
fn meets(r: &[DVec2; 2], a: DVec2, b: DVec2) -> bool {
    let d = b - a;
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for k in 0..2 {
        if d[k].abs() < 1e-12 {
            if a[k] < r[0][k] || a[k] > r[1][k] {
                return false;
            }
        } else {
            let (p, q) = ((r[0][k] - a[k]) / d[k], (r[1][k] - a[k]) / d[k]);
            (t0, t1) = (t0.max(p.min(q)), t1.min(p.max(q)));
        }
    }
    t0 <= t1
}

/// The tour as a closed polyline, fine enough that its chords stand for the curve; `None` where it meets a block.
fn curve(job: &PathJob<'_>, blocked: &[[DVec2; 2]], state: &mut u64) -> Option<Vec<DVec2>> {
    let flat = |v: Vec3| DVec2::new(f64::from(v.x), f64::from(v.z));
    let (low, size) = (flat(job.bounds.min), flat(job.bounds.size()));
    let count = 9;
    let mut points: Vec<DVec2> = vec![];
    // Waypoints in turn around the middle, at 0.35 to 0.95 of the way out: a loop that does not double back.
    let turn = unit(state);
    for k in 0..count {
        let free = (0..1000).find_map(|_| {
            let angle = std::f64::consts::TAU * (turn + (k as f64 + 0.7 * (unit(state) - 0.5)) / count as f64);
            let out = 0.35 + 0.6 * unit(state);
            let p = low + size * (DVec2::splat(0.5) + 0.5 * out * DVec2::from_angle(angle));
            // A whole leg has to be free, and so does the neighbourhood that the curve swings through.
            let leg = points.last().is_none_or(|&q| !hits(blocked, q, p));
            let last = k + 1 < count || !hits(blocked, p, points[0]);
            (leg && last && !hits(blocked, p, p)).then_some(p)
        })?;
        points.push(free);
    }
    // Corners are cut where the curve between waypoints meets something: the legs themselves are free, so inserting their
    // middles draws the curve towards them.
    for _ in 0..7 {
        let fine = catmull_rom(&points);
        let bad: Vec<bool> = (0..points.len()).map(|i| fine[i].windows(2).any(|w| hits(blocked, w[0], w[1]))).collect();
        if !bad.contains(&true) {
            return Some(
                fine.into_iter()
                    .flat_map(|mut s| {
                        s.pop();
                        s
                    })
                    .collect(),
            );
        }
        let n = points.len();
        points = (0..n)
            .flat_map(|i| {
                let (a, b) = (points[i], points[(i + 1) % n]);
                if bad[i] { vec![a, a.lerp(b, 0.25), a.lerp(b, 0.75)] } else { vec![a] }
            })
            .collect();
    }
    None
}

/// The closed centripetal Catmull-Rom curve through `points`: a polyline a span.
fn catmull_rom(points: &[DVec2]) -> Vec<Vec<DVec2>> {
    let n = points.len();
    let at = |i: usize| points[i % n];
    (0..n)
        .map(|i| {
            let p = [at(i + n - 1), at(i), at(i + 1), at(i + 2)];
            // Knots t' = t + |p' - p|^(1/2).
            let mut t = [0.0; 4];
            for k in 1..4 {
                t[k] = t[k - 1] + p[k].distance(p[k - 1]).sqrt().max(1e-9);
            }
            (0..=64).map(|s| barry_goldman(&p, &t, t[1] + (t[2] - t[1]) * f64::from(s) / 64.0)).collect()
        })
        .collect()
}

/// The spline's point at `u`, by repeated interpolation (Barry and Goldman 1988).
fn barry_goldman(p: &[DVec2; 4], t: &[f64; 4], u: f64) -> DVec2 {
    let mix = |a: DVec2, b: DVec2, t0: f64, t1: f64| a * ((t1 - u) / (t1 - t0)) + b * ((u - t0) / (t1 - t0));
    let a = [0, 1, 2].map(|k| mix(p[k], p[k + 1], t[k], t[k + 1]));
    let b = [0, 1].map(|k| mix(a[k], a[k + 1], t[k], t[k + 2]));
    mix(b[0], b[1], t[1], t[2])
}

/// Walks a closed polyline: the eye moves at most the speed limit; the heading follows the tangent ahead, and the eye waits
/// where it would have to turn faster than the limit.
fn walk(job: &PathJob<'_>, curve: &[DVec2]) -> Vec<Camera> {
    let n = curve.len();
    let mut starts = vec![0.0];
    for i in 0..n {
        starts.push(starts[i] + curve[i].distance(curve[(i + 1) % n]));
    }
    let length = starts[n].max(1e-9);
    let point = |s: f64| {
        let s = s.rem_euclid(length);
        let i = starts.partition_point(|&x| x <= s).clamp(1, n) - 1;
        let f = (s - starts[i]) / (starts[i + 1] - starts[i]).max(1e-12);
        curve[i].lerp(curve[(i + 1) % n], f)
    };
    let step = f64::from(job.views.max_speed) / f64::from(job.frames_per_s);
    // A hair under the limit: the yaw is rounded to 32 bits on its way into a camera.
    let most = 0.999 * f64::from(job.views.max_turn_rad) / f64::from(job.frames_per_s);
    // The tangent over a stretch about the eye: the polyline's own corners do not show.
    let window = (2.0 * step).max(length / n as f64);
    let heading = |s: f64| {
        let d = point(s + window) - point(s - window);
        (-d.x).atan2(-d.y)
    };
    let (mut s, mut yaw) = (0.0, heading(0.0));
    let mut out = Vec::with_capacity(job.frames);
    for _ in 0..job.frames {
        let p = point(s);
        out.push(job.camera(DVec3::new(p.x, job.eye_y(), p.y), yaw, job.pitch()));
        let turn = wrapped(heading(s + step) - yaw);
        yaw += turn.clamp(-most, most);
        // Slower in proportion where the turn is cut.
        s += step * (most / turn.abs().max(most)).min(1.0);
    }
    out
}

/// An angle in -pi..=pi.
fn wrapped(a: f64) -> f64 {
    let t = std::f64::consts::TAU;
    a - t * (a / t).round()
}

/// The next number in 0..1 of a sequence that `state` seeds (SplitMix64; Steele et al. 2014).
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn views() -> ViewModel {
        ViewModel {
            fov_y_rad: 1.0,
            resolution: [64, 64],
            near: 0.1,
            eye_height: [17.0, 17.0],
            pitch_rad: [-0.1, 0.1],
            max_speed: 30.0,
            max_turn_rad: 45f32.to_radians(),
        }
    }

    fn park(seed: u64, boxes: usize) -> Vec<Aabb> {
        let mut state = seed;
        (0..boxes)
            .map(|_| {
                let c =
                    Vec3::new((unit(&mut state) as f32 - 0.5) * 1650.0, 20.0, (unit(&mut state) as f32 - 0.5) * 2035.0);
                Aabb { min: c - Vec3::new(28.0, 20.0, 25.0), max: c + Vec3::new(28.0, 20.0, 25.0) }
            })
            .collect()
    }

    fn job<'a>(views: &'a ViewModel, obstacles: &'a [Aabb], seed: u64) -> PathJob<'a> {
        let bounds = Aabb { min: Vec3::new(-825.0, 0.0, -1017.0), max: Vec3::new(825.0, 40.0, 1017.0) };
        PathJob { bounds, obstacles, views, frames_per_s: 30.0, frames: 3000, seed }
    }

    fn yaw(c: &Camera) -> f64 {
        f64::from(-c.forward.x).atan2(f64::from(-c.forward.z))
    }

    fn within_limits(job: &PathJob<'_>, path: &[Camera]) -> Result<(), TestCaseError> {
        for w in path.windows(2) {
            let moved = w[0].eye.distance(w[1].eye) * f64::from(job.frames_per_s);
            let turned = wrapped(yaw(&w[1]) - yaw(&w[0])).abs() * f64::from(job.frames_per_s);
            prop_assert!(moved <= 30.0 * (1.0 + 1e-6), "{moved} units/s");
            prop_assert!(turned <= 45f64.to_radians() * (1.0 + 1e-4), "{} degrees/s", turned.to_degrees());
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn tours_keep_their_limits_and_out_of_every_box(seed in 0u64..1_000_000, boxes in 0usize..260) {
            let (views, obstacles) = (views(), park(seed, boxes));
            let job = job(&views, &obstacles, seed);
            let path = tour(&job).unwrap();
            prop_assert_eq!(path.len(), job.frames);
            within_limits(&job, &path)?;
            for c in &path {
                let eye = c.eye.as_vec3();
                prop_assert!(job.bounds.contains(eye));
                prop_assert!(obstacles.iter().all(|b| b.distance(eye) > views.near), "{eye} in a box");
            }
            prop_assert!(path[0].eye.distance(path[300].eye) > 50.0, "it hardly moves");
            prop_assert_eq!(&tour(&job).unwrap(), &path);
        }

        #[test]
        fn orbits_and_lines_keep_their_limits(seed in 0u64..1_000_000) {
            let views = views();
            let job = job(&views, &[], seed);
            within_limits(&job, &orbit(&job))?;
            within_limits(&job, &line(&job))?;
        }
    }

    /// Found by the property test when fifty tries were all.
    #[test]
    fn a_crowded_park_has_a_tour() {
        let (views, obstacles) = (views(), park(105_634, 230));
        assert_eq!(tour(&job(&views, &obstacles, 105_634)).unwrap().len(), 3000);
    }

    #[test]
    fn a_scene_that_is_full_is_refused() {
        let views = views();
        let full = [Aabb { min: Vec3::splat(-2000.0), max: Vec3::splat(2000.0) }];
        assert!(tour(&job(&views, &full, 1)).unwrap_err().to_string().contains("no tour"));
    }

    #[test]
    fn key_frames_are_met_and_checked() {
        let views = views();
        let key =
            |time_s: f64, x: f64, yaw: f64| Key { time_s, eye: DVec3::new(x, 2.0, 0.0), yaw_rad: yaw, pitch_rad: 0.0 };
        let job = PathJob { frames: 91, ..job(&views, &[], 1) };
        let path = keyed(&job, &[key(0.0, 0.0, 3.0), key(1.0, 10.0, -3.0), key(2.0, 10.0, -3.0)]).unwrap();
        assert!((path[30].eye.x - 10.0).abs() < 1e-5 && (path[15].eye.x - 5.0).abs() < 1e-5 && path[90].eye.x == 10.0);
        assert!((yaw(&path[15]).abs() - std::f64::consts::PI).abs() < 1e-3, "the shorter way round");
        assert!(keyed(&job, &[]).is_err());
        assert!(
            keyed(&job, &[key(1.0, 0.0, 0.0), key(1.0, 0.0, 0.0)]).unwrap_err().to_string().contains("key frame 1")
        );
    }

    #[test]
    fn a_still_path_stands() {
        let views = views();
        let path = still(&job(&views, &[], 4));
        assert!(path.iter().all(|c| *c == path[0]));
    }
}
