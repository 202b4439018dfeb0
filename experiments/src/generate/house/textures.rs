//! The ten textures of the house, made texel by texel from the seed: 3 of 1024 x 1024 and 7 of 512 x 512, 19 MiB in all, as the paper's house
//! has 19 megabytes of them. All but the atlas repeat without a seam. O(texels).

use farfield_core::scene::Texture;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::stuff::Stuff;
use crate::generate::noise::unit;

/// Columns and rows of the atlas: rows of book backs below rows of pictures.
pub(super) const BOOKS: [u32; 2] = [32, 4];
/// Pictures of the atlas.
pub(super) const PICTURES: [u32; 2] = [4, 2];

/// The atlas's rectangle (low, high) of a book's back.
pub(super) fn book(i: u32) -> [Vec2; 2] {
    let [w, h] = BOOKS;
    let (x, y) = (i % w, i / w % h);
    inset([x as f32 / w as f32, 0.5 + 0.5 * y as f32 / h as f32], [1.0 / w as f32, 0.5 / h as f32])
}

/// The atlas's rectangle of a picture.
pub(super) fn picture(i: u32) -> [Vec2; 2] {
    let [w, h] = PICTURES;
    let (x, y) = (i % w, i / w % h);
    inset([x as f32 / w as f32, 0.5 * y as f32 / h as f32], [1.0 / w as f32, 0.5 / h as f32])
}

/// Two texels inside, so that neighbours do not bleed in.
fn inset(low: [f32; 2], size: [f32; 2]) -> [Vec2; 2] {
    let (low, size, rim) = (Vec2::from(low), Vec2::from(size), Vec2::splat(2.0 / 1024.0));
    [low + rim, low + size - rim]
}

/// The texture of a material.
pub(super) fn texture(stuff: Stuff, seed: u64) -> Texture {
    let edge = match stuff {
        Stuff::Atlas | Stuff::Brick | Stuff::Planks => 1024,
        _ => 512,
    };
    let seed = (seed as u32).wrapping_mul(0x9e37).wrapping_add(stuff as u32);
    let color: fn(Vec2, u32) -> Vec3 = match stuff {
        Stuff::Atlas => atlas,
        Stuff::Brick => brick,
        Stuff::Carpet => carpet,
        Stuff::Fabric => fabric,
        Stuff::Grass => grass,
        Stuff::Paint => |_, _| Vec3::ONE,
        Stuff::Planks => planks,
        Stuff::Plaster => plaster,
        Stuff::Roof => roof,
        Stuff::Tiles => tiles,
        Stuff::Wood => |p, seed| Vec3::splat(1.0) * grain(p, 1, seed),
    };
    let texel = |i: u32| {
        let p = Vec2::new((i % edge) as f32 + 0.5, (i / edge) as f32 + 0.5) / edge as f32;
        let c = (color(p, seed).clamp(Vec3::ZERO, Vec3::ONE) * 255.0).round();
        [c.x as u8, c.y as u8, c.z as u8, 255]
    };
    Texture { name: stuff.name().into(), size: [edge; 2], rgba: (0..edge * edge).into_par_iter().map(texel).collect() }
}

/// Value noise that repeats after 1, of `cells` cells, 0..1.
fn wave(p: Vec2, cells: [u32; 2], seed: u32) -> f32 {
    let q = p * Vec2::new(cells[0] as f32, cells[1] as f32);
    let base = q.floor();
    let f = q - base;
    let s = f * f * (3.0 - 2.0 * f);
    let [w, h] = cells.map(|c| c as i32);
    let at = |i: i32, j: i32| unit((base.x as i32 + i).rem_euclid(w), (base.y as i32 + j).rem_euclid(h), seed);
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    mix(mix(at(0, 0), at(1, 0), s.x), mix(at(0, 1), at(1, 1), s.x), s.y)
}

/// Octaves of [`wave`], 0..1.
fn cloud(p: Vec2, cells: [u32; 2], octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut all) = (0.0, 1.0, 0.0);
    for k in 0..octaves {
        sum += weight * wave(p, cells.map(|c| c << k), seed.wrapping_add(k * 77));
        all += weight;
        weight *= 0.55;
    }
    sum / all
}

fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Distance from the rim of a cell of `size` in which `p` (0..1 in both) is, in the units of `size`.
fn rim(f: Vec2, size: Vec2) -> f32 {
    let d = f.min(1.0 - f) * size;
    d.min_element()
}

/// Light wood that runs along x, brightness: `rings` says how wavy.
fn grain(p: Vec2, rings: u32, seed: u32) -> f32 {
    let bend = cloud(p, [2, 4], 3, seed);
    let lines = cloud(p + Vec2::new(0.0, 0.08 * bend * rings as f32), [3, 64], 3, seed + 5);
    let fine = wave(p, [24, 256], seed + 9);
    0.80 + 0.16 * lines + 0.08 * (fine - 0.5)
}

fn planks(p: Vec2, seed: u32) -> Vec3 {
    // 16 boards of 15 cm across 2.4 m, each cut twice, at its own place.
    let row = (p.y * 16.0).floor();
    let shift = unit(row as i32, 1, seed);
    let along = (p.x + shift).fract() * 2.0;
    let board = row as i32 * 2 + along.floor() as i32;
    let f = Vec2::new(along.fract(), (p.y * 16.0).fract());
    let tone = unit(board, 3, seed);
    let own = Vec2::new(p.x, p.y + 0.37 * unit(board, 5, seed));
    let g = grain(Vec2::new(own.x, own.y.fract()), 2, seed);
    let gap = smooth(0.0, 0.0022, rim(f, Vec2::new(1.2, 0.15)) - 0.0006);
    Vec3::new(0.74, 0.53, 0.34).lerp(Vec3::new(0.60, 0.40, 0.24), tone) * (0.35 + 0.65 * gap) * (0.55 + 0.5 * g)
}

fn brick(p: Vec2, seed: u32) -> Vec3 {
    // Bricks of 25 x 8 cm in running bond over 2 m: 8 a row, 25 rows; an odd row would end the bond, so 24 of 8.3 cm.
    let row = (p.y * 24.0).floor();
    let x = p.x * 8.0 + 0.5 * (row % 2.0);
    let f = Vec2::new(x.fract(), (p.y * 24.0).fract());
    let i = row as i32 * 8 + (x.floor() as i32).rem_euclid(8);
    let tone = unit(i, 1, seed);
    let rough = cloud(p, [32, 32], 4, seed);
    let own = Vec3::new(0.66, 0.32, 0.24).lerp(Vec3::new(0.48, 0.24, 0.20), tone) * (0.8 + 0.4 * rough);
    let mortar = Vec3::splat(0.70 + 0.12 * wave(p, [200, 200], seed + 3));
    mortar.lerp(own, smooth(0.004, 0.008, rim(f, Vec2::new(0.25, 0.083)) + 0.003 * (rough - 0.5)))
}

fn tiles(p: Vec2, seed: u32) -> Vec3 {
    // 20 cm, six across 1.2 m.
    let q = p * 6.0;
    let f = q.fract();
    let i = q.x as i32 * 6 + q.y as i32;
    let tone = 0.93 + 0.07 * unit(i, 1, seed) - 0.06 * cloud(p, [8, 8], 3, seed);
    let joint = smooth(0.0015, 0.003, rim(f, Vec2::splat(0.2)));
    Vec3::new(0.66, 0.65, 0.63).lerp(Vec3::new(0.98, 0.98, 0.96) * tone, joint)
}

fn plaster(p: Vec2, seed: u32) -> Vec3 {
    Vec3::splat(0.93 + 0.05 * cloud(p, [6, 6], 4, seed) + 0.03 * (cloud(p, [64, 64], 3, seed + 8) - 0.5))
}

fn carpet(p: Vec2, seed: u32) -> Vec3 {
    let tufts = cloud(p, [128, 128], 2, seed);
    Vec3::splat(0.70 + 0.16 * cloud(p, [8, 8], 3, seed + 2) + 0.28 * (tufts - 0.4))
}

fn fabric(p: Vec2, seed: u32) -> Vec3 {
    // 64 threads each way, over and under.
    let q = p * 64.0;
    let over = (q.x as i32 + q.y as i32) % 2 == 0;
    let f = q.fract() - 0.5;
    let across = if over { f.y } else { f.x };
    let thread = if over { unit(q.y as i32, 1, seed) } else { unit(q.x as i32, 2, seed) };
    Vec3::splat(0.78 + 0.1 * thread + 0.12 * (1.0 - 4.0 * across * across) - 0.1 * cloud(p, [4, 4], 3, seed))
}

fn grass(p: Vec2, seed: u32) -> Vec3 {
    let patch = cloud(p, [4, 4], 3, seed);
    let blades = cloud(p, [96, 64], 3, seed + 3);
    let dry = smooth(0.6, 0.9, cloud(p, [6, 6], 3, seed + 6));
    let green = Vec3::new(0.16, 0.34, 0.09).lerp(Vec3::new(0.38, 0.56, 0.20), blades);
    green.lerp(Vec3::new(0.50, 0.52, 0.26), 0.45 * dry) * (0.75 + 0.4 * patch)
}

fn roof(p: Vec2, seed: u32) -> Vec3 {
    // Rows of 20 cm, tiles of 20 cm, shifted by half from row to row; each row's lower rim lies over the next.
    let row = (p.y * 8.0).floor();
    let x = p.x * 8.0 + 0.5 * (row % 2.0);
    let f = Vec2::new(x.fract(), (p.y * 8.0).fract());
    let i = row as i32 * 8 + (x.floor() as i32).rem_euclid(8);
    let tone = unit(i, 1, seed);
    let round = 1.0 - 1.3 * (f.x - 0.5) * (f.x - 0.5);
    let lap = smooth(0.0, 0.16, f.y) * (0.85 + 0.15 * f.y);
    let side = smooth(0.0, 0.05, f.x.min(1.0 - f.x));
    let own = Vec3::new(0.62, 0.31, 0.21).lerp(Vec3::new(0.46, 0.23, 0.18), tone);
    own * round * (0.45 + 0.55 * lap) * (0.7 + 0.3 * side) * (0.85 + 0.3 * cloud(p, [48, 48], 3, seed))
}

/// Colours of book bindings.
const BINDINGS: [[f32; 3]; 10] = [
    [0.46, 0.12, 0.12],
    [0.13, 0.22, 0.40],
    [0.16, 0.34, 0.22],
    [0.62, 0.52, 0.34],
    [0.85, 0.80, 0.68],
    [0.24, 0.19, 0.16],
    [0.72, 0.36, 0.14],
    [0.36, 0.24, 0.42],
    [0.20, 0.44, 0.48],
    [0.88, 0.84, 0.80],
];

fn atlas(p: Vec2, seed: u32) -> Vec3 {
    if p.y < 0.5 {
        let q = p * Vec2::new(PICTURES[0] as f32, 2.0 * PICTURES[1] as f32);
        return painting(q.fract(), q.x as i32 + PICTURES[0] as i32 * q.y as i32, seed);
    }
    let q = (p - Vec2::new(0.0, 0.5)) * Vec2::new(BOOKS[0] as f32, 2.0 * BOOKS[1] as f32);
    spine(q.fract(), q.x as i32 + BOOKS[0] as i32 * q.y as i32, seed)
}

/// The back of a book: a binding, bands, a label with lines of letters.
fn spine(f: Vec2, i: i32, seed: u32) -> Vec3 {
    let pick = |k: i32| unit(i, k, seed);
    let base = Vec3::from(BINDINGS[(pick(1) * 9.99) as usize]) * (0.8 + 0.35 * pick(2));
    let bright = base.element_sum() > 1.6;
    let ink = if bright { Vec3::new(0.2, 0.12, 0.1) } else { Vec3::new(0.86, 0.74, 0.42) };
    let worn = base * (0.88 + 0.24 * wave(f, [3, 24], seed + i as u32));
    let band = |at: f32| smooth(0.012, 0.004, (f.y - at).abs());
    let bands = if pick(3) < 0.5 { band(0.08).max(band(0.92)).max(band(0.7)) } else { band(0.05).max(band(0.3)) };
    let (top, length) = (0.14 + 0.08 * pick(4), 0.25 + 0.25 * pick(5));
    let along = (f.y - top) / length;
    let letter = unit((f.y * 90.0) as i32, i, seed + 4) > 0.25 && (0.0..1.0).contains(&along);
    let width = 0.10 + 0.14 * pick(6);
    let letters = if letter { smooth(width + 0.03, width - 0.03, (f.x - 0.5).abs()) } else { 0.0 };
    let round = 1.0 - 0.9 * (f.x - 0.5) * (f.x - 0.5);
    worn.lerp(ink, (0.9 * bands).max(0.85 * letters)) * round
}

/// A landscape: sky, hills behind hills, a sun or moon, brush strokes.
fn painting(f: Vec2, i: i32, seed: u32) -> Vec3 {
    let pick = |k: i32| unit(i, k, seed + 91);
    let hue = |k: i32| Vec3::new(pick(k), pick(k + 1), pick(k + 2));
    let high = Vec3::new(0.35, 0.5, 0.75).lerp(hue(10), 0.35);
    let low = Vec3::new(0.95, 0.82, 0.62).lerp(hue(13), 0.3);
    let mut c = high.lerp(low, smooth(0.0, 0.6, f.y));
    let sun = Vec2::new(0.2 + 0.6 * pick(1), 0.18 + 0.15 * pick(2));
    c = c.lerp(Vec3::new(1.0, 0.95, 0.8), smooth(0.085, 0.07, f.distance(sun)));
    for k in 0..4 {
        let rise = 0.42 + 0.13 * k as f32;
        let ridge =
            rise + 0.22 * (cloud(Vec2::new(f.x * 0.9, 0.1 * k as f32), [4, 4], 3, seed + (i * 7 + k) as u32) - 0.5);
        let ground =
            Vec3::new(0.45, 0.5, 0.55).lerp(Vec3::new(0.14, 0.22, 0.10), k as f32 / 3.0).lerp(hue(20 + 3 * k), 0.3);
        c = c.lerp(
            ground * (0.8 + 0.4 * cloud(f, [24, 8], 2, seed + k as u32)),
            smooth(ridge - 0.004, ridge + 0.004, f.y),
        );
    }
    c * (0.9 + 0.2 * cloud(f, [40, 64], 2, seed + i as u32))
}
