//! Bringing a mesh from a file to the place and size that a scene wants it at. O(vertices).

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use farfield_core::mesh::TriangleMesh;

use super::GenerateError;

/// The direction of a file's coordinates that is up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Up {
    /// +y, as the scene has it.
    #[default]
    Y,
    /// +z.
    Z,
    /// -z.
    MinusZ,
}

impl Up {
    /// The rotation that brings it to +y.
    pub fn to_y(self) -> Mat3 {
        match self {
            Up::Y => Mat3::IDENTITY,
            Up::Z => Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y),
            Up::MinusZ => Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y),
        }
    }
}

/// Turns the mesh upright, then by `yaw_deg` about the vertical (counter-clockwise seen from above), scales it **uniformly** so
/// that its height is `size.y`, and puts it on y = 0, its box centred in x and z. Width and depth are what the mesh's
/// proportions make of them; `size.x` and `size.z` are not forced. Returns the scale.
///
/// # Errors
/// If the mesh is empty, has coordinates that are not finite, or is flat in the upward direction.
pub fn fit_to_box(mesh: &mut TriangleMesh, up: Up, yaw_deg: f32, size: Vec3) -> Result<f32, GenerateError> {
    let turn = (Mat3::from_rotation_y(yaw_deg.to_radians()) * up.to_y()).as_dmat3();
    let fail = |cause| Err(GenerateError::Fit { cause });
    if mesh.positions.is_empty() {
        return fail("it has no vertices");
    }
    if !mesh.positions.iter().all(|p| p.is_finite()) {
        return fail("it has coordinates that are not finite");
    }
    // In double precision: files far from their origin lose nothing before they are centred.
    let turned: Vec<_> = mesh.positions.iter().map(|p| turn * p.as_dvec3()).collect();
    let lo = turned.iter().copied().reduce(|a, b| a.min(b)).unwrap_or_default();
    let hi = turned.iter().copied().reduce(|a, b| a.max(b)).unwrap_or_default();
    let height = hi.y - lo.y;
    if height <= 1e-9 * (hi - lo).max_element() {
        return fail("it is flat in the upward direction");
    }
    let scale = f64::from(size.y) / height;
    let foot = glam::DVec3::new(0.5 * (lo.x + hi.x), lo.y, 0.5 * (lo.z + hi.z));
    mesh.positions = turned.iter().map(|&p| ((p - foot) * scale).as_vec3()).collect();
    let turn = turn.as_mat3();
    mesh.normals.iter_mut().for_each(|n| *n = turn * *n);
    Ok(scale as f32)
}
