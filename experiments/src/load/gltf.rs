//! glTF 2.0 and GLB: the default scene's nodes as placements, meshes shared, primitives as parts, base colours and textures.
//!
//! Transforms are composed in 64 bits. Triangles, strips and fans are read; points and lines are skipped with a warning.
//! Of the extensions KHR_materials_pbrSpecularGlossiness (its diffuse part), KHR_materials_unlit, KHR_texture_transform
//! (applied to the coordinates) and KHR_mesh_quantization are read; a file that requires another one is refused. Samplers
//! are not used: textures repeat. O(n).

use std::fs::File;
use std::path::Path;

use farfield_core::color::byte_of_linear;
use farfield_core::scene::Material;
use glam::{DAffine3, DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf::json::material::AlphaMode;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::texture::Info;
use gltf::json::validation::{Checked, Validate};
use gltf::json::{Accessor, Index, Node, Root};

use super::gltf_accessor::{Buffer, Document, uri_bytes};
use super::gltf_stream;
use super::part::{Model, Part};
use super::sink::Sink;
use super::texture::Textures;
use super::{LoadError, bytes};
use crate::chunks::ReadAt;

const EXTENSIONS: [&str; 4] =
    ["KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit", "KHR_mesh_quantization", "KHR_texture_transform"];

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Model, LoadError> {
    let (json, bin) = if data.starts_with(b"glTF") { chunks(path, data)? } else { (data, None) };
    let root = document(path, json)?;
    let mut textures = Textures::default();
    let doc = Document::new(path, &root, bin.map(|b| Buffer::Held(b.into())), false, &mut textures.beside)?;
    let (materials, mut warnings) = materials(&doc, &mut textures);
    let mut model = Model { materials, textures: textures.finish(), ..Model::default() };
    let mut indices_read = 0;
    for i in 0..root.meshes.len() {
        let part = mesh(&doc, i, &mut warnings, &mut indices_read)?;
        model.parts.push(part);
    }
    model.placements = nodes(path, &root, &mut warnings)?;
    unused(&root, &mut warnings);
    model.warnings = warnings;
    Ok(model)
}

/// What a file has beside its meshes.
pub(super) struct Beside {
    pub(super) materials: Vec<Material>,
    pub(super) warnings: Vec<String>,
    /// Meshes and their transforms.
    pub(super) placements: Vec<(usize, DAffine3)>,
}

/// Reads an unpacked file piece by piece into `sink`, a mesh a mesh of the document. `batch` items are held at a time.
pub(super) fn stream(
    path: &Path,
    file: File,
    batch: u64,
    sink: &mut impl Sink<u32>,
    textures: &mut Textures,
) -> Result<Beside, LoadError> {
    let (json, bin) = kept_chunks(path, file)?;
    let root = document(path, &json)?;
    let doc = Document::new(path, &root, bin, true, &mut textures.beside)?;
    let (materials, mut warnings) = materials(&doc, textures);
    let mut vertices = 0;
    for (i, m) in root.meshes.iter().enumerate() {
        sink.part(&m.name.clone().unwrap_or_else(|| format!("mesh {i}")), "triangle")?;
        let mut triangles = 0;
        for (k, p) in m.primitives.iter().enumerate() {
            let place = format!("meshes[{i}].primitives[{k}]");
            let Some(shape) = shape(&doc, p, &place, &mut warnings)? else { continue };
            gltf_stream::primitive(&doc, &shape, &place, batch, (&mut vertices, &mut triangles), sink)?;
        }
    }
    let placements = nodes(path, &root, &mut warnings)?;
    unused(&root, &mut warnings);
    Ok(Beside { materials, warnings, placements })
}

/// The JSON of a file, and its binary chunk where it is a GLB.
fn kept_chunks(path: &Path, file: File) -> Result<(Vec<u8>, Option<Buffer<'static>>), LoadError> {
    let failed = |cause| LoadError::Read { file: path.to_owned(), cause };
    let bad = |cause: String| LoadError::data(path, "GLB chunk", cause);
    let len = file.metadata().map_err(failed)?.len();
    let read = |at: u64, n: u64| -> Result<Vec<u8>, LoadError> {
        if at.checked_add(n).is_none_or(|end| end > len) {
            return Err(bad(format!("{n} bytes at byte {at} of a file of {len}")));
        }
        let mut out = vec![0; n as usize];
        file.read_at(&mut out, at).map_err(failed)?;
        Ok(out)
    };
    if len < 12 || !read(0, 4)?.starts_with(b"glTF") {
        return Ok((read(0, len)?, None));
    }
    let word = |b: &[u8]| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let head = read(0, 12)?;
    if (word(&head[4..]), word(&head[8..]) <= len) != (2, true) {
        let cause = format!("version {}, {} bytes announced; the file has {len}", word(&head[4..]), word(&head[8..]));
        return Err(LoadError::data(path, "GLB header", cause));
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while at + 8 <= len {
        let head = read(at, 8)?;
        let (start, n) = (at + 8, word(&head));
        match &head[4..] {
            b"JSON" if json.is_none() => json = Some(read(start, n)?),
            b"BIN\0" if bin.is_none() => {
                if start + n > len {
                    return Err(bad(format!("{n} bytes at byte {start} of a file of {len}")));
                }
                bin = Some((start, n));
            }
            _ => {}
        }
        at = start + n;
    }
    let bin = bin.map(|(start, len)| Buffer::Kept { file, start, len });
    json.map(|j| (j, bin)).ok_or_else(|| LoadError::data(path, "GLB", "has no JSON chunk"))
}

/// The document, valid, of version 2, and without extensions that are needed and not known.
fn document(path: &Path, json: &[u8]) -> Result<Root, LoadError> {
    let mut root: Root = serde_json::from_slice(json)
        .map_err(|e| LoadError::data(path, format!("line {}, column {}", e.line(), e.column()), e.to_string()))?;
    if let Some(e) = root.extensions_required.iter().find(|e| !EXTENSIONS.contains(&e.as_str())) {
        let cause =
            format!("{} is required and not supported; supported are {}", bytes::excerpt(e, 80), EXTENSIONS.join(", "));
        return Err(LoadError::unsupported(path, "extensionsRequired", cause));
    }
    root.extensions_required.clear();
    // gltf-json 1.4 looks up a primitive's positions before it has checked their index, and panics.
    for (i, m) in root.meshes.iter().enumerate() {
        for (k, p) in m.primitives.iter().enumerate() {
            if let Some(a) = p.attributes.values().map(Index::value).find(|&a| a >= root.accessors.len()) {
                let cause = format!("an attribute names accessor {a} of {}", root.accessors.len());
                return Err(LoadError::data(path, format!("meshes[{i}].primitives[{k}]"), cause));
            }
        }
    }
    let mut first = None;
    root.validate(&root, gltf::json::Path::new, &mut |at, e| {
        first.get_or_insert_with(|| (at().to_string(), e.to_string()));
    });
    if let Some((place, cause)) = first {
        return Err(LoadError::data(path, place, cause));
    }
    if !root.asset.version.starts_with("2.") {
        let cause = format!("glTF {} is not supported; 2.x is", bytes::excerpt(&root.asset.version, 20));
        return Err(LoadError::unsupported(path, "asset.version", cause));
    }

    Ok(root)
}

/// All materials, and what is said of them.
fn materials(doc: &Document, textures: &mut Textures) -> (Vec<Material>, Vec<String>) {
    let (root, mut warnings) = (doc.root, vec![]);
    let mut out: Vec<Material> = (0..root.materials.len()).map(|i| material(doc, i, textures, &mut warnings)).collect();
    if root.meshes.iter().flat_map(|m| &m.primitives).any(|p| p.material.is_none()) {
        // Section 3.7.2.2: a primitive without a material is white.
        out.push(Material { base_color: [1.0; 4], ..Default::default() });
    }
    (out, warnings)
}

fn unused(root: &Root, warnings: &mut Vec<String>) {
    for (n, what) in [(root.animations.len(), "animations"), (root.skins.len(), "skins")] {
        if n > 0 {
            warnings.push(format!("{n} {what} not used: meshes stand as they are stored"));
        }
    }
}

/// The JSON and binary chunks of a GLB (glTF 2.0, section 4.4).
fn chunks<'a>(path: &Path, data: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), LoadError> {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let bad = |place: &str, cause: String| LoadError::data(path, place, cause);
    match (word(4), word(8)) {
        (Some(2), Some(n)) if n as usize <= data.len() => {}
        (Some(2), Some(n)) => {
            return Err(bad("GLB header", format!("announces {n} bytes; the file has {}", data.len())));
        }
        (Some(v), Some(_)) => return Err(bad("GLB header", format!("version {v}, not 2"))),
        _ => return Err(bad("GLB header", "the file ends in it".into())),
    }
    let (mut json, mut bin, mut at) = (None, None, 12);
    while let (Some(n), Some(kind)) = (word(at), word(at + 4)) {
        let chunk = data
            .get(at + 8..at + 8 + n as usize)
            .ok_or_else(|| bad("GLB chunk", format!("{n} bytes at byte {} of a file of {}", at + 8, data.len())))?;
        match &kind.to_le_bytes() {
            b"JSON" => json = json.or(Some(chunk)),
            b"BIN\0" => bin = bin.or(Some(chunk)),
            _ => {}
        }
        at += 8 + n as usize;
    }
    json.map(|j| (j, bin)).ok_or_else(|| bad("GLB", "has no JSON chunk".into()))
}

/// Every node with a mesh below the default scene (or the first, or, without scenes, all roots), transforms composed.
fn nodes(path: &Path, root: &Root, warnings: &mut Vec<String>) -> Result<Vec<(usize, DAffine3)>, LoadError> {
    let scene = root.scene.map(|s| s.value()).or((!root.scenes.is_empty()).then_some(0));
    let tops: Vec<usize> = match scene {
        Some(s) => root.scenes[s].nodes.iter().map(Index::value).collect(),
        None => {
            let mut top = vec![true; root.nodes.len()];
            root.nodes.iter().flat_map(|n| n.children.iter().flatten()).for_each(|c| top[c.value()] = false);
            (0..top.len()).filter(|&i| top[i]).collect()
        }
    };
    let mut seen = vec![false; root.nodes.len()];
    let mut out = vec![];
    let mut flat = 0;
    let mut stack: Vec<(usize, DAffine3)> = tops.into_iter().rev().map(|i| (i, DAffine3::IDENTITY)).collect();
    while let Some((i, above)) = stack.pop() {
        if std::mem::replace(&mut seen[i], true) {
            return Err(LoadError::data(path, format!("nodes[{i}]"), "is reached twice: nodes do not form a tree"));
        }
        let n = &root.nodes[i];
        let own = transform(n);
        let here = above * own;
        if !here.is_finite() {
            return Err(LoadError::data(path, format!("nodes[{i}]"), "its transform is not finite"));
        }
        if let Some(m) = n.mesh {
            if here.matrix3.determinant() == 0.0 {
                flat += 1;
            } else {
                out.push((m.value(), here));
            }
        }
        stack.extend(n.children.iter().flatten().rev().map(|c| (c.value(), here)));
    }
    if flat > 0 {
        warnings.push(format!("{flat} nodes whose transform flattens their mesh left out"));
    }
    Ok(out)
}

fn transform(n: &Node) -> DAffine3 {
    if let Some(m) = n.matrix {
        return DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
    }
    let three = |v: Option<[f32; 3]>, d: f64| v.map_or(DVec3::splat(d), |v| DVec3::from(v.map(f64::from)));
    let [x, y, z, w] = n.rotation.map_or([0.0, 0.0, 0.0, 1.0], |q| q.0.map(f64::from));
    // Stored with 32 bits, quaternions are a little off unit length.
    let turn = DQuat::from_xyzw(x, y, z, w);
    let turn = if turn.length_squared() > 0.0 { turn.normalize() } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(three(n.scale, 1.0), turn, three(n.translation, 0.0))
}

/// The texture that gives a material its colour, and the factor on it.
fn base(m: &gltf::json::Material) -> ([f32; 4], Option<&Info>) {
    match m.extensions.as_ref().and_then(|e| e.pbr_specular_glossiness.as_ref()) {
        Some(s) => (s.diffuse_factor.0, s.diffuse_texture.as_ref()),
        None => (m.pbr_metallic_roughness.base_color_factor.0, m.pbr_metallic_roughness.base_color_texture.as_ref()),
    }
}

fn material(doc: &Document, i: usize, textures: &mut Textures, warnings: &mut Vec<String>) -> Material {
    let m = &doc.root.materials[i];
    let name = m.name.clone().unwrap_or_else(|| format!("material {i}"));
    let (factor, info) = base(m);
    if m.alpha_mode != Checked::Valid(AlphaMode::Opaque) {
        warnings.push(format!("material \"{name}\" is transparent: it is drawn opaque"));
    }
    let texture = info.and_then(|info| {
        let image = &doc.root.images[doc.root.textures[info.index.value()].source.value()];
        let at = format!("images[{}]", doc.root.textures[info.index.value()].source.value());
        let made = match (&image.uri, image.buffer_view) {
            (Some(uri), _) if !uri.starts_with("data:") => {
                textures.file(doc.path.parent().unwrap_or(Path::new("")), &super::gltf_accessor::unescaped(uri))
            }
            (Some(uri), _) => uri_bytes(doc.path, uri).and_then(|d| textures.memory(&at, &d)),
            (None, Some(view)) => doc.view(view).map_err(|e| e.to_string()).and_then(|d| textures.memory(&at, &d)),
            (None, None) => Err("has neither uri nor bufferView".into()),
        };
        made.map_err(|cause| warnings.push(format!("{at}: {cause}: the plain colour is taken"))).ok()
    });
    let base_color = factor.map(|v| if v.is_finite() { v.clamp(0.0, 1.0) } else { 1.0 });
    Material { name, base_color, texture, two_sided: m.double_sided }
}

/// All triangles of a mesh.
fn mesh(doc: &Document, i: usize, warnings: &mut Vec<String>, indices_read: &mut u64) -> Result<Part, LoadError> {
    let m = &doc.root.meshes[i];
    let name = m.name.clone().unwrap_or_else(|| format!("mesh {i}"));
    let mut part = Part { name, place: "triangle", ..Default::default() };
    for (k, p) in m.primitives.iter().enumerate() {
        primitive(doc, p, &format!("meshes[{i}].primitives[{k}]"), &mut part, warnings, indices_read)?;
    }
    Ok(part)
}

fn primitive(
    doc: &Document,
    p: &Primitive,
    place: &str,
    part: &mut Part,
    warnings: &mut Vec<String>,
    indices_read: &mut u64,
) -> Result<(), LoadError> {
    let bad = |cause: String| LoadError::data(doc.path, place, cause);
    let Some(shape) = shape(doc, p, place, warnings)? else { return Ok(()) };
    let mode = shape.mode;
    let positions = doc.numbers::<3>(shape.positions, 0.0)?;
    let n = positions.len();
    let mut indices = match shape.indices {
        Some(id) => doc.indices(id)?,
        None => (0..n as u32).collect(),
    };
    if let Some(at) = indices.iter().position(|&v| v as usize >= n) {
        return Err(bad(format!("index {at} names vertex {} of {n}", indices[at])));
    }
    let normals = shape.normals.map(|a| doc.numbers::<3>(a, 0.0)).transpose()?;
    let uvs = shape.uvs.map(|a| doc.numbers::<2>(a, 0.0)).transpose()?;
    let colors = shape.colors.map(|a| doc.numbers::<4>(a, 1.0)).transpose()?;

    // An index takes a byte at least; accessors may be shared, but not so often that a small file fills the memory.
    let most = 16 * doc.held().max(1 << 16);
    *indices_read += indices.len() as u64;
    if *indices_read > most {
        return Err(bad(format!("primitives share their indices too often: more than {most} in all")));
    }
    // Primitives may share vertices: each takes those that it uses.
    let (mut new, mut used) = (vec![u32::MAX; n], vec![]);
    for v in &mut indices {
        let id = &mut new[*v as usize];
        if *id == u32::MAX {
            *id = used.len() as u32;
            used.push(*v as usize);
        }
        *v = *id;
    }
    let first = part.positions.len() as u32;
    if u64::from(first) + used.len() as u64 > u64::from(u32::MAX) {
        return Err(bad("the mesh has more than 2^32 vertices".into()));
    }
    part.positions.extend(used.iter().map(|&v| DVec3::from(positions[v].map(f64::from))));
    let all = part.positions.len();
    // Attributes that only some primitives have: the others get none, (0, 0) and white.
    if normals.is_some() || !part.normals.is_empty() {
        part.normals.resize(first as usize, Vec3::ZERO);
        part.normals.extend(normals.iter().flat_map(|l| used.iter().map(|&v| Vec3::from(l[v]))));
        part.normals.resize(all, Vec3::ZERO);
    }
    if uvs.is_some() || !part.uvs.is_empty() {
        let placed = placement(shape.info);
        part.uvs.resize(first as usize, Vec2::ZERO);
        part.uvs.extend(uvs.iter().flat_map(|l| used.iter().map(|&v| placed(Vec2::from(l[v])))));
        part.uvs.resize(all, Vec2::ZERO);
    }
    if colors.is_some() || !part.colors.is_empty() {
        part.colors.resize(first as usize, [255; 4]);
        part.colors.extend(colors.iter().flat_map(|l| used.iter().map(|&v| l[v])).map(|[r, g, b, _]| srgb([r, g, b])));
        part.colors.resize(all, [255; 4]);
    }
    let mut push = |t: [u32; 3]| {
        part.triangles.push(t.map(|v| first + v));
        part.materials.push(shape.material);
    };
    match mode {
        Mode::TriangleStrip => indices.windows(3).enumerate().for_each(|(k, w)| {
            push(if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] });
        }),
        // Section 3.7.2.1: (v[i+1], v[i+2], v[0]).
        Mode::TriangleFan => indices.windows(2).skip(1).for_each(|w| push([w[0], w[1], indices[0]])),
        _ => indices.chunks_exact(3).for_each(|t| push([t[0], t[1], t[2]])),
    }
    Ok(())
}

/// A linear vertex colour as bytes.
pub(super) fn srgb(linear: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = linear.map(|v| if v.is_finite() { byte_of_linear(v) } else { 255 });
    [r, g, b, 255]
}

/// What a primitive is made of.
pub(super) struct Shape<'a> {
    pub(super) mode: Mode,
    pub(super) positions: Index<Accessor>,
    pub(super) indices: Option<Index<Accessor>>,
    pub(super) normals: Option<Index<Accessor>>,
    pub(super) uvs: Option<Index<Accessor>>,
    pub(super) colors: Option<Index<Accessor>>,
    pub(super) material: u32,
    pub(super) info: Option<&'a Info>,
}

/// The accessors of a primitive, of one length; `None` of points and lines.
fn shape<'a>(
    doc: &Document<'a>,
    p: &'a Primitive,
    place: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<Shape<'a>>, LoadError> {
    let bad = |cause: String| LoadError::data(doc.path, place, cause);
    let find = |s: Semantic| p.attributes.get(&Checked::Valid(s)).copied();
    let Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) = p.mode else {
        warnings.push(format!("{place} holds points or lines: left out"));
        return Ok(None);
    };
    let Some(positions) = find(Semantic::Positions) else {
        return Err(bad("has no POSITION".into()));
    };
    let (normals, colors) = (find(Semantic::Normals), find(Semantic::Colors(0)));
    [Some(positions), p.indices, normals, colors].into_iter().flatten().try_for_each(|id| doc.fits(id))?;
    let n = doc.count(positions);
    let corners = p.indices.map_or(n, |i| doc.count(i));
    if mode == Mode::Triangles && !corners.is_multiple_of(3) {
        return Err(bad(format!("{corners} indices are not whole triangles")));
    }
    let info = p.material.and_then(|m| base(&doc.root.materials[m.value()]).1);
    let set = info.map_or(0, |i| {
        let moved = i.extensions.as_ref().and_then(|e| e.texture_transform.as_ref()).and_then(|t| t.tex_coord);
        moved.unwrap_or(i.tex_coord)
    });
    let uvs = find(Semantic::TexCoords(set));
    for (what, id) in [("NORMAL", normals), ("TEXCOORD", uvs), ("COLOR", colors)] {
        if let Some(len) = id.map(|i| doc.count(i)).filter(|&l| l != n) {
            return Err(bad(format!("{what} has {len} items for {n} vertices")));
        }
    }
    let material = p.material.map_or(doc.root.materials.len(), |m| m.value()) as u32;
    Ok(Some(Shape { mode, positions, indices: p.indices, normals, uvs, colors, material, info }))
}

/// KHR_texture_transform: uv' = offset + R(rotation) (scale uv).
pub(super) fn placement(info: Option<&Info>) -> impl Fn(Vec2) -> Vec2 {
    let t = info.and_then(|i| i.extensions.as_ref()).and_then(|e| e.texture_transform.as_ref());
    let (offset, scale, angle) =
        t.map_or((Vec2::ZERO, Vec2::ONE, 0.0), |t| (Vec2::from(t.offset.0), Vec2::from(t.scale.0), t.rotation.0));
    let (s, c) = angle.sin_cos();
    move |uv| {
        let uv = uv * scale;
        offset + Vec2::new(c * uv.x + s * uv.y, c * uv.y - s * uv.x)
    }
}
