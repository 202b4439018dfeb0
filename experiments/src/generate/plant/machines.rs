//! Equipment of a bay: tanks, heat exchangers, pumps, fans, tube banks, headers, cabinets; mills, turbines, bunkers on their own.
//!
//! A machine stands on y = 0 in the middle of its floor, which is 6.4 m wide; most are lower than 4 m.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Vec3};

use super::model::{bar, rod, sides, to, up};
use crate::generate::solid::{Knot, Paint, Solid, frame};

const BASE: Paint = [104, 106, 104];
const STEEL: Paint = [168, 172, 176];
const BOLT: Paint = [80, 82, 86];

/// A lathe along x at a point.
fn along(x: f32, y: f32, z: f32) -> Affine3A {
    frame(Vec3::new(x, y, z), Vec3::X, Vec3::Y)
}

/// The profile of a shell of radius `r` from `a` to `b` with dished ends.
pub(super) fn shell(a: f32, b: f32, r: f32, level: u32) -> Vec<Knot> {
    let n = 2 + level / 2;
    // A quarter of an ellipse of height 0.4 r from the axis to the shell.
    let dish: Vec<Knot> = (0..=n)
        .map(|k| {
            let (s, c) = (FRAC_PI_2 * k as f32 / n as f32).sin_cos();
            [0.4 * r * (1.0 - c), if k == 0 { 0.0 } else { r * s }]
        })
        .collect();
    let high = dish.iter().rev().map(|&[x, y]| [b - x, y]);
    dish.iter().map(|&[x, y]| [a + x, y]).chain(high).collect()
}

/// A flanged nozzle along the x axis of `at`, closed by a blind with bolts.
fn nozzle(s: &mut Solid, at: Affine3A, r: f32, long: f32, level: u32, paint: Paint) {
    let (n, f) = (sides(level), 1.5 * r + 0.03);
    let t = 0.05 + 0.1 * r;
    let profile = [[0.0, r], [long - 2.0 * t, r], [long - 2.0 * t, f], [long, f], [long, 0.0]];
    s.lathe(at, n, paint, &profile);
    if level >= 4 {
        for k in 0..8 {
            let (sn, c) = (TAU * k as f32 / 8.0).sin_cos();
            let ring = 0.5 * (r + f);
            let bolt = at * Affine3A::from_translation(Vec3::new(0.0, ring * c, ring * sn));
            let (a, b, w) = (long - 2.0 * t - 0.03, long + 0.03, 0.16 * (f - r) + 0.01);
            s.lathe(bolt, if level < 8 { 4 } else { 6 }, BOLT, &[[a, 0.0], [a, w], [b, w], [b, 0.0]]);
        }
    }
}

/// An upright tank with hoops, a manhole, a ladder and nozzles.
pub(super) fn tank(s: &mut Solid, level: u32, r: f32, high: f32, paint: Paint) {
    let n = 2 * sides(level);
    s.lathe(up(0.0, 0.0, 0.0), n, BASE, &[[0.0, 0.0], [0.0, r + 0.1], [0.15, r + 0.1], [0.15, 0.0]]);
    s.lathe(up(0.0, 0.15, 0.0), n, paint, &shell(-0.4 * r, high - 0.15, r, level));
    for k in 1..4 {
        let y = 0.15 + 0.25 * k as f32 * (high - 0.4 * r);
        let hoop = [[y, r - 0.01], [y, r + 0.05], [y + 0.08, r + 0.05], [y + 0.08, r - 0.01]];
        s.lathe(up(0.0, 0.0, 0.0), n, STEEL, &hoop);
    }
    nozzle(s, frame(Vec3::new(0.0, 0.8, 0.0), Vec3::Z, Vec3::X), 0.3, r + 0.3, level, paint);
    nozzle(s, frame(Vec3::new(0.0, 0.3 * high, 0.0), Vec3::X, Vec3::Y), 0.18, r + 0.4, level, paint);
    nozzle(s, up(0.3 * r, 0.5 * high, 0.0), 0.2, 0.5 * high + 0.3, level, paint);
    let m = 3 + level.min(9);
    for x in [-0.22, 0.22] {
        rod(s, [x, 0.0, -r - 0.2], [x, high, -r - 0.2], 0.025, m, [226, 184, 40]);
    }
    for k in 0..(2.0 * high) as u32 {
        let y = 0.3 + 0.45 * k as f32;
        if y < high {
            rod(s, [-0.22, y, -r - 0.2], [0.22, y, -r - 0.2], 0.015, m, [226, 184, 40]);
        }
    }
}

/// Two horizontal shells over each other on saddles.
pub(super) fn exchanger(s: &mut Solid, level: u32) {
    let n = 2 * sides(level);
    for (y, r, paint) in [(1.15, 0.75, [196, 200, 204]), (2.95, 0.6, [150, 96, 66])] {
        s.lathe(along(0.0, y, 0.0), n, paint, &shell(-2.9, 2.9, r, level));
        for x in [-2.1, 2.1] {
            let flange = [[x - 0.08, r], [x - 0.08, r + 0.14], [x + 0.08, r + 0.14], [x + 0.08, r]];
            s.lathe(along(0.0, y, 0.0), n, STEEL, &flange);
        }
        for x in [-1.3, 1.3] {
            bar(s, [x - 0.12, y - r - 0.5, -0.5], [x + 0.12, y - 0.6 * r, 0.5], BASE);
        }
        for x in [-2.4, 0.4, 2.4] {
            nozzle(s, frame(Vec3::new(x, y, 0.0), Vec3::Z, Vec3::X), 0.2, r + 0.35, level, paint);
            nozzle(s, frame(Vec3::new(x, y, 0.0), Vec3::Y, Vec3::NEG_X), 0.16, r + 0.3, level, paint);
        }
    }
    bar(s, [-3.0, 0.0, -0.6], [3.0, 0.12, 0.6], BASE);
}

/// Three pumps with finned motors on skids.
pub(super) fn pumps(s: &mut Solid, level: u32) {
    let n = sides(level);
    for (k, z) in [-2.1, 0.0, 2.1].into_iter().enumerate() {
        let paint = [[44, 96, 150], [44, 96, 150], [40, 120, 92]][k];
        bar(s, [-2.4, 0.0, z - 0.55], [2.2, 0.25, z + 0.55], BASE);
        // The motor, its fins and its terminal box.
        s.lathe(along(-0.9, 0.85, z), 2 * n, paint, &shell(-0.95, 0.95, 0.46, level));
        let fins = 6 + 2 * level.min(9);
        for f in 0..fins {
            let turn = Affine3A::from_rotation_x(TAU * f as f32 / fins as f32);
            s.block(to(-0.9, 0.85, z) * turn * to(0.0, 0.49, 0.0), Vec3::new(0.6, 0.05, 0.012), paint);
        }
        bar(s, [-1.2, 1.25, z - 0.2], [-0.7, 1.5, z + 0.2], paint);
        for x in [-1.5, -0.3] {
            bar(s, [x - 0.1, 0.25, z - 0.35], [x + 0.1, 0.6, z + 0.35], paint);
        }
        rod(s, [0.0, 0.85, z], [0.7, 0.85, z], 0.09, n, STEEL);
        s.lathe(along(0.3, 0.85, z), n, [226, 184, 40], &[[-0.15, 0.0], [-0.15, 0.18], [0.15, 0.18], [0.15, 0.0]]);
        // The volute: a ring about x and its outlet upwards.
        let axis = frame(Vec3::new(1.1, 0.85, z), Vec3::Y, Vec3::X);
        s.ring_wheel(axis, n, 2 * n, paint, [0.36, 0.24]);
        s.lathe(along(1.1, 0.85, z), 2 * n, paint, &[[-0.26, 0.0], [-0.26, 0.4], [0.26, 0.4], [0.26, 0.0]]);
        nozzle(s, frame(Vec3::new(1.1, 0.85, z + 0.36), Vec3::Y, Vec3::NEG_X), 0.2, 1.4, level, paint);
        nozzle(s, along(1.1, 0.85, z), 0.24, 1.1, level, paint);
        bar(s, [0.9, 0.25, z - 0.2], [1.3, 0.6, z + 0.2], BASE);
    }
}

/// A bank of tubes that wind up and down between two headers.
pub(super) fn bank(s: &mut Solid, level: u32) {
    let n = 3 + level.min(16);
    let (rows, loops) = (3 + level.min(14), 5);
    let turn = 2 + level / 3;
    for k in 0..rows {
        let z = -2.6 + 5.2 * k as f32 / (rows - 1) as f32;
        let mut line = vec![Vec3::new(-2.7, 3.7, z)];
        for j in 0..loops {
            let x = -2.7 + 1.08 * j as f32;
            // Down, around, up, around.
            for (cx, cy, flip) in [(x + 0.27, 0.75, -1.0), (x + 0.81, 2.9, 1.0)] {
                if flip > 0.0 && j == loops - 1 {
                    break;
                }
                for i in 0..=turn {
                    let (sn, c) = (PI * i as f32 / turn as f32).sin_cos();
                    line.push(Vec3::new(cx - 0.27 * c, cy + flip * 0.27 * sn, z));
                }
            }
        }
        line.push(Vec3::new(-2.7 + 1.08 * 4.0 + 0.54, 3.7, z));
        s.sweep(&line, n, [150, 112, 92], |_| 0.055);
    }
    for x in [-2.7, 2.16] {
        let at = frame(Vec3::new(x, 3.75, 0.0), Vec3::Z, Vec3::X);
        s.lathe(at, sides(level), [124, 128, 132], &shell(-3.1, 3.1, 0.22, level));
    }
    for (x, z) in [(-3.0, -2.9), (2.6, -2.9), (-3.0, 2.9), (2.6, 2.9)] {
        bar(s, [x - 0.08, 0.0, z - 0.08], [x + 0.08, 3.6, z + 0.08], BASE);
    }
    for z in [-2.9, 2.9] {
        bar(s, [-3.0, 3.4, z - 0.07], [2.6, 3.52, z + 0.07], BASE);
    }
}

/// Headers with rows of upright tubes between them, one nest inside the other.
pub(super) fn headers(s: &mut Solid, level: u32) {
    let n = 3 + level.min(16);
    let count = 6 + 3 * level.min(12);
    for (i, (z, r, top)) in [(-2.2, 0.28, 3.6), (-1.1, 0.2, 3.1), (0.0, 0.34, 3.8), (1.1, 0.2, 3.1), (2.2, 0.28, 3.6)]
        .into_iter()
        .enumerate()
    {
        let paint: Paint = [[186, 188, 190], [160, 104, 70]][i % 2];
        for y in [0.6, top] {
            s.lathe(along(0.0, y, z), sides(level) + 4, paint, &shell(-3.0, 3.0, r, level));
        }
        for k in 0..count {
            let x = -2.7 + 5.4 * k as f32 / (count - 1) as f32;
            let off = 0.35 * r * if k % 2 == 0 { 1.0 } else { -1.0 };
            rod(s, [x, 0.6, z + off], [x, top, z + off], 0.045, n, [142, 118, 104]);
        }
        for x in [-2.85, 2.85] {
            bar(s, [x - 0.08, 0.0, z - 0.2], [x + 0.08, 0.6 - 0.6 * r, z + 0.2], BASE);
        }
    }
    for x in [-2.95, 2.95] {
        rod(s, [x, 0.6, -2.2], [x, 0.6, 2.2], 0.14, sides(level), [186, 188, 190]);
    }
}

/// Two rows of cabinets with doors, vents and lamps.
pub(super) fn cabinets(s: &mut Solid, level: u32) {
    for z in [-1.5, 1.5] {
        bar(s, [-2.9, 0.0, z - 0.42], [2.9, 0.1, z + 0.42], BASE);
        for k in 0..7 {
            let x = -2.8 + 0.8 * k as f32;
            let paint = if k % 3 == 2 { [150, 164, 170] } else { [186, 190, 180] };
            bar(s, [x, 0.1, z - 0.4], [x + 0.785, 2.2, z + 0.4], paint);
            bar(s, [x + 0.03, 0.16, z + 0.4], [x + 0.755, 2.14, z + 0.415], paint.map(|c| c - 14));
            if level >= 3 {
                for v in 0..(2 + level.min(10)) {
                    let y = 0.3 + 0.045 * v as f32;
                    bar(s, [x + 0.15, y, z + 0.415], [x + 0.63, y + 0.02, z + 0.425], BOLT);
                }
                rod(s, [x + 0.68, 1.1, z + 0.41], [x + 0.68, 1.3, z + 0.44], 0.015, 4 + level.min(6), BOLT);
                for (l, lamp) in [[200, 50, 40], [60, 170, 70], [230, 190, 60]].into_iter().enumerate() {
                    let at = frame(Vec3::new(x + 0.2 + 0.12 * l as f32, 1.9, z + 0.415), Vec3::Z, Vec3::X);
                    s.lathe(at, 4 + level, lamp, &[[0.0, 0.03], [0.02, 0.025], [0.03, 0.0]]);
                }
            }
        }
    }
}

/// A radial fan: a spiral case, an inlet, a motor, an outlet duct.
pub(super) fn fan(s: &mut Solid, level: u32) {
    let n = sides(level);
    let steps = 8 + 3 * level;
    let paint = [92, 128, 140];
    // The case as a prism lying on its side: the spiral's radius grows by half over a turn.
    let mut outline: Vec<glam::Vec2> = (0..steps)
        .map(|k| {
            let t = k as f32 / steps as f32;
            glam::Vec2::from_angle(-TAU * t) * (1.15 + 0.55 * t)
        })
        .collect();
    outline.push(glam::Vec2::new(1.7, 0.02));
    outline.dedup_by(|a, b| a.distance(*b) < 1e-4);
    let side = to(-0.6, 1.95, 0.0) * Affine3A::from_rotation_z(-FRAC_PI_2);
    s.prism(side, &outline, glam::Vec2::ZERO, [0.0, 1.2], paint);
    s.lathe(
        along(0.6, 1.95, 0.0),
        2 * n,
        STEEL,
        &[[0.0, 0.7], [0.1, 0.72], [0.6, 0.95], [0.65, 0.95], [0.55, 0.7], [0.02, 0.5], [0.02, 0.0]],
    );
    bar(s, [-2.6, 0.0, -1.0], [1.4, 0.3, 1.0], BASE);
    s.lathe(along(-1.7, 1.95, 0.0), 2 * n, [44, 96, 150], &shell(-0.9, 0.9, 0.5, level));
    bar(s, [-2.4, 0.3, -0.45], [-1.0, 1.55, 0.45], BASE);
    rod(s, [-0.9, 1.95, 0.0], [-0.55, 1.95, 0.0], 0.1, n, STEEL);
    for z in [-0.9, 0.7] {
        bar(s, [-0.5, 0.3, z], [0.5, 1.2, z + 0.2], BASE);
    }
}

/// A coal mill: a heavy body, a gearbox, a classifier, four coal pipes upwards.
pub(super) fn mill(s: &mut Solid, level: u32) {
    let n = 2 * sides(level);
    let body = [
        [0.0, 0.0],
        [0.0, 2.4],
        [0.5, 2.4],
        [0.6, 1.9],
        [2.2, 2.0],
        [2.3, 2.3],
        [2.6, 2.3],
        [2.7, 1.9],
        [4.4, 1.9],
        [5.6, 1.1],
        [6.4, 0.9],
        [6.4, 0.0],
    ];
    s.lathe(up(0.0, 0.0, 0.0), n, [122, 98, 84], &body);
    for k in 0..3 {
        let (sn, c) = (TAU * k as f32 / 3.0).sin_cos();
        let at = frame(
            Vec3::new(1.6 * c, 1.5, 1.6 * sn),
            Vec3::new(c, 0.25, sn).normalize(),
            Vec3::new(-0.25 * c, 1.0, -0.25 * sn).normalize(),
        );
        nozzle(s, at, 0.5, 1.1, level, [150, 120, 96]);
    }
    for k in 0..4 {
        let (sn, c) = (TAU * (k as f32 + 0.5) / 4.0).sin_cos();
        let line =
            [[0.6 * c, 5.9, 0.6 * sn], [0.9 * c, 6.8, 0.9 * sn], [1.3 * c, 7.6, 1.3 * sn], [1.3 * c, 9.3, 1.3 * sn]];
        s.sweep(&line.map(Vec3::from), sides(level), [128, 120, 112], |_| 0.28);
    }
    bar(s, [2.0, 0.0, -0.8], [3.1, 1.2, 0.8], [44, 96, 150]);
}

/// A steam turbine and its generator along x, 17 m long.
pub(super) fn turbine(s: &mut Solid, level: u32) {
    let n = 2 * sides(level);
    bar(s, [-8.6, 0.0, -2.4], [8.6, 1.0, 2.4], [150, 148, 142]);
    let casing = [
        [-8.0, 0.0],
        [-8.0, 0.7],
        [-7.4, 0.8],
        [-7.2, 1.3],
        [-5.6, 1.3],
        [-5.2, 0.9],
        [-4.6, 0.9],
        [-4.2, 1.6],
        [-2.4, 2.1],
        [-0.4, 2.1],
        [0.2, 1.2],
        [0.9, 0.8],
        [1.6, 0.7],
        [1.6, 0.0],
    ];
    s.lathe(along(0.0, 2.6, 0.0), n, [196, 198, 190], &casing);
    for x in [-6.4, -3.3, -1.4, -0.5] {
        let r = if x < -5.0 {
            1.3
        } else if x < -3.0 {
            1.86
        } else {
            2.1
        };
        let joint = [[x - 0.12, r - 0.1], [x - 0.12, r + 0.12], [x + 0.12, r + 0.12], [x + 0.12, r - 0.1]];
        s.lathe(along(0.0, 2.6, 0.0), n, STEEL, &joint);
    }
    let generator = [
        [1.7, 0.0],
        [1.7, 0.5],
        [2.2, 0.5],
        [2.2, 1.6],
        [2.5, 1.75],
        [7.3, 1.75],
        [7.6, 1.6],
        [7.6, 0.6],
        [8.3, 0.6],
        [8.3, 0.0],
    ];
    s.lathe(along(0.0, 2.6, 0.0), n, [64, 110, 150], &generator);
    let ribs = 4 + level.min(12);
    for k in 0..ribs {
        let x = 2.8 + 4.2 * k as f32 / (ribs - 1) as f32;
        s.lathe(
            along(0.0, 2.6, 0.0),
            n,
            [56, 98, 134],
            &[[x - 0.04, 1.74], [x - 0.04, 1.85], [x + 0.04, 1.85], [x + 0.04, 1.74]],
        );
    }
    for (x, r) in [(-6.6, 0.3), (-5.9, 0.3), (-2.9, 0.5), (-1.2, 0.5)] {
        for z in [-0.6, 0.6] {
            s.sweep(
                &[[x, 2.6, z], [x, 4.9, z], [x, 5.3, 1.4 * z], [x, 5.5, 2.4 * z], [x, 5.5, 4.4 * z]].map(Vec3::from),
                sides(level),
                [206, 206, 200],
                |_| r,
            );
        }
    }
    bar(s, [2.4, 1.0, -1.7], [7.4, 1.6, 1.7], [64, 110, 150]);
    bar(s, [-7.6, 1.0, -1.4], [0.6, 1.9, 1.4], [150, 148, 142]);
}

/// A coal bunker: a cylinder over a cone, 15 m high.
pub(super) fn bunker(s: &mut Solid, level: u32) {
    let n = 2 * sides(level);
    let profile = [[0.0, 0.0], [0.0, 0.5], [5.5, 3.0], [14.6, 3.0], [14.6, 3.1], [14.9, 3.1], [14.9, 0.0]];
    s.lathe(up(0.0, 0.0, 0.0), n, [116, 120, 118], &profile);
    for y in [5.5, 8.0, 10.5, 13.0] {
        s.lathe(up(0.0, 0.0, 0.0), n, [96, 100, 98], &[[y, 2.99], [y, 3.15], [y + 0.2, 3.15], [y + 0.2, 2.99]]);
    }
    let ribs = 8 + 2 * level.min(8);
    for k in 0..ribs {
        let turn = Affine3A::from_rotation_y(TAU * k as f32 / ribs as f32);
        s.block(turn * to(3.03, 10.0, 0.0), Vec3::new(0.07, 4.5, 0.05), [96, 100, 98]);
    }
}

/// A straight piece of rectangular duct along x with ribs, `size` high and deep.
pub(super) fn duct(s: &mut Solid, level: u32, long: f32, size: f32) {
    let (x, h) = (0.5 * long, 0.5 * size);
    bar(s, [-x, -h, -h], [x, h, h], [172, 174, 172]);
    let ribs = (long * (0.5 + 0.12 * level.min(16) as f32)) as u32;
    for k in 0..ribs {
        let at = -x + long * (k as f32 + 0.5) / ribs as f32;
        let (w, o) = (0.03, h + 0.1);
        for side in [-1.0, 1.0] {
            s.block(to(at, side * (h + 0.05), 0.0), Vec3::new(w, 0.05, o), [142, 146, 146]);
            s.block(to(at, 0.0, side * (h + 0.05)), Vec3::new(w, h, 0.05), [142, 146, 146]);
        }
    }
    for side in [-1.0, 1.0] {
        for z in [-0.5, 0.5] {
            s.block(to(0.0, side * (h + 0.03), z * size), Vec3::new(x, 0.03, 0.04), [142, 146, 146]);
        }
    }
}
