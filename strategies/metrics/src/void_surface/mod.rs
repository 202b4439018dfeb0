//! `void-surface`: the solid angle in which a viewpoint may see what no sample saw. It needs no reference picture.
//!
//! Follows Wilson and Manocha ("Simplifying complex environments using incremental textured depth meshes", 2003, sections 3.3 and
//! 3.5). Where depth jumps between neighbouring pixels of a sample ([`Joined`]) stands a *skin*, the border of the space that the
//! sample knows nothing of. Seen from a viewpoint V, a pixel belongs to the *global void surface* when for every sample i the nearest
//! skin of i lies before the nearest surface of all samples, and
//!
//! ```text
//! F(V) = sum of the solid angles of those pixels        steradians
//! ```
//!
//! F is evaluated at [`candidates`](crate::candidates); the largest value decides, and its place is the next sample. The paper stops at
//! 0.2 sr. [`Voids`] gives F anywhere.
//!
//! Deviations. Skins are *walls* along the rays between two pixels ([`Surface::walls`]), which have no area for their own sample, where
//! the paper triangulates between pixels' centres. Only what the void hides within the subject's bounds counts: a skin behind the
//! last of them hides nothing of it. Beside corners taken as samples there are candidates in corners that are none. A background is
//! endless space of which nothing is known behind a silhouette either: what stands alone before the sky has a void though
//! nothing may be there. Of a subject that fits one picture, an object or a window, F is counted in that picture, so that a
//! far one is counted as finely as a near one.
//!
//! F is an angle whatever the subject's size: 0.2 sr suit what is all round. An object's F lies below its own solid angle, and a hole
//! of n pixels takes n / q^2 of it, with q the view's pixels a unit of tangent (443 for 512 pixels of 60 degrees: 100 pixels
//! are 5e-4 sr).
//!
//! **F is an estimate.** A ray that passes through unknown space to a surface that some sample saw counts: something might stand
//! there (F too large; among hanging blocks by a fifth to a half). Test 2 marks surfaces seen at a grazing angle that were seen (F too large); a hole narrower than a pixel of a sample is
//! unknown (too small); between the candidates F may be larger. The claim is the value itself, and an audit may refute it. Beside the
//! pictures of a sample that is no whole cube nothing is known and nothing counted: samples that are windows have to hold the same
//! part of space, or the one that does not would clear what the others know to be hidden.
//!
//! Cost: O(n p) for n samples of p pixels, O(n^2) for edges that bend (test 3), then for every candidate O(n p) at worst; surfaces
//! are drawn only where walls of all samples overlap. A sample holds some 50 bytes a pixel meanwhile.
//!
//! [`Joined`]: farfield_core::panorama::Joined
//! [`Surface::walls`]: farfield_core::panorama::Surface::walls

mod drawn;
mod voids;

pub use voids::{Unseen, Voids};

use farfield_core::claim::Quantity;
use farfield_core::context::{Context, collect};
use farfield_core::panorama::SkinTests;
use farfield_core::region::Region;
use farfield_core::strategy::{Subject, Verdict, VisibilityMetric};
use farfield_core::{Aabb, Camera, Fault};
use glam::{DVec2, DVec3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::candidates::{half_spaces, planar, solid};

/// Where viewpoints are tried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Candidates {
    /// In the plane through the cell's centre: for a viewer who walks.
    #[default]
    #[serde(rename = "planar")]
    Planar,
    /// Anywhere in the region.
    #[serde(rename = "solid")]
    Solid,
}

/// The void surface under a solid angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VoidSurface {
    /// Samples serve a cell when no candidate sees more void than this; the paper's epsilon.
    #[serde(default = "fifth")]
    #[schemars(range(min = 0.0, max = 12.566), extend("unit" = "sr"))]
    pub max_sr: f64,
    /// An edge between two pixels at a smaller angle to the view ray is a skin.
    #[serde(default = "five")]
    #[schemars(range(min = 0.0, max = 90.0), extend("unit" = "deg"))]
    pub alpha_deg: f32,
    /// An edge that reaches farther is a skin; by default none is for that.
    #[serde(default)]
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub far: Option<f32>,
    /// Edge of the six pictures in which the void is counted; where the subject fits one picture, that one's longer edge.
    #[serde(default = "faces")]
    #[schemars(range(min = 8, max = 4096), extend("unit" = "px"))]
    pub face_px: u32,
    /// Where viewpoints are tried: in the plane of the cell's centre, as published, or in its whole region.
    #[serde(default)]
    pub candidates: Candidates,
}

fn fifth() -> f64 {
    0.2
}

fn five() -> f32 {
    5.0
}

fn faces() -> u32 {
    128
}

impl Default for VoidSurface {
    fn default() -> Self {
        Self { max_sr: fifth(), alpha_deg: five(), far: None, face_px: faces(), candidates: Candidates::default() }
    }
}

/// Heights that differ by less than this share of what is seen are one: rounding of 32-bit positions.
const LEVEL: f32 = 1e-6;

/// The most void there can be: all around.
const ALL_SR: f64 = 4.0 * std::f64::consts::PI;

impl VoidSurface {
    /// The tests for skins that need no other sample.
    pub fn skin_tests(&self) -> SkinTests {
        SkinTests { far: self.far.unwrap_or(f32::INFINITY), alpha_rad: self.alpha_deg.to_radians() }
    }

    /// The candidates for another sample, sorted by their coordinates.
    ///
    /// # Errors
    /// [`Fault::Refused`] for a region without bound.
    pub fn places(&self, subject: &Subject<'_>) -> Result<Vec<Vec3>, Fault> {
        let outline = &subject.cell.outline;
        let eyes = eyes(subject);
        let found: Vec<Vec3> = match (&outline.region, self.candidates) {
            (Region::Everywhere, _) => {
                return Err(Fault::Refused(format!(
                    "void-surface: the region of cell {} has no bound, so that no viewpoint is farthest from the samples",
                    outline.id.0
                )));
            }
            (region, Candidates::Planar) => {
                // A sample above or below a place does not stand there.
                let b = subject.bounds.union(Aabb::of(eyes.iter().map(|e| e.as_vec3())));
                let level = f64::from(LEVEL * b.size().max_element());
                let beside = |e: &&DVec3| (e.y - f64::from(outline.centre.y)).abs() <= level;
                let flat: Vec<DVec2> = eyes.iter().filter(beside).map(|e| DVec2::new(e.x, e.z)).collect();
                let up = |p: DVec2| Vec3::new(p.x as f32, outline.centre.y, p.y as f32);
                planar(&region.footprint(), &flat).into_iter().map(up).collect()
            }
            (region, Candidates::Solid) => solid(&half_spaces(region), &eyes).into_iter().map(DVec3::as_vec3).collect(),
        };
        let mut places = vec![];
        for p in found.into_iter().map(|p| outline.region.brought_in(p)) {
            if !places.contains(&p) && !eyes.contains(&p.as_dvec3()) {
                places.push(p);
            }
        }
        Ok(places)
    }

    /// The candidate with the largest F, and F there; `None` where there is none.
    fn worst(&self, subject: &Subject<'_>, cx: &Context<'_>) -> Result<Option<(Vec3, f64)>, Fault> {
        self.check()?;
        let places = self.places(subject)?;
        if subject.samples.is_empty() {
            return Ok(Some((subject.cell.outline.centre, ALL_SR)));
        }
        if places.is_empty() {
            return Ok(None);
        }
        let voids = Voids::new(subject.samples, subject.bounds, &self.skin_tests(), cx)?;
        let near = subject.views.near;
        let values = collect(cx.run, places.len(), &|i| {
            cx.check()?;
            let eye = places[i].as_dvec3();
            let cameras = match framed(eye, &subject.bounds, self.face_px, near) {
                Some(camera) => vec![camera],
                None => Camera::cube(eye, self.face_px, near).to_vec(),
            };
            Ok(voids.unseen_in(cameras).sr)
        })?;
        // Of equal ones the first.
        let first = |best: Option<(Vec3, f64)>, now: (Vec3, f64)| Some(best.filter(|b| b.1 >= now.1).unwrap_or(now));
        Ok(places.into_iter().zip(values).fold(None, first))
    }

    fn check(&self) -> Result<(), Fault> {
        let refuse = |what: String| Err(Fault::Refused(format!("void-surface: {what}")));
        if !(0.0..=ALL_SR).contains(&self.max_sr) {
            return refuse(format!("max_sr = {} is no solid angle", self.max_sr));
        }
        if !(0.0..=90.0).contains(&self.alpha_deg) {
            return refuse(format!("alpha_deg = {} is no angle between a ray and an edge", self.alpha_deg));
        }
        if !(8..=4096).contains(&self.face_px) {
            return refuse(format!("face_px = {} is not within 8..=4096", self.face_px));
        }
        if self.far.is_some_and(|f| f.is_nan() || f <= 0.0) {
            return refuse("far is no distance".into());
        }
        Ok(())
    }
}

/// The picture that just holds the bounds; `None` where they do not lie ahead within [`WIDEST_TAN`].
fn framed(eye: DVec3, bounds: &Aabb, face_px: u32, near: f32) -> Option<Camera> {
    let axis = (bounds.centre().as_dvec3() - eye).as_vec3();
    // Rounding outwards takes two pixels at most.
    let around = |px_per_tan: f32| Camera::around(eye, axis, bounds.corners(), px_per_tan, 0, near);
    let fine = around(FINE)?;
    let reach = [-fine.left, fine.right_tan, -fine.bottom, fine.top].into_iter().fold(0.0, f32::max);
    let extent = (fine.right_tan - fine.left).max(fine.top - fine.bottom);
    if reach.partial_cmp(&WIDEST_TAN) != Some(std::cmp::Ordering::Less) {
        return None;
    }
    around((face_px - 2) as f32 / extent)
}

/// A subject that reaches farther from the middle of a picture is counted all round: one picture's pixels would differ too much.
const WIDEST_TAN: f32 = 2.0;

/// Pixels a unit of tangent at which a subject's extent is measured.
const FINE: f32 = (1u32 << 20) as f32;

/// Where the samples were taken.
pub(crate) fn eyes(subject: &Subject<'_>) -> Vec<DVec3> {
    subject.samples.chunk_by(|a, b| a.0.eye == b.0.eye).map(|views| views[0].0.eye).collect()
}

#[typetag::serde(name = "void-surface")]
impl VisibilityMetric for VoidSurface {
    fn judge(&self, subject: &Subject<'_>, cx: &Context<'_>) -> Result<Verdict, Fault> {
        let value = self.worst(subject, cx)?.map_or(0.0, |(_, sr)| sr);
        Ok(Verdict { value, claim: value, quantity: Quantity::UnseenSolidAngle, passes: value <= self.max_sr })
    }

    fn next(&self, subject: &Subject<'_>, cx: &Context<'_>) -> Result<Option<Vec3>, Fault> {
        Ok(self.worst(subject, cx)?.filter(|(_, sr)| *sr > self.max_sr).map(|(at, _)| at))
    }
}
