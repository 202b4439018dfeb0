//! A folder as one scene: every model file in it, in the order of their names, in one coordinate frame. Folders in it are not
//! looked into, and files of other kinds (textures, notes) are passed over.

use std::path::{Path, PathBuf};

use farfield_core::id::MaterialId;

use super::part::Checked;
use super::{Counts, FORMATS, LoadError, LoadOptions, read_file, reader};

/// The model files of a folder, in the order of their names.
pub(super) fn files(folder: &Path) -> Result<Vec<PathBuf>, LoadError> {
    let failed = |cause| LoadError::Read { file: folder.to_owned(), cause };
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let mut files: Vec<PathBuf> = entries.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>().map_err(failed)?;
    files.retain(|f| f.is_file() && reader(f).is_ok());
    files.sort();
    if files.is_empty() {
        return Err(LoadError::unsupported(folder, "this folder", format!("holds no model file: {FORMATS}")));
    }
    Ok(files)
}

pub(super) fn read(folder: &Path, options: &LoadOptions) -> Result<Checked, LoadError> {
    let files = files(folder)?;
    let mut all = Checked {
        meshes: vec![],
        placements: vec![],
        materials: vec![],
        textures: vec![],
        warnings: vec![],
        counts: Counts::default(),
    };
    for file in files {
        append(&mut all, read_file(&file, options)?);
    }
    Ok(all)
}

/// Appends what a file holds: its meshes, materials and textures are numbered on.
fn append(all: &mut Checked, one: Checked) {
    let (meshes, materials, textures) = (all.meshes.len(), all.materials.len() as u32, all.textures.len() as u32);
    all.meshes.extend(one.meshes.into_iter().map(|mesh| {
        mesh.map(|(name, mut mesh)| {
            mesh.sections.iter_mut().for_each(|s| s.1 = MaterialId(s.1.0 + materials));
            (name, mesh)
        })
    }));
    all.placements.extend(one.placements.into_iter().map(|(i, transform)| (i + meshes, transform)));
    all.materials.extend(one.materials.into_iter().map(|mut m| {
        m.texture.iter_mut().for_each(|t| t.0 += textures);
        m
    }));
    all.textures.extend(one.textures);
    all.warnings.extend(one.warnings);
    let (c, o) = (&mut all.counts, one.counts);
    c.meshes += o.meshes;
    c.parts += o.parts;
    c.placed_parts += o.placed_parts;
    c.triangles += o.triangles;
    c.degenerate_triangles += o.degenerate_triangles;
    c.duplicate_triangles += o.duplicate_triangles;
}
