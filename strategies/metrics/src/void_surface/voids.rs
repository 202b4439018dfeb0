//! F(V) for a set of samples.

use farfield_core::context::{Context, collect};
use farfield_core::image::SurfaceImage;
use farfield_core::panorama::raster::Raster;
use farfield_core::panorama::{Joined, NONE, Panorama, Place, SkinTests, Surface, pixel_solid_angle_sr};
use farfield_core::{Aabb, Camera, Fault};
use glam::DVec3;

use super::drawn::{Patches, Tiles};

/// Edge of the squares of pixels whose quadrilaterals make a patch.
const PATCH: u32 = 16;

/// Walls that end nowhere end this much beyond the bounds.
const BEYOND: f32 = 1.01;

/// Surfaces and walls of samples, ready to be looked at from anywhere.
pub struct Voids {
    samples: Vec<Sample>,
    bounds: Aabb,
}

struct Sample {
    eye: DVec3,
    surface: Patches,
    walls: Patches,
    wall_count: usize,
}

/// What a viewpoint may see that no sample saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Unseen {
    /// The objective function F: the solid angle, steradians.
    pub sr: f64,
    /// The pictures from the viewpoint: six all round, or those that were asked for.
    pub cameras: Vec<Camera>,
    /// Their pixels, picture by picture, row by row: whether they belong to the global void surface.
    pub mask: Vec<bool>,
}

impl Voids {
    /// From pictures grouped by their eyes; only what lies within `bounds` (local frame) will count.
    ///
    /// # Errors
    /// [`Fault::Cancelled`].
    pub fn new(
        samples: &[(Camera, SurfaceImage)],
        bounds: Aabb,
        tests: &SkinTests,
        cx: &Context<'_>,
    ) -> Result<Self, Fault> {
        let panoramas = Panorama::group(samples);
        let samples = collect(cx.run, panoramas.len(), &|i| {
            let own = &panoramas[i];
            cx.check()?;
            let mut joined = Joined::new(own, tests);
            joined.see_past_all(own, panoramas.iter().filter(|o| o.eye() != own.eye()));
            Ok(Sample::new(own, &joined, &bounds))
        })?;
        Ok(Self { samples, bounds })
    }

    /// Number of quadrilaterals of void surface of all samples.
    pub fn walls(&self) -> usize {
        self.samples.iter().map(|s| s.wall_count).sum()
    }

    /// What may be seen from `eye` in six pictures of `face_px` x `face_px` that begin at `near`.
    pub fn unseen(&self, eye: DVec3, face_px: u32, near: f32) -> Unseen {
        self.unseen_in(Camera::cube(eye, face_px, near).to_vec())
    }

    /// What may be seen in pictures of one eye, as [`Voids::unseen`]; 0 in none.
    ///
    /// Walls come first: a pixel stays in question while every sample has one there, before the ray leaves the bounds. Only
    /// there does it matter whether a surface lies before the last sample's nearest wall.
    pub fn unseen_in(&self, cameras: Vec<Camera>) -> Unseen {
        let eye = cameras.first().map_or(DVec3::ZERO, |c| c.eye);
        let raster = Raster::new(&cameras);
        let mut limits = self.exits(eye, &raster);
        let mut deepest = vec![0f32; limits.len()];
        // The nearest sample's walls cover least.
        let mut near_to_far: Vec<&Sample> = self.samples.iter().collect();
        near_to_far.sort_by(|a, b| a.eye.distance_squared(eye).total_cmp(&b.eye.distance_squared(eye)));
        for sample in &near_to_far {
            let tiles = Tiles::new(&raster, &limits);
            if tiles.done() {
                break;
            }
            let mut nearest = vec![f32::INFINITY; limits.len()];
            if sample.eye != eye {
                let moved = (sample.eye - eye).as_vec3();
                sample.walls.draw(moved, &raster, &tiles, |i, z| nearest[i] = nearest[i].min(z));
            }
            for ((limit, deepest), nearest) in limits.iter_mut().zip(&mut deepest).zip(nearest) {
                *deepest = deepest.max(nearest);
                if nearest > *limit {
                    *limit = 0.0;
                }
            }
        }
        // Whatever surface lies before the deepest wall hides it.
        for (limit, deepest) in limits.iter_mut().zip(deepest) {
            *limit = if *limit > 0.0 { deepest } else { 0.0 };
        }
        for sample in &near_to_far {
            let tiles = Tiles::new(&raster, &limits);
            if tiles.done() {
                break;
            }
            let moved = (sample.eye - eye).as_vec3();
            sample.surface.draw(moved, &raster, &tiles, |i, z| {
                if z <= limits[i] {
                    limits[i] = 0.0;
                }
            });
        }
        let mask: Vec<bool> = limits.iter().map(|&l| l > 0.0).collect();
        Unseen { sr: solid_angle(&cameras, &mask), cameras, mask }
    }

    /// The depth at which each pixel's ray leaves the bounds; 0 where it does not meet them.
    fn exits(&self, eye: DVec3, raster: &Raster) -> Vec<f32> {
        let low = (self.bounds.min.as_dvec3() - eye).as_vec3();
        let high = (self.bounds.max.as_dvec3() - eye).as_vec3();
        let mut out = Vec::with_capacity(raster.pixels());
        for view in 0..raster.views() {
            let [w, h] = raster.camera(view).size;
            for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
                // Never exactly 0: pixels' centres are not, but for those of odd faces.
                let ray = raster.ray(view, x, y).map(|c| if c.abs() < 1e-12 { 1e-12 } else { c });
                let (a, b) = (low / ray, high / ray);
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                out.push(if enter <= leave { leave.max(0.0) } else { 0.0 });
            }
        }
        out
    }
}

/// The solid angle of the pixels of pictures that a mask holds.
fn solid_angle(cameras: &[Camera], mask: &[bool]) -> f64 {
    let pixels = cameras.iter().flat_map(|c| {
        let [w, h] = c.size;
        (0..h).flat_map(move |y| (0..w).map(move |x| (c, x, y)))
    });
    pixels.zip(mask).filter(|(_, m)| **m).fold(0.0, |sum, ((c, x, y), _)| sum + pixel_solid_angle_sr(c, x, y))
}

impl Sample {
    fn new(p: &Panorama<'_>, joined: &Joined, bounds: &Aabb) -> Self {
        let surface = Surface::new(p, joined);
        let reach = bounds.corners().map(|c| c.as_dvec3().distance(p.eye()));
        let far = BEYOND * reach.into_iter().fold(0.0, f64::max) as f32;
        let (mut points, mut keyed) = (vec![], vec![]);
        surface.walls(p, far, |wall| {
            let middle = wall[0].normalize_or_zero() + wall[3].normalize_or_zero();
            let key = p.look(middle).map_or(u32::MAX, |at| key(p, at.view, at.x, at.y));
            let first = points.len() as u32;
            points.extend(wall);
            keyed.push((key, [0, 1, 2, 3].map(|k| first + k)));
        });
        let wall_count = keyed.len();
        let walls = Patches::new(points, keyed);
        let mut keyed = Vec::with_capacity(surface.quads.len());
        for at in by_patch(p) {
            let quad = surface.quads[p.pixel(at) as usize];
            if quad[0] != NONE {
                keyed.push((key(p, at.view, at.x, at.y), quad));
            }
        }
        Self { eye: p.eye(), surface: Patches::new(surface.points, keyed), walls, wall_count }
    }
}

/// All pixels, square by square.
fn by_patch<'a>(p: &'a Panorama<'_>) -> impl Iterator<Item = Place> + 'a {
    let squares = |n: u32| (0..n.div_ceil(PATCH)).map(move |i| i * PATCH..((i + 1) * PATCH).min(n));
    (0..p.views().len()).flat_map(move |view| {
        let [w, h] = p.views()[view].0.size;
        squares(h).flat_map(move |rows| {
            squares(w).flat_map(move |columns| {
                let row = move |y| columns.clone().map(move |x| Place { view, x, y });
                rows.clone().flat_map(row)
            })
        })
    })
}

/// The number of a pixel's square.
fn key(p: &Panorama<'_>, view: usize, x: u32, y: u32) -> u32 {
    let columns = p.views()[view].0.size[0].div_ceil(PATCH);
    let before: u32 =
        p.views()[..view].iter().map(|(c, _)| c.size[0].div_ceil(PATCH) * c.size[1].div_ceil(PATCH)).sum();
    before + y / PATCH * columns + x / PATCH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_of_all_pixels_is_all_around_whatever_their_number() {
        for px in [8, 33, 128, 512] {
            let face = Camera::cube(DVec3::ZERO, px, 0.1);
            let n = (6 * px * px) as usize;
            let all = solid_angle(&face, &vec![true; n]);
            assert!((all / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6, "{all}");
            let half = solid_angle(&face, &[vec![true; n / 2], vec![false; n / 2]].concat());
            assert!((half / all - 0.5).abs() < 1e-12);
            assert_eq!(solid_angle(&face, &vec![false; n]), 0.0);
        }
    }
}
