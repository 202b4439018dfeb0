//! Bedrooms: beds, nightstands, wardrobes, drawers.

use glam::Vec3;

use super::{OAK, PINE, STEEL, WHITE, put, slab, to};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::noise::fbm;
use crate::generate::solid::{Paint, frame};

/// A small round knob on a front.
fn knob(m: &mut Model, x: f32, y: f32, z: f32) {
    let sides = 4 + m.level();
    m.part(Stuff::Paint, |s| {
        let at = frame(Vec3::new(x, y, z), Vec3::Z, Vec3::X);
        s.lathe(
            at,
            sides,
            STEEL,
            &[[0.0, 0.0], [0.0, 0.006], [0.012, 0.006], [0.016, 0.014], [0.026, 0.01], [0.026, 0.0]],
        );
    });
}

/// A bed, its head at -z, `w` wide and 2.05 long.
fn bed(m: &mut Model, w: f32, wood: Paint, cover: Paint, pillows: u32) {
    let (n, soft) = (m.edge().min(6), m.soft());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.0, -1.03], [w + 0.08, 1.0, 0.05], 0.02, n, wood);
        slab(s, [0.0, 0.0, 1.03], [w + 0.08, 0.48, 0.04], 0.015, n, wood);
        for x in [-1.0, 1.0] {
            slab(s, [x * 0.5 * (w + 0.04), 0.16, 0.0], [0.035, 0.2, 2.02], 0.01, n, wood);
        }
        slab(s, [0.0, 0.2, 0.0], [w, 0.06, 2.0], 0.0, 0, wood);
    });
    m.part(Stuff::Fabric, |s| {
        slab(s, [0.0, 0.265, 0.0], [w - 0.02, 0.2, 1.98], 0.06, soft, WHITE);
    });
    // The duvet: rounded, sagging over the sides, with folds.
    m.part(Stuff::Fabric, |s| {
        let first = s.mesh.positions.len();
        s.rounded(to(0.0, 0.455, 0.28), Vec3::new(0.5 * w + 0.03, 0.075, 0.72), 0.07, soft, cover);
        for p in &mut s.mesh.positions[first..] {
            let lift = fbm(*p * Vec3::new(1.0, 0.0, 1.0), 0.5, 3, 0.02, 11);
            p.y += 0.05 * lift * ((p.y - 0.4) / 0.1).clamp(0.0, 1.0);
        }
        s.smooth(first);
        slab(s, [0.0, 0.5, -0.44], [w + 0.05, 0.055, 0.28], 0.027, soft, cover.map(|c| c.saturating_add(14)));
    });
    m.part(Stuff::Fabric, |s| {
        for k in 0..pillows {
            let x = (k as f32 - 0.5 * (pillows - 1) as f32) * 0.8;
            let at = to(x, 0.56, -0.76) * glam::Affine3A::from_rotation_x(0.28);
            s.rounded(at, Vec3::new(0.34, 0.075, 0.2), 0.075, soft, WHITE);
        }
    });
}

/// A chest of drawers `w` wide, `d` deep, 0.82 high.
pub(super) fn drawers(m: &mut Model, w: f32, d: f32, paint: Paint) {
    let n = m.edge().min(4);
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.06, 0.0], [w, 0.72, d], 0.004, n.min(1), paint);
        slab(s, [0.0, 0.78, 0.0], [w + 0.04, 0.03, d + 0.03], 0.01, n, paint);
        for x in [-1.0, 1.0] {
            for z in [-1.0, 1.0] {
                slab(s, [x * (0.5 * w - 0.04), 0.0, z * (0.5 * d - 0.04)], [0.05, 0.06, 0.05], 0.0, 0, paint);
            }
        }
        for row in 0..3 {
            for x in [-1.0, 1.0] {
                let y = 0.08 + 0.235 * row as f32;
                slab(s, [x * 0.25 * w, y, 0.5 * d + 0.006], [0.5 * w - 0.02, 0.22, 0.018], 0.006, n, paint);
            }
        }
    });
    for row in 0..3 {
        for x in [-1.0, 1.0] {
            knob(m, x * 0.25 * w, 0.19 + 0.235 * row as f32, 0.5 * d + 0.014);
        }
    }
}

fn nightstand(m: &mut Model) {
    let n = m.edge().min(4);
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.12, 0.0], [0.44, 0.36, 0.36], 0.006, n.min(1), OAK);
        slab(s, [0.0, 0.48, 0.0], [0.47, 0.025, 0.39], 0.01, n, OAK);
        for (x, z) in [(-0.19, -0.15), (0.19, -0.15), (-0.19, 0.15), (0.19, 0.15)] {
            slab(s, [x, 0.0, z], [0.035, 0.12, 0.035], 0.0, 0, OAK);
        }
        for y in [0.14, 0.31] {
            slab(s, [0.0, y, 0.184], [0.4, 0.155, 0.018], 0.006, n, OAK);
        }
    });
    knob(m, 0.0, 0.22, 0.192);
    knob(m, 0.0, 0.39, 0.192);
}

fn wardrobe(m: &mut Model) {
    let n = m.edge().min(4);
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.0, 0.0], [1.6, 2.1, 0.55], 0.0, 0, PINE);
        slab(s, [0.0, 2.1, 0.0], [1.68, 0.05, 0.6], 0.02, n, PINE);
        for k in 0..3 {
            let x = -0.53 + 0.53 * k as f32;
            slab(s, [x, 0.1, 0.28], [0.52, 1.97, 0.024], 0.006, n, PINE);
            for [y, h] in [[0.18, 0.8], [1.05, 0.95]] {
                slab(s, [x, y, 0.288], [0.38, h, 0.018], 0.008, n, PINE.map(|c| c - 14));
            }
        }
    });
    for x in [-0.32, 0.21, 0.32] {
        knob(m, x, 1.02, 0.3);
    }
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    out.push(thing("double bed", vec![put(9.2, 0.0, 1.26, 0.0)], |m| bed(m, 1.6, OAK, [92, 116, 150], 2)));
    out.push(thing("single bed", vec![put(13.68, 0.0, 3.82, -90.0)], |m| bed(m, 0.9, PINE, [204, 96, 78], 1)));
    out.push(thing("nightstand", vec![put(8.08, 0.0, 0.42, 0.0), put(10.32, 0.0, 0.42, 0.0)], nightstand));
    out.push(thing("wardrobe", vec![put(10.85, 0.0, 2.6, -90.0)], wardrobe));
    let chests = vec![put(7.5, 0.0, 1.9, 90.0), put(11.5, 0.0, 2.5, 90.0), put(11.0, 0.0, 4.66, 0.0)];
    out.push(thing("chest of drawers", chests, |m| drawers(m, 1.0, 0.38, OAK)));
}
