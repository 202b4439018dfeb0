//! What every backend must do alike, as one test that takes the backend to try.
//!
//! Expectations are computed by hand, pixel by pixel, wherever a scene is simple enough; two scenes of random triangles are held
//! against the reference backend. Rasterisers and ray casters differ at silhouettes: nothing is asked of a pixel closer than a
//! pixel to an edge, and comparisons with the reference allow for a share of such pixels.
//!
//! What is fixed here beyond the words of `farfield_core::draw` and `payload`:
//! - Facing follows the winding in the local frame, after placement. A placement that mirrors turns front faces into back
//!   faces; whoever imports mirrored instances reverses their triangles.
//! - A two-sided surface's normal is turned when n . (point - eye) > 0, whatever its winding.
//! - A surface pass clears its target: albedo 0, normal 0, depth infinite, object 0 where nothing is drawn.
//! - Of layered depth images that cover a pixel at one depth the one drawn first is seen; a smoothed one averages over those pixels
//!   that it covers before every other image of the pass.
//! - At one depth triangles are seen before points and points before lines; of points, the one that comes first in its part.
//! - A pass without draws, a chunk without triangles and a part without triangles are no errors.

mod contract;
mod facing;
mod fixture;
mod geometry;
mod layered;
mod light;
mod paint;
mod primitives;
mod projected;
mod reference;

use farfield_core::backend::Backend;
use farfield_core::scene::Scene;

/// Makes a backend for a scene, with nothing uploaded.
pub type Make<'a> = &'a dyn Fn(&Scene) -> Box<dyn Backend>;

/// Tries a backend against everything that draw lists promise.
///
/// # Panics
/// Where the backend differs, saying in what: it is a test's body.
pub fn suite(make: Make<'_>) {
    let part = |name: &str, run: fn(Make<'_>)| {
        println!("conformance: {name}");
        run(make);
    };
    part("contract", contract::all);
    part("geometry", geometry::all);
    part("facing", facing::all);
    part("paint", paint::all);
    part("projected", projected::all);
    part("layered", layered::all);
    part("primitives", primitives::all);
    part("light", light::all);
    part("reference: soup", reference::soup);
    part("reference: instances", reference::instances);
}
