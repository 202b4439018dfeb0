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

use farfield_core::Fault;
use farfield_core::claim::Quantity;
use farfield_core::context::Context;
use farfield_core::strategy::{Subject, Verdict, VisibilityMetric};
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
        if self.max_px.is_nan() || self.max_px < 0.0 {
            return Err(Fault::Refused(format!("self-occlusion: max_px = {} is no number of pixels", self.max_px)));
        }
        let (value, claim) = measure(subject);
        Ok(Verdict { value, claim, quantity: Quantity::HoleWidthPx, passes: value < self.max_px })
    }
}

fn measure(subject: &Subject<'_>) -> (f64, f64) {
    let outline = &subject.cell.outline;
    if subject.facing.is_empty() {
        return (0.0, 0.0);
    }
    let Some(corners) = outline.region.corners() else { return (f64::INFINITY, f64::INFINITY) };
    let centre = outline.centre.as_dvec3();
    let radius = corners.iter().map(|c| c.as_dvec3().distance(centre)).fold(0.0, f64::max);
    let q = f64::from(subject.px_per_tan);

    let Some(axis) = (subject.bounds.centre().as_dvec3() - centre).try_normalize() else {
        return (f64::INFINITY, f64::INFINITY);
    };
    let from_centre = |p: &glam::Vec3| -> DVec3 { p.as_dvec3() - centre };
    let (mut near, mut far, mut farthest) = (f64::INFINITY, f64::NEG_INFINITY, 0f64);
    for p in subject.facing {
        let v = from_centre(p);
        let along = v.dot(axis);
        (near, far, farthest) = (near.min(along), far.max(along), farthest.max(v.length()));
    }
    let value = published_px(radius, near, far - near, q);

    let from_region = f64::from(outline.region.distance(&subject.bounds));
    let nearest = f64::from(subject.bounds.distance(outline.centre));
    let stretch = f64::from(subject.views.half_diagonal_rad()).cos().powi(-2);
    let depth = (farthest - nearest).max(0.0);
    (value, bound_px(radius, from_region, nearest, depth, stretch, q))
}

#[cfg(test)]
mod tests;
