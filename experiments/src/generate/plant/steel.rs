//! The building's steel: columns, beams, gratings, railings, stairs, floors.
//!
//! A walkway's panel lies along x, its upper side at y = 0, its middle at the origin.

use super::model::{bar, rod};
use crate::generate::solid::{Paint, Solid};

const STEEL: Paint = [112, 124, 136];
const GRATING: Paint = [150, 152, 150];
const RAIL: Paint = [226, 184, 40];
/// Width of a walkway.
pub(super) const WIDE: f32 = 1.9;

/// A double-T column, `high` high, from y = 0.
pub(super) fn column(s: &mut Solid, level: u32, high: f32) {
    if level < 3 {
        return bar(s, [-0.2, 0.0, -0.2], [0.2, high, 0.2], STEEL);
    }
    for z in [-0.2, 0.17] {
        bar(s, [-0.2, 0.0, z], [0.2, high, z + 0.03], STEEL);
    }
    bar(s, [-0.015, 0.0, -0.17], [0.015, high, 0.17], STEEL);
    if level >= 6 {
        for k in 0..3 {
            let y = (0.2 + 0.3 * k as f32) * high;
            for x in [-0.2, 0.03] {
                bar(s, [x, y, -0.17], [x + 0.17, y + 0.02, 0.17], STEEL);
            }
        }
        bar(s, [-0.32, 0.0, -0.32], [0.32, 0.03, 0.32], STEEL);
    }
}

/// A double-T beam along x, `long` long, its upper side at y = 0.
pub(super) fn beam(s: &mut Solid, level: u32, long: f32, deep: f32) {
    let (x, w) = (0.5 * long, 0.35 * deep);
    if level < 3 {
        return bar(s, [-x, -deep, -0.7 * w], [x, 0.0, 0.7 * w], STEEL);
    }
    bar(s, [-x, -0.03, -w], [x, 0.0, w], STEEL);
    bar(s, [-x, -deep, -w], [x, 0.03 - deep, w], STEEL);
    bar(s, [-x, 0.03 - deep, -0.012], [x, -0.03, 0.012], STEEL);
    if level >= 6 {
        let ribs = long.round() as i32 / 2;
        for k in 1..ribs {
            let at = -x + long * k as f32 / ribs as f32;
            for z in [-w, 0.012] {
                bar(s, [at, 0.03 - deep, z], [at + 0.015, -0.03, z + w - 0.012], STEEL);
            }
        }
    }
}

/// A panel of grating: a frame, bearing bars along x and cross bars; a plate on the lowest levels.
pub(super) fn grating(s: &mut Solid, level: u32, long: f32) {
    let (x, z) = (0.5 * long, 0.5 * WIDE);
    if level < 3 {
        return bar(s, [-x, -0.05, -z], [x, 0.0, z], GRATING);
    }
    for side in [-z, z - 0.03] {
        bar(s, [-x, -0.14, side], [x, 0.01, side + 0.03], STEEL);
    }
    // Bars become more and finer.
    let along = 5 + 2 * level.min(20);
    let thick = (0.35 * WIDE / along as f32).min(0.05);
    for k in 0..along {
        let at = -z + 0.03 + (WIDE - 0.06 - thick) * k as f32 / (along - 1) as f32;
        bar(s, [-x, -0.035, at], [x, 0.0, at + thick], GRATING);
    }
    let across = (long * (0.8 + 0.35 * level.min(20) as f32)) as u32;
    for k in 0..across {
        let at = -x + (long - 0.03) * (k as f32 + 0.5) / across as f32;
        bar(s, [at, -0.03, 0.03 - z], [at + 0.03, -0.004, z - 0.03], GRATING);
    }
}

/// A railing along x, standing on y = 0: posts, two rails, a toe board.
pub(super) fn railing(s: &mut Solid, level: u32, long: f32) {
    let (x, n) = (0.5 * long, 3 + level.min(14));
    let posts = (long / if level < 3 { 4.0 } else { 1.4 }).round() as u32;
    for k in 0..=posts {
        let at = (x - 0.03) * (2.0 * k as f32 / posts as f32 - 1.0);
        rod(s, [at, 0.0, 0.0], [at, 1.1, 0.0], 0.022, n, RAIL);
    }
    for y in [0.55, 1.1] {
        rod(s, [-x, y, 0.0], [x, y, 0.0], 0.024, n, RAIL);
    }
    if level >= 2 {
        bar(s, [-x, 0.0, -0.006], [x, 0.12, 0.006], RAIL);
    }
}

/// Two flights of stairs that climb 5 m with a landing half way; the foot at x = -2.6, z = 0.6.
pub(super) fn stairs(s: &mut Solid, level: u32) {
    let steps = 12;
    let n = 3 + level.min(10);
    for (z, from, dir, base) in [(0.6, -2.4_f32, 1.0_f32, 0.0_f32), (-0.6, 1.2, -1.0, 2.5)] {
        let (run, rise) = (3.6 / steps as f32, 2.5 / steps as f32);
        for k in 0..steps {
            let x = from + dir * run * (k as f32 + 0.5);
            let y = base + rise * (k as f32 + 1.0);
            bar(s, [x - 0.14, y - 0.04, z - 0.45], [x + 0.14, y, z + 0.45], GRATING);
        }
        for side in [-0.48, 0.48] {
            let (a, b) = ([from, base + 0.02, z + side], [from + dir * 3.6, base + 2.48, z + side]);
            rod(s, a, b, 0.06, n, STEEL);
            rod(s, [a[0], a[1] + 1.0, a[2]], [b[0], b[1] + 1.0, b[2]], 0.025, n, RAIL);
            for k in 0..=4 {
                let t = k as f32 / 4.0;
                let p = [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, a[2]];
                rod(s, p, [p[0], p[1] + 1.0, p[2]], 0.02, n, RAIL);
            }
        }
    }
    for (x, y) in [(1.2, 2.5), (-3.4, 5.0)] {
        bar(s, [x, y - 0.06, -1.1], [x + 1.0, y, 1.1], GRATING);
    }
}

/// The plate of a bay's floor, its upper side at y = 0, on three beams.
pub(super) fn floor(s: &mut Solid, level: u32, edge: f32) {
    let h = 0.5 * edge;
    bar(s, [-h, -0.06, -h], [h, 0.0, h], [132, 132, 126]);
    if level >= 2 {
        for z in [-0.8 * h, 0.0, 0.8 * h] {
            bar(s, [-h, -0.3, z - 0.08], [h, -0.06, z + 0.08], STEEL);
        }
    }
}

/// Cable trays along x, two over each other, with cables; hung from y = 0.
pub(super) fn trays(s: &mut Solid, level: u32, long: f32) {
    let x = 0.5 * long;
    if level < 2 {
        for y in [-0.35, -0.7] {
            bar(s, [-x, y, -0.25], [x, y + 0.09, 0.25], [110, 112, 114]);
        }
        return bar(s, [-0.02, -0.75, -0.02], [0.02, 0.0, 0.02], STEEL);
    }
    for (i, y) in [-0.35, -0.7].into_iter().enumerate() {
        for z in [-0.25, 0.23] {
            bar(s, [-x, y, z], [x, y + 0.09, z + 0.02], [170, 174, 176]);
        }
        let rungs = (long * if level < 3 { 0.4 } else { 2.0 }) as u32;
        for k in 0..rungs {
            let at = -x + long * (k as f32 + 0.5) / rungs as f32;
            bar(s, [at, y, -0.23], [at + 0.04, y + 0.02, 0.23], [170, 174, 176]);
        }
        let colors = [[40, 40, 42], [52, 56, 66], [120, 44, 38], [36, 66, 96]];
        for k in 0..(2 + level.min(8)) {
            let z = -0.2 + 0.4 * k as f32 / (1 + level.min(8)) as f32;
            rod(s, [-x, y + 0.045, z], [x, y + 0.045, z], 0.018, 3 + level.min(10), colors[(k as usize + i) % 4]);
        }
    }
    for at in [-0.8 * x, 0.0, 0.8 * x] {
        for z in [-0.3, 0.25] {
            bar(s, [at, -0.75, z], [at + 0.03, 0.0, z + 0.03], STEEL);
        }
        bar(s, [at, -0.75, -0.27], [at + 0.03, -0.72, 0.25], STEEL);
    }
}

/// A sheet of corrugated cladding, 10 m along x and 5 m high from y = 0, that looks along +z.
pub(super) fn cladding(s: &mut Solid, level: u32) {
    let paint: Paint = [158, 172, 180];
    bar(s, [-5.0, 0.0, 0.0], [5.0, 4.98, 0.03], paint);
    let ribs = 3 * level.min(16);
    for k in 0..ribs {
        let x = -5.0 + 10.0 * (k as f32 + 0.5) / ribs as f32;
        let w = 2.2 / ribs as f32;
        for [from, to] in [[-0.05, 0.0], [0.03, 0.09]] {
            bar(s, [x - w, 0.0, from], [x + w, 4.98, to], paint);
        }
    }
}
