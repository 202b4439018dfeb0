//! What a bake leaves beside its images: which is whose, where it stands, and how many samples it took.
//!
//! Encoded as JSON, readable by hand: some hundred bytes beside megabytes of samples.

use farfield_core::{Aabb, Fault};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// One cell's index.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Index {
    /// Its images, by window.
    pub pictures: Vec<Picture>,
}

/// A payload that is warped.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// Its id in the asset: the number of its window.
    pub payload: u32,
    /// The split that it belongs to.
    pub split: u32,
    /// The box of its samples, local frame.
    pub bounds: Aabb,
    /// The corners of its frustum between its nearest and its farthest sample, local frame.
    pub corners: [Vec3; 8],
    /// Bytes in memory.
    pub bytes: u64,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// How many of its pixels have a sample.
    pub covered: u64,
    /// Its samples.
    pub samples: u64,
    /// The most samples of a pixel.
    pub deepest: u32,
    /// Pixels of a view a pixel of the image: above 1 where it was taken with less than the window's density.
    pub coarse: f32,
    /// A bound of how far rounding of depths moves a sample's image, pixels, for eyes of the cell that are at most half-way to the
    /// nearest sample and look at it.
    pub rounding_px: f32,
    /// How many construction images it was made of, where a metric decided that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken: Option<u32>,
}

impl Index {
    pub(crate) fn encode(&self) -> Result<Vec<u8>, Fault> {
        serde_json::to_vec(self)
            .map_err(|e| Fault::Data { place: "index of layered-depth-image".into(), cause: e.to_string() })
    }

    /// Reads what a bake wrote; nothing gives an index of no images.
    ///
    /// # Errors
    /// [`Fault::Data`] where the bytes are something else.
    pub fn decode(place: &str, bytes: &[u8]) -> Result<Self, Fault> {
        if bytes.is_empty() {
            return Ok(Self::default());
        }
        serde_json::from_slice(bytes).map_err(|e| Fault::Data { place: place.to_owned(), cause: e.to_string() })
    }
}

impl Picture {
    /// How far samples may miss their place, pixels: half a pixel of the image, and rounding. Says nothing of what is missing.
    pub(crate) fn error_px(&self) -> f32 {
        0.5 * self.coarse + self.rounding_px
    }
}
