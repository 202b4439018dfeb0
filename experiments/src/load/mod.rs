//! Model files to scenes: OBJ with MTL and textures, PLY (ascii and binary, faces and triangle strips, vertex colours),
//! glTF and GLB with instances, STL; any of them gzipped.
//!
//! A file either loads, with warnings for what was left out or guessed, or is refused with the file, the place and the
//! cause. Nothing panics on bad bytes, and no header can ask for more memory than the file could fill.
//!
//! Decisions. Colours: textures and vertex colours are sRGB (glTF vertex colours are linear and are encoded); `Kd` of MTL
//! is taken as sRGB, and a texture replaces it, since most exporters write the texture's mean or a preview there; glTF
//! factors are linear. Texture coordinates of OBJ and PLY are flipped to a top-left origin. Normals that a file does not
//! give stay empty and are made by the core; where it gives some, the others are made smooth here. STL facets are welded
//! and their normals dropped. Models larger than memory are read piece by piece ([`stream`]). Alpha, metalness, skins, morphs and animations are not used. Limits: 32-bit indices, gzip
//! streams of at most 2 GiB.

mod bytes;
mod error;
mod folder;
mod gltf;
mod gltf_accessor;
mod gltf_stream;
mod mtl;
mod obj;
mod part;
mod ply;
mod polygon;
mod sink;
mod stl;
pub mod stream;
mod texture;

use std::path::Path;

use farfield_core::id::MaterialId;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Placement, SceneBuilder, Texture};
use glam::{DAffine3, DMat3, DVec3, Vec3};

pub use error::LoadError;
use part::Checked;

/// The formats that [`load`] reads, for messages.
pub const FORMATS: &str = ".obj, .ply, .gltf, .glb and .stl, each also as .gz";

/// Which axis of a file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Y, as in glTF and in this project.
    #[default]
    Y,
    /// Z: turned by -90 degrees about X, so that (x, y, z) becomes (x, z, -y).
    Z,
}

/// How to load a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Which of the file's axes points up.
    pub up: Up,
    /// Scene units in one unit of the file; finite and above 0.
    pub scale: f64,
    /// Whether surfaces are seen from behind too. `None`: as each glTF material says, and true for the other formats.
    pub two_sided: Option<bool>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { up: Up::Y, scale: 1.0, two_sided: None }
    }
}

/// What was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Meshes with triangles.
    pub meshes: usize,
    /// Runs of one material over all meshes.
    pub parts: usize,
    /// Runs of one material over all placements.
    pub placed_parts: usize,
    /// Triangles over all placements.
    pub triangles: usize,
    /// Triangles without area, kept out (once a mesh).
    pub degenerate_triangles: usize,
    /// Triangles that stand where one before them does, kept (once a mesh).
    pub duplicate_triangles: usize,
}

/// A loaded file.
pub struct Imported {
    /// Meshes, placements, materials and textures.
    pub builder: SceneBuilder,
    /// What was left out or guessed.
    pub warnings: Vec<String>,
    /// What was read.
    pub counts: Counts,
}

/// Loads a file, or all model files of a folder, as a scene: meshes in the file's own space, placed by 64-bit transforms that include the options' axes and scale.
///
/// # Errors
/// [`LoadError`] with the file, the place in it and the cause.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Imported, LoadError> {
    let root = root(path, options)?;
    let file = read(path, options)?;
    let mut builder = SceneBuilder::default();
    (builder.materials, builder.textures) = (file.materials, file.textures);
    let mut add = |name: &str, mesh: TriangleMesh| {
        builder.mesh(name, mesh).map_err(|e| LoadError::data(path, "meshes", e.to_string()))
    };
    // A mirrored placement would turn its triangles inside out: it gets a mirrored mesh, so that no placement mirrors.
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mut placements = vec![];
    let mut ids = vec![[None; 2]; file.meshes.len()];
    for (i, transform) in file.placements {
        let (name, mesh) = file.meshes[i].as_ref().expect("placements of empty meshes are gone");
        let mirrored = transform.matrix3.determinant() < 0.0;
        let id = match ids[i][usize::from(mirrored)] {
            Some(id) => id,
            None if mirrored => add(&format!("{name} (mirrored)"), merge(&[(mesh, mirror)]))?,
            None => add(name, mesh.clone())?,
        };
        ids[i][usize::from(mirrored)] = Some(id);
        placements.push((id, if mirrored { transform * mirror } else { transform }));
    }
    for (mesh, transform) in placements {
        builder.place(Placement { mesh, transform: root * transform });
    }
    Ok(Imported { builder, warnings: file.warnings, counts: file.counts })
}

/// Loads a file as one mesh: everything it places, transformed and merged, with its materials and textures.
///
/// # Errors
/// [`LoadError`] with the file, the place in it and the cause.
pub fn load_mesh(path: &Path, options: &LoadOptions) -> Result<(TriangleMesh, Vec<Material>, Vec<Texture>), LoadError> {
    let root = root(path, options)?;
    let file = read(path, options)?;
    let placed: Vec<(&TriangleMesh, DAffine3)> = file
        .placements
        .iter()
        .map(|(i, m)| (&file.meshes[*i].as_ref().expect("placements of empty meshes are gone").1, root * *m))
        .collect();
    let (vertices, indices) = placed.iter().fold((0, 0), |(v, i), (m, _)| (v + m.positions.len(), i + m.indices.len()));
    if vertices.max(indices) > u32::MAX as usize {
        let cause = format!("{vertices} vertices and {indices} indices are too many for one mesh: load it as a scene");
        return Err(LoadError::data(path, "all placements", cause));
    }
    let mesh = merge(&placed);
    if let Some(i) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return Err(LoadError::data(path, format!("vertex {i}"), "is not finite once scaled and placed"));
    }
    Ok((mesh, file.materials, file.textures))
}

/// One mesh of everything placed, in the order of the placements; triangles that a mirroring turns inside out are turned back.
///
/// # Panics
/// With more than 2^32 vertices or indices in all (the first is checked where wrapping would be silent).
pub fn merge(placed: &[(&TriangleMesh, DAffine3)]) -> TriangleMesh {
    let mut out = TriangleMesh::default();
    let some = |f: fn(&TriangleMesh) -> bool| placed.iter().any(|(m, _)| !f(m));
    let (normals, uvs, colors) =
        (some(|m| m.normals.is_empty()), some(|m| m.uvs.is_empty()), some(|m| m.colors.is_empty()));
    let mut runs: Vec<(MaterialId, Vec<u32>)> = vec![];
    for (mesh, transform) in placed {
        let first = u32::try_from(out.positions.len()).expect("at most 2^32 vertices");
        out.positions.extend(mesh.positions.iter().map(|p| transform.transform_point3(p.as_dvec3()).as_vec3()));
        let n = mesh.positions.len();
        if normals {
            // Normals turn by the inverse transpose: n' = (M^-1)^T n.
            let turn: DMat3 = transform.matrix3.inverse().transpose();
            let mut smooth = TriangleMesh::default();
            let given = if mesh.normals.is_empty() {
                smooth.clone_from(mesh);
                smooth.smooth_normals();
                &smooth.normals
            } else {
                &mesh.normals
            };
            out.normals
                .extend(given.iter().map(|n| (turn * n.as_dvec3()).try_normalize().map_or(Vec3::Y, |n| n.as_vec3())));
        }
        if uvs {
            out.uvs.extend_from_slice(&mesh.uvs);
            out.uvs.resize(out.positions.len(), glam::Vec2::ZERO);
        }
        if colors {
            out.colors.extend_from_slice(&mesh.colors);
            out.colors.resize(out.positions.len(), [255; 4]);
        }
        debug_assert_eq!(out.positions.len(), first as usize + n);
        let mirrored = transform.matrix3.determinant() < 0.0;
        for (range, material) in &mesh.sections {
            let at = runs.iter().position(|r| r.0 == *material).unwrap_or_else(|| {
                runs.push((*material, vec![]));
                runs.len() - 1
            });
            for t in mesh.indices[range.start as usize..range.end as usize].chunks_exact(3) {
                let t = if mirrored { [t[0], t[2], t[1]] } else { [t[0], t[1], t[2]] };
                runs[at].1.extend(t.map(|v| first + v));
            }
        }
    }
    for (material, indices) in runs {
        let start = out.indices.len() as u32;
        out.indices.extend(indices);
        out.sections.push((start..out.indices.len() as u32, material));
    }
    out
}

fn root(path: &Path, options: &LoadOptions) -> Result<DAffine3, LoadError> {
    if !(options.scale.is_finite() && options.scale > 0.0) {
        return Err(LoadError::data(path, "option scale", format!("{} is not finite and above 0", options.scale)));
    }
    let turn = match options.up {
        Up::Y => DMat3::IDENTITY,
        Up::Z => DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y),
    };
    Ok(DAffine3::from_mat3(turn * options.scale))
}

fn read(path: &Path, options: &LoadOptions) -> Result<Checked, LoadError> {
    if path.is_dir() { folder::read(path, options) } else { read_file(path, options) }
}

type Reader = fn(&Path, &[u8]) -> Result<part::Model, LoadError>;

/// What reads a file, by its name.
fn reader(path: &Path) -> Result<Reader, LoadError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let stem = name.strip_suffix(".gz").unwrap_or(&name);
    Ok(match stem.rsplit_once('.').map(|(_, e)| e) {
        Some("obj") => obj::read,
        Some("ply") => ply::read,
        Some("stl") => stl::read,
        Some("gltf" | "glb") => gltf::read,
        other => {
            let cause = format!("cannot be loaded; supported are {FORMATS}");
            let place = other.map_or("a name without extension".to_owned(), |e| format!("format .{e}"));
            return Err(LoadError::unsupported(path, place, cause));
        }
    })
}

fn read_file(path: &Path, options: &LoadOptions) -> Result<Checked, LoadError> {
    let mut model = reader(path)?(path, &bytes::read(path)?)?;
    if let Some(two_sided) = options.two_sided {
        model.materials.iter_mut().for_each(|m| m.two_sided = two_sided);
    }
    model.check(path)
}

/// A two-sided plain material, for formats that have none.
fn plain(name: &str) -> Material {
    Material { name: name.into(), two_sided: true, ..Default::default() }
}

#[cfg(test)]
mod tests;
