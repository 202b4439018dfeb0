//! Wavefront OBJ: `v` (with colours), `vt`, `vn`, `f`, `o`, `g`, `usemtl`, `mtllib`; other statements are skipped.
//!
//! Follows Wavefront's "Object Files (.obj)" specification, version 3.0, for polygons, with vertex colours as MeshLab writes
//! them (`v x y z r g b`, sRGB 0..1). Read here and not by `tobj`, whose errors name no line, which shifts attributes where
//! only some faces have them, stops at Latin-1 bytes and continued lines, and panics on `Kd 1`; the tests hold this reader
//! to tobj's result on every file that tobj reads. Each `o` or `g` with faces is a part. Smoothing groups, lines, points
//! and free-form surfaces are not used. O(n).

use std::collections::{BTreeSet, HashMap};
use std::io::BufRead;
use std::path::Path;

use farfield_core::scene::Material;
use glam::{DVec3, Vec2, Vec3};

use super::part::{Model, Part};
use super::sink::Sink;
use super::texture::Textures;
use super::{LoadError, bytes, mtl, plain, polygon};

/// How much the file has listed so far.
#[derive(Clone, Copy, Default)]
struct Listed {
    positions: usize,
    uvs: usize,
    normals: usize,
    any_color: bool,
    bad_colors: usize,
}

/// A corner as resolved indices: position, texture coordinates, normal; `u32::MAX` where there is none.
type Corner = [u32; 3];

/// In memory: what is listed, and the meshes.
#[derive(Default)]
struct Held {
    positions: Vec<DVec3>,
    colors: Vec<Option<[u8; 4]>>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    parts: Vec<Building>,
    split: Vec<[u32; 3]>,
}

/// A mesh.
struct Building {
    part: Part,
    index: HashMap<Corner, u32>,
    any_uv: bool,
    any_normal: bool,
    any_color: bool,
}

impl Building {
    fn finish(mut self) -> Option<Part> {
        if !self.any_uv {
            self.part.uvs.clear();
        }
        if !self.any_normal {
            self.part.normals.clear();
        }
        if !self.any_color {
            self.part.colors.clear();
        }
        (!self.part.triangles.is_empty()).then_some(self.part)
    }
}

impl Sink<Corner> for Held {
    fn part(&mut self, name: &str, place: &'static str) -> Result<(), LoadError> {
        let part = Part { name: name.to_owned(), place, ..Default::default() };
        self.parts.push(Building { part, index: HashMap::new(), any_uv: false, any_normal: false, any_color: false });
        Ok(())
    }
    fn position(&mut self, p: DVec3) -> Result<(), LoadError> {
        self.positions.push(p);
        Ok(())
    }
    fn color(&mut self, c: Option<[u8; 4]>) -> Result<(), LoadError> {
        self.colors.push(c);
        Ok(())
    }
    fn uv(&mut self, uv: Option<Vec2>) -> Result<(), LoadError> {
        self.uvs.extend(uv);
        Ok(())
    }
    fn normal(&mut self, n: Option<Vec3>) -> Result<(), LoadError> {
        self.normals.extend(n);
        Ok(())
    }
    fn face(&mut self, corners: &[Corner], material: u32, place: u32) -> Result<(), LoadError> {
        let points: Vec<DVec3> = corners.iter().map(|c| self.positions[c[0] as usize]).collect();
        self.split.clear();
        polygon::triangulate(&points, &mut self.split);
        let now = self.parts.last_mut().expect("faces follow a mesh");
        let mut ids = vec![];
        for &corner in corners {
            ids.push(*now.index.entry(corner).or_insert_with(|| {
                let [v, vt, vn] = corner.map(|i| i as usize);
                now.any_uv |= vt < self.uvs.len();
                now.any_normal |= vn < self.normals.len();
                now.any_color |= self.colors[v].is_some();
                now.part.positions.push(self.positions[v]);
                now.part.uvs.push(self.uvs.get(vt).copied().unwrap_or_default());
                now.part.normals.push(self.normals.get(vn).copied().unwrap_or_default());
                now.part.colors.push(self.colors[v].unwrap_or([255; 4]));
                now.part.positions.len() as u32 - 1
            }));
        }
        for t in &self.split {
            now.part.triangles.push(t.map(|k| ids[k as usize]));
            now.part.materials.push(material);
            now.part.places.push(place);
        }
        Ok(())
    }
}

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Model, LoadError> {
    let mut held = Held::default();
    let mut textures = Textures::default();
    let text = bytes::text(data);
    let (materials, warnings) = parse(path, &mut text.as_bytes(), &mut held, &mut textures)?;
    let parts: Vec<Part> = held.parts.into_iter().filter_map(Building::finish).collect();
    let placements = (0..parts.len()).map(|i| (i, glam::DAffine3::IDENTITY)).collect();
    Ok(Model { parts, placements, materials, textures: textures.finish(), warnings, flat: true })
}

/// Reads a file piece by piece into `sink`; returns its materials and what was left out or guessed. Bytes that are not UTF-8
/// become U+FFFD.
pub(super) fn parse(
    path: &Path,
    input: &mut dyn BufRead,
    sink: &mut impl Sink<Corner>,
    textures: &mut Textures,
) -> Result<(Vec<Material>, Vec<String>), LoadError> {
    let (mut all, mut warnings): (Vec<Material>, Vec<String>) = (vec![], vec![]);
    let mut materials: HashMap<String, u32> = HashMap::new();
    let (mut given, mut libraries) = (BTreeSet::new(), BTreeSet::new());
    let mut material = None;
    let mut listed = Listed::default();
    sink.part("unnamed", "line")?;
    let (mut raw, mut joined, mut corners) = (vec![], String::new(), vec![]);

    let mut lines = 0_u32;
    let mut next = |out: &mut String| -> Result<bool, LoadError> {
        raw.clear();
        let failed = |cause| LoadError::Read { file: path.to_owned(), cause };
        let n = input.read_until(b'\n', &mut raw).map_err(failed)?;
        out.push_str(&String::from_utf8_lossy(&raw));
        Ok(n > 0)
    };
    loop {
        joined.clear();
        if !next(&mut joined)? {
            break;
        }
        lines += 1;
        let number = lines;
        if number == 1 && joined.starts_with('\u{feff}') {
            joined.remove(0);
        }
        // A backslash at the end continues a line (specification, "Comments").
        while joined.trim_end().ends_with('\\') {
            joined.truncate(joined.trim_end().trim_end_matches('\\').len());
            joined.push(' ');
            if !next(&mut joined)? {
                break;
            }
            lines += 1;
        }
        let line = joined.trim();
        let bad = |cause: String| LoadError::data(path, format!("line {number}"), cause);
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match word {
            "v" => {
                let (p, color) = listed.vertex(rest).map_err(bad)?;
                sink.position(p)?;
                sink.color(color)?;
            }
            "vt" => {
                let [u, v] = numbers::<2>(rest, 1).map_err(bad)?;
                listed.uvs += 1;
                sink.uv(Some(Vec2::new(u as f32, 1.0 - v as f32)))?;
            }
            "vn" => {
                let n = numbers::<3>(rest, 3).map_err(bad)?;
                listed.normals += 1;
                sink.normal(Some(DVec3::from(n).as_vec3()))?;
            }
            "f" | "fo" => {
                corners.clear();
                for word in rest.split('#').next().unwrap_or("").split_whitespace() {
                    corners.push(corner(word, &listed).map_err(bad)?);
                }
                if corners.len() < 3 {
                    return Err(bad(format!("a face of {} corners", corners.len())));
                }
                let material = *material.get_or_insert_with(|| {
                    all.push(plain("default"));
                    all.len() as u32 - 1
                });
                sink.face(&corners, material, number)?;
            }
            "o" | "g" => sink.part(if rest.trim().is_empty() { "unnamed" } else { rest.trim() }, "line")?,
            "usemtl" => {
                let name = rest.trim();
                material = Some(*materials.entry(name.to_owned()).or_insert_with(|| {
                    if !name.is_empty() {
                        warnings.push(format!("line {number}: there is no material \"{name}\": grey is taken"));
                    }
                    all.push(plain(name));
                    all.len() as u32 - 1
                }));
            }
            "mtllib" => {
                if !libraries.insert(rest.trim().to_owned()) {
                    continue;
                }
                for (name, m) in mtl::read_library(path, rest.trim(), textures, &mut warnings) {
                    all.push(m);
                    materials.insert(name, all.len() as u32 - 1);
                    given.insert(all.len() as u32 - 1);
                }
            }
            _ => {}
        }
    }
    if listed.any_color {
        // Materials that the file itself does not colour show the vertices' colours as they are.
        let own = |i: usize| !given.contains(&(i as u32));
        all.iter_mut().enumerate().filter(|(i, _)| own(*i)).for_each(|(_, m)| m.base_color = [1.0; 4]);
    }
    if listed.bad_colors > 0 {
        warnings.push(format!("{} vertex colours are not finite: white is taken", listed.bad_colors));
    }
    Ok((all, warnings))
}

impl Listed {
    /// `x y z`, `x y z w` (divided by w) or `x y z r g b`.
    fn vertex(&mut self, rest: &str) -> Result<(DVec3, Option<[u8; 4]>), String> {
        let words: Vec<&str> = rest.split('#').next().unwrap_or("").split_whitespace().collect();
        let all = words.iter().map(|w| number(w)).collect::<Result<Vec<f64>, String>>()?;
        let (p, color) = match *all {
            [x, y, z] => (DVec3::new(x, y, z), None),
            [x, y, z, w] if w != 0.0 => (DVec3::new(x, y, z) / w, None),
            [_, _, _, w] => return Err(format!("weight {w} of a vertex")),
            [x, y, z, r, g, b] | [x, y, z, r, g, b, _] => (DVec3::new(x, y, z), Some([r, g, b])),
            _ => return Err(format!("a vertex of {} numbers, not 3, 4, 6 or 7", all.len())),
        };
        self.positions += 1;
        let color = color.map(|c: [f64; 3]| {
            if c.iter().any(|v| !v.is_finite()) {
                self.bad_colors += 1;
                return [255; 4];
            }
            let [r, g, b] = c.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            [r, g, b, 255]
        });
        self.any_color |= color.is_some();
        Ok((p, color))
    }
}

fn number(word: &str) -> Result<f64, String> {
    word.parse().map_err(|_| format!("\"{}\" is not a number", bytes::excerpt(word, 40)))
}

/// Up to `N` numbers of which `least` must be there; the others are 0, further ones are not read.
fn numbers<const N: usize>(rest: &str, least: usize) -> Result<[f64; N], String> {
    let mut out = [0.0; N];
    let mut n = 0;
    for w in rest.split('#').next().unwrap_or("").split_whitespace().take(N) {
        out[n] = number(w)?;
        n += 1;
    }
    if n < least { Err(format!("{n} numbers, not {least}")) } else { Ok(out) }
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or from the end where negative.
fn corner(word: &str, listed: &Listed) -> Result<Corner, String> {
    let mut out = [u32::MAX; 3];
    let mut fields = word.split('/');
    let of = [("vertex", listed.positions), ("texture coordinate", listed.uvs), ("normal", listed.normals)];
    for (k, (what, n)) in of.into_iter().enumerate() {
        let field = fields.next().unwrap_or("");
        if field.is_empty() {
            if k == 0 {
                return Err(format!("the corner \"{}\" names no vertex", bytes::excerpt(word, 40)));
            }
            continue;
        }
        let i: i64 = field.parse().map_err(|_| format!("\"{}\" is not an index", bytes::excerpt(word, 40)))?;
        let at = if i < 0 { (n as i64).checked_add(i) } else { i.checked_sub(1) };
        match at.filter(|&a| a >= 0 && a < n as i64) {
            Some(a) => out[k] = a as u32,
            None => return Err(format!("the face names {what} {i}; {n} are defined before it")),
        }
    }
    match fields.next() {
        Some(_) => Err(format!("the corner \"{}\" has more than three fields", bytes::excerpt(word, 40))),
        None => Ok(out),
    }
}
