//! Dragon and rabbit. Both face +x and stand on y = 0.

use glam::{Mat3, Vec3};

use super::noise::{cells, fbm, unit};
use super::sdf::Solid;
use super::shapes::{Knot, spline, turn, v};

const SIDES: [f32; 2] = [-1.0, 1.0];

/// The dragon's back bone, head to tail.
const SPINE: [Knot; 15] = [
    [18.0, 33.0, 0.0, 3.3],
    [13.4, 29.5, 0.2, 3.9],
    [10.6, 22.5, -0.4, 4.6],
    [11.8, 14.0, -0.6, 5.5],
    [9.0, 7.6, 0.6, 5.9],
    [2.0, 8.0, 2.8, 5.7],
    [-3.4, 15.0, 3.4, 5.4],
    [-7.6, 22.6, 1.4, 5.2],
    [-13.6, 23.4, -1.8, 4.9],
    [-17.6, 16.0, -3.2, 4.5],
    [-18.6, 7.0, -2.2, 4.0],
    [-23.0, 3.6, 1.0, 3.2],
    [-27.4, 8.0, 3.0, 2.4],
    [-27.6, 16.0, 2.6, 1.7],
    [-25.4, 23.0, 1.6, 1.0],
];

/// A coiled, scaled, horned dragon, about 58 x 25 x 40.
pub(super) fn dragon(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, dragon_relief, 0.6);
    s.tube(&SPINE, 5, 0.0);
    crest_and_belly(&mut s);
    dragon_head(&mut s, seed);
    for z in SIDES {
        // Fore leg: shoulder, elbow, foot.
        s.egg(v(9.6, 9.6, 4.8 * z), v(4.2, 5.2, 2.8), turn(0.0, 0.0, -20.0), 1.5);
        s.limb(v(9.4, 8.4, 5.4 * z), 3.0, v(12.6, 4.6, 8.8 * z), 1.9, 1.2);
        s.limb(v(12.6, 4.6, 8.8 * z), 1.9, v(17.6, 2.0, 8.8 * z), 1.4, 0.6);
        claw(&mut s, v(17.8, 1.5, 8.8 * z), 1.0);
        s.limb(v(12.0, 5.6, 9.0 * z), 0.9, v(9.4, 8.6, 11.2 * z), 0.15, 0.5);
        // Hind leg: haunch, knee, hock, foot.
        s.egg(v(-16.6, 9.4, 5.0 * z - 2.0), v(4.6, 6.0, 3.0), turn(0.0, 0.0, -15.0), 1.5);
        s.limb(v(-16.0, 9.0, 6.0 * z - 1.2), 3.2, v(-10.8, 7.2, 9.0 * z), 2.1, 1.2);
        s.limb(v(-10.8, 7.2, 9.0 * z), 2.0, v(-14.0, 2.6, 9.2 * z), 1.5, 0.7);
        s.limb(v(-14.0, 2.6, 9.2 * z), 1.5, v(-10.6, 1.7, 9.2 * z), 1.3, 0.6);
        claw(&mut s, v(-10.2, 1.5, 9.2 * z), 0.95);
        s.limb(v(-11.4, 8.0, 9.4 * z), 0.9, v(-13.4, 11.6, 11.4 * z), 0.15, 0.5);
    }
    // The tail ends in a flame of blades.
    for i in 0..7 {
        let a = (-75.0 + 25.0 * i as f32).to_radians();
        let reach = 4.6 + 1.6 * (0.6 * i as f32).sin();
        let tip = v(-25.2 + reach * a.sin(), 23.4 + reach * a.cos(), 1.6 + 0.9 * (i % 2) as f32);
        s.limb(v(-25.4, 22.8, 1.6), 1.0, tip, 0.15, 0.5);
    }
    s
}

/// Dorsal blades and ventral plates along the spine.
fn crest_and_belly(s: &mut Solid) {
    let points = spline(&SPINE, 5);
    let at = |i: usize| v(points[i][0], points[i][1], points[i][2]);
    for (i, &[.., r]) in points.iter().enumerate().take(points.len() - 2).skip(1) {
        let p = at(i);
        let along = (at(i + 1) - at(i - 1)).normalize();
        // The back is on the left of the way down the neck, in the plane of the coils.
        let back = (v(along.y, -along.x, 0.0) - along * v(along.y, -along.x, 0.0).dot(along)).normalize();
        let aside = along.cross(back);
        let height = 0.62 * r + 0.5;
        s.limb(p + back * 0.8 * r, 0.30 * r, p + back * (r + height) + along * 0.9, 0.12, 0.5);
        s.egg(p - back * 0.36 * r, v(0.72, 0.72 * r, 0.78 * r), Mat3::from_cols(along, back, aside), 0.35);
    }
}

fn dragon_head(s: &mut Solid, seed: u32) {
    s.egg(v(19.6, 34.0, 0.0), v(4.6, 3.3, 3.3), turn(0.0, 0.0, -8.0), 1.5);
    // Upper jaw, nose, lower jaw, tongue.
    s.limb(v(21.0, 34.2, 0.0), 2.5, v(27.6, 33.4, 0.0), 1.6, 1.0);
    s.egg(v(28.0, 33.8, 0.0), v(1.8, 1.4, 2.0), Mat3::IDENTITY, 0.7);
    s.limb(v(19.6, 31.4, 0.0), 2.1, v(25.6, 28.4, 0.0), 1.2, 0.8);
    s.egg(v(26.2, 28.3, 0.0), v(1.7, 0.9, 1.5), turn(0.0, 0.0, -25.0), 0.5);
    s.tube(
        &[[21.0, 31.2, 0.0, 0.9], [25.0, 30.3, 0.0, 0.75], [28.2, 29.9, 0.2, 0.55], [30.0, 31.0, 0.4, 0.25]],
        3,
        0.3,
    );
    for z in SIDES {
        for i in 0..6 {
            let x = 23.0 + i as f32;
            let r = if i == 4 { 0.5 } else { 0.34 };
            s.limb(v(x, 32.6, 1.45 * z), r, v(x + 0.15, 31.5 - r, 1.5 * z), 0.08, 0.15);
            let y = 30.9 - 0.5 * i as f32;
            s.limb(v(x - 0.6, y - 0.6, 1.05 * z), r, v(x - 0.3, y + 0.75, 1.15 * z), 0.08, 0.15);
        }
        s.ball(v(28.7, 35.0, 1.0 * z), 0.85, 0.5);
        s.carve_egg(v(29.5, 35.1, 1.2 * z), v(0.5, 0.4, 0.4), Mat3::IDENTITY, 0.2);
        // Eye under a heavy brow.
        s.carve_egg(v(22.4, 35.4, 2.7 * z), v(1.3, 0.9, 0.8), turn(0.0, 0.0, 12.0), 0.4);
        s.ball(v(22.3, 35.3, 2.2 * z), 0.8, 0.05);
        s.limb(v(24.0, 35.8, 1.6 * z), 0.6, v(20.2, 37.4, 2.7 * z), 0.75, 0.5);
        // Horns and a frill of spikes.
        s.tube(
            &[
                [19.2, 36.6, 1.5 * z, 1.1],
                [16.0, 38.4, 2.2 * z, 0.95],
                [12.4, 38.8, 3.0 * z, 0.7],
                [8.8, 40.6, 3.6 * z, 0.2],
            ],
            4,
            0.6,
        );
        s.limb(v(16.6, 38.4, 2.2 * z), 0.6, v(14.8, 40.8, 2.6 * z), 0.12, 0.4);
        for i in 0..5 {
            let t = i as f32 / 4.0;
            let root = v(17.6 - 0.4 * t, 36.0 - 6.0 * t, 2.6 * z);
            let tip = v(12.6 + 1.6 * t, 37.6 - 11.0 * t + unit(i, 3, seed), (5.4 - 1.2 * (t - 0.5).abs()) * z);
            s.limb(root, 1.0, tip, 0.12, 0.6);
        }
        // Whiskers.
        s.tube(
            &[
                [28.0, 32.8, 1.5 * z, 0.5],
                [29.8, 31.4, 3.4 * z, 0.42],
                [28.6, 29.0, 5.2 * z, 0.34],
                [29.6, 26.6, 6.2 * z, 0.2],
            ],
            4,
            0.3,
        );
    }
    // Beard.
    for i in 0..5 {
        let o = i as f32 - 2.0;
        s.limb(v(24.4 - 0.5 * o.abs(), 28.2, 0.5 * o), 0.7, v(22.4 - 0.3 * o.abs(), 24.2, 0.7 * o), 0.12, 0.4);
    }
}

/// Four talons; `at` is the middle of the foot.
fn claw(s: &mut Solid, at: Vec3, r: f32) {
    s.egg(at, v(1.9 * r, 1.2 * r, 1.8 * r), Mat3::IDENTITY, 0.4);
    for i in 0..4 {
        let a = (-50.0 + 33.0 * i as f32).to_radians();
        let out = v(a.cos(), 0.0, a.sin());
        let knuckle = at + out * 2.2 * r + v(0.0, 0.1 * r, 0.0);
        s.limb(at + out * r, 0.85 * r, knuckle, 0.7 * r, 0.3);
        s.limb(knuckle, 0.6 * r, knuckle + out * 1.9 * r - v(0.0, 0.95 * r, 0.0), 0.14 * r, 0.15);
    }
}

fn dragon_relief(p: Vec3, spacing: f32, seed: u32) -> f32 {
    // Scales on the body; the face and the feet have wrinkled skin.
    let face = ((p.x - 16.0) / 3.0).clamp(0.0, 1.0) * f32::from(p.y > 25.0);
    let scaled = (1.0 - face) * ((p.y - 2.0) / 2.0).clamp(0.0, 1.0);
    0.34 * scaled * cells(p, 1.15, spacing, seed) + 0.20 * fbm(p, 2.4, 5, spacing, seed ^ 11) - 0.05
}

/// A sitting rabbit, about 44 x 33 x 43.
pub(super) fn bunny(spacing: f32, seed: u32) -> Solid {
    let mut s = Solid::new(spacing, seed, bunny_relief, 0.75);
    s.egg(v(-5.0, 13.8, 0.0), v(15.0, 12.8, 12.6), turn(0.0, 0.0, -12.0), 0.0);
    s.egg(v(5.5, 13.6, 0.0), v(9.2, 11.0, 9.8), turn(0.0, 0.0, 20.0), 4.0);
    s.egg(v(7.5, 8.0, 0.0), v(6.5, 7.0, 7.5), Mat3::IDENTITY, 3.0);
    s.limb(v(7.0, 18.0, 0.0), 7.0, v(11.5, 24.0, 0.0), 5.6, 3.0);
    // Head.
    s.egg(v(13.0, 27.0, 0.0), v(7.8, 6.4, 6.2), turn(0.0, 0.0, -18.0), 1.8);
    s.egg(v(18.4, 24.6, 0.0), v(3.8, 3.3, 3.6), turn(0.0, 0.0, -18.0), 1.6);
    s.ball(v(21.8, 25.6, 0.0), 0.95, 0.5);
    s.carve_limb(v(22.3, 24.7, 0.0), 0.2, v(21.6, 22.6, 0.0), 0.25, 0.4);
    s.egg(v(18.6, 21.8, 0.0), v(2.2, 1.3, 1.8), Mat3::IDENTITY, 0.8);
    for z in SIDES {
        s.egg(v(19.4, 23.8, 1.9 * z), v(2.4, 2.0, 2.0), Mat3::IDENTITY, 0.5);
        s.egg(v(14.4, 23.4, 3.9 * z), v(4.0, 3.2, 2.6), Mat3::IDENTITY, 1.4);
        s.carve_egg(v(16.6, 28.2, 5.4 * z), v(1.9, 1.6, 1.1), turn(0.0, -20.0 * z, 0.0), 0.6);
        s.ball(v(16.2, 28.1, 4.5 * z), 1.35, 0.1);
        s.egg(v(16.0, 29.6, 4.5 * z), v(1.9, 0.5, 0.9), turn(0.0, 0.0, 8.0), 0.5);
        // Ear: a long spoon, hollow in front.
        let axes = turn(9.0 * z + 4.0, 0.0, 0.0) * turn(0.0, 20.0 * z, 20.0 + 6.0 * z);
        let center = v(7.4 - 0.9 * z, 36.2, 4.6 * z);
        s.egg(center, v(1.7, 8.6, 3.3), axes, 1.2);
        s.carve_egg(center + axes * v(1.5, 0.6, 0.0), v(1.1, 6.6, 2.1), axes, 0.7);
        // Haunch, hind foot, fore leg.
        s.egg(v(-8.0, 10.6, 9.8 * z), v(9.8, 9.6, 6.0), turn(0.0, 0.0, 15.0), 1.6);
        s.egg(v(1.2, 2.2, 10.6 * z), v(8.0, 2.3, 2.9), turn(0.0, 6.0 * z, 0.0), 0.8);
        s.limb(v(9.6, 11.0, 4.8 * z), 3.4, v(12.6, 3.0, 4.6 * z), 2.1, 1.4);
        s.egg(v(14.6, 1.8, 4.6 * z), v(3.4, 1.8, 2.2), Mat3::IDENTITY, 0.7);
        for i in 0..3 {
            let o = 0.95 * (i as f32 - 1.0);
            s.carve_limb(v(16.6, 2.3, 4.6 * z + o + 0.45), 0.16, v(18.2, 0.9, 4.6 * z + o + 0.45), 0.2, 0.25);
            s.carve_limb(v(7.2, 2.8, 10.6 * z + o + 0.45), 0.18, v(9.4, 1.2, 10.6 * z + o + 0.45), 0.22, 0.25);
        }
    }
    s.ball(v(-20.0, 8.6, 0.0), 3.9, 1.2);
    s.block(v(-3.0, 1.2, 0.0), v(11.0, 1.2, 9.0), 0.9, Mat3::IDENTITY, 1.5);
    s
}

fn bunny_relief(p: Vec3, spacing: f32, seed: u32) -> f32 {
    // Tufts of fur on body and haunches, short hair on head, ears and feet.
    let furry = (1.0 - ((p.y - 20.0) / 5.0).clamp(0.0, 1.0)) * ((p.y - 3.0) / 3.0).clamp(0.0, 1.0);
    let swept = v(0.75 * p.x, p.y, p.z) + 1.2 * fbm(p, 7.0, 2, spacing, seed ^ 2);
    0.40 * furry * (cells(swept, 2.9, spacing, seed) - 0.35)
        + (0.10 + 0.16 * furry) * fbm(v(0.35 * p.x, p.y, p.z), 1.4, 4, 0.6 * spacing, seed ^ 6)
}
