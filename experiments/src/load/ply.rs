//! PLY, ascii and binary of either byte order: `vertex`, `face` and `tristrips`; other elements are skipped.
//!
//! Follows G. Turk, "The PLY polygon file format" (1994); strips as in the Georgia Tech archive and VCGlib (-1 restarts,
//! the winding alternates). Vertex properties of any number type: x y z, nx ny nz, red green blue (bytes, or floats in
//! 0..1) alone or with the prefix `diffuse_`, and s t, u v or texture_u texture_v. Parsed element by element with
//! ply-rs-bw, after the header's counts have been held against the file's size. O(n).

use std::io::BufRead;
use std::path::Path;

use farfield_core::scene::Material;
use glam::{DAffine3, DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};

use super::bytes::Input;
use super::part::{Model, Part};
use super::sink::Sink;
use super::texture::Textures;
use super::{LoadError, bytes, plain};

#[derive(Default)]
struct Vertex {
    position: [f64; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    color: [u8; 3],
}

#[derive(Default)]
struct Face(Vec<i64>);

struct Skipped;

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { color: [255; 3], ..Default::default() }
    }

    fn set_property(&mut self, name: &str, p: Property) -> PropertyAccessResult {
        let Some(v) = scalar(&p) else { return PropertyAccessResult::Ignored };
        let byte = || match p {
            Property::Float(_) | Property::Double(_) => (v.clamp(0.0, 1.0) * 255.0).round() as u8,
            Property::UShort(_) => (v / 257.0).round() as u8,
            _ => v.clamp(0.0, 255.0) as u8,
        };
        match name {
            "x" => self.position[0] = v,
            "y" => self.position[1] = v,
            "z" => self.position[2] = v,
            "nx" => self.normal[0] = v as f32,
            "ny" => self.normal[1] = v as f32,
            "nz" => self.normal[2] = v as f32,
            "s" | "u" | "texture_u" => self.uv[0] = v as f32,
            "t" | "v" | "texture_v" => self.uv[1] = v as f32,
            "red" | "diffuse_red" => self.color[0] = byte(),
            "green" | "diffuse_green" => self.color[1] = byte(),
            "blue" | "diffuse_blue" => self.color[2] = byte(),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, p: Property) -> PropertyAccessResult {
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match p {
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

fn scalar(p: &Property) -> Option<f64> {
    Some(match *p {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        Property::Float(v) => v.into(),
        Property::Double(v) => v,
        _ => return None,
    })
}

/// The payload.
struct Body<'a, 'd> {
    path: &'a Path,
    encoding: Encoding,
    data: Input<'d>,
    /// Where it starts.
    start: u64,
    line: usize,
}

impl Body<'_, '_> {
    /// Refuses a count that the rest of the file cannot hold, where that is known.
    fn claim(&self, def: &ElementDef) -> Result<(), LoadError> {
        let least: u64 = match self.encoding {
            Encoding::Ascii => (2 * def.properties.len() as u64).max(1),
            _ => def
                .properties
                .iter()
                .map(|(_, p)| match &p.data_type {
                    PropertyType::Scalar(t) | PropertyType::List(t, _) => size(t),
                })
                .sum(),
        };
        let Some(left) = self.data.left() else { return Ok(()) };
        // The last line of an ascii file may lack its line break.
        let room = left + u64::from(self.encoding == Encoding::Ascii);
        if (def.count as u64).checked_mul(least).is_none_or(|n| n > room) {
            let cause = format!("claims {} of at least {least} bytes each; {left} bytes are left", def.count);
            return Err(LoadError::data(self.path, format!("header, element {}", def.name), cause));
        }
        Ok(())
    }

    fn each<E: PropertyAccess>(
        &mut self,
        def: &ElementDef,
        mut f: impl FnMut(usize, E) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        self.claim(def)?;
        if def.properties.is_empty() && self.encoding != Encoding::Ascii {
            return Ok(());
        }
        let parser = Parser::<E>::new();
        let mut line = vec![];
        for i in 0..def.count {
            let at = self.data.position() - self.start;
            let read = match self.encoding {
                Encoding::Ascii => {
                    line.clear();
                    while line.trim_ascii().is_empty() {
                        line.clear();
                        self.line += 1;
                        if self.data.read_until(b'\n', &mut line).unwrap_or(0) == 0 {
                            let cause = format!("the file ends; {} were announced", def.count);
                            return Err(LoadError::data(self.path, format!("{} {i}", def.name), cause));
                        }
                    }
                    parser.read_ascii_element(&String::from_utf8_lossy(&line), def)
                }
                Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut self.data, def),
                Encoding::BinaryLittleEndian => parser.read_little_endian_element(&mut self.data, def),
            };
            f(
                i,
                read.map_err(|e| {
                    let place = match self.encoding {
                        Encoding::Ascii => format!("line {} ({} {i})", self.line, def.name),
                        _ => format!("{} {i} (byte {at} after the header)", def.name),
                    };
                    LoadError::data(self.path, place, said(&e))
                })?,
            )?;
        }
        Ok(())
    }
}

fn size(t: &ScalarType) -> u64 {
    match t {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The parser's words, on one line of bounded length.
fn said(e: &ParseError) -> String {
    bytes::excerpt(&e.to_string().split_whitespace().collect::<Vec<_>>().join(" "), 240)
}

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Model, LoadError> {
    let mut part = Part::default();
    let mut textures = Textures::default();
    let (material, warnings) = parse(path, Input::held(data), &mut part, &mut textures)?;
    Ok(Model {
        parts: vec![part],
        placements: vec![(0, DAffine3::IDENTITY)],
        materials: vec![material],
        textures: textures.finish(),
        warnings,
        flat: true,
    })
}

/// Reads a file piece by piece into `sink`, as one mesh; returns its material and what was left out.
pub(super) fn parse(
    path: &Path,
    mut data: Input<'_>,
    sink: &mut impl Sink<u32>,
    textures: &mut Textures,
) -> Result<(Material, Vec<String>), LoadError> {
    if data.fill_buf().is_ok_and(<[u8]>::is_empty) {
        return Err(LoadError::data(path, "header", "the file is empty"));
    }
    let mut reader = Reader::new(data);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|e| {
        let place = e.line().map_or("header".into(), |l| format!("line {l}"));
        LoadError::data(path, place, said(&e))
    })?;
    let line = reader.line().saturating_sub(1);
    let data = reader.into_inner();
    let mut body = Body { path, encoding: header.encoding, start: data.position(), data, line };

    sink.part("ply", "face")?;
    let (mut vertices, mut any_uvs, mut any_colors) = (0, false, false);
    for (_, def) in &header.elements {
        let has = |names: &[&str]| names.iter().all(|n| def.properties.contains_key(*n));
        match def.name.as_str() {
            "vertex" => {
                if !has(&["x", "y", "z"]) {
                    return Err(LoadError::data(path, "header, element vertex", "has no properties x, y and z"));
                }
                if vertices > 0 {
                    return Err(LoadError::data(path, "header, element vertex", "stands there twice"));
                }
                let normals = has(&["nx", "ny", "nz"]);
                let uvs = has(&["s", "t"]) || has(&["u", "v"]) || has(&["texture_u", "texture_v"]);
                let colors = has(&["red", "green", "blue"]) || has(&["diffuse_red", "diffuse_green", "diffuse_blue"]);
                (any_uvs, any_colors) = (any_uvs || uvs && def.count > 0, any_colors || colors && def.count > 0);
                body.each(def, |_, v: Vertex| {
                    vertices += 1;
                    sink.position(DVec3::from(v.position))?;
                    if normals {
                        sink.normal(Some(Vec3::from(v.normal)))?;
                    }
                    if uvs {
                        sink.uv(Some(Vec2::new(v.uv[0], 1.0 - v.uv[1])))?;
                    }
                    if colors {
                        let [r, g, b] = v.color;
                        sink.color(Some([r, g, b, 255]))?;
                    }
                    Ok(())
                })?;
            }
            "face" => body.each(def, |i, f: Face| {
                let bad = |cause| LoadError::data(path, format!("face {i}"), cause);
                let corners = named(&f.0, vertices).map_err(bad)?;
                if corners.len() < 3 {
                    return Err(bad(format!("a face of {} corners", corners.len())));
                }
                sink.face(&corners, 0, i as u32)
            })?,
            "tristrips" => body.each(def, |i, f: Face| {
                let bad = |cause| LoadError::data(path, format!("tristrips {i}"), cause);
                for run in f.0.split(|&v| v == -1) {
                    let corners = named(run, vertices).map_err(bad)?;
                    // Triangles (a, b, c), (c, b, d), (c, d, e), ...: every second one is turned, and -1 starts anew.
                    for (k, w) in corners.windows(3).enumerate() {
                        let w = if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
                        sink.face(&w, 0, i as u32)?;
                    }
                }
                Ok(())
            })?,
            _ => body.each(def, |_, _: Skipped| Ok(()))?,
        }
    }
    // To the end: only there a gzip stream's checksum is looked at.
    std::io::copy(&mut body.data, &mut std::io::sink())
        .map_err(|cause| LoadError::Read { file: path.to_owned(), cause })?;
    let mut warnings = vec![];
    let mut material = plain("default");
    if let Some(name) = header.comments.iter().find_map(|c| c.trim().strip_prefix("TextureFile "))
        && any_uvs
    {
        match textures.file(path.parent().unwrap_or(Path::new("")), name.trim()) {
            Ok(id) => {
                material.texture = Some(id);
                material.base_color = [1.0; 4];
            }
            Err(cause) => warnings.push(format!("{cause}: the plain colour is taken")),
        }
    }
    if any_colors {
        material.base_color = [1.0; 4];
    }
    Ok((material, warnings))
}

/// The vertices that a list names.
fn named(list: &[i64], vertices: u64) -> Result<Vec<u32>, String> {
    let vertex = |&i: &i64| match u32::try_from(i) {
        Ok(v) if u64::from(v) < vertices => Ok(v),
        _ => Err(format!("names vertex {i}; {vertices} are listed before it (counted from 0)")),
    };
    list.iter().map(vertex).collect()
}
