//! The boiler: walls of parallel tubes, buckstays, headers, the steam drum, downcomers, burners, the hopper; and the stack.
//!
//! A wall's panel lies in the plane z = 0 and looks along +z; it is [`PANEL`] wide and a storey high, from y = 0.

use std::f32::consts::TAU;

use glam::Vec3;

use super::machines::shell;
use super::model::{bar, rod, sides, to, up};
use crate::generate::solid::{Knot, Paint, Solid, frame};

/// Width of a panel.
pub(super) const PANEL: f32 = 4.0;
/// Height of a panel.
pub(super) const STOREY: f32 = 5.0;
/// Half the boiler's width.
pub(super) const HALF: f32 = 8.0;

const TUBE: Paint = [150, 116, 98];
const STEEL: Paint = [112, 124, 136];

/// Parallel tubes with fins between them, on a plate.
pub(super) fn panel(s: &mut Solid, level: u32) {
    let (w, n) = (0.5 * PANEL, 3 + level.min(18));
    bar(s, [-w, 0.0, -0.06], [w, STOREY, 0.0], [104, 84, 74]);
    let count = 5 + 2 * level.min(18);
    let pitch = PANEL / count as f32;
    for k in 0..count {
        let x = -w + pitch * (k as f32 + 0.5);
        let tone = 1.0 + 0.12 * (crate::generate::noise::unit(k as i32, 3, 17) - 0.5);
        let profile: [Knot; 2] = [[0.0, 0.38 * pitch], [STOREY, 0.38 * pitch]];
        s.lathe(up(x, 0.0, 0.0), n, TUBE.map(|c| (f32::from(c) * tone) as u8), &profile);
    }
}

/// A buckstay along x over all of a wall.
pub(super) fn buckstay(s: &mut Solid, level: u32) {
    let x = HALF + 0.5;
    bar(s, [-x, -0.25, 0.12], [x, -0.22, 0.5], STEEL);
    bar(s, [-x, 0.22, 0.12], [x, 0.25, 0.5], STEEL);
    bar(s, [-x, -0.22, 0.29], [x, 0.22, 0.32], STEEL);
    let ribs = 2 * level.min(10);
    for k in 0..ribs {
        let at = -x + 2.0 * x * (k as f32 + 0.5) / ribs as f32;
        bar(s, [at, -0.22, 0.12], [at + 0.03, 0.22, 0.29], STEEL);
        bar(s, [at, -0.22, 0.32], [at + 0.03, 0.22, 0.5], STEEL);
    }
}

/// A header along x over all of a wall, with stubs upwards.
pub(super) fn header(s: &mut Solid, level: u32) {
    let at = frame(Vec3::ZERO, Vec3::X, Vec3::Y);
    s.lathe(at, 2 * sides(level), [168, 170, 172], &shell(-HALF - 0.6, HALF + 0.6, 0.32, level));
    let count = 5 * level.min(16);
    for k in 0..count {
        let x = -HALF + 2.0 * HALF * (k as f32 + 0.5) / count as f32;
        let z = if k % 2 == 0 { 0.14 } else { -0.14 };
        rod(s, [x, 0.2, z], [x, 1.0, z], 0.055, 3 + level.min(16), TUBE);
    }
}

/// The steam drum along x with its nozzles and a row of risers on either side.
pub(super) fn drum(s: &mut Solid, level: u32) {
    let at = frame(Vec3::ZERO, Vec3::X, Vec3::Y);
    s.lathe(at, 3 * sides(level), [186, 184, 176], &shell(-9.0, 9.0, 1.0, level));
    for x in [-7.0, -3.5, 0.0, 3.5, 7.0] {
        let ring = [[x - 0.12, 0.98], [x - 0.12, 1.1], [x + 0.12, 1.1], [x + 0.12, 0.98]];
        s.lathe(at, 3 * sides(level), STEEL, &ring);
        s.lathe(
            up(x + 0.8, 0.9, 0.0),
            sides(level),
            STEEL,
            &[[0.0, 0.25], [1.0, 0.25], [1.0, 0.4], [1.12, 0.4], [1.12, 0.0]],
        );
    }
    let count = 12 + 4 * level.min(10);
    let bend = 3 + level.min(8);
    for k in 0..count {
        let x = -8.0 + 16.0 * k as f32 / (count - 1) as f32;
        for z in [-1.0, 1.0] {
            let line: Vec<Vec3> = (0..=bend)
                .map(|i| {
                    let (sn, c) = (std::f32::consts::FRAC_PI_2 * i as f32 / bend as f32).sin_cos();
                    Vec3::new(x, -2.4 + 2.2 * sn, z * (3.0 - 2.2 * (1.0 - c)))
                })
                .collect();
            s.sweep(&line, 3 + level.min(14), TUBE, |_| 0.11);
        }
    }
}

/// A downcomer, a storey of it.
pub(super) fn downcomer(s: &mut Solid, level: u32) {
    let n = 2 * sides(level);
    s.lathe(up(0.0, 0.0, 0.0), n, [204, 204, 200], &[[0.0, 0.4], [STOREY, 0.4]]);
    let bands: &[f32] = if level < 2 { &[] } else { &[0.02, 2.5] };
    for y in bands.iter().copied() {
        s.lathe(up(0.0, 0.0, 0.0), n, STEEL, &[[y, 0.39], [y, 0.46], [y + 0.12, 0.46], [y + 0.12, 0.39]]);
    }
}

/// A row of four burners that look along +z, with their coal pipes from below.
pub(super) fn burners(s: &mut Solid, level: u32) {
    let n = sides(level) + 4;
    bar(s, [-7.0, -1.4, 0.12], [7.0, 1.4, 0.3], [132, 134, 134]);
    for k in 0..4 {
        let x = -5.25 + 3.5 * k as f32;
        let at = frame(Vec3::new(x, 0.0, 0.0), Vec3::Z, Vec3::X);
        let body = [[0.1, 0.0], [0.1, 1.0], [0.5, 1.0], [0.6, 0.75], [1.0, 0.7], [1.0, 0.85], [1.1, 0.85], [1.1, 0.0]];
        s.lathe(at, n, [172, 96, 60], &body);
        let line = [[x, 0.0, 0.9], [x, -0.2, 1.35], [x, -0.7, 1.5], [x, -4.0, 1.5]];
        s.sweep(&line.map(Vec3::from), n, [128, 120, 112], |_| 0.28);
        let ring = frame(Vec3::new(x, -2.0, 1.5), Vec3::Y, Vec3::X);
        s.lathe(ring, n, STEEL, &[[-0.1, 0.27], [-0.1, 0.4], [0.1, 0.4], [0.1, 0.27]]);
    }
}

/// The hopper under the boiler: a pyramid upside down and its ash gate.
pub(super) fn hopper(s: &mut Solid, level: u32) {
    let square = |h: f32, y: f32| [(h, h), (h, -h), (-h, -h), (-h, h)].map(|(x, z)| Vec3::new(x, y, z));
    let (low, high) = (square(1.2, 1.6), square(HALF, 7.0));
    let plate = [128, 110, 98];
    for k in 0..4 {
        let (a, b, c, d) = (low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]);
        let n = (b - a).cross(d - a).normalize();
        let [a, b, c, d] = [a, b, c, d].map(|p| s.vertex(p, n, plate));
        s.mesh.indices.extend([a, b, c, a, c, d]);
    }
    for (q, n, order) in [(low, Vec3::NEG_Y, [0, 3, 2, 1]), (high, Vec3::Y, [0, 1, 2, 3])] {
        let ids = order.map(|k: usize| s.vertex(q[k], n, plate));
        s.mesh.indices.extend([ids[0], ids[1], ids[2], ids[0], ids[2], ids[3]]);
    }
    let count = 10 + 4 * level.min(14);
    for k in 0..count {
        let t = 2.0 * (k as f32 + 0.5) / count as f32 - 1.0;
        for turn in 0..4 {
            let at = glam::Affine3A::from_rotation_y(TAU * turn as f32 / 4.0);
            let ends = [Vec3::new(t * 1.2, 1.6, 1.25), Vec3::new(t * HALF, 7.0, HALF + 0.05)];
            s.sweep(&ends.map(|p| at.transform_point3(p)), 3 + level.min(12), TUBE, |_| 0.06);
        }
    }
    bar(s, [-1.4, 0.4, -1.4], [1.4, 1.6, 1.4], STEEL);
    bar(s, [-1.8, 0.0, -1.8], [1.8, 0.4, 1.8], [104, 106, 104]);
}

/// A ring of the stack, 5 m high: concrete, banded in red towards the top.
pub(super) fn stack(s: &mut Solid, level: u32, banded: bool) {
    let n = 3 * sides(level);
    let paint: Paint = if banded { [178, 70, 58] } else { [188, 184, 176] };
    s.lathe(up(0.0, 0.0, 0.0), n, paint, &[[0.0, 2.6], [5.0, 2.6]]);
    s.lathe(up(0.0, 0.0, 0.0), n, [150, 148, 142], &[[0.1, 2.59], [0.1, 2.72], [0.3, 2.72], [0.3, 2.59]]);
    for k in 0..4 {
        let at = glam::Affine3A::from_rotation_y(TAU * k as f32 / 4.0) * to(2.62, 2.5, 0.0);
        s.block(at, Vec3::new(0.05, 2.4, 0.12), [150, 148, 142]);
    }
}

/// The stack's mouth: an inner shell, dark.
pub(super) fn mouth(s: &mut Solid, level: u32) {
    let n = 3 * sides(level);
    let rim = [[-6.0, 0.0], [-6.0, 2.2], [-5.9, 2.8], [0.4, 2.8], [0.4, 2.3], [-5.0, 2.2], [-5.0, 0.0]];
    s.lathe(up(0.0, 0.0, 0.0), n, [96, 92, 90], &rim[2..5]);
    s.lathe(up(0.0, 0.0, 0.0), n, [60, 56, 54], &rim[4..]);
}
