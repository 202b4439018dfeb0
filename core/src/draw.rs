//! Draw lists: a frame as plain data. Strategies write them, backends carry them out.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::id::{PayloadRef, TargetId};
use crate::scene::{ChunkSet, Light};
use crate::{Aabb, Camera};

/// A frame: passes in order.
#[derive(Clone, Debug, Default)]
pub struct DrawList {
    /// The passes, first to last.
    pub passes: Vec<Pass>,
}

/// One pass. It writes one target and may read others that earlier passes wrote.
#[derive(Clone, Debug)]
pub struct Pass {
    /// What it does.
    pub kind: PassKind,
    /// Through which camera; its size is the written target's.
    pub camera: Camera,
    /// The target it fills; cleared first.
    pub writes: TargetId,
    /// What it draws (surface passes).
    pub draws: Vec<Draw>,
}

/// The kinds of passes.
#[derive(Clone, Debug)]
pub enum PassKind {
    /// Fills albedo, normal, linear depth and object number.
    Surface,
    /// Lights the surface target it names; the same for every pipeline.
    Shade {
        /// The surface target that is lit.
        surface: TargetId,
        /// Lights and background.
        shading: Shading,
    },
}

/// One thing to draw. `bounds` and `error_px` say what a later pass must know of it, whatever strategy drew it.
#[derive(Clone, Debug)]
pub struct Draw {
    /// What.
    pub what: DrawWhat,
    /// Its box in the local frame.
    pub bounds: Aabb,
    /// The error it was drawn with, pixels.
    pub error_px: f32,
}

/// What can be drawn.
#[derive(Clone, Debug)]
pub enum DrawWhat {
    /// Placed chunks of original geometry.
    Chunks(ChunkSet),
    /// A drawable part (not an atlas) of a payload.
    Payload {
        /// The payload.
        id: PayloadRef,
        /// The index of the part.
        part: u16,
        /// What the object plane says of its pixels: object number + 1, never 0. The samples of a layered part have their own:
        /// 0 there.
        object: u32,
    },
}

/// Lights and background of a shading pass: colour = albedo * (ambient + sum over lights of light * max(0, n . to_light)),
/// linear light, Lambert, so that it does not depend on the eye. Nothing hit: `sky` where the ray rises, `ground` where it
/// falls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shading {
    /// Linear ambient light.
    pub ambient: Vec3,
    /// At most [`Shading::MAX_LIGHTS`].
    pub lights: Vec<Light>,
    /// sRGB background above the horizon.
    pub sky: [u8; 3],
    /// sRGB background below the horizon.
    pub ground: [u8; 3],
}

impl Shading {
    /// How many lights a shading pass takes.
    pub const MAX_LIGHTS: usize = 8;
}
