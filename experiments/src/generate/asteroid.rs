//! An asteroid: one closed, bumpy surface with craters of all sizes, of as many triangles as wanted, made vertex by vertex.
//!
//! It stands for scans of single objects with tens and hundreds of millions of triangles, and is what tests of models larger than memory
//! use: [`write_ply`] never holds more than a few thousand vertices. A cube's surface with n x n squares a side is blown up to a
//! ball (its squares spread evenly by a tangent) and displaced by noise down to the mesh's spacing: 12 n^2 triangles, 6 n^2 + 2
//! vertices. O(n^2), constant memory.

use std::io::{self, Write};

use farfield_core::mesh::TriangleMesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::GenerateError;
use super::noise::{cells, fbm};

/// The least total.
pub const LEAST_ASTEROID: u64 = 768;
/// The greatest total: far above what fits in memory, and below what 32 bits can number.
pub const MOST_ASTEROID: u64 = 1_000_000_000;
/// A million triangles.
pub const ASTEROID_1M: u64 = 1_000_000;

/// Mean radius, scene units.
const RADIUS: f32 = 100.0;
/// Vertices, or squares, that are made at a time.
const BATCH: u64 = 1 << 14;

/// What asteroid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AsteroidSettings {
    /// Triangles; 12 n^2 come nearest.
    pub triangles: u64,
    /// Seed of its shape.
    pub seed: u64,
}

/// The surface of a cube of n x n x n cells as a grid: its points are numbered layer by layer, z upwards.
#[derive(Clone, Copy)]
struct Grid {
    n: u64,
    seed: u32,
}

impl Grid {
    fn new(s: &AsteroidSettings) -> Result<Self, GenerateError> {
        let (least, most) = (LEAST_ASTEROID, MOST_ASTEROID);
        if !(least..=most).contains(&s.triangles) {
            return Err(GenerateError::Total { what: "an asteroid", asked: s.triangles, least, most });
        }
        let n = (s.triangles as f64 / 12.0).sqrt().round() as u64;
        Ok(Self { n, seed: (s.seed ^ s.seed >> 32) as u32 })
    }

    fn vertices(self) -> u64 {
        6 * self.n * self.n + 2
    }

    /// Squares; each is two triangles.
    fn squares(self) -> u64 {
        6 * self.n * self.n
    }

    /// The number of a point of the surface.
    fn number(self, [x, y, z]: [u64; 3]) -> u64 {
        let n = self.n;
        let side = n + 1;
        if z == 0 {
            return y * side + x;
        }
        if z == n {
            return side * side + (n - 1) * 4 * n + y * side + x;
        }
        // Around a layer, counter-clockwise from (0, 0).
        let around = match (x, y) {
            (x, 0) if x < n => x,
            (x, y) if x == n && y < n => n + y,
            (x, y) if y == n && x > 0 => 3 * n - x,
            (_, y) => 4 * n - y,
        };
        side * side + (z - 1) * 4 * n + around
    }

    /// The point with a number.
    fn point(self, number: u64) -> [u64; 3] {
        let n = self.n;
        let side = n + 1;
        if number < side * side {
            return [number % side, number / side, 0];
        }
        let k = number - side * side;
        if k >= (n - 1) * 4 * n {
            let k = k - (n - 1) * 4 * n;
            return [k % side, k / side, n];
        }
        let (z, k) = (1 + k / (4 * n), k % (4 * n));
        match (k / n, k % n) {
            (0, k) => [k, 0, z],
            (1, k) => [n, k, z],
            (2, k) => [n - k, n, z],
            (_, k) => [0, n - k, z],
        }
    }

    /// The two triangles of a square, counter-clockwise seen from outside.
    fn triangles(self, square: u64) -> [[u32; 3]; 2] {
        let n = self.n;
        let (face, k) = (square / (n * n), square % (n * n));
        let (axis, high) = ((face / 2) as usize, face % 2 == 1);
        let corner = |du: u64, dv: u64| {
            let mut at = [0; 3];
            at[axis] = if high { n } else { 0 };
            at[(axis + 1) % 3] = k % n + du;
            at[(axis + 2) % 3] = k / n + dv;
            self.number(at) as u32
        };
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        if high { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
    }

    /// Place and sRGB colour of a vertex.
    fn vertex(self, number: u64) -> (Vec3, [u8; 4]) {
        let even = |i: u64| ((2.0 * i as f64 / self.n as f64 - 1.0) * std::f64::consts::FRAC_PI_4).tan();
        let out = DVec3::from(self.point(number).map(even)).normalize().as_vec3();
        let spacing = RADIUS * std::f32::consts::FRAC_PI_2 / self.n as f32;
        let p = out * RADIUS;
        let lumps = fbm(p, 160.0, 14, spacing, self.seed);
        let bowl = |c: f32| {
            let t = ((c - 0.5) / 0.4).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let craters = [(48.0, 7.0), (17.0, 2.5), (6.0, 0.9), (2.0, 0.3), (0.7, 0.1)]
            .iter()
            .zip(1_u32..)
            .map(|(&(width, depth), k)| depth * bowl(cells(p, width, spacing, self.seed.wrapping_add(77 * k))))
            .sum::<f32>();
        let height = 26.0 * lumps - craters;
        let tone = (0.7 + 0.012 * height - 0.015 * craters).clamp(0.2, 0.95);
        let color = [255.0 * tone, 245.0 * tone, 230.0 * tone].map(|v| v as u8);
        // Longer than it is wide, and flatter.
        let p = out * (RADIUS + height) * Vec3::new(1.0, 0.72, 0.85);
        (p, [color[0], color[1], color[2], 255])
    }
}

/// The asteroid in memory.
///
/// # Errors
/// [`GenerateError::Total`] where the total is out of range.
pub fn asteroid(s: &AsteroidSettings) -> Result<TriangleMesh, GenerateError> {
    let grid = Grid::new(s)?;
    let vertices: Vec<(Vec3, [u8; 4])> = (0..grid.vertices()).into_par_iter().map(|i| grid.vertex(i)).collect();
    let triangles: Vec<[[u32; 3]; 2]> = (0..grid.squares()).into_par_iter().map(|i| grid.triangles(i)).collect();
    Ok(TriangleMesh {
        positions: vertices.iter().map(|v| v.0).collect(),
        colors: vertices.iter().map(|v| v.1).collect(),
        indices: triangles.as_flattened().as_flattened().to_vec(),
        ..TriangleMesh::default()
    })
}

/// Writes the asteroid as binary PLY without holding it; returns its triangles.
///
/// # Errors
/// [`GenerateError::Total`], of kind `InvalidInput`, where the total is out of range; what writing gives.
pub fn write_ply(s: &AsteroidSettings, out: &mut impl Write, go_on: &dyn Fn() -> io::Result<()>) -> io::Result<u64> {
    let grid = Grid::new(s).map_err(|e| io::Error::new(io::ErrorKind::InvalidInput, e))?;
    let (vertices, squares) = (grid.vertices(), grid.squares());
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment farfield\nelement vertex {vertices}\nproperty float x\n\
         property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        2 * squares
    )?;
    let mut bytes = vec![];
    for first in (0..vertices).step_by(BATCH as usize) {
        go_on()?;
        let last = (first + BATCH).min(vertices);
        let made: Vec<(Vec3, [u8; 4])> = (first..last).into_par_iter().map(|i| grid.vertex(i)).collect();
        bytes.clear();
        for (p, c) in made {
            p.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend(&c[..3]);
        }
        out.write_all(&bytes)?;
    }
    for first in (0..squares).step_by(BATCH as usize) {
        go_on()?;
        bytes.clear();
        for t in (first..(first + BATCH).min(squares)).flat_map(|i| grid.triangles(i)) {
            bytes.push(3);
            t.iter().for_each(|v| bytes.extend((*v as i32).to_le_bytes()));
        }
        out.write_all(&bytes)?;
    }
    Ok(2 * squares)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn it_is_closed_and_its_outside_is_outside() {
        let mesh = asteroid(&AsteroidSettings { triangles: 30_000, seed: 3 }).unwrap();
        assert_eq!(mesh.triangles(), 12 * 50 * 50);
        assert_eq!(mesh.positions.len(), 6 * 50 * 50 + 2);
        let edges: HashSet<[u32; 2]> =
            mesh.indices.chunks_exact(3).flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
        assert_eq!(edges.len(), mesh.indices.len(), "every edge once a direction");
        assert!(edges.iter().all(|&[a, b]| edges.contains(&[b, a])), "every edge has two triangles");
        let used: HashSet<u32> = mesh.indices.iter().copied().collect();
        assert_eq!(used.len(), mesh.positions.len());
        let places: HashSet<[u32; 3]> = mesh.positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
        assert_eq!(places.len(), mesh.positions.len(), "no two vertices at one place");
        let volume: f32 = mesh.indices.chunks_exact(3).fold(0.0, |v, t| {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[t[k] as usize]);
            v + a.dot(b.cross(c)) / 6.0
        });
        let ball = 4.0 / 3.0 * std::f32::consts::PI * RADIUS.powi(3) * 0.72 * 0.85;
        assert!((0.7..1.2).contains(&(volume / ball)), "{volume} of {ball}");
    }

    #[test]
    fn numbers_and_points_are_one_to_one() {
        let grid = Grid { n: 9, seed: 1 };
        for i in 0..grid.vertices() {
            let p = grid.point(i);
            assert!(p.iter().any(|&c| c == 0 || c == 9) && p.iter().all(|&c| c <= 9), "{i}: {p:?}");
            assert_eq!(grid.number(p), i);
        }
    }

    #[test]
    fn the_file_holds_what_is_made_in_memory() {
        let settings = AsteroidSettings { triangles: 200_000, seed: 5 };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.ply");
        let mut bytes = vec![];
        assert_eq!(
            write_ply(&settings, &mut bytes, &|| Ok(())).unwrap(),
            asteroid(&settings).unwrap().triangles() as u64
        );
        std::fs::write(&file, bytes).unwrap();
        let (read, ..) = crate::load::load_mesh(&file, &crate::load::LoadOptions::default()).unwrap();
        let corners = |m: &TriangleMesh| -> Vec<(Vec3, [u8; 4])> {
            m.indices.iter().map(|&v| (m.positions[v as usize], m.colors[v as usize])).collect()
        };
        assert_eq!(corners(&read), corners(&asteroid(&settings).unwrap()));
        let too_many = AsteroidSettings { triangles: MOST_ASTEROID + 1, seed: 5 };
        let stop = || Err(io::ErrorKind::Interrupted.into());
        assert_eq!(write_ply(&settings, &mut vec![], &stop).unwrap_err().kind(), io::ErrorKind::Interrupted);
        assert_eq!(write_ply(&too_many, &mut vec![], &|| Ok(())).unwrap_err().kind(), io::ErrorKind::InvalidInput);
    }
}
