//! Claims: bounds that strategies and partitions state, and that the harness audits.

use serde::{Deserialize, Serialize};

use crate::id::LocalPayload;

/// What a claim bounds. A closed list: for each there is one measurement, taken at held-out viewpoints. Measuring samples,
/// so it can refute a claim and never prove it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Width of the widest hole (reference hit, candidate background), pixels.
    HoleWidthPx,
    /// Original triangles drawn in a frame.
    NearTriangles,
    /// Far surfaces that a viewpoint should see and does not, over the whole sphere of directions, steradians.
    #[serde(rename = "unseen_solid_angle_sr")]
    UnseenSolidAngle,
    /// How far the surface that a pixel shows lies from the original surface, as the picture shows that distance, and the other way round;
    /// pixels. What a splat covers beside its point does not count.
    SurfaceDistancePx,
}

impl Quantity {
    /// Its name with its unit, as results files spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::HoleWidthPx => "hole_width_px",
            Self::NearTriangles => "near_triangles",
            Self::UnseenSolidAngle => "unseen_solid_angle_sr",
            Self::SurfaceDistancePx => "surface_distance_px",
        }
    }
}

/// A bound, claimed of one payload or of the whole asset or cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Claim {
    /// Of what.
    pub quantity: Quantity,
    /// Of which payload; `None`: of all together.
    pub payload: Option<LocalPayload>,
    /// Never more than this, for any viewpoint of the cell.
    pub max: f64,
}
