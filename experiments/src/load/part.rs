//! What every reader makes, and the checks that all of it goes through.
//!
//! Kept out, with a warning that counts them: triangles without area (a corner twice, or a cross product of exactly zero in
//! 64 bits). Kept, with a warning: duplicate triangles (same three positions, whatever the winding). Refused: a triangle
//! with a corner that does not exist or is not finite; an extent whose square overflows 32-bit floats. Dropped silently:
//! vertices that no triangle uses. O(n log n).

use std::path::Path;

use farfield_core::id::MaterialId;
use farfield_core::mesh::{TriangleMesh, position_ids};
use farfield_core::scene::{Material, Texture};
use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::{Counts, LoadError};

/// One mesh as a reader makes it.
#[derive(Default)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) positions: Vec<DVec3>,
    /// Empty, or one a vertex; zero where the file gives none.
    pub(super) normals: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) colors: Vec<[u8; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The material of each triangle.
    pub(super) materials: Vec<u32>,
    /// Where each triangle stands in the file, in units of `place`; empty: its number.
    pub(super) places: Vec<u32>,
    /// "line", "face", "facet", ...
    pub(super) place: &'static str,
}

/// A file as a reader makes it.
#[derive(Default)]
pub(super) struct Model {
    pub(super) parts: Vec<Part>,
    /// Parts and their transforms, in the file's units and axes.
    pub(super) placements: Vec<(usize, DAffine3)>,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) warnings: Vec<String>,
    /// Whether all parts stand in one space, once each.
    pub(super) flat: bool,
}

/// A file whose meshes have been checked.
pub(super) struct Checked {
    /// Meshes; those left without triangles are `None`.
    pub(super) meshes: Vec<Option<(String, TriangleMesh)>>,
    pub(super) placements: Vec<(usize, DAffine3)>,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) warnings: Vec<String>,
    pub(super) counts: Counts,
}

impl Part {
    fn place_of(&self, triangle: usize) -> String {
        let number = self.places.get(triangle).map_or(triangle, |&p| p as usize);
        if self.place == "line" {
            format!("line {number}")
        } else {
            format!("\"{}\": {} {number}", self.name, self.place)
        }
    }

    /// Corners exist and are finite; triangles without area go. Returns how many went.
    fn sift(&mut self, file: &Path) -> Result<usize, LoadError> {
        let n = self.positions.len();
        let mut keep = vec![true; self.triangles.len()];
        for (i, t) in self.triangles.iter().enumerate() {
            if let Some(v) = t.iter().find(|&&v| v as usize >= n) {
                return Err(LoadError::data(
                    file,
                    self.place_of(i),
                    format!("names vertex {v} of {n} (counted from 0)"),
                ));
            }
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            if let Some(k) = [a, b, c].iter().position(|p| !p.is_finite()) {
                let cause = format!("its vertex {} stands at {}, which is not finite", t[k], [a, b, c][k]);
                return Err(LoadError::data(file, self.place_of(i), cause));
            }
            let scale = (b - a).abs().max((c - a).abs()).max_element();
            keep[i] = scale > 0.0 && ((b - a) / scale).cross((c - a) / scale) != DVec3::ZERO;
        }
        let mut k = keep.iter();
        self.triangles.retain(|_| *k.next().expect("one flag a triangle"));
        let mut k = keep.iter();
        self.materials.retain(|_| *k.next().expect("one flag a triangle"));
        Ok(keep.iter().filter(|k| !**k).count())
    }

    /// The finished mesh, relative to `origin`: unused vertices dropped, triangles in runs of one material.
    fn finish(self, origin: DVec3) -> TriangleMesh {
        let mut order: Vec<usize> = (0..self.triangles.len()).collect();
        order.sort_by_key(|&i| self.materials[i]);
        let mut new = vec![u32::MAX; self.positions.len()];
        let (mut used, mut out) = (vec![], TriangleMesh::default());
        for i in order {
            for v in self.triangles[i] {
                if new[v as usize] == u32::MAX {
                    new[v as usize] = used.len() as u32;
                    used.push(v as usize);
                }
                out.indices.push(new[v as usize]);
            }
            let (end, material) = (out.indices.len() as u32, MaterialId(self.materials[i]));
            match out.sections.last_mut() {
                Some((r, m)) if *m == material => r.end = end,
                _ => out.sections.push((end - 3..end, material)),
            }
        }
        out.positions = used.iter().map(|&v| (self.positions[v] - origin).as_vec3()).collect();
        if !self.uvs.is_empty() {
            out.uvs = used.iter().map(|&v| if self.uvs[v].is_finite() { self.uvs[v] } else { Vec2::ZERO }).collect();
        }
        if !self.colors.is_empty() {
            out.colors = used.iter().map(|&v| self.colors[v]).collect();
        }
        let normals: Vec<Option<Vec3>> =
            used.iter().map(|&v| self.normals.get(v).and_then(|n| n.try_normalize())).collect();
        if normals.iter().any(Option::is_some) {
            if normals.iter().any(Option::is_none) {
                out.smooth_normals();
            } else {
                out.normals = vec![Vec3::Y; normals.len()];
            }
            out.normals.iter_mut().zip(normals).for_each(|(n, given)| *n = given.unwrap_or(*n));
        }
        out
    }
}

impl Model {
    /// Checks everything.
    pub(super) fn check(mut self, file: &Path) -> Result<Checked, LoadError> {
        let mut counts = Counts::default();
        for p in &mut self.parts {
            counts.degenerate_triangles += p.sift(file)?;
        }
        if self.parts.iter().all(|p| p.triangles.is_empty()) {
            return Err(no_triangles(file, counts.degenerate_triangles as u64));
        }
        let origin = self.extent(file)?;
        counts.duplicate_triangles = self.duplicates();
        for (n, what) in [
            (counts.degenerate_triangles, "triangles without area kept out"),
            (counts.duplicate_triangles, "duplicate triangles kept"),
        ] {
            if n > 0 {
                self.warnings.push(format!("{n} {what}"));
            }
        }
        let moved = DAffine3::from_translation(origin);
        let meshes: Vec<_> = self
            .parts
            .into_iter()
            .map(|mut p| {
                let name = std::mem::take(&mut p.name);
                (!p.triangles.is_empty()).then(|| (name, p.finish(origin)))
            })
            .collect();
        self.placements.retain(|p| meshes[p.0].is_some());
        for (_, m) in meshes.iter().flatten() {
            counts.parts += m.sections.len();
        }
        for (i, m) in &mut self.placements {
            *m *= moved;
            let mesh = &meshes[*i].as_ref().expect("placements of empty meshes are gone").1;
            counts.placed_parts += mesh.sections.len();
            counts.triangles += mesh.triangles();
        }
        counts.meshes = meshes.iter().flatten().count();
        let (placements, materials) = (self.placements, self.materials);
        Ok(Checked { meshes, placements, materials, textures: self.textures, warnings: self.warnings, counts })
    }

    fn extent(&self, file: &Path) -> Result<DVec3, LoadError> {
        let mut boxes = vec![];
        for p in self.parts.iter().filter(|p| !p.triangles.is_empty()) {
            let (mut l, mut h) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for &v in p.triangles.iter().flatten() {
                let x = p.positions[v as usize];
                (l, h) = (l.min(x), h.max(x));
            }
            boxes.push((p.name.as_str(), l, h));
        }
        origin(file, &boxes, self.flat)
    }

    /// Triangles whose three positions another one before them has too.
    fn duplicates(&self) -> usize {
        let space = |parts: &[Part]| {
            let all: Vec<Vec3> = parts.iter().flat_map(|p| p.positions.iter().map(|p| p.as_vec3())).collect();
            let ids = position_ids(&all);
            let mut first = 0;
            let mut keys: Vec<[u32; 3]> = vec![];
            for p in parts {
                keys.extend(p.triangles.iter().map(|t| {
                    let mut k = t.map(|v| ids[first + v as usize]);
                    k.sort_unstable();
                    k
                }));
                first += p.positions.len();
            }
            keys.sort_unstable();
            keys.windows(2).filter(|w| w[0] == w[1]).count()
        };
        if self.flat { space(&self.parts) } else { self.parts.iter().map(|p| space(std::slice::from_ref(p))).sum() }
    }
}

/// Refuses a file without triangles.
pub(super) fn no_triangles(file: &Path, degenerate: u64) -> LoadError {
    let cause = match degenerate {
        0 => "holds no triangles".to_owned(),
        n => format!("all {n} triangles have no area"),
    };
    LoadError::data(file, "the whole file", cause)
}

/// Refuses extents that 32-bit floats cannot measure, by the names and boxes of meshes with triangles; returns the origin that
/// keeps coordinates precise: zero, or, for a flat file that stands further than 64 of its diagonals away, its middle.
pub(super) fn origin(file: &Path, boxes: &[(&str, DVec3, DVec3)], flat: bool) -> Result<DVec3, LoadError> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &(name, l, h) in boxes {
        let diagonal2 = (h - l).as_vec3().length_squared();
        let refused = |what: &str, flows: &str| {
            let cause =
                format!("its box {l:?} .. {h:?} is too {what}: the square of its diagonal {flows} 32-bit floats");
            LoadError::data(file, format!("\"{name}\""), cause)
        };
        if !(diagonal2.is_finite() && l.as_vec3().is_finite() && h.as_vec3().is_finite()) {
            return Err(refused("large", "overflows"));
        }
        if diagonal2 < f32::MIN_POSITIVE {
            return Err(refused("small", "underflows"));
        }
        (low, high) = (low.min(l), high.max(h));
    }
    let middle = (low + high) * 0.5;
    let far = flat && middle.length() > 64.0 * (high - low).length();
    Ok(if far { middle } else { DVec3::ZERO })
}
