//! Leaves, potted plants, and the crowns, bushes and hedges of the garden.

use glam::{Affine3A, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{put, to, up};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::noise::fbm;
use crate::generate::solid::{Paint, Solid};

/// A closed leaf of 8 triangles from `foot` to `tip`, `wide` wide, folded a little.
pub(in crate::generate::house) fn leaf(s: &mut Solid, foot: Vec3, tip: Vec3, wide: f32, paint: Paint) {
    let along = tip - foot;
    let side = along.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
    let high = side.cross(along).normalize();
    let middle = foot + 0.45 * along;
    let rim = [foot, middle + 0.5 * wide * side, tip, middle - 0.5 * wide * side];
    let hubs = [middle - 0.16 * wide * high + 0.012 * high, middle - 0.16 * wide * high - 0.012 * high];
    for (hub, order) in [(hubs[0], [0, 1, 2, 3, 0]), (hubs[1], [0, 3, 2, 1, 0])] {
        for w in order.windows(2) {
            let (a, b) = (rim[w[0]], rim[w[1]]);
            let n = (a - hub).cross(b - hub).normalize_or(high);
            let [i, j, k] = [hub, a, b].map(|p| s.vertex(p, n, paint));
            s.mesh.indices.extend([i, j, k]);
        }
    }
}

/// A shade of a colour.
fn shade(paint: Paint, by: f32) -> Paint {
    paint.map(|c| (f32::from(c) * by).clamp(0.0, 255.0) as u8)
}

fn pot(m: &mut Model, r: f32, h: f32, paint: Paint) {
    let sides = m.sides();
    m.part(Stuff::Paint, |s| {
        let profile = [
            [0.0, 0.0],
            [0.0, 0.72 * r],
            [0.85 * h, 0.96 * r],
            [0.85 * h, 1.05 * r],
            [h, 1.05 * r],
            [h, 0.95 * r],
            [0.9 * h, 0.92 * r],
        ];
        s.lathe(up(0.0, 0.0, 0.0), sides, paint, &profile);
        s.lathe(up(0.0, 0.0, 0.0), sides, [64, 46, 34], &[[0.9 * h, 0.92 * r], [0.92 * h, 0.0]]);
    });
}

/// A palm-like plant: many arching fronds of leaflets.
fn palm(m: &mut Model) {
    pot(m, 0.19, 0.34, [184, 104, 72]);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (fronds, leaflets) = (9 + m.level(), 3 + m.level());
    m.part(Stuff::Carpet, |s| {
        for f in 0..fronds {
            let angle = 2.4 * f as f32 + rng.random_range(-0.2..0.2);
            let (sn, c) = angle.sin_cos();
            let (reach, rise) = (rng.random_range(0.3..0.62), rng.random_range(0.55..1.15));
            let at = |t: f32| {
                Vec3::new(c * reach * t * t.sqrt(), 0.3 + rise * (t - 0.42 * t * t) * 1.5, sn * reach * t * t.sqrt())
            };
            let stem: Vec<Vec3> = (0..=6).map(|i| at(i as f32 / 6.0)).collect();
            s.sweep(&stem, 4, [110, 138, 60], |t| 0.007 * (1.0 - 0.8 * t));
            for k in 0..leaflets {
                let t = 0.35 + 0.65 * k as f32 / leaflets as f32;
                let d = (at(t + 0.02) - at(t)).normalize();
                let across = d.cross(Vec3::Y).normalize();
                let paint = shade([70, 124, 50], rng.random_range(0.75..1.2));
                for side in [-1.0, 1.0] {
                    let tip = at(t) + (across * side * 0.8 + d * 0.7 - Vec3::Y * 0.3) * 0.17 * (1.15 - 0.6 * t);
                    leaf(s, at(t), tip, 0.035, paint);
                }
            }
        }
    });
}

/// A round-leaved plant.
fn rubber(m: &mut Model, scale: f32) {
    pot(m, 0.16 * scale, 0.26 * scale, [228, 226, 218]);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let leaves = 14 + 6 * m.level();
    m.part(Stuff::Carpet, |s| {
        for stem in 0..3 {
            let (sn, c) = (2.1 * stem as f32).sin_cos();
            let top = Vec3::new(0.12 * c, 0.85 + 0.15 * stem as f32, 0.12 * sn) * scale;
            s.sweep(&[Vec3::new(0.0, 0.2 * scale, 0.0), top * Vec3::new(0.6, 0.6, 0.6), top], 5, [112, 92, 62], |_| {
                0.011 * scale
            });
        }
        for _ in 0..leaves {
            let (sn, c) = rng.random_range(0.0..std::f32::consts::TAU).sin_cos();
            let y = rng.random_range(0.4..1.12);
            let foot = Vec3::new(0.08 * c, y, 0.08 * sn) * scale;
            let reach = rng.random_range(0.16..0.28);
            let tip = foot + Vec3::new(c, rng.random_range(-0.3..0.6), sn) * reach * scale;
            leaf(s, foot, tip, 0.12 * scale, shade([52, 106, 52], rng.random_range(0.8..1.35)));
        }
    });
}

/// A lump of foliage: a dark core and, from level 2 on, leaves over it.
fn foliage(m: &mut Model, at: Vec3, radii: Vec3, paint: Paint, rng: &mut ChaCha8Rng) {
    let (n, leaves) = (2 + m.level(), 5 * m.level() * m.level());
    let seed = rng.random_range(0..1000);
    m.part(Stuff::Carpet, |s| {
        let first = s.mesh.positions.len();
        s.ball(Affine3A::from_translation(at) * Affine3A::from_scale(radii), n, shade(paint, 0.8), |d| {
            0.93 + 0.22 * fbm(d, 0.9, 3, 0.5 / n as f32, seed)
        });
        s.smooth(first);
        let colors = s.mesh.positions.iter().map(|p| 0.78 + 0.5 * fbm(*p, 0.5, 3, 0.0, seed)).collect::<Vec<_>>();
        for (c, by) in s.mesh.colors[first..].iter_mut().zip(&colors[first..]) {
            crate::generate::house::stuff::tint(c, *by);
        }
        for _ in 0..leaves {
            let d = Vec3::new(rng.random_range(-1.0..1.0), rng.random_range(-0.8..1.0), rng.random_range(-1.0..1.0));
            let Some(d) = d.try_normalize() else { continue };
            let foot = at + d * radii * rng.random_range(0.86..1.0);
            let off = Vec3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.5..0.5), rng.random_range(-0.6..0.6));
            let size = rng.random_range(0.6..1.2) * (0.10 + 0.3 / m_level(n));
            let lit = rng.random_range(0.8..1.25) * (0.9 + 0.25 * d.y);
            leaf(s, foot, foot + (d + off).normalize() * size, 0.45 * size, shade(paint, lit));
        }
    });
}

fn m_level(n: u32) -> f32 {
    n as f32
}

/// A tree of seeded shape, about `high` high: a bent trunk, branches, and foliage at their ends.
pub(in crate::generate::house) fn crown(m: &mut Model, high: f32, paint: Paint, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sides = 5 + m.level() / 2;
    let fork = Vec3::new(rng.random_range(-0.2..0.2), 0.4 * high, rng.random_range(-0.2..0.2));
    let bark = [118, 96, 76];
    let mut ends = vec![];
    for k in 0..7 {
        let angle = 2.4 * k as f32 + rng.random_range(-0.4..0.4);
        let out = if k == 0 { 0.0 } else { rng.random_range(0.14..0.27) * high };
        let y = if k == 0 { 0.84 } else { rng.random_range(0.58..0.78) } * high;
        ends.push(Vec3::new(out * angle.cos(), y, out * angle.sin()));
    }
    m.part(Stuff::Wood, |s| {
        let trunk = [Vec3::ZERO, fork * Vec3::new(0.3, 0.5, 0.8), fork];
        s.sweep(&trunk, sides, bark, |t| 0.032 * high * (1.25 - 0.55 * t));
        for &end in &ends {
            let knee = fork.lerp(end, 0.5) - Vec3::Y * 0.04 * high;
            s.sweep(&[fork - Vec3::Y * 0.05, knee, end], sides, bark, |t| 0.018 * high * (1.0 - 0.75 * t));
        }
    });
    for end in ends {
        let r = rng.random_range(0.15..0.2) * high;
        let own = shade(paint, rng.random_range(0.88..1.12));
        foliage(m, end, Vec3::new(1.15 * r, 0.9 * r, 1.15 * r), own, &mut rng);
    }
}

/// A bush.
pub(in crate::generate::house) fn bush(m: &mut Model, paint: Paint, flowers: Option<Paint>, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for k in 0..3 {
        let x = 0.32 * (k as f32 - 1.0);
        let r = rng.random_range(0.34..0.46);
        foliage(m, Vec3::new(x, 0.8 * r, rng.random_range(-0.15..0.15)), Vec3::new(r, 0.95 * r, r), paint, &mut rng);
    }
    let Some(color) = flowers else { return };
    let (count, n) = (8 + 3 * m.level(), 2 + m.level() / 6);
    m.part(Stuff::Paint, |s| {
        for _ in 0..count {
            let (sn, c) = rng.random_range(0.0..std::f32::consts::TAU).sin_cos();
            let (r, t) = (rng.random_range(0.3..0.44), rng.random_range(0.2..1.2_f32));
            let p =
                Vec3::new(0.3 * rng.random_range(-1.0..1.0) + r * c * t.sin(), 0.36 + r * t.cos(), r * sn * t.sin());
            s.ball(Affine3A::from_translation(p), n, color, |_| 0.035);
        }
    });
}

/// A clipped hedge along x, `long` long.
pub(in crate::generate::house) fn hedge(m: &mut Model, long: f32, high: f32, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (n, leaves) = (1 + m.level() / 2, (long * 2.0) as u32 * m.level() * m.level());
    let paint = [66, 104, 48];
    m.part(Stuff::Carpet, |s| {
        // Pieces of a metre, so that there is room for bumps.
        let pieces = long.round() as u32;
        for k in 0..pieces {
            let first = s.mesh.positions.len();
            let x = (k as f32 + 0.5) * long / pieces as f32 - 0.5 * long;
            let h = 0.5 * high;
            let size = Vec3::new(0.56 * long / pieces as f32, h + 0.02 * (k % 3) as f32, 0.32 + 0.01 * (k % 2) as f32);
            s.rounded(to(x, h, 0.0), size, 0.2, n, shade(paint, 0.82));
            for (p, c) in s.mesh.positions[first..].iter_mut().zip(&mut s.mesh.colors[first..]) {
                let bump = fbm(*p, 0.35, 3, 0.1, seed as u32);
                *p += Vec3::new(0.0, 0.05, 0.12 * p.z.signum()) * bump;
                crate::generate::house::stuff::tint(c, 0.9 + 0.9 * bump);
            }
            s.smooth(first);
        }
        for _ in 0..leaves {
            let side = rng.random_range(0..3);
            let x = rng.random_range(-0.5..0.5) * long;
            let (foot, d) = match side {
                0 => (Vec3::new(x, high, rng.random_range(-0.3..0.3)), Vec3::Y),
                _ => {
                    let z = if side == 1 { 1.0 } else { -1.0 };
                    (Vec3::new(x, rng.random_range(0.05..1.0) * high, 0.31 * z), Vec3::Z * z)
                }
            };
            let off = Vec3::new(rng.random_range(-0.8..0.8), rng.random_range(-0.4..0.8), rng.random_range(-0.8..0.8));
            let size = rng.random_range(0.05..0.11);
            leaf(s, foot, foot + (d + off).normalize() * size, 0.55 * size, shade(paint, rng.random_range(0.8..1.4)));
        }
    });
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    let palms = vec![
        put(7.9, 0.0, 10.4, 0.0),
        put(0.6, 0.0, 10.4, 90.0),
        put(14.4, 0.0, 10.45, 200.0),
        put(14.5, 0.0, 0.5, 40.0),
    ];
    out.push(thing("palm", palms, palm));
    let pots = vec![
        put(5.55, 0.0, 6.95, 0.0),
        put(7.55, 0.0, 4.0, 50.0),
        put(4.25, 0.0, 5.7, 80.0),
        put(11.3, 0.0, 10.5, 0.0),
    ];
    out.push(thing("rubber plant", pots, |m| rubber(m, 1.0)));
    let small = [
        (0.28, 1.08 - 0.17, 4.0),
        (1.9, 1.09, 0.14),
        (8.8, 0.905, 0.14),
        (12.8, 0.905, 0.14),
        (9.8, 0.905, 10.84),
        (8.0, 0.44, 7.95),
    ];
    out.push(thing("small plant", small.map(|(x, y, z)| put(x, y, z, 60.0 * x)).to_vec(), |m| rubber(m, 0.32)));
}
