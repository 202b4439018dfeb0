//! One statue: distance field, mesh of an exact triangle count, normals, colours, the paper's box.
//!
//! The field is meshed on a lattice finer than asked for, evened out, and collapsed to the very count, so that triangles
//! stand where the shape needs them. Relief finer than the mesh can hold is left out: every count gets as much detail as it can
//! carry. About 4 s of one core for 200,000 triangles, 9 s for all of the 2M park.

use glam::{Mat3, Vec3};

use farfield_core::mesh::TriangleMesh;

use super::kind::Kind;
use super::march::{Raw, march};
use super::sdf::Solid;
use super::shade::{Palette, color};
use super::{GenerateError, creatures, figures, quadrupeds, remesh};

/// Fewest triangles of a statue: below that legs and horns cannot be told.
pub const LEAST_TRIANGLES: u32 = 200;
/// Most triangles of a statue: the lattice takes some 10 bytes a triangle and the square root of the count on top.
pub const MOST_TRIANGLES: u32 = 4_000_000;

/// Triangles that the mesh is made with before it is collapsed to its count, within the next two bounds.
const OVERSAMPLED: f32 = 80_000.0;
/// At least so many times the count.
const LEAST_FINER: f32 = 1.35;
/// At most so many times the count.
const MOST_FINER: f32 = 12.0;
/// Rounds of relaxation that rid marching cubes of its slivers.
const RELAXATIONS: usize = 3;

/// Sculpts a statue of `triangles` triangles (one less where that is odd: a closed mesh has an even number), closed, oriented
/// outward, in the paper's box ([`Kind::size`]): on y = 0, centred in x and z, with unit normals and sRGB vertex colours.
/// `seed` varies relief, locks, folds and colour.
///
/// # Errors
/// If the count is out of [`LEAST_TRIANGLES`]..=[`MOST_TRIANGLES`].
pub fn sculpt(kind: Kind, triangles: u32, seed: u64) -> Result<TriangleMesh, GenerateError> {
    if !(LEAST_TRIANGLES..=MOST_TRIANGLES).contains(&triangles) {
        return Err(GenerateError::Triangles {
            kind: kind.name(),
            asked: triangles,
            least: LEAST_TRIANGLES,
            most: MOST_TRIANGLES,
        });
    }
    let seed = (seed ^ seed >> 32) as u32 ^ (kind as u32 + 1).wrapping_mul(0x9e37_79b9);
    let target = triangles as usize & !1;
    let (solid, mut raw) = lattice(kind, target, seed);
    remesh::relax(&mut raw, &solid, RELAXATIONS);
    remesh::project(&mut raw, &solid, 1);
    let mut raw = remesh::reduce(raw, target)?;
    remesh::project(&mut raw, &solid, 2);
    Ok(finish(kind, &solid, raw, seed))
}

/// The field at a spacing whose mesh has more than `target` triangles, and that mesh.
fn lattice(kind: Kind, target: usize, seed: u32) -> (Solid, Raw) {
    // Small meshes start from many more triangles than they keep, big ones need not.
    let finer = (OVERSAMPLED / target as f32).clamp(LEAST_FINER, MOST_FINER);
    let wanted = finer * target as f32;
    let make = |spacing: f32| mesh_at(kind, spacing, finer, seed);
    let size = kind.size();
    // First guess: a surface of half the box's, three triangles a squared spacing; corrected on a mesh of a quarter the count.
    let mut spacing = (3.0 * (size.x * size.y + size.y * size.z + size.z * size.x) / wanted).sqrt();
    let probe = make(2.0 * spacing).1.triangles.len();
    // Triangles go with the inverse square of the spacing.
    spacing *= (4.0 * probe as f32 / wanted).sqrt().clamp(0.5, 2.0);
    let mut made = make(spacing);
    while made.1.triangles.len() < target {
        spacing *= 0.93;
        made = make(spacing);
    }
    made
}

fn mesh_at(kind: Kind, spacing: f32, finer: f32, seed: u32) -> (Solid, Raw) {
    let make = match kind {
        Kind::Dragon => creatures::dragon,
        Kind::Bunny => creatures::bunny,
        Kind::Statue => figures::statue,
        Kind::Cattle => quadrupeds::cattle,
        Kind::Horse => quadrupeds::horse,
        Kind::Easter => figures::easter,
        Kind::Camel => quadrupeds::camel,
        Kind::Venus => figures::venus,
    };
    let mut solid = make(spacing, seed);
    // The collapse leaves more triangles where there is relief: somewhat finer detail survives than an even mesh would hold.
    solid.stand(spacing * (0.7 * finer.sqrt()).max(1.0));
    let raw = march(&solid);
    (solid, raw)
}

/// Colours, normals, and the box: a turn about the vertical and a slight stretch to the paper's width, depth and height.
fn finish(kind: Kind, solid: &Solid, raw: Raw, seed: u32) -> TriangleMesh {
    let normals = remesh::normals(&raw, solid);
    let lows = raw.positions.iter().map(|p| p.y).fold(f32::MAX, f32::min);
    let highs = raw.positions.iter().map(|p| p.y).fold(f32::MIN, f32::max);
    let palette = palette(kind);
    let colors = raw
        .positions
        .iter()
        .zip(&normals)
        .map(|(&p, &n)| color(solid, &palette, p, n, (lows, highs - lows), seed))
        .collect();
    let turn = Mat3::from_rotation_y(yaw_deg(kind).to_radians());
    let turned: Vec<Vec3> = raw.positions.iter().map(|&p| turn * p).collect();
    let lo = turned.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let hi = turned.iter().copied().reduce(Vec3::max).unwrap_or_default();
    let stretch = kind.size() / (hi - lo);
    let foot = Vec3::new(0.5 * (lo.x + hi.x), lo.y, 0.5 * (lo.z + hi.z));
    TriangleMesh {
        positions: turned.iter().map(|&p| (p - foot) * stretch).collect(),
        // A normal goes with the inverse transpose of a stretch.
        normals: normals.iter().map(|&n| ((turn * n) / stretch).normalize()).collect(),
        uvs: Vec::new(),
        colors,
        indices: raw.triangles.into_iter().flatten().collect(),
        sections: Vec::new(),
    }
}

/// Turn, degrees, that gives the sculpture the proportions of the paper's box: horse and bull stand across it.
fn yaw_deg(kind: Kind) -> f32 {
    match kind {
        Kind::Cattle => 45.0,
        Kind::Horse => -65.0,
        _ => 0.0,
    }
}

fn palette(kind: Kind) -> Palette {
    let rgb = |r: u8, g: u8, b: u8| Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0;
    let of = |light, cavity, patina, patina_share| Palette { light, cavity, patina, patina_share };
    match kind {
        Kind::Dragon => of(rgb(118, 152, 122), rgb(38, 58, 48), rgb(158, 150, 96), 0.45),
        Kind::Bunny => of(rgb(196, 176, 150), rgb(96, 76, 58), rgb(150, 140, 116), 0.4),
        Kind::Statue => of(rgb(222, 218, 208), rgb(120, 110, 98), rgb(186, 178, 160), 0.4),
        Kind::Cattle => of(rgb(150, 106, 72), rgb(62, 40, 28), rgb(104, 132, 110), 0.35),
        Kind::Horse => of(rgb(164, 130, 84), rgb(62, 46, 32), rgb(108, 152, 128), 0.5),
        Kind::Easter => of(rgb(142, 136, 126), rgb(70, 66, 60), rgb(164, 160, 112), 0.5),
        Kind::Camel => of(rgb(190, 156, 108), rgb(94, 70, 44), rgb(160, 140, 104), 0.35),
        Kind::Venus => of(rgb(236, 230, 218), rgb(150, 138, 122), rgb(206, 194, 172), 0.35),
    }
}
