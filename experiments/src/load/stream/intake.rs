//! What a reader gives, in temporary files: positions, attributes and the triangles that have an area.
//!
//! The checks are those of meshes in memory ([`super::super::part`]), a batch of faces at a time: corners that are not finite are
//! refused with their place, triangles without area kept out and counted. Duplicates are not looked for. O(n).

use std::ops::Range;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::Work;
use super::array::{Array, Places};
use crate::load::sink::{Corner, Sink};
use crate::load::{LoadError, polygon};

/// Texture coordinates of vertices that have none.
const NO_UV: [f32; 2] = [f32::from_bits(0x7fc0_1dea); 2];

/// A mesh, by its triangles.
pub(super) struct Mesh {
    pub(super) name: String,
    place: &'static str,
    /// Runs of triangles of one material, in the file's order.
    pub(super) runs: Vec<(u32, Range<u64>)>,
    /// The box of its corners, the file's units.
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// The range of its positions' numbers.
    pub(super) positions: Range<u32>,
    pub(super) uvs: bool,
    pub(super) colors: bool,
    /// Whether some corners have normals of their own, and whether some have none.
    pub(super) normals_given: bool,
    pub(super) normals_missing: bool,
}

impl Mesh {
    /// Its triangles.
    pub(super) fn triangles(&self) -> u64 {
        self.runs.iter().map(|r| r.1.end - r.1.start).sum()
    }

    fn place_of(&self, number: u32) -> String {
        if self.place == "line" {
            format!("line {number}")
        } else {
            format!("\"{}\": {} {number}", self.name, self.place)
        }
    }
}

/// An attribute, in a file as soon as anything has it.
pub(super) struct Attribute<T> {
    pub(super) array: Option<Array<T>>,
    /// What stands for none.
    missing: T,
    /// How many have none, before the first that has it.
    skipped: u64,
}

impl<T: bytemuck::Pod> Attribute<T> {
    fn new(missing: T) -> Self {
        Self { array: None, missing, skipped: 0 }
    }

    fn push(&mut self, folder: &Path, value: Option<T>) -> std::io::Result<()> {
        match (&mut self.array, value) {
            (None, None) => {
                self.skipped += 1;
                Ok(())
            }
            (Some(array), value) => array.push(value.unwrap_or(self.missing)),
            (None, Some(value)) => {
                let array = self.array.insert(Array::filled(folder, self.skipped, self.missing)?);
                array.push(value)
            }
        }
    }
}

/// Everything that was read.
pub(super) struct Intake<'a, C> {
    pub(super) file: &'a Path,
    pub(super) work: &'a Work<'a>,
    pub(super) positions: Array<[f64; 3]>,
    pub(super) normals: Attribute<[f32; 3]>,
    pub(super) uvs: Attribute<[f32; 2]>,
    /// Alpha 0 where a vertex has none.
    pub(super) colors: Attribute<[u8; 4]>,
    pub(super) triangles: Array<[C; 3]>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) degenerate: u64,
    corners: Vec<C>,
    /// Corners, material and place of each face that waits.
    faces: Vec<(u32, u32, u32)>,
}

impl<'a, C: Corner> Intake<'a, C> {
    /// Nothing yet.
    pub(super) fn new(file: &'a Path, work: &'a Work<'a>) -> Result<Self, LoadError> {
        let failed = |e| LoadError::temporary(work.folder, e);
        Ok(Self {
            file,
            work,
            positions: Array::new(work.folder).map_err(failed)?,
            normals: Attribute::new([0.0; 3]),
            uvs: Attribute::new(NO_UV),
            colors: Attribute::new([255, 255, 255, 0]),
            triangles: Array::new(work.folder).map_err(failed)?,
            meshes: vec![],
            degenerate: 0,
            corners: vec![],
            faces: vec![],
        })
    }

    fn failed(&self) -> impl Fn(std::io::Error) -> LoadError + use<'a, C> {
        let folder = self.work.folder;
        move |e| LoadError::temporary(folder, e)
    }

    /// Ends reading: nothing waits any more.
    pub(super) fn finish(&mut self) -> Result<(), LoadError> {
        self.sift()?;
        let failed = self.failed();
        self.flush().and_then(|()| self.triangles.flush()).map_err(failed)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.positions.flush()?;
        self.normals.array.iter_mut().try_for_each(Array::flush)?;
        self.uvs.array.iter_mut().try_for_each(Array::flush)?;
        self.colors.array.iter_mut().try_for_each(Array::flush)
    }

    /// Splits the faces that wait into triangles, checks these and appends them to the last mesh.
    fn sift(&mut self) -> Result<(), LoadError> {
        if self.faces.is_empty() {
            return Ok(());
        }
        let failed = self.failed();
        self.work.go_on().and_then(|()| self.flush()).map_err(&failed)?;
        let (corners, faces) = (std::mem::take(&mut self.corners), std::mem::take(&mut self.faces));
        let places = Places::of(corners.iter().map(|c| c.position()).collect());
        let at = self.positions.gather(&places).map_err(&failed)?;
        let mesh = self.meshes.last_mut().expect("faces follow a mesh");
        let ends = places.ends();
        mesh.positions = match mesh.positions.is_empty() {
            true => ends,
            false => mesh.positions.start.min(ends.start)..mesh.positions.end.max(ends.end),
        };
        mesh.colors = mesh.colors || given(self.colors.array.as_ref(), &places, |c| c[3] != 0).map_err(&failed)?;
        if !mesh.uvs {
            let named: Vec<u32> = corners.iter().filter_map(|c| c.uv()).collect();
            let is = |uv: &[f32; 2]| uv.map(f32::to_bits) != NO_UV.map(f32::to_bits);
            mesh.uvs = given(self.uvs.array.as_ref(), &Places::of(named), is).map_err(&failed)?;
        }
        let normal_places = Places::of(corners.iter().filter_map(|c| c.normal()).collect());
        let normals = match &self.normals.array {
            Some(n) => n.gather(&normal_places).map_err(&failed)?,
            None => vec![],
        };
        let has_normal = |c: C| {
            let n = c.normal().and_then(|i| normals.get(normal_places.slot(i)));
            n.is_some_and(|n| Vec3::from(*n).try_normalize().is_some())
        };
        let (mut rest, mut points, mut split) = (&corners[..], vec![], vec![]);
        for (len, material, number) in faces {
            let (face, after) = rest.split_at(len as usize);
            rest = after;
            split.clear();
            points.clear();
            points.extend(face.iter().map(|c| DVec3::from(at[places.slot(c.position())])));
            polygon::triangulate(&points, &mut split);
            for t in &split {
                let [a, b, c] = t.map(|k| points[k as usize]);
                let t = t.map(|k| face[k as usize]);
                if let Some(k) = [a, b, c].iter().position(|p| !p.is_finite()) {
                    let (v, at) = (t[k].position(), [a, b, c][k]);
                    let cause = format!("its vertex {v} stands at {at}, which is not finite");
                    return Err(LoadError::data(self.file, mesh.place_of(number), cause));
                }
                let scale = (b - a).abs().max((c - a).abs()).max_element();
                if !(scale > 0.0 && ((b - a) / scale).cross((c - a) / scale) != DVec3::ZERO) {
                    self.degenerate += 1;
                    continue;
                }
                mesh.low = mesh.low.min(a).min(b).min(c);
                mesh.high = mesh.high.max(a).max(b).max(c);
                for c in t {
                    let given = has_normal(c);
                    mesh.normals_given |= given;
                    mesh.normals_missing |= !given;
                }
                let i = self.triangles.len();
                if i == u64::from(u32::MAX) {
                    return Err(LoadError::data(
                        self.file,
                        mesh.place_of(number),
                        "there are more than 2^32 triangles",
                    ));
                }
                match mesh.runs.last_mut() {
                    Some((m, r)) if *m == material && r.end == i => r.end = i + 1,
                    _ => mesh.runs.push((material, i..i + 1)),
                }
                self.triangles.push(t).map_err(&failed)?;
            }
        }
        Ok(())
    }
}

/// Whether a vertex at one of the places has an attribute.
fn given<T: bytemuck::Pod>(
    array: Option<&Array<T>>,
    places: &Places,
    has: impl Fn(&T) -> bool,
) -> std::io::Result<bool> {
    match array {
        Some(a) => Ok(a.gather(places)?.iter().any(has)),
        None => Ok(false),
    }
}

impl<C: Corner> Sink<C> for Intake<'_, C> {
    fn part(&mut self, name: &str, place: &'static str) -> Result<(), LoadError> {
        self.sift()?;
        self.meshes.push(Mesh {
            name: name.to_owned(),
            place,
            runs: vec![],
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            positions: 0..0,
            uvs: false,
            colors: false,
            normals_given: false,
            normals_missing: false,
        });
        Ok(())
    }

    fn position(&mut self, p: DVec3) -> Result<(), LoadError> {
        if self.positions.len() == u64::from(u32::MAX) {
            return Err(LoadError::data(self.file, "vertices", "there are more than 2^32"));
        }
        let failed = self.failed();
        self.positions.push(p.to_array()).map_err(failed)
    }

    fn color(&mut self, c: Option<[u8; 4]>) -> Result<(), LoadError> {
        let failed = self.failed();
        self.colors.push(self.work.folder, c.map(|[r, g, b, _]| [r, g, b, 255])).map_err(failed)
    }

    fn uv(&mut self, uv: Option<Vec2>) -> Result<(), LoadError> {
        let failed = self.failed();
        let uv = uv.map(|uv| if uv.is_finite() { uv.to_array() } else { [0.0; 2] });
        self.uvs.push(self.work.folder, uv).map_err(failed)
    }

    fn normal(&mut self, n: Option<Vec3>) -> Result<(), LoadError> {
        let failed = self.failed();
        self.normals.push(self.work.folder, n.map(|n| n.to_array())).map_err(failed)
    }

    fn face(&mut self, corners: &[C], material: u32, place: u32) -> Result<(), LoadError> {
        self.corners.extend_from_slice(corners);
        self.faces.push((corners.len() as u32, material, place));
        if self.corners.len() >= 3 * self.work.batch { self.sift() } else { Ok(()) }
    }
}
