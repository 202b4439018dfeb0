//! Where readers of large formats put what they read, piece by piece: a [`Part`] in memory, or files.

use bytemuck::Pod;
use glam::{DVec3, Vec2, Vec3};

use super::part::Part;
use super::{LoadError, polygon};

/// A corner of a face, by what it names; all that it names has been given before.
pub(super) trait Corner: Pod + Ord + Send + Sync {
    /// A triangle and its number, for files.
    type Record: Pod + Send + Sync;
    /// The record of a triangle.
    fn pack(corners: [Self; 3], number: u32) -> Self::Record;
    /// What was packed.
    fn unpack(record: Self::Record) -> ([Self; 3], u32);
    /// The number of its position, which is that of its colour too.
    fn position(self) -> u32;
    /// The number of its texture coordinates.
    fn uv(self) -> Option<u32>;
    /// The number of its normal.
    fn normal(self) -> Option<u32>;
    /// All corners with positions in a range, where a position makes a corner.
    fn all(range: std::ops::Range<u32>) -> Option<Vec<Self>>;
}

/// Vertices that have everything under one number.
impl Corner for u32 {
    type Record = [u32; 4];
    fn pack([a, b, c]: [u32; 3], number: u32) -> [u32; 4] {
        [a, b, c, number]
    }
    fn unpack([a, b, c, number]: [u32; 4]) -> ([u32; 3], u32) {
        ([a, b, c], number)
    }
    fn position(self) -> u32 {
        self
    }
    fn uv(self) -> Option<u32> {
        Some(self)
    }
    fn normal(self) -> Option<u32> {
        Some(self)
    }
    fn all(range: std::ops::Range<u32>) -> Option<Vec<u32>> {
        Some(range.collect())
    }
}

/// Position, texture coordinates, normal; `u32::MAX` where there is none.
impl Corner for [u32; 3] {
    type Record = [u32; 10];
    fn pack([a, b, c]: [[u32; 3]; 3], number: u32) -> [u32; 10] {
        [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], number]
    }
    fn unpack(r: [u32; 10]) -> ([[u32; 3]; 3], u32) {
        ([[r[0], r[1], r[2]], [r[3], r[4], r[5]], [r[6], r[7], r[8]]], r[9])
    }
    fn position(self) -> u32 {
        self[0]
    }
    fn uv(self) -> Option<u32> {
        (self[1] != u32::MAX).then_some(self[1])
    }
    fn normal(self) -> Option<u32> {
        (self[2] != u32::MAX).then_some(self[2])
    }
    fn all(_: std::ops::Range<u32>) -> Option<Vec<[u32; 3]>> {
        None
    }
}

/// What takes a file's pieces. Attributes that are left out for some vertices are given as `None`.
pub(super) trait Sink<C> {
    /// Begins a mesh; faces that follow are its own. `place` is what faces are counted in: "line", "face".
    fn part(&mut self, name: &str, place: &'static str) -> Result<(), LoadError>;
    fn position(&mut self, p: DVec3) -> Result<(), LoadError>;
    /// The colour of the last position, sRGB.
    fn color(&mut self, c: Option<[u8; 4]>) -> Result<(), LoadError>;
    fn uv(&mut self, uv: Option<Vec2>) -> Result<(), LoadError>;
    fn normal(&mut self, n: Option<Vec3>) -> Result<(), LoadError>;
    /// A face of at least three corners, which stands at `place` in the file.
    fn face(&mut self, corners: &[C], material: u32, place: u32) -> Result<(), LoadError>;
}

/// In memory, for one mesh whose vertices have everything under one number.
impl Sink<u32> for Part {
    fn part(&mut self, name: &str, place: &'static str) -> Result<(), LoadError> {
        self.name = name.to_owned();
        self.place = place;
        Ok(())
    }
    fn position(&mut self, p: DVec3) -> Result<(), LoadError> {
        self.positions.push(p);
        Ok(())
    }
    fn color(&mut self, c: Option<[u8; 4]>) -> Result<(), LoadError> {
        self.colors.extend(c);
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
    fn face(&mut self, corners: &[u32], material: u32, place: u32) -> Result<(), LoadError> {
        if let &[a, b, c] = corners {
            self.triangles.push([a, b, c]);
        } else {
            let points: Vec<DVec3> = corners.iter().map(|&v| self.positions[v as usize]).collect();
            let mut split = vec![];
            polygon::triangulate(&points, &mut split);
            self.triangles.extend(split.iter().map(|t| t.map(|k| corners[k as usize])));
        }
        self.materials.resize(self.triangles.len(), material);
        self.places.resize(self.triangles.len(), place);
        Ok(())
    }
}
