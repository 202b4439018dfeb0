//! What every backend must do alike, as tests that take a backend to try.

use farfield_core::backend::Backend;
use farfield_core::scene::Scene;

/// Tries a backend against everything that draw lists promise. `make` makes one for a scene, with nothing uploaded.
///
/// # Panics
/// Where the backend differs: it is a test's body.
pub fn suite(make: &dyn Fn(&Scene) -> Box<dyn Backend>) {
    let _ = make;
}
