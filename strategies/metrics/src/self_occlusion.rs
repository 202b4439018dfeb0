//! `self-occlusion`: how far a viewer can look behind an object's own silhouette.
//!
//! Follows textured LOD meshes (2003, section 3.1.2). A mesh of the polygons that face the cell's centre V lacks those that turn
//! away; a viewer at V' in the cell may see them beside a silhouette. With d the distance from V to the object, l its depth
//! behind that and c the cell's edge the paper has, for the farthest V',
//!
//! ```text
//! s = sqrt(3) c l / (2 d (d + l)) * image_res        pixels
//! ```
//!
//! where the window of width c at distance sqrt(3)/2 c is image_res pixels wide, i.e. image_res = (2/sqrt(3)) q with q the pixels
//! a unit of tangent. So s = c l / (d (d + l)) q: **the same number in a form that needs no hexagon**, with R, the distance of
//! the farthest viewpoint from V, in place of c:
//!
//! ```text
//! s = R l / (d (d + l)) q = R (1/d - 1/(d + l)) q    pixels
//! ```
//!
//! (1/d - 1/(d+l) is the parallax of the two points for a step of one.) d and l are measured on the polygons that are front-facing to the
//! cell, along the line from V to the middle of the object's box. d <= 0 (the object is beside or round V) gives infinity.
//!
//! **s decides, but it is an estimate**: other viewpoints are nearer than V, pictures are stretched towards their corners, and the
//! object is no line. What is *claimed* is a bound. Let a kept point O hide a point P from V, on one ray with distances t1 < t2 from V.
//! From V' with |VV'| <= R they project apart by at most
//!
//! ```text
//! R (t2 - t1) / (z1 z2) q,  z = distance from V' along the picture's axis
//! ```
//!
//! and z >= (distance from V') cos(phi), phi at most half the diagonal field of view. |V'O| and |V'P| are at least D, the distance
//! from the region to the object's box, and |V'P| >= t2 - R; t2 - t1 <= L = t_max - t_min, and (t2 - t1) / max(D, t2 - R) grows with t2, so
//!
//! ```text
//! claim = R L / (D max(D, t_min + L - R)) / cos^2(phi) q    pixels
//! ```
//!
//! Every pixel that lacks a turned-away polygon lies within that of one that is drawn. Limits: it speaks of the polygons before
//! simplification; the region's extreme points stand for it (a ball's box is a little larger). O(vertices).
//!
//! **With several samples** (beyond the paper) a viewpoint is served by the one nearest to it: R is the largest distance of a viewpoint
//! of the region from its nearest sample, found among the [`solid`] candidates, and the bound holds with t measured from whichever
//! sample is worst. While s is not under the threshold, the candidate farthest from all samples is the next sample. s speaks of
//! the whole subject, so that a region touched by geometry asks for ever more: a far field's greatest number of samples ends it.

use farfield_core::Fault;
use farfield_core::claim::Quantity;
use farfield_core::context::Context;
use farfield_core::region::Region;
use farfield_core::strategy::{Subject, Verdict, VisibilityMetric};
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::candidates::{half_spaces, solid};
use crate::void_surface::eyes;

/// Self-occlusion under a number of pixels.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SelfOcclusion {
    /// An object passes below this; the paper's Ts (3, 5, 7).
    #[serde(default = "five")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f64,
}

fn five() -> f64 {
    5.0
}

impl Default for SelfOcclusion {
    fn default() -> Self {
        Self { max_px: five() }
    }
}

/// s of the module's text, pixels. Infinite where the object is not ahead; 0 for one without depth.
fn published_px(radius: f64, d: f64, l: f64, px_per_tan: f64) -> f64 {
    if d.is_nan() || d <= 0.0 {
        return f64::INFINITY;
    }
    radius * (l / d / (d + l)) * px_per_tan
}

/// The claim of the module's text, pixels. Infinite where the object touches the region.
fn bound_px(radius: f64, from_region: f64, nearest: f64, depth: f64, stretch: f64, px_per_tan: f64) -> f64 {
    if from_region.is_nan() || from_region <= 0.0 {
        return f64::INFINITY;
    }
    radius * (depth / from_region / from_region.max(nearest + depth - radius)) * stretch * px_per_tan
}

#[typetag::serde(name = "self-occlusion")]
impl VisibilityMetric for SelfOcclusion {
    fn judge(&self, subject: &Subject<'_>, _cx: &Context<'_>) -> Result<Verdict, Fault> {
        self.check()?;
        let (value, claim) = measure(subject);
        Ok(Verdict { value, claim, quantity: Quantity::HoleWidthPx, passes: value < self.max_px })
    }

    fn next(&self, subject: &Subject<'_>, _cx: &Context<'_>) -> Result<Option<Vec3>, Fault> {
        self.check()?;
        if measure(subject).0 < self.max_px {
            return Ok(None);
        }
        let eyes = eyes(subject);
        if eyes.is_empty() {
            return Ok(Some(subject.cell.outline.centre));
        }
        let region = &subject.cell.outline.region;
        let places = solid(&half_spaces(region), &eyes).into_iter().map(|p| region.brought_in(p.as_vec3()));
        let farther = |best: Option<(Vec3, f64)>, p: Vec3| {
            let d = from_nearest(p.as_dvec3(), &eyes);
            // Of equal ones the first; a sample, after rounding, is none.
            if best.map_or(d > 0.0, |(_, b)| d > b) { Some((p, d)) } else { best }
        };
        Ok(places.fold(None, farther).map(|(p, _)| p))
    }
}

impl SelfOcclusion {
    fn check(&self) -> Result<(), Fault> {
        if self.max_px.is_nan() || self.max_px < 0.0 {
            return Err(Fault::Refused(format!("self-occlusion: max_px = {} is no number of pixels", self.max_px)));
        }
        Ok(())
    }
}

/// The distance to the nearest sample.
fn from_nearest(p: DVec3, eyes: &[DVec3]) -> f64 {
    eyes.iter().map(|e| e.distance(p)).fold(f64::INFINITY, f64::min)
}

/// R: the largest distance of a viewpoint from its nearest sample.
fn reach(region: &Region, corners: &[Vec3], eyes: &[DVec3]) -> f64 {
    // The distance from one point is convex: its largest value stands in a corner. From several it may stand between them.
    let between = if eyes.len() > 1 { solid(&half_spaces(region), eyes) } else { vec![] };
    let places = between.into_iter().chain(corners.iter().map(|c| c.as_dvec3()));
    places.map(|p| from_nearest(p, eyes)).fold(0.0, f64::max)
}

fn measure(subject: &Subject<'_>) -> (f64, f64) {
    let outline = &subject.cell.outline;
    if subject.facing.is_empty() {
        return (0.0, 0.0);
    }
    let Some(corners) = outline.region.corners() else { return (f64::INFINITY, f64::INFINITY) };
    let centre = outline.centre.as_dvec3();
    let sampled = eyes(subject);
    let eyes = if sampled.is_empty() { vec![centre] } else { sampled };
    let radius = reach(&outline.region, &corners, &eyes);
    let q = f64::from(subject.px_per_tan);

    let Some(axis) = (subject.bounds.centre().as_dvec3() - centre).try_normalize() else {
        return (f64::INFINITY, f64::INFINITY);
    };
    let from_centre = |p: &glam::Vec3| -> DVec3 { p.as_dvec3() - centre };
    let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in subject.facing {
        let along = from_centre(p).dot(axis);
        (near, far) = (near.min(along), far.max(along));
    }
    let value = published_px(radius, near, far - near, q);

    let from_region = f64::from(outline.region.distance(&subject.bounds));
    let stretch = f64::from(subject.views.half_diagonal_rad()).cos().powi(-2);
    let from = |eye: &DVec3| {
        let nearest = f64::from(subject.bounds.distance(eye.as_vec3()));
        let farthest = subject.facing.iter().map(|p| p.as_dvec3().distance(*eye)).fold(0.0, f64::max);
        bound_px(radius, from_region, nearest, (farthest - nearest).max(0.0), stretch, q)
    };
    (value, eyes.iter().map(from).fold(0.0, f64::max))
}

#[cfg(test)]
mod tests;
