//! Bull, rearing horse and dromedary. All face +x, left is -z, hooves stand on y = 0.

use glam::Mat3;

use super::noise::{cells, fbm, unit};
use super::sdf::Solid;
use super::shapes::{turn, v};

const SIDES: [f32; 2] = [-1.0, 1.0];

/// Muscle and short hair: hair lies along x.
fn hide(p: glam::Vec3, spacing: f32, seed: u32, size: f32) -> f32 {
    let hair = v(0.3 * p.x, p.y, p.z);
    size * (0.30 * fbm(p, 6.0 * size, 4, spacing, seed) + 0.10 * fbm(hair, 0.9 * size, 3, 0.6 * spacing, seed ^ 5))
}

/// A fighting bull at a walk, about 45 x 15 x 31.
pub(super) fn cattle(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, cattle_relief, 0.9);
    s.egg(v(-2.5, 17.6, 0.0), v(14.5, 6.6, 5.6), turn(0.0, 0.0, 2.0), 0.0);
    s.egg(v(8.5, 18.6, 0.0), v(7.6, 8.6, 6.0), Mat3::IDENTITY, 3.0);
    s.egg(v(7.5, 24.0, 0.0), v(7.0, 4.3, 3.4), turn(0.0, 0.0, -12.0), 3.0);
    s.egg(v(-13.0, 18.8, 0.0), v(6.2, 6.6, 5.3), Mat3::IDENTITY, 3.0);
    s.egg(v(12.5, 14.6, 0.0), v(5.5, 4.6, 1.5), turn(0.0, 0.0, 35.0), 2.5);
    s.limb(v(10.0, 20.8, 0.0), 6.0, v(17.5, 21.5, 0.0), 4.4, 3.0);
    // Head: forehead, muzzle, cheeks, brow.
    s.limb(v(18.6, 21.6, 0.0), 3.3, v(23.4, 16.4, 0.0), 2.0, 1.5);
    s.egg(v(24.0, 15.6, 0.0), v(1.9, 1.8, 2.2), turn(0.0, 0.0, -35.0), 1.0);
    s.egg(v(18.4, 24.2, 0.0), v(2.0, 1.5, 3.0), Mat3::IDENTITY, 1.2);
    s.egg(v(19.6, 18.6, 0.0), v(2.4, 2.6, 2.5), Mat3::IDENTITY, 1.2);
    s.carve_limb(v(22.9, 14.2, -2.2), 0.18, v(24.6, 14.6, 0.0), 0.18, 0.3);
    s.carve_limb(v(24.6, 14.6, 0.0), 0.18, v(22.9, 14.2, 2.2), 0.18, 0.3);
    for z in SIDES {
        s.tube(
            &[
                [18.2, 24.2, 2.2 * z, 1.25],
                [18.0, 25.1, 5.2 * z, 1.15],
                [19.2, 27.2, 7.2 * z, 0.85],
                [21.0, 30.6, 6.6 * z, 0.3],
            ],
            4,
            0.6,
        );
        s.egg(v(17.3, 22.6, 4.5 * z), v(0.7, 1.0, 2.2), turn(20.0 * z, 0.0, 0.0), 0.6);
        s.carve_egg(v(17.9, 22.5, 4.9 * z), v(0.4, 0.55, 1.4), turn(20.0 * z, 0.0, 0.0), 0.3);
        s.carve_egg(v(20.9, 20.7, 2.75 * z), v(0.9, 0.8, 0.6), Mat3::IDENTITY, 0.5);
        s.ball(v(20.7, 20.7, 2.45 * z), 0.62, 0.1);
        s.egg(v(20.4, 21.5, 2.45 * z), v(1.2, 0.4, 0.6), turn(0.0, 0.0, -30.0), 0.4);
        s.carve_egg(v(25.5, 15.8, 0.95 * z), v(0.6, 0.45, 0.5), turn(0.0, 0.0, 30.0), 0.3);
        // Shoulder blade and haunch stand out of the trunk.
        s.egg(v(8.6, 17.5, 4.2 * z), v(3.2, 6.2, 2.4), turn(0.0, 0.0, -12.0), 1.6);
        s.egg(v(-13.2, 16.8, 3.8 * z), v(4.3, 6.2, 2.6), turn(0.0, 0.0, -10.0), 1.6);
        let (fore, hind) = (1.9 * z, -2.2 * z);
        s.limb(v(9.0, 14.5, 3.9 * z), 2.9, v(9.4 + fore, 8.0, 3.6 * z), 1.75, 1.6);
        s.limb(v(9.4 + fore, 8.0, 3.6 * z), 1.75, v(9.2 + 1.5 * fore, 2.6, 3.6 * z), 1.05, 0.6);
        hoof(&mut s, v(9.2 + 1.5 * fore, 2.6, 3.6 * z), 1.15);
        s.limb(v(-12.8, 14.8, 3.7 * z), 3.6, v(-11.4 + hind, 10.0, 3.7 * z), 2.2, 1.6);
        s.limb(v(-11.4 + hind, 10.0, 3.7 * z), 2.1, v(-15.2 + hind, 6.8, 3.7 * z), 1.45, 0.8);
        s.limb(v(-15.2 + hind, 6.8, 3.7 * z), 1.4, v(-14.4 + hind, 2.6, 3.7 * z), 1.05, 0.5);
        hoof(&mut s, v(-14.4 + hind, 2.6, 3.7 * z), 1.15);
    }
    s.tube(
        &[[-18.2, 22.6, 0.0, 1.0], [-20.4, 21.6, 0.3, 0.75], [-21.2, 16.0, 1.2, 0.6], [-20.6, 10.5, 2.0, 0.6]],
        4,
        1.2,
    );
    tuft(&mut s, v(-20.6, 10.8, 2.0), v(-20.4, 5.2, 2.4), 0.95, seed);
    s
}

fn cattle_relief(p: glam::Vec3, spacing: f32, seed: u32) -> f32 {
    // Curls on brow, neck and hump.
    let curly = ((p.x - 4.0) / 8.0).clamp(0.0, 1.0)
        * ((p.y - 15.5) / 5.0).clamp(0.0, 1.0)
        * f32::from(p.x < 20.5 && p.y < 25.4);
    hide(p, spacing, seed, 1.0) + 0.45 * curly * cells(v(p.x, p.y * 0.8, p.z), 1.3, spacing, seed ^ 9)
}

/// A rearing horse, about 57 x 17 x 83.
pub(super) fn horse(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, horse_relief, 0.8);
    s.egg(v(-8.5, 34.0, 0.0), v(7.6, 9.2, 7.0), turn(0.0, 0.0, 30.0), 0.0);
    s.limb(v(-6.0, 36.5, 0.0), 7.6, v(6.5, 50.0, 0.0), 7.7, 4.0);
    s.egg(v(8.5, 53.0, 0.0), v(6.4, 8.6, 6.2), turn(0.0, 0.0, -20.0), 3.0);
    s.tube(&[[7.0, 55.0, 0.0, 6.8], [11.0, 62.5, 0.0, 5.2], [15.5, 69.5, 0.0, 4.1], [18.6, 75.0, 0.0, 3.5]], 4, 3.0);
    // Head: cheek, bridge, muzzle, lips.
    s.limb(v(19.4, 76.2, 0.0), 3.3, v(28.4, 69.0, 0.0), 1.9, 1.5);
    s.egg(v(20.6, 73.6, 0.0), v(3.6, 3.2, 2.1), turn(0.0, 0.0, -38.0), 1.2);
    s.egg(v(29.4, 68.0, 0.0), v(2.3, 1.9, 1.9), turn(0.0, 0.0, -38.0), 1.0);
    s.limb(v(24.0, 70.2, 0.0), 1.5, v(28.2, 65.9, 0.0), 0.95, 0.6);
    s.carve_egg(v(29.2, 66.4, 0.0), v(2.4, 0.4, 2.2), turn(0.0, 0.0, -44.0), 0.4);
    for z in SIDES {
        s.limb(v(17.6, 78.8, 1.7 * z), 1.25, v(18.4, 82.6, 2.1 * z), 0.4, 0.6);
        s.carve_limb(v(18.9, 79.6, 2.1 * z), 0.5, v(18.9, 81.6, 2.4 * z), 0.2, 0.2);
        s.carve_egg(v(22.6, 75.4, 2.55 * z), v(1.1, 0.9, 0.7), Mat3::IDENTITY, 0.5);
        s.ball(v(22.4, 75.3, 2.2 * z), 0.75, 0.1);
        s.egg(v(22.2, 76.3, 2.1 * z), v(1.5, 0.5, 0.7), turn(0.0, 0.0, -35.0), 0.5);
        s.carve_egg(v(30.6, 68.6, 1.1 * z), v(0.75, 0.5, 0.6), turn(0.0, 0.0, 40.0), 0.3);
        s.egg(v(7.6, 49.5, 4.4 * z), v(4.4, 7.6, 3.0), turn(0.0, 0.0, -25.0), 2.0);
        s.egg(v(-8.2, 31.0, 4.6 * z), v(5.6, 8.6, 3.4), turn(0.0, 0.0, 25.0), 2.0);
        // Fore legs beat the air, one higher than the other.
        let up = 2.6 * z;
        s.limb(v(9.5, 46.5, 4.6 * z), 3.5, v(20.0 - 0.4 * up, 48.5 + up, 5.0 * z), 2.1, 1.8);
        s.limb(v(20.0 - 0.4 * up, 48.5 + up, 5.0 * z), 2.15, v(22.5 + up, 40.0 + 1.6 * up, 4.8 * z), 1.35, 0.7);
        hoof(&mut s, v(22.5 + up, 40.0 + 1.6 * up, 4.8 * z), 1.5);
        // Hind legs: stifle, hock, fetlock.
        let step = 1.6 * z;
        s.limb(v(-8.6, 31.0, 4.6 * z), 5.4, v(-1.4 + step, 23.5, 5.0 * z), 3.5, 2.0);
        s.limb(v(-1.4 + step, 23.5, 5.0 * z), 3.3, v(-9.4 + step, 13.6, 5.0 * z), 2.0, 1.0);
        s.limb(v(-9.4 + step, 13.6, 5.0 * z), 2.1, v(-6.6 + step, 4.6, 5.0 * z), 1.5, 0.6);
        s.ball(v(-6.5 + step, 4.4, 5.0 * z), 1.85, 0.6);
        hoof(&mut s, v(-6.3 + step, 3.8, 5.0 * z), 1.7);
    }
    // Mane: locks from poll to withers, thrown back to both sides.
    for i in 0..14 {
        let t = i as f32 / 13.0;
        let (x, y) = (16.2 - 13.2 * t, 79.2 - 17.0 * t);
        let [a, b] = [unit(i, 1, seed), unit(i, 2, seed)];
        let side = (if i % 2 == 0 { 1.0 } else { -1.0 }) * (1.4 + 1.6 * a);
        s.tube(
            &[
                [x + 1.4, y - 1.2, 0.2 * side, 1.5],
                [x - 1.6, y + 0.6, 0.7 * side, 1.35],
                [x - 4.6 - 1.5 * b, y - 2.2, side, 1.0],
                [x - 6.4 - 2.4 * b, y - 6.0 - 2.0 * a, 1.2 * side, 0.45],
            ],
            3,
            0.7,
        );
    }
    s.limb(v(17.0, 79.6, 0.0), 1.3, v(22.5, 77.6, 0.3), 0.7, 0.7);
    // Tail: a bundle of locks down to the ground.
    for i in 0..9 {
        let [a, b, c] = [0, 1, 2].map(|k| unit(i + 40, k, seed) - 0.5);
        s.tube(
            &[
                [-14.6, 39.0, 0.4 * a, 1.7],
                [-20.4 + a, 39.2 + b, 2.2 * c, 1.7],
                [-24.4 + 1.6 * a, 29.0 + 2.0 * b, 4.6 * c, 1.75],
                [-23.6 + 2.6 * b, 14.0, 5.6 * c + a, 1.6],
                [-26.0 + 4.0 * a, 1.6 + 1.4 * (b + 0.5), 6.5 * c, 0.9],
            ],
            5,
            0.8,
        );
    }
    s
}

fn horse_relief(p: glam::Vec3, spacing: f32, seed: u32) -> f32 {
    let locks = f32::from(p.x < -15.0);
    hide(p, spacing, seed, 1.3) + 0.25 * locks * fbm(v(p.x, 0.2 * p.y, p.z), 1.4, 2, 0.7 * spacing, seed ^ 3)
}

/// A standing dromedary, about 49 x 16 x 47.
pub(super) fn camel(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, camel_relief, 0.8);
    s.egg(v(-3.5, 27.4, 0.0), v(13.0, 6.8, 7.4), turn(0.0, 0.0, 3.0), 0.0);
    s.egg(v(5.5, 27.0, 0.0), v(6.2, 7.0, 6.6), Mat3::IDENTITY, 3.0);
    s.egg(v(-13.0, 27.2, 0.0), v(5.6, 6.2, 6.4), Mat3::IDENTITY, 3.0);
    s.limb(v(-4.0, 33.0, 0.0), 5.2, v(-5.0, 39.2, 0.0), 2.6, 4.5);
    s.tube(
        &[
            [7.0, 28.0, 0.0, 5.0],
            [13.0, 24.6, 0.0, 3.9],
            [17.6, 27.0, 0.0, 3.0],
            [19.0, 34.5, 0.0, 2.4],
            [19.6, 42.0, 0.0, 2.3],
        ],
        4,
        3.0,
    );
    s.limb(v(19.8, 43.4, 0.0), 2.4, v(26.4, 41.2, 0.0), 1.65, 1.0);
    s.egg(v(27.0, 40.8, 0.0), v(1.7, 1.6, 1.7), Mat3::IDENTITY, 0.7);
    s.limb(v(21.0, 41.4, 0.0), 1.5, v(26.0, 38.9, 0.0), 1.0, 0.6);
    s.carve_egg(v(26.4, 39.75, 0.0), v(2.6, 0.22, 2.0), turn(0.0, 0.0, -18.0), 0.3);
    s.egg(v(19.2, 45.4, 0.0), v(1.6, 1.1, 1.6), Mat3::IDENTITY, 0.7);
    for z in SIDES {
        s.egg(v(18.0, 45.7, 2.1 * z), v(0.6, 1.3, 0.7), turn(25.0 * z, 0.0, 20.0), 0.3);
        s.egg(v(21.6, 44.6, 1.6 * z), v(1.1, 0.55, 0.7), turn(0.0, 0.0, -20.0), 0.5);
        s.ball(v(21.8, 43.9, 1.85 * z), 0.6, 0.1);
        s.carve_egg(v(28.3, 41.2, 0.7 * z), v(0.5, 0.25, 0.4), turn(0.0, 0.0, 40.0), 0.2);
        s.egg(v(5.8, 24.6, 4.6 * z), v(2.8, 5.2, 2.3), Mat3::IDENTITY, 1.6);
        s.egg(v(-13.6, 24.2, 4.4 * z), v(3.6, 6.0, 2.4), turn(0.0, 0.0, -8.0), 1.6);
        let (fore, hind) = (0.9 * z, -1.1 * z);
        s.limb(v(5.8, 22.0, 4.4 * z), 2.5, v(6.2 + fore, 12.8, 4.0 * z), 1.5, 1.4);
        s.ball(v(6.3 + fore, 12.6, 4.0 * z), 1.85, 0.7);
        s.limb(v(6.2 + fore, 12.6, 4.0 * z), 1.4, v(5.8 + fore, 3.0, 4.0 * z), 1.1, 0.5);
        pad(&mut s, v(6.6 + fore, 0.0, 4.1 * z));
        s.limb(v(-13.6, 22.0, 4.4 * z), 3.2, v(-12.2 + hind, 17.0, 4.2 * z), 2.0, 1.4);
        s.limb(v(-12.2 + hind, 17.0, 4.2 * z), 1.9, v(-15.8 + hind, 11.2, 4.0 * z), 1.5, 0.8);
        s.limb(v(-15.8 + hind, 11.2, 4.0 * z), 1.4, v(-14.8 + hind, 2.8, 4.0 * z), 1.05, 0.5);
        pad(&mut s, v(-14.0 + hind, 0.0, 4.1 * z));
    }
    s.tube(
        &[[-17.8, 29.4, 0.0, 0.9], [-19.9, 27.5, 0.0, 0.65], [-20.6, 22.0, 0.4, 0.5], [-20.4, 17.5, 0.8, 0.5]],
        4,
        1.0,
    );
    tuft(&mut s, v(-20.4, 17.8, 0.8), v(-20.6, 13.8, 1.0), 0.8, seed);
    s
}

fn camel_relief(p: glam::Vec3, spacing: f32, seed: u32) -> f32 {
    // Shaggy on the hump and along the throat.
    let shaggy = ((p.y - 33.0) / 4.0).clamp(0.0, 1.0) * f32::from(p.x < 6.0)
        + ((p.x - 9.0) / 4.0).clamp(0.0, 1.0) * f32::from(p.y < 36.0);
    hide(p, spacing, seed, 1.0) + 0.35 * shaggy * fbm(v(p.x, 0.4 * p.y, p.z), 1.6, 3, 0.7 * spacing, seed ^ 3)
}

/// Pastern and hoof below the fetlock at `from`.
fn hoof(s: &mut Solid, from: glam::Vec3, r: f32) {
    let tip = v(from.x + 1.1 * r, (from.y - 2.0).max(0.8 * r), from.z);
    s.ball(from, 1.12 * r, 0.4);
    s.limb(from, 0.9 * r, tip, 1.25 * r, 0.4);
    s.block(v(tip.x + 0.1 * r, tip.y - 0.45 * r, tip.z), v(1.35 * r, 0.4 * r, 1.2 * r), 0.35 * r, Mat3::IDENTITY, 0.3);
}

/// The two-toed foot of a camel; `at` is on the ground.
fn pad(s: &mut Solid, at: glam::Vec3) {
    s.limb(at + v(-0.8, 2.6, 0.0), 1.1, at + v(0.2, 1.0, 0.0), 1.3, 0.4);
    for z in SIDES {
        s.egg(at + v(0.5, 0.75, 0.65 * z), v(2.1, 0.75, 0.95), turn(0.0, -10.0 * z, 0.0), 0.3);
    }
}

/// The brush of a tail.
fn tuft(s: &mut Solid, from: glam::Vec3, to: glam::Vec3, r: f32, seed: u32) {
    for i in 0..5 {
        let [a, b] = [0, 1].map(|k| unit(i + 90, k, seed) - 0.5);
        let off = v(2.0 * r * a, 0.0, 2.0 * r * b);
        let middle = 0.5 * (from + to) + 0.8 * off;
        s.limb(from, 0.6 * r, middle, 0.75 * r, 0.3);
        s.limb(middle, 0.75 * r, to + off, 0.25 * r, 0.3);
    }
}
