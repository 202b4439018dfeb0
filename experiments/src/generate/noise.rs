//! Seeded noise for relief and colour: gradient noise (Perlin 2002) summed over octaves, and cellular noise (Worley 1996).
//!
//! Octaves whose wavelength is near the mesh's spacing are faded out, so that the relief never aliases into crumbs. O(octaves).

use glam::Vec3;

/// 32 well-mixed bits of three coordinates and a seed.
fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f)
        ^ seed.wrapping_mul(0x9e37_79b9);
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

fn slope(h: u32, d: Vec3) -> f32 {
    // Perlin's twelve directions, four of them twice.
    let u = if h & 8 == 0 { d.x } else { d.y };
    let w = match h & 15 {
        0..4 => d.y,
        12 | 14 => d.x,
        _ => d.z,
    };
    (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { w } else { -w })
}

/// Gradient noise of wavelength 1, about -1..1.
pub(super) fn noise(p: Vec3, seed: u32) -> f32 {
    let base = p.floor();
    let f = p - base;
    let [x, y, z] = [base.x as i32, base.y as i32, base.z as i32];
    let s = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner =
        |i: i32, j: i32, k: i32| slope(hash(x + i, y + j, z + k, seed), f - Vec3::new(i as f32, j as f32, k as f32));
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let plane =
        |k: i32| mix(mix(corner(0, 0, k), corner(1, 0, k), s.x), mix(corner(0, 1, k), corner(1, 1, k), s.x), s.y);
    mix(plane(0), plane(1), s.z)
}

/// How much of a wave of this length a mesh of this spacing can hold: 0 below 2.5 spacings, 1 above 5.
pub(super) fn resolved(wavelength: f32, spacing: f32) -> f32 {
    let t = ((wavelength / spacing - 2.5) / 2.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Octaves of gradient noise from `wavelength` downwards, amplitude halved each time, as far as `spacing` resolves; about -1..1.
pub(super) fn fbm(p: Vec3, wavelength: f32, octaves: u32, spacing: f32, seed: u32) -> f32 {
    let (mut sum, mut length, mut amplitude) = (0.0, wavelength, 0.5);
    for octave in 0..octaves {
        let keep = resolved(length, spacing);
        if keep == 0.0 {
            break;
        }
        sum += amplitude * keep * noise(p / length, seed.wrapping_add(octave));
        length *= 0.5;
        amplitude *= 0.5;
    }
    sum
}

/// Own cell, then the neighbours.
const ORDER: [f32; 3] = [0.0, -1.0, 1.0];

/// Rounded cells of size `wavelength`: 1 at a cell's middle, down to 0 at its border, 0 where the mesh is too coarse for them.
pub(super) fn cells(p: Vec3, wavelength: f32, spacing: f32, seed: u32) -> f32 {
    let keep = resolved(wavelength, spacing);
    if keep == 0.0 {
        return 0.0;
    }
    let q = p / wavelength;
    let base = q.floor();
    // Own cell first; a cell is only asked for its spot if that could be the nearest. Beyond 1 nothing counts.
    let mut nearest = 1.0_f32;
    for n in 0..27 {
        let step = Vec3::new(ORDER[n % 3], ORDER[n / 3 % 3], ORDER[n / 9]);
        let cell = base + step;
        let gap = (cell + 0.15 - q).max(q - cell - 0.85).max(Vec3::ZERO);
        if gap.length_squared() >= nearest {
            continue;
        }
        let h = hash(cell.x as i32, cell.y as i32, cell.z as i32, seed);
        let spot = Vec3::new((h & 1023) as f32, ((h >> 10) & 1023) as f32, ((h >> 20) & 1023) as f32) / 1023.0;
        nearest = nearest.min((cell + 0.15 + 0.7 * spot).distance_squared(q));
    }
    keep * (1.0 - nearest)
}

/// A number in 0..1 for the `k`-th property of the `i`-th thing.
pub(super) fn unit(i: i32, k: i32, seed: u32) -> f32 {
    (hash(i, k, 7, seed) >> 8) as f32 / (1 << 24) as f32
}
