//! Model files larger than memory: read once, cut into a chunk file, and used from there.
//!
//! PLY and OBJ, also gzipped, and glTF and GLB. A reader gives positions, attributes and faces one after another ([`intake`]);
//! what is too much for memory waits in temporary files ([`array`], [`spill`]); each mesh is welded and divided there until its
//! parts fit ([`weld`], [`cut`]). The chunks, names and normals are bit for bit those of the same file in memory, and so is the
//! scene's digest. In memory: what `memory_bytes` allows, the tables of the scene (about 120 bytes a chunk), 3/16 of a byte a
//! vertex, textures, and 24 bytes for each run of faces with one material. On disk, for as long as it takes, about 100 bytes a triangle
//! of a PLY file and 200 of an OBJ file.
//!
//! The chunk file is in the store, `scenes/`, by the digest of the input's contents; files beside the input (material libraries,
//! textures, buffers) are named in it with theirs and looked at again when it is opened.
//!
//! Limits: 2^32 vertices and triangles a file. Not streamed: STL, whose corners have to be welded before anything is known of its vertices. Duplicate triangles are kept, as in
//! memory, but not counted.

mod array;
mod cut;
mod intake;
mod spill;
#[cfg(test)]
mod tests;
mod weld;

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use farfield_core::id::TextureId;
use farfield_core::scene::{Placement, SceneBuilder, Texture};
use glam::{DAffine3, DVec3};

use self::cut::{MIRROR, Scope};
use self::intake::Intake;
use super::bytes::Input;
use super::sink::Corner;
use super::texture::Textures;
use super::{LoadError, LoadOptions, folder, gltf, obj, ply, root};
use crate::chunks::{ChunkFile, Kept, Writer, identity};
use crate::store::{Store, hex, key};

/// Part of every chunk file's key: other rules of reading or cutting are another version.
const VERSION: &[u8] = b"1";

/// Bytes of the limit for each triangle that is looked at at once: its corners, positions, sums and numbers, several times over.
const BYTES_A_TRIANGLE: u64 = 640;

/// What is said of files that cannot be read piece by piece.
const WHOLE: &str = "is loaded whole only: set out_of_core = false in [scene], or convert the file";

/// What cutting gets.
pub struct Work<'a> {
    /// Where temporary files are.
    folder: &'a Path,
    /// About what is held.
    memory_bytes: u64,
    /// Triangles that are looked at at once.
    batch: usize,
    cancel: &'a AtomicBool,
}

impl<'a> Work<'a> {
    fn new(folder: &'a Path, memory_bytes: u64, cancel: &'a AtomicBool) -> Self {
        // A batch is a few chunks at least.
        let batch = (memory_bytes / BYTES_A_TRIANGLE).clamp(8 << 10, 4 << 20) as usize;
        Self { folder, memory_bytes, batch, cancel }
    }

    fn go_on(&self) -> io::Result<()> {
        go_on(self.cancel)
    }
}

/// An error of the kind that means it, once somebody wants it to stop.
pub(crate) fn go_on(cancel: &AtomicBool) -> io::Result<()> {
    match cancel.load(Ordering::Relaxed) {
        true => Err(io::ErrorKind::Interrupted.into()),
        false => Ok(()),
    }
}

/// Where and how scenes larger than memory are kept.
pub struct Keep<'a> {
    /// The store.
    pub store: &'a Store,
    /// The most bytes of chunks, and about the most while the file is cut.
    pub memory_bytes: u64,
    /// Set to stop.
    pub cancel: &'a AtomicBool,
    /// Told when a file is cut.
    pub say: &'a (dyn Fn(&str) + Sync),
}

impl Keep<'_> {
    fn digest(&self, file: &Path) -> Result<[u8; 32], LoadError> {
        identity::digest(self.store, file, &|| go_on(self.cancel)).map_err(|cause| match cause.kind() {
            io::ErrorKind::Interrupted => LoadError::Cancelled,
            _ => LoadError::Read { file: file.to_owned(), cause },
        })
    }
}

/// A scene on disk.
pub struct Streamed {
    /// Meshes, placements, materials and textures; their chunks are in the file.
    pub builder: SceneBuilder,
    /// The way to the chunks.
    pub file: ChunkFile,
    /// What was left out or guessed.
    pub warnings: Vec<String>,
}

/// The bytes of a file or of a folder's model files, with the buffers that glTF files name, gzipped ones counted threefold; `None` where one of them cannot be read piece by piece.
///
/// # Errors
/// What looking at the files gives.
pub fn bytes(path: &Path) -> Result<Option<u64>, LoadError> {
    let files = if path.is_dir() { folder::files(path)? } else { vec![path.to_owned()] };
    let mut sum = 0;
    for file in files {
        if Format::of(&file).is_none() {
            return Ok(None);
        }
        let unpacks = if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) { 3 } else { 1 };
        if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf")) {
            sum += buffers(&file);
        }
        sum += unpacks * std::fs::metadata(&file).map_err(|cause| LoadError::Read { file, cause })?.len();
    }
    Ok(Some(sum))
}

/// The bytes of all buffers that a glTF file names; 0 where it cannot be read, which loading will tell.
fn buffers(file: &Path) -> u64 {
    let json = super::bytes::read(file).ok().and_then(|b| serde_json::from_slice::<serde_json::Value>(&b).ok());
    let all = json.as_ref().and_then(|j| j["buffers"].as_array());
    all.into_iter().flatten().filter_map(|b| b["byteLength"].as_u64()).fold(0, u64::saturating_add)
}

#[derive(Clone, Copy)]
enum Format {
    Ply,
    Obj,
    Gltf,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let stem = name.strip_suffix(".gz").unwrap_or(&name);
        match stem.rsplit_once('.')?.1 {
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// Opens a file, or all model files of a folder, as a scene on disk; cuts it first where the store has no chunk file of it.
///
/// # Errors
/// [`LoadError`] with the file, the place in it and the cause. An unfinished chunk file is not left behind.
pub fn open(path: &Path, options: &LoadOptions, keep: &Keep<'_>) -> Result<Streamed, LoadError> {
    let root = root(path, options)?;
    let files = if path.is_dir() { folder::files(path)? } else { vec![path.to_owned()] };
    let mut digests = vec![];
    for f in &files {
        digests.push(keep.digest(f)?);
    }
    let parts: Vec<&[u8]> = std::iter::once(VERSION).chain(digests.iter().map(<[u8; 32]>::as_slice)).collect();
    let name = key("chunks", &parts);
    let home = keep.store.root().join("scenes");
    let home = home.join(hex(&name) + ".chunks");
    let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
    let known = home.exists().then(|| ChunkFile::open(&home, keep.memory_bytes));
    let file = match known {
        Some(Ok(f)) if beside_is(f.kept(), folder, keep) => f,
        other => {
            if let Some(Err(e)) = other {
                (keep.say)(&format!("{e}; it is made anew"));
            }
            (keep.say)(&format!("{} is cut into chunks, kept in {}", path.display(), home.display()));
            make(&files, &digests, folder, &home, keep)?;
            ChunkFile::open(&home, keep.memory_bytes).map_err(|e| LoadError::kept(&home, e))?
        }
    };
    let kept = file.kept();
    let mut builder = SceneBuilder::default();
    builder.materials.clone_from(&kept.materials);
    builder.textures = file.textures().map_err(|e| LoadError::kept(&home, e))?;
    if let Some(two_sided) = options.two_sided {
        builder.materials.iter_mut().for_each(|m| m.two_sided = two_sided);
    }
    let ids: Vec<_> = kept.meshes.iter().map(|m| builder.kept(m.clone())).collect();
    for (mesh, columns) in &kept.placements {
        let transform = root * DAffine3::from_cols_array(columns);
        builder.place(Placement { mesh: ids[*mesh as usize], transform });
    }
    let warnings = kept.warnings.clone();
    Ok(Streamed { builder, file, warnings })
}

/// Whether the files beside the input are those that a chunk file was made with.
fn beside_is(kept: &Kept, folder: &Path, keep: &Keep<'_>) -> bool {
    kept.beside.iter().all(|(name, digest)| keep.digest(&folder.join(name)).ok() == *digest)
}

/// A file for positioned reads: itself, or what a gzipped one unpacks to.
fn unpacked(file: &Path, folder: &Path) -> Result<File, LoadError> {
    let failed = |cause| LoadError::Read { file: file.to_owned(), cause };
    let mut input = Input::open(file)?;
    if input.left().is_some() {
        return File::open(file).map_err(failed);
    }
    let mut out = tempfile::tempfile_in(folder).map_err(|e| LoadError::temporary(folder, e))?;
    let copied = io::copy(&mut input, &mut out);
    copied.map_err(|e| LoadError::data(file, "gzip stream", e.to_string()))?;
    Ok(out)
}

/// A file that has been read.
struct Read<'a, C> {
    intake: Intake<'a, C>,
    textures: Textures,
    beside: gltf::Beside,
    /// Whether all meshes stand in one space, once each.
    flat: bool,
}

/// Cuts `files`, whose contents are known by `digests`, into the chunk file `home`.
fn make(files: &[PathBuf], digests: &[[u8; 32]], folder: &Path, home: &Path, keep: &Keep<'_>) -> Result<(), LoadError> {
    let aside = keep.store.aside();
    let work = Work::new(&aside, keep.memory_bytes, keep.cancel);
    let failed = |e| LoadError::temporary(&aside, e);
    let mut writer = Writer::new(&aside).map_err(failed)?;
    for file in files {
        let mut textures = Textures::default();
        match Format::of(file) {
            Some(Format::Ply) => {
                let mut intake = Intake::new(file, &work)?;
                let (material, warnings) = ply::parse(file, Input::open(file)?, &mut intake, &mut textures)?;
                let (materials, placements) = (vec![material], vec![(0, DAffine3::IDENTITY)]);
                let beside = gltf::Beside { materials, warnings, placements };
                append(Read { intake, textures, beside, flat: true }, &mut writer, folder, keep)?;
            }
            Some(Format::Obj) => {
                let mut intake = Intake::new(file, &work)?;
                let mut input = Input::open(file)?;
                if input.starts_with(&[0xfe, 0xff]) || input.starts_with(&[0xff, 0xfe]) {
                    return Err(LoadError::unsupported(file, "UTF-16 text", WHOLE));
                }
                let (materials, warnings) = obj::parse(file, &mut input, &mut intake, &mut textures)?;
                let placements = (0..intake.meshes.len()).map(|i| (i, DAffine3::IDENTITY)).collect();
                let beside = gltf::Beside { materials, warnings, placements };
                append(Read { intake, textures, beside, flat: true }, &mut writer, folder, keep)?;
            }
            Some(Format::Gltf) => {
                let mut intake = Intake::new(file, &work)?;
                let plain = unpacked(file, &aside)?;
                let beside = gltf::stream(file, plain, work.batch as u64, &mut intake, &mut textures)?;
                append(Read { intake, textures, beside, flat: false }, &mut writer, folder, keep)?;
            }
            None => return Err(LoadError::unsupported(file, "this format", WHOLE)),
        }
    }
    // What was read is what the file's name says.
    for (file, digest) in files.iter().zip(digests) {
        let now = keep.digest(file)?;
        if now != *digest {
            return Err(LoadError::data(file, "contents", "the file changed while it was read"));
        }
    }
    writer.finish(home).map_err(|e| LoadError::temporary(home.parent().unwrap_or(home), e))
}

/// Cuts what was read into the chunk file, after what is in it.
fn append<C: Corner>(read: Read<'_, C>, writer: &mut Writer, folder: &Path, keep: &Keep<'_>) -> Result<(), LoadError> {
    let Read { mut intake, textures, beside, flat } = read;
    let gltf::Beside { materials, mut warnings, placements } = beside;
    intake.finish()?;
    let work = intake.work;
    let failed = |e| LoadError::temporary(work.folder, e);
    let origin = checked(&intake, flat)?;
    if intake.degenerate > 0 {
        warnings.push(format!("{} triangles without area kept out", intake.degenerate));
    }
    let first_material = writer.kept().materials.len() as u32;
    let first_texture = writer.kept().textures.len() as u32;
    for m in &mut intake.meshes {
        m.runs.iter_mut().for_each(|r| r.0 += first_material);
    }
    let moved = DAffine3::from_translation(origin);
    let mut ids = vec![[None; 2]; intake.meshes.len()];
    for (i, transform) in placements {
        let mesh = &intake.meshes[i];
        if mesh.triangles() == 0 {
            continue;
        }
        // A mirrored placement would turn its triangles inside out: it gets a mirrored mesh.
        let transform = transform * moved;
        let mirrored = transform.matrix3.determinant() < 0.0;
        let id = match ids[i][usize::from(mirrored)] {
            Some(id) => id,
            None => {
                let scope = Scope { intake: &intake, mesh, origin, mirrored };
                let (infos, vertex_ids) = scope.write(writer).map_err(failed)?;
                let name = if mirrored { format!("{} (mirrored)", mesh.name) } else { mesh.name.clone() };
                writer.mesh(&name, infos, vertex_ids)
            }
        };
        ids[i][usize::from(mirrored)] = Some(id);
        let transform = if mirrored { transform * MIRROR } else { transform };
        writer.kept().placements.push((id, transform.to_cols_array()));
    }
    for file in &textures.beside {
        let name = file.strip_prefix(folder).unwrap_or(file).to_string_lossy().into_owned();
        let digest = match keep.digest(file) {
            Err(LoadError::Cancelled) => return Err(LoadError::Cancelled),
            known => known.ok(),
        };
        writer.kept().beside.push((name, digest));
    }
    let textures: Vec<Texture> = textures.finish();
    textures.iter().try_for_each(|t| writer.texture(t)).map_err(failed)?;
    let kept = writer.kept();
    kept.warnings.extend(warnings);
    kept.materials.extend(materials.into_iter().map(|mut m| {
        m.texture = m.texture.map(|t| TextureId(t.0 + first_texture));
        m
    }));
    Ok(())
}

/// The checks of whole files that meshes in memory go through; returns what positions are relative to.
fn checked<C: Corner>(intake: &Intake<'_, C>, flat: bool) -> Result<DVec3, LoadError> {
    let boxes: Vec<_> =
        intake.meshes.iter().filter(|m| m.triangles() > 0).map(|m| (m.name.as_str(), m.low, m.high)).collect();
    if boxes.is_empty() {
        return Err(super::part::no_triangles(intake.file, intake.degenerate));
    }
    super::part::origin(intake.file, &boxes, flat)
}
