//! What is simplified: a generated sphere with bumps of many sizes, and Stanford scans where `FARFIELD_MODELS` is set.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use glam::Vec3;

/// Positions and indices; no two positions are equal.
pub(crate) type Mesh = (Vec<Vec3>, Vec<u32>);

/// An octahedron, each face cut into n x n triangles, blown up to a unit sphere and displaced by sines of seven octaves.
pub(crate) fn sphere(n: u32) -> Mesh {
    let mut ids = BTreeMap::new();
    let (mut positions, mut indices) = Mesh::default();
    for octant in 0..8 {
        let sign = [0, 1, 2].map(|k| if octant >> k & 1 == 0 { 1 } else { -1 });
        let mut vertex = |i: u32, j: u32| {
            let key = [i as i32 * sign[0], j as i32 * sign[1], (n - i - j) as i32 * sign[2]];
            *ids.entry(key).or_insert_with(|| {
                positions.push(bumpy(Vec3::from_array(key.map(|x| x as f32)).normalize()));
                positions.len() as u32 - 1
            })
        };
        let mut triangle = |t: [u32; 3]| {
            let out = sign.iter().product::<i32>() > 0;
            indices.extend(if out { t } else { [t[0], t[2], t[1]] });
        };
        for i in 0..n {
            for j in 0..n - i {
                let (a, b, c) = (vertex(i, j), vertex(i + 1, j), vertex(i, j + 1));
                triangle([a, b, c]);
                if i + j + 1 < n {
                    triangle([b, vertex(i + 1, j + 1), c]);
                }
            }
        }
    }
    (positions, indices)
}

fn bumpy(p: Vec3) -> Vec3 {
    let mut height = 1.0;
    for octave in 0..7 {
        let q = p * 1.9f32.powi(octave) * 3.0 + octave as f32;
        height += 0.08 * 0.55f32.powi(octave) * (q.x + 1.3 * q.y.sin()).sin() * (q.z - 0.7 * q.x.cos()).sin();
    }
    p * height
}

/// An ascii PLY of triangles whose vertices begin with x, y, z; compressed by gzip.
pub(crate) fn ply(path: &Path) -> Result<Mesh, String> {
    let bad = |cause: &str| format!("{}: {cause}", path.display());
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(|e| bad(&e.to_string()))?;
    flate2::read::GzDecoder::new(file).read_to_string(&mut text).map_err(|e| bad(&e.to_string()))?;
    let (header, body) = text.split_once("end_header\n").ok_or_else(|| bad("no end_header"))?;
    let count = |what: &str| -> Result<usize, String> {
        let line = header.lines().find_map(|l| l.strip_prefix(what)).ok_or_else(|| bad(what))?;
        line.trim().parse().map_err(|_| bad(line))
    };
    let (vertices, faces) = (count("element vertex ")?, count("element face ")?);
    let mut lines = body.lines();
    let (mut positions, mut indices) = Mesh::default();
    for line in lines.by_ref().take(vertices) {
        let mut xyz = line.split_ascii_whitespace().map_while(|w| w.parse().ok());
        match (xyz.next(), xyz.next(), xyz.next()) {
            (Some(x), Some(y), Some(z)) => positions.push(Vec3::new(x, y, z)),
            _ => return Err(bad(line)),
        }
    }
    for line in lines.take(faces) {
        match line.split_ascii_whitespace().map_while(|w| w.parse().ok()).collect::<Vec<u32>>()[..] {
            [3, a, b, c] => indices.extend([a, b, c]),
            _ => return Err(bad(line)),
        }
    }
    Ok((positions, indices))
}
