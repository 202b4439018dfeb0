//! Scenes to model files: GLB (instances as nodes), OBJ with MTL (instances baked), binary PLY (baked, colours in the vertices).
//!
//! What is read back by [`crate::load`] is the same scene; the tests hold that. Deterministic: same scene, same bytes.

mod glb;
mod obj;
mod ply;

use std::path::{Path, PathBuf};

use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Texture};
use glam::DAffine3;

/// A scene to be written. Sections name materials by index; where `materials` is empty, all is one default material.
#[derive(Clone, Copy, Debug)]
pub struct Export<'a> {
    /// Meshes with their names.
    pub meshes: &'a [(String, TriangleMesh)],
    /// Meshes and where they stand.
    pub placements: &'a [(usize, DAffine3)],
    /// Materials.
    pub materials: &'a [Material],
    /// Textures; PLY does not hold them.
    pub textures: &'a [Texture],
}

/// Why a scene was not written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file could not be written.
    #[error("{}: cannot be written: {cause}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The file's format is not one that is written, or cannot hold the scene.
    #[error("{}: {cause}", file.display())]
    Unsupported {
        /// The file.
        file: PathBuf,
        /// What is not supported.
        cause: String,
    },
}

/// Writes a scene in the format that the path's extension names: `.glb`, `.obj` or `.ply`.
///
/// # Errors
/// [`ExportError`] with the file and the cause: a format that is not written, a placement, section or texture that names
/// something that is not there, a scene too large for the format's 32-bit counts, or the system's.
pub fn export(path: &Path, scene: &Export) -> Result<(), ExportError> {
    let refused = |cause: String| ExportError::Unsupported { file: path.to_owned(), cause };
    scene.check().map_err(refused)?;
    let written = match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("glb") => std::fs::write(path, glb::bytes(scene).map_err(refused)?),
        Some("obj") => obj::write(path, scene),
        Some("ply") => std::fs::write(path, ply::bytes(scene).map_err(refused)?),
        _ => return Err(refused("scenes are written as .glb, .obj or .ply".into())),
    };
    written.map_err(|cause| ExportError::Write { file: path.to_owned(), cause })
}

impl Export<'_> {
    fn check(&self) -> Result<(), String> {
        for (i, (mesh, transform)) in self.placements.iter().enumerate() {
            if *mesh >= self.meshes.len() || !transform.is_finite() {
                return Err(format!("placement {i} names mesh {mesh} of {}, or is not finite", self.meshes.len()));
            }
        }
        for (name, m) in self.meshes {
            let n = m.positions.len();
            let whole = |len: usize| len == 0 || len == n;
            if !(whole(m.normals.len()) && whole(m.uvs.len()) && whole(m.colors.len())) {
                return Err(format!("mesh \"{name}\": attributes are not one a vertex"));
            }
            if m.indices.iter().any(|&i| i as usize >= n) {
                return Err(format!("mesh \"{name}\": an index is out of range"));
            }
            for (r, id) in &m.sections {
                if r.end as usize > m.indices.len() || r.start > r.end || r.start % 3 != 0 || r.end % 3 != 0 {
                    return Err(format!("mesh \"{name}\": a section is out of range"));
                }
                if !self.materials.is_empty() && id.index() >= self.materials.len() {
                    return Err(format!("mesh \"{name}\": material {} of {}", id.0, self.materials.len()));
                }
            }
        }
        match self.materials.iter().find(|m| m.texture.is_some_and(|t| t.index() >= self.textures.len())) {
            Some(m) => Err(format!("material \"{}\": its texture does not exist", m.name)),
            None => Ok(()),
        }
    }
}

/// A texture as a PNG file.
fn png(t: &Texture) -> Result<Vec<u8>, image::ImageError> {
    use image::ImageEncoder;
    let mut out = vec![];
    let rgba: &[u8] = bytemuck::cast_slice(&t.rgba);
    image::codecs::png::PngEncoder::new(&mut out).write_image(
        rgba,
        t.size[0],
        t.size[1],
        image::ExtendedColorType::Rgba8,
    )?;
    Ok(out)
}

#[cfg(test)]
mod tests;
