//! Wavefront OBJ: `v` (with colours), `vt`, `vn`, `f`, `o`, `g`, `usemtl`, `mtllib`; other statements are skipped.
//!
//! Follows Wavefront's "Object Files (.obj)" specification, version 3.0, for polygons, with vertex colours as MeshLab writes
//! them (`v x y z r g b`, sRGB 0..1). Read here and not by `tobj`, whose errors name no line, which shifts attributes where
//! only some faces have them, stops at Latin-1 bytes and continued lines, and panics on `Kd 1`; the tests hold this reader
//! to tobj's result on every file that tobj reads. Each `o` or `g` with faces is a part. Smoothing groups, lines, points
//! and free-form surfaces are not used. O(n).

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::part::{Model, Part};
use super::texture::Textures;
use super::{LoadError, bytes, mtl, plain, polygon};

/// What the file has listed so far.
#[derive(Default)]
struct Lists {
    positions: Vec<DVec3>,
    colors: Vec<Option<[u8; 4]>>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    bad_colors: usize,
}

/// A corner as resolved indices; `u32::MAX` where there is none.
type Corner = [u32; 3];

struct Building {
    part: Part,
    index: HashMap<Corner, u32>,
    any_uv: bool,
    any_normal: bool,
    any_color: bool,
}

impl Building {
    fn new(name: &str) -> Self {
        let part = Part { name: name.to_owned(), place: "line", ..Default::default() };
        Self { part, index: HashMap::new(), any_uv: false, any_normal: false, any_color: false }
    }

    fn vertex(&mut self, corner: Corner, lists: &Lists) -> u32 {
        *self.index.entry(corner).or_insert_with(|| {
            let [v, vt, vn] = corner.map(|i| i as usize);
            self.any_uv |= vt < lists.uvs.len();
            self.any_normal |= vn < lists.normals.len();
            self.any_color |= lists.colors[v].is_some();
            self.part.positions.push(lists.positions[v]);
            self.part.uvs.push(lists.uvs.get(vt).copied().unwrap_or_default());
            self.part.normals.push(lists.normals.get(vn).copied().unwrap_or_default());
            self.part.colors.push(lists.colors[v].unwrap_or([255; 4]));
            self.part.positions.len() as u32 - 1
        })
    }

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

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Model, LoadError> {
    let text = bytes::text(data);
    let mut model = Model { flat: true, ..Default::default() };
    let mut textures = Textures::default();
    let mut materials: HashMap<String, u32> = HashMap::new();
    let (mut given, mut libraries) = (BTreeSet::new(), BTreeSet::new());
    let mut material = None;
    let mut lists = Lists::default();
    let mut now = Building::new("unnamed");
    let (mut corners, mut points, mut split) = (vec![], vec![], vec![]);

    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        let number = i as u32 + 1;
        let mut joined = String::new();
        let mut line = line;
        // A backslash at the end continues a line (specification, "Comments").
        while line.trim_end().ends_with('\\') {
            joined.push_str(line.trim_end().trim_end_matches('\\'));
            joined.push(' ');
            line = lines.next().map_or("", |(_, l)| l);
        }
        if !joined.is_empty() {
            joined.push_str(line);
            line = &joined;
        }
        let bad = |cause: String| LoadError::data(path, format!("line {number}"), cause);
        let (word, rest) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
        match word {
            "v" => lists.vertex(rest).map_err(bad)?,
            "vt" => {
                let [u, v] = numbers::<2>(rest, 1).map_err(bad)?;
                lists.uvs.push(Vec2::new(u as f32, 1.0 - v as f32));
            }
            "vn" => {
                let n = numbers::<3>(rest, 3).map_err(bad)?;
                lists.normals.push(DVec3::from(n).as_vec3());
            }
            "f" | "fo" => {
                corners.clear();
                for word in rest.split('#').next().unwrap_or("").split_whitespace() {
                    corners.push(corner(word, &lists).map_err(bad)?);
                }
                if corners.len() < 3 {
                    return Err(bad(format!("a face of {} corners", corners.len())));
                }
                points.clear();
                points.extend(corners.iter().map(|c| lists.positions[c[0] as usize]));
                split.clear();
                polygon::triangulate(&points, &mut split);
                let material = *material.get_or_insert_with(|| {
                    model.materials.push(plain("default"));
                    model.materials.len() as u32 - 1
                });
                let ids: Vec<u32> = corners.iter().map(|&c| now.vertex(c, &lists)).collect();
                for t in &split {
                    now.part.triangles.push(t.map(|k| ids[k as usize]));
                    now.part.materials.push(material);
                    now.part.places.push(number);
                }
            }
            "o" | "g" => {
                let name = if rest.trim().is_empty() { "unnamed" } else { rest.trim() };
                model.parts.extend(std::mem::replace(&mut now, Building::new(name)).finish());
            }
            "usemtl" => {
                let name = rest.trim();
                material = Some(*materials.entry(name.to_owned()).or_insert_with(|| {
                    if !name.is_empty() {
                        model.warnings.push(format!("line {number}: there is no material \"{name}\": grey is taken"));
                    }
                    model.materials.push(plain(name));
                    model.materials.len() as u32 - 1
                }));
            }
            "mtllib" => {
                if !libraries.insert(rest.trim().to_owned()) {
                    continue;
                }
                for (name, m) in mtl::read_library(path, rest.trim(), &mut textures, &mut model.warnings) {
                    model.materials.push(m);
                    materials.insert(name, model.materials.len() as u32 - 1);
                    given.insert(model.materials.len() as u32 - 1);
                }
            }
            _ => {}
        }
    }
    model.parts.extend(now.finish());
    if lists.colors.iter().any(Option::is_some) {
        // Materials that the file itself does not colour show the vertices' colours as they are.
        let own = |i: usize| !given.contains(&(i as u32));
        model.materials.iter_mut().enumerate().filter(|(i, _)| own(*i)).for_each(|(_, m)| m.base_color = [1.0; 4]);
    }
    if lists.bad_colors > 0 {
        model.warnings.push(format!("{} vertex colours are not finite: white is taken", lists.bad_colors));
    }
    model.placements = (0..model.parts.len()).map(|i| (i, glam::DAffine3::IDENTITY)).collect();
    model.textures = textures.finish();
    Ok(model)
}

impl Lists {
    /// `x y z`, `x y z w` (divided by w) or `x y z r g b`.
    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let words: Vec<&str> = rest.split('#').next().unwrap_or("").split_whitespace().collect();
        let all = words.iter().map(|w| number(w)).collect::<Result<Vec<f64>, String>>()?;
        let (p, color) = match *all {
            [x, y, z] => (DVec3::new(x, y, z), None),
            [x, y, z, w] if w != 0.0 => (DVec3::new(x, y, z) / w, None),
            [_, _, _, w] => return Err(format!("weight {w} of a vertex")),
            [x, y, z, r, g, b] | [x, y, z, r, g, b, _] => (DVec3::new(x, y, z), Some([r, g, b])),
            _ => return Err(format!("a vertex of {} numbers, not 3, 4, 6 or 7", all.len())),
        };
        self.positions.push(p);
        self.colors.push(color.map(|c| {
            if c.iter().any(|v| !v.is_finite()) {
                self.bad_colors += 1;
                return [255; 4];
            }
            let [r, g, b] = c.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            [r, g, b, 255]
        }));
        Ok(())
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
fn corner(word: &str, lists: &Lists) -> Result<Corner, String> {
    let mut out = [u32::MAX; 3];
    let mut fields = word.split('/');
    let of =
        [("vertex", lists.positions.len()), ("texture coordinate", lists.uvs.len()), ("normal", lists.normals.len())];
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
