//! Bust, moai and Venus. All face +z and stand on y = 0.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3};

use super::noise::{cells, fbm, unit};
use super::sdf::Solid;
use super::shapes::{turn, v};

const SIDES: [f32; 2] = [-1.0, 1.0];

/// A draped, wreathed bust on its plinth, about 12 x 13 x 23.
pub(super) fn statue(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, statue_relief, 0.45);
    s.block(v(0.0, 0.55, 0.0), v(4.7, 0.55, 5.6), 0.12, Mat3::IDENTITY, 0.0);
    s.block(v(0.0, 1.9, 0.0), v(4.2, 1.1, 5.1), 0.1, Mat3::IDENTITY, 0.15);
    s.limb(v(0.0, 2.6, 0.0), 2.1, v(0.0, 5.6, 0.0), 1.5, 0.4);
    s.ring(v(0.0, 3.3, 0.0), 2.1, 0.4, Mat3::IDENTITY, 0.2);
    s.ring(v(0.0, 4.6, 0.0), 1.75, 0.25, Mat3::IDENTITY, 0.2);
    // Chest and shoulders, cut off below in a curve.
    s.egg(v(0.0, 9.3, -0.2), v(4.3, 4.6, 3.6), Mat3::IDENTITY, 0.6);
    s.limb(v(-4.2, 10.5, -0.5), 1.75, v(4.2, 10.5, -0.5), 1.75, 1.8);
    s.limb(v(0.0, 10.6, -0.4), 2.6, v(0.0, 15.6, 0.1), 1.75, 1.2);
    // Toga: cloth heaped on the left shoulder, folds from there across the breast and over the back.
    s.limb(v(3.0, 11.6, -1.6), 1.3, v(3.6, 11.2, 1.2), 1.4, 0.8);
    for i in 0..9 {
        let t = i as f32 / 8.0;
        let w = 0.30 + 0.16 * unit(i, 0, seed);
        let sway = 0.3 * (unit(i, 1, seed) - 0.5);
        let (top, low) = (1.9 + 3.2 * t, 9.6 - 4.6 * t);
        s.tube(
            &[
                [top, 12.9 - 1.5 * t, -0.6, w],
                [top - 0.5, 11.9 - 1.5 * t, 2.3 - 0.5 * t, w + 0.08],
                [0.2 + 2.2 * t + sway, 10.0 - 2.6 * t, 3.9 - 0.7 * t, w + 0.14],
                [-2.6 + 2.2 * t, low - 0.4, 3.0 - 0.9 * t, w + 0.1],
                [-5.2 + 3.1 * t, low + 0.2 * t, 0.0, w],
            ],
            5,
            0.15,
        );
        s.tube(
            &[
                [top, 12.9 - 1.5 * t, -0.6, w],
                [top - 0.6, 11.2 - 1.4 * t, -3.0 + 0.3 * t, w + 0.08],
                [-0.4 + 1.6 * t + sway, 9.4 - 2.4 * t, -4.0 + 0.7 * t, w + 0.12],
                [-4.4 + 2.8 * t, low + 0.2, -2.2 + 0.4 * t, w],
            ],
            5,
            0.15,
        );
    }
    bust_head(&mut s, seed);
    s
}

fn bust_head(s: &mut Solid, seed: u32) {
    s.egg(v(0.0, 19.4, -0.35), v(2.75, 3.1, 3.35), turn(-8.0, 0.0, 0.0), 0.8);
    s.egg(v(0.0, 17.5, 1.15), v(2.15, 3.0, 2.0), turn(6.0, 0.0, 0.0), 0.8);
    s.egg(v(0.0, 15.35, 2.35), v(0.95, 0.7, 0.75), Mat3::IDENTITY, 0.6);
    s.limb(v(0.0, 20.2, 2.0), 1.1, v(0.0, 19.3, 2.35), 0.9, 0.9);
    // Nose, lips, larynx.
    s.limb(v(0.0, 18.9, 2.95), 0.28, v(0.0, 17.5, 3.65), 0.4, 0.35);
    s.egg(v(0.0, 16.4, 2.75), v(1.0, 0.75, 0.6), Mat3::IDENTITY, 0.5);
    s.egg(v(0.0, 16.58, 3.12), v(0.85, 0.2, 0.34), Mat3::IDENTITY, 0.25);
    s.egg(v(0.0, 16.14, 3.08), v(0.7, 0.22, 0.34), Mat3::IDENTITY, 0.25);
    s.carve_egg(v(0.0, 16.36, 3.45), v(0.85, 0.1, 0.3), Mat3::IDENTITY, 0.12);
    s.ball(v(0.0, 14.0, 1.5), 0.55, 0.6);
    for x in SIDES {
        s.ball(v(0.36 * x, 17.42, 3.3), 0.3, 0.25);
        s.carve_egg(v(0.28 * x, 17.15, 3.65), v(0.13, 0.14, 0.2), Mat3::IDENTITY, 0.06);
        s.carve_egg(v(1.05 * x, 18.55, 3.15), v(0.72, 0.5, 0.62), turn(0.0, 18.0 * x, 0.0), 0.35);
        s.ball(v(1.02 * x, 18.5, 2.5), 0.55, 0.04);
        s.egg(v(1.05 * x, 18.82, 2.62), v(0.7, 0.2, 0.5), turn(0.0, 18.0 * x, -6.0 * x), 0.15);
        s.limb(v(0.45 * x, 19.1, 3.0), 0.28, v(1.75 * x, 19.15, 2.3), 0.26, 0.25);
        s.egg(v(1.55 * x, 17.3, 2.0), v(0.8, 0.6, 0.8), Mat3::IDENTITY, 0.6);
        s.egg(v(2.5 * x, 18.0, -0.25), v(0.45, 1.1, 0.72), turn(-12.0, 20.0 * x, 0.0), 0.3);
        s.carve_egg(v(2.98 * x, 18.1, -0.1), v(0.3, 0.6, 0.36), turn(-12.0, 20.0 * x, 0.0), 0.2);
        // Sternomastoid.
        s.limb(v(1.9 * x, 16.8, -0.4), 0.6, v(0.5 * x, 12.6, 1.7), 0.45, 0.8);
    }
    // Locks along the hair line, from ear to ear.
    for i in 0..15 {
        let a = (-105.0 + 15.0 * i as f32 + 8.0 * (unit(i, 5, seed) - 0.5)).to_radians();
        let (sin, cos) = a.sin_cos();
        let drop = 1.0 + 0.5 * unit(i, 6, seed) + 1.3 * sin * sin;
        let root = v(2.6 * sin, 20.5 - 0.4 * (1.0 - cos), -0.25 + 3.0 * cos);
        s.limb(root, 0.42, root + v(0.1 * sin + 0.3 * (unit(i, 7, seed) - 0.5), -drop, 0.12 * cos), 0.24, 0.15);
    }
    // Laurel: a ring of leaves, tilted up at the brow.
    let tilt = turn(-16.0, 0.0, 0.0);
    let center = v(0.0, 20.2, -0.2);
    s.ring(center, 3.0, 0.28, tilt, 0.1);
    let leaves = 22;
    for i in 0..leaves {
        for (row, lift) in [0.5_f32, -0.35].into_iter().enumerate() {
            let a = TAU * (i as f32 + 0.5 * row as f32 + 0.3 * unit(i, row as i32, seed)) / leaves as f32;
            let out = v(a.sin(), 0.0, a.cos());
            let along = v(a.cos(), 0.0, -a.sin()) * if a.sin() >= 0.0 { -1.0 } else { 1.0 };
            let long = (along + 0.55 * out + v(0.0, 1.2 * lift, 0.0)).normalize();
            let flat = long.cross(v(0.0, 1.0, 0.0)).normalize();
            let axes = tilt * Mat3::from_cols(long, flat.cross(long), flat);
            s.egg(center + tilt * (out * 3.15 + v(0.0, lift, 0.0)), v(0.85, 0.34, 0.16), axes, 0.06);
        }
    }
}

fn statue_relief(p: Vec3, spacing: f32, seed: u32) -> f32 {
    let stone = 0.10 * fbm(p, 1.8, 5, spacing, seed);
    // Locks of hair on the skull, behind the hair line.
    let hair_line = 0.9 * p.z + 17.4 + 0.25 * (3.0 * p.x).sin();
    let hair = ((p.y - hair_line) / 0.35).clamp(0.0, 1.0) * f32::from(p.y > 16.4 && p.x.abs() < 3.2);
    if hair == 0.0 {
        return stone;
    }
    let combed = v(p.x, p.y, p.z) + 0.35 * fbm(p, 1.6, 2, spacing, seed ^ 3);
    stone + hair * (0.05 + 0.34 * (cells(combed, 1.0, spacing, seed ^ 4) - 0.3))
}

/// A moai: long head with brow and nose on a trunk with its arms along the sides, about 12 x 11 x 31.
pub(super) fn easter(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, easter_relief, 0.6);
    s.block(v(0.0, 7.4, -0.4), v(5.6, 7.6, 4.2), 2.2, turn(3.0, 0.0, 0.0), 0.0);
    s.block(v(0.0, 0.9, -0.2), v(5.9, 0.9, 4.8), 0.5, Mat3::IDENTITY, 0.8);
    s.egg(v(0.0, 6.4, 2.6), v(4.2, 4.4, 2.2), Mat3::IDENTITY, 1.2);
    // Head: narrow at the neck, heavy at jaw and brow.
    s.block(v(0.0, 22.6, -0.9), v(4.1, 8.0, 3.3), 1.6, turn(-3.0, 0.0, 0.0), 0.6);
    s.block(v(0.0, 18.4, 1.4), v(3.7, 2.9, 2.5), 1.3, turn(-8.0, 0.0, 0.0), 1.0);
    s.block(v(0.0, 16.3, 2.9), v(2.4, 1.1, 1.6), 0.7, turn(-12.0, 0.0, 0.0), 0.7);
    s.block(v(0.0, 26.9, 1.9), v(4.3, 1.35, 1.5), 0.6, turn(-14.0, 0.0, 0.0), 0.6);
    s.block(v(0.0, 30.2, -0.8), v(3.9, 0.6, 3.0), 0.5, turn(-4.0, 0.0, 0.0), 0.8);
    s.egg(v(0.0, 19.1, 3.6), v(2.5, 0.65, 1.0), turn(10.0, 0.0, 0.0), 0.3);
    s.egg(v(0.0, 17.75, 3.65), v(2.2, 0.65, 1.0), turn(-6.0, 0.0, 0.0), 0.3);
    s.carve_egg(v(0.0, 18.42, 4.9), v(2.4, 0.35, 0.8), Mat3::IDENTITY, 0.3);
    for x in SIDES {
        s.egg(v(1.15 * x, 21.3, 3.5), v(0.8, 0.65, 0.85), Mat3::IDENTITY, 0.4);
        s.carve_egg(v(2.25 * x, 24.6, 2.9), v(1.55, 1.25, 1.15), turn(0.0, 0.0, -8.0 * x), 0.5);
        s.egg(v(2.2 * x, 24.0, 2.0), v(1.15, 0.65, 0.5), turn(0.0, 0.0, -8.0 * x), 0.25);
        s.carve_egg(v(2.7 * x, 21.2, 3.6), v(1.1, 1.8, 0.7), turn(0.0, 25.0 * x, 0.0), 0.8);
        // Long ears.
        s.block(v(4.35 * x, 23.0, -0.9), v(0.55, 3.6, 1.0), 0.4, turn(-4.0, 0.0, 0.0), 0.3);
        s.carve_block(v(4.85 * x, 23.3, -0.8), v(0.22, 2.6, 0.5), 0.2, turn(-4.0, 0.0, 0.0), 0.2);
        s.ball(v(4.4 * x, 19.5, -0.7), 0.75, 0.4);
        // Arms and hands meeting below the belly.
        s.limb(v(5.2 * x, 13.0, -0.4), 1.35, v(5.6 * x, 5.0, 0.2), 1.15, 0.5);
        s.limb(v(5.5 * x, 5.0, 0.3), 1.15, v(3.9 * x, 3.4, 4.1), 0.85, 0.4);
        s.egg(v(2.4 * x, 3.2, 4.2), v(1.9, 1.0, 0.75), turn(0.0, 14.0 * x, 8.0 * x), 0.3);
        for i in 0..3 {
            let y = 3.6 - 0.45 * i as f32;
            s.carve_limb(v(3.0 * x, y, 5.1), 0.1, v(0.8 * x, y - 0.2, 5.2), 0.14, 0.1);
        }
        s.egg(v(2.1 * x, 11.6, 3.3), v(1.7, 1.3, 0.7), Mat3::IDENTITY, 0.6);
    }
    // The nose last, with its bridge filled, so that the eye sockets do not undercut it.
    s.limb(v(0.0, 25.8, 1.9), 1.0, v(0.0, 22.0, 2.4), 1.2, 0.3);
    s.limb(v(0.0, 26.4, 2.4), 0.85, v(0.0, 21.7, 4.1), 1.15, 0.5);
    s.ball(v(0.0, 6.0, 4.6), 0.6, 0.4);
    s
}

fn easter_relief(p: Vec3, spacing: f32, seed: u32) -> f32 {
    // Tuff: broad tool marks, pits, grain.
    0.30 * fbm(p, 3.2, 6, spacing, seed) + 0.10 * (cells(v(p.x, 0.6 * p.y, p.z), 0.9, spacing, seed ^ 8) - 0.4)
}

/// A Venus without arms, draped from the hips down, about 10 x 8 x 22.
pub(super) fn venus(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, venus_relief, 0.16);
    s.block(v(0.1, 0.45, 0.0), v(4.6, 0.45, 3.7), 0.15, Mat3::IDENTITY, 0.0);
    // Head: skull, face, knot of hair, nose.
    s.egg(v(0.35, 20.15, -0.1), v(1.4, 1.75, 1.7), Mat3::IDENTITY, 0.2);
    s.egg(v(0.4, 19.4, 0.45), v(1.1, 1.6, 1.2), turn(0.0, 8.0, 0.0), 0.4);
    s.egg(v(0.3, 20.0, -1.9), v(0.85, 0.8, 0.75), Mat3::IDENTITY, 0.3);
    s.limb(v(0.55, 19.9, 1.55), 0.16, v(0.6, 19.15, 1.85), 0.22, 0.15);
    s.egg(v(0.57, 18.65, 1.55), v(0.38, 0.14, 0.2), Mat3::IDENTITY, 0.08);
    s.egg(v(0.35, 20.7, -0.3), v(1.5, 1.25, 1.7), turn(-14.0, 0.0, 0.0), 0.3);
    s.limb(v(0.1, 16.6, -0.25), 1.0, v(0.3, 18.8, 0.0), 0.88, 0.7);
    // Torso in contrapposto: shoulders fall to one side, hips to the other.
    s.egg(v(0.0, 14.4, -0.1), v(2.9, 3.2, 1.95), turn(0.0, 0.0, 4.0), 0.8);
    s.limb(v(-3.15, 15.7, -0.2), 1.2, v(3.15, 16.2, -0.2), 1.2, 1.0);
    s.limb(v(0.0, 13.0, 0.0), 2.1, v(0.2, 9.6, 0.1), 2.4, 1.0);
    s.egg(v(0.25, 9.9, 0.8), v(2.1, 2.0, 1.5), Mat3::IDENTITY, 0.8);
    s.egg(v(0.45, 8.2, -0.2), v(3.5, 2.6, 2.5), turn(0.0, 0.0, -6.0), 1.0);
    s.carve_egg(v(0.25, 10.5, 2.5), v(0.16, 0.2, 0.35), Mat3::IDENTITY, 0.15);
    s.limb(v(-3.5, 15.6, -0.2), 1.15, v(-4.3, 12.4, -0.1), 0.95, 0.5);
    s.limb(v(3.5, 16.0, -0.2), 1.15, v(4.2, 14.4, 0.2), 1.0, 0.5);
    s.carve_block(v(-4.4, 11.4, 0.0), v(1.6, 0.9, 1.6), 0.05, turn(0.0, 0.0, -10.0), 0.1);
    s.carve_block(v(4.7, 13.0, 0.0), v(1.6, 0.9, 1.6), 0.05, turn(0.0, 0.0, 25.0), 0.1);
    for (x, y) in [(-1.35, 14.25), (1.4, 14.5)] {
        s.egg(v(x, y, 1.55), v(1.15, 1.15, 1.1), Mat3::IDENTITY, 0.45);
    }
    // Drapery: a roll about the hips, the forward knee, folds down to the base.
    s.limb(v(0.4, 6.6, -0.1), 3.1, v(0.2, 1.6, 0.0), 3.2, 1.2);
    s.limb(v(1.7, 6.6, 0.9), 1.9, v(1.9, 4.3, 1.7), 1.5, 0.8);
    for i in 0..3 {
        let y = 7.5 - 0.55 * i as f32;
        s.ring(
            v(0.35, y, 0.0),
            3.05 + 0.15 * i as f32,
            0.5 - 0.06 * i as f32,
            turn(8.0 + 3.0 * i as f32, 0.0, 10.0),
            0.3,
        );
    }
    let folds = 20;
    for i in 0..folds {
        let a = TAU * (i as f32 + 0.5 * unit(i, 0, seed)) / folds as f32;
        let (sin, cos) = a.sin_cos();
        let lean = 0.5 * (unit(i, 1, seed) - 0.5);
        let (top, low) = (3.0, 3.6 + 0.3 * unit(i, 2, seed));
        s.tube(
            &[
                [0.35 + top * sin, 6.6 - 0.4 * sin, 0.85 * top * cos, 0.28],
                [0.3 + 3.3 * (a + 0.5 * lean).sin(), 4.0, 2.95 * (a + 0.5 * lean).cos(), 0.42],
                [0.15 + low * (a + lean).sin(), 0.9, 0.9 * low * (a + lean).cos(), 0.55],
            ],
            3,
            0.3,
        );
    }
    s.tube(&[[2.9, 8.0, 1.2, 0.5], [2.7, 6.0, 2.9, 0.45], [1.9, 3.2, 3.35, 0.4], [2.3, 0.9, 3.3, 0.5]], 4, 0.3);
    s
}

fn venus_relief(p: Vec3, spacing: f32, seed: u32) -> f32 {
    let hair = f32::from(p.y > 20.3 || (p.y > 18.8 && p.z < -0.6));
    0.05 * fbm(p, 1.5, 4, spacing, seed) + 0.10 * hair * fbm(v(p.x, p.y, 0.5 * p.z), 0.6, 2, spacing, seed ^ 2)
}
