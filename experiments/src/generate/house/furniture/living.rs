//! Seats, low tables, lamps, rugs, the television, radiators, desk and office chair.

use glam::{Affine3A, Vec3};

use super::{DARK, OAK, PINE, STEEL, WALNUT, WHITE, put, rod, slab, to, up};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::solid::Paint;

/// A seat for `seats`, 0.72 a seat, with arms, back and loose cushions.
fn sofa(m: &mut Model, seats: u32, paint: Paint) {
    let (soft, sides) = (m.soft(), 4 + m.level());
    let w = 0.72 * seats as f32;
    m.part(Stuff::Fabric, |s| {
        slab(s, [0.0, 0.1, 0.0], [w + 0.02, 0.2, 0.82], 0.03, soft, paint);
        slab(s, [0.0, 0.12, -0.36], [w + 0.3, 0.7, 0.2], 0.09, soft, paint);
        for x in [-1.0, 1.0] {
            slab(s, [x * (0.5 * w + 0.09), 0.1, 0.02], [0.19, 0.5, 0.86], 0.08, soft, paint);
        }
        for k in 0..seats {
            let x = (k as f32 - 0.5 * (seats - 1) as f32) * 0.72;
            slab(s, [x, 0.285, 0.07], [0.715, 0.17, 0.72], 0.065, soft, paint.map(|c| c.saturating_add(8)));
            let at = to(x, 0.64, -0.2) * Affine3A::from_rotation_x(-0.2);
            s.rounded(at, Vec3::new(0.34, 0.24, 0.085), 0.085, soft, paint.map(|c| c.saturating_add(8)));
        }
    });
    m.part(Stuff::Fabric, |s| {
        let colors = [[206, 154, 70], [70, 108, 120]];
        for k in 0..seats.min(2) {
            let x = (k as f32 - 0.5) * (w - 0.42);
            let at =
                to(x, 0.6, 0.01) * Affine3A::from_rotation_x(-0.45) * Affine3A::from_rotation_z(0.2 - 0.5 * k as f32);
            s.rounded(at, Vec3::new(0.2, 0.2, 0.07), 0.07, soft, colors[k as usize]);
        }
    });
    m.part(Stuff::Wood, |s| {
        for (x, z) in [(-1.0, -0.36), (1.0, -0.36), (-1.0, 0.36), (1.0, 0.36)] {
            let leg = [[0.0, 0.0], [0.0, 0.018], [0.11, 0.028], [0.11, 0.0]];
            s.lathe(up(x * 0.5 * w, 0.0, z), sides, WALNUT, &leg);
        }
    });
}

fn coffee_table(m: &mut Model) {
    let (n, sides) = (m.edge().min(6), m.sides());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.38, 0.0], [1.1, 0.04, 0.6], 0.015, n, WALNUT);
        slab(s, [0.0, 0.14, 0.0], [0.96, 0.025, 0.46], 0.008, n, WALNUT);
        for (x, z) in [(-0.48, -0.23), (0.48, -0.23), (-0.48, 0.23), (0.48, 0.23)] {
            s.lathe(up(x, 0.0, z), sides, WALNUT, &[[0.0, 0.0], [0.0, 0.02], [0.39, 0.03], [0.39, 0.0]]);
        }
    });
    m.part(Stuff::Paint, |s| {
        for (k, paint) in [[176, 60, 52], [238, 232, 214], [64, 92, 128]].into_iter().enumerate() {
            let at = to(-0.25, 0.43 + 0.022 * k as f32, 0.04) * Affine3A::from_rotation_y(0.3 * k as f32 - 0.2);
            s.rounded(at, Vec3::new(0.13, 0.0105, 0.09), 0.003, n.min(2), paint);
        }
        let vase = [
            [0.0, 0.0],
            [0.0, 0.04],
            [0.05, 0.07],
            [0.1, 0.062],
            [0.15, 0.03],
            [0.2, 0.04],
            [0.2, 0.034],
            [0.15, 0.024],
            [0.1, 0.0],
        ];
        s.lathe(up(0.28, 0.42, -0.06), sides, [72, 130, 140], &vase);
    });
}

fn television(m: &mut Model) {
    let n = m.edge().min(4);
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.08, 0.0], [1.7, 0.36, 0.4], 0.008, n, WALNUT);
        slab(s, [0.0, 0.0, 0.0], [1.5, 0.08, 0.3], 0.0, 0, DARK);
        for k in 0..3 {
            slab(s, [-0.56 + 0.56 * k as f32, 0.1, 0.206], [0.54, 0.32, 0.016], 0.006, n, WALNUT);
        }
    });
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.44, 0.0], [0.5, 0.015, 0.22], 0.006, n, DARK);
        slab(s, [0.0, 0.45, -0.02], [0.08, 0.1, 0.04], 0.01, n, DARK);
        slab(s, [0.0, 0.53, 0.0], [1.24, 0.72, 0.045], 0.012, n, [30, 30, 32]);
        slab(s, [0.0, 0.55, 0.022], [1.2, 0.675, 0.006], 0.002, n, [24, 30, 40]);
    });
}

/// A standing lamp with a cloth shade, `high` high.
fn lamp(m: &mut Model, high: f32) {
    let sides = m.sides();
    let k = high.clamp(0.4, 1.0);
    m.part(Stuff::Paint, |s| {
        let foot = [
            [0.0, 0.0],
            [0.0, 0.15 * k],
            [0.02, 0.15 * k],
            [0.035, 0.05 * k],
            [0.06, 0.014],
            [high - 0.25 * k, 0.012],
            [high - 0.25 * k, 0.0],
        ];
        s.lathe(up(0.0, 0.0, 0.0), sides, [150, 120, 72], &foot);
    });
    m.part(Stuff::Fabric, |s| {
        let (low, top, r) = (high - 0.34 * k, high, 0.24 * k);
        let shade = [[low, r - 0.008], [low, r], [top, 0.62 * r], [top, 0.62 * r - 0.008], [low, r - 0.008]];
        s.lathe(up(0.0, 0.0, 0.0), 2 * sides, [255, 236, 196], &shade);
    });
    m.part(Stuff::Paint, |s| {
        s.ball(to(0.0, high - 0.2 * k, 0.0), 2 + sides / 6, [255, 248, 220], |_| 0.05 * k);
    });
}

/// A lamp that hangs from the ceiling at y = 0.
fn pendant(m: &mut Model) {
    let sides = 2 * m.sides();
    m.part(Stuff::Paint, |s| {
        s.lathe(up(0.0, 0.0, 0.0), sides, WHITE, &[[-0.03, 0.0], [-0.03, 0.05], [0.02, 0.06], [0.02, 0.0]]);
        rod(s, [0.0, -0.55, 0.0], [0.0, 0.0, 0.0], 0.004, 6, DARK);
        // Outside from the rim to the top, and back inside to the rim.
        let bell =
            [[-0.82, 0.205], [-0.82, 0.21], [-0.72, 0.19], [-0.62, 0.11], [-0.58, 0.03], [-0.53, 0.025], [-0.53, 0.0]];
        let lining = [[-0.575, 0.0], [-0.625, 0.1], [-0.72, 0.182], [-0.82, 0.205]];
        s.lathe(up(0.0, 0.0, 0.0), sides, [196, 84, 62], &bell);
        s.lathe(up(0.0, 0.0, 0.0), sides, [255, 244, 220], &lining);
        s.ball(to(0.0, -0.72, 0.0), 2 + sides / 8, [255, 250, 226], |_| 0.055);
    });
}

/// A flat round light under the ceiling at y = 0.
fn ceiling_light(m: &mut Model) {
    let sides = 2 * m.sides();
    m.part(Stuff::Paint, |s| {
        let disc = [[-0.1, 0.0], [-0.09, 0.09], [-0.06, 0.15], [-0.025, 0.17], [0.01, 0.17], [0.01, 0.0]];
        s.lathe(up(0.0, 0.0, 0.0), sides, [255, 252, 238], &disc);
    });
}

/// A rug w x d with a border.
pub(super) fn rug(m: &mut Model, w: f32, d: f32, paint: Paint) {
    let n = m.soft().min(6);
    m.part(Stuff::Carpet, |s| {
        slab(s, [0.0, 0.0, 0.0], [w, 0.010, d], 0.004, n, paint);
        slab(s, [0.0, 0.004, 0.0], [w - 0.16, 0.010, d - 0.16], 0.003, n, paint.map(|c| c / 2 + 110));
        slab(s, [0.0, 0.006, 0.0], [w - 0.24, 0.012, d - 0.24], 0.003, n, paint);
    });
}

fn desk(m: &mut Model) {
    let (n, sides) = (m.edge().min(4), m.sides());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.71, 0.0], [1.5, 0.035, 0.7], 0.01, n, OAK);
        for x in [-0.52, 0.52] {
            slab(s, [x, 0.0, 0.0], [0.4, 0.71, 0.6], 0.004, n.min(1), OAK);
            for y in [0.06, 0.28, 0.5] {
                slab(s, [x, y, 0.306], [0.36, 0.2, 0.018], 0.006, n, OAK);
            }
        }
        slab(s, [0.0, 0.35, -0.27], [0.66, 0.36, 0.02], 0.0, 0, OAK);
    });
    m.part(Stuff::Paint, |s| {
        for x in [-0.52, 0.52] {
            for y in [0.16, 0.38, 0.6] {
                slab(s, [x, y, 0.322], [0.1, 0.012, 0.016], 0.004, n, STEEL);
            }
        }
        slab(s, [0.1, 0.745, -0.2], [0.24, 0.012, 0.18], 0.004, n, DARK);
        slab(s, [0.1, 0.75, -0.22], [0.04, 0.16, 0.03], 0.008, n, DARK);
        slab(s, [0.1, 0.87, -0.2], [0.6, 0.36, 0.03], 0.01, n, [36, 36, 40]);
        slab(s, [0.1, 0.885, -0.186], [0.57, 0.33, 0.006], 0.002, n, [66, 98, 140]);
        slab(s, [0.1, 0.745, 0.08], [0.42, 0.014, 0.14], 0.004, n, [60, 60, 64]);
        // Keys, as rows of little blocks.
        for row in 0..if n == 0 { 0 } else { 5 } {
            for k in 0..14 {
                let at = [-0.094 + 0.029 * k as f32 + 0.006 * row as f32, 0.757, 0.03 + 0.025 * row as f32];
                slab(s, at, [0.024, 0.008, 0.02], 0.003, n.min(1), [214, 214, 210]);
            }
        }
        slab(s, [0.42, 0.745, 0.08], [0.06, 0.025, 0.1], 0.012, n, [40, 40, 44]);
        // A desk lamp: foot, two arms, a cone.
        s.lathe(up(-0.55, 0.745, -0.18), sides, [44, 92, 84], &[[0.0, 0.0], [0.0, 0.09], [0.02, 0.08], [0.02, 0.0]]);
        rod(s, [-0.55, 0.76, -0.18], [-0.62, 1.05, -0.22], 0.008, sides / 2, STEEL);
        rod(s, [-0.62, 1.05, -0.22], [-0.42, 1.2, -0.05], 0.008, sides / 2, STEEL);
        let at = to(-0.42, 1.2, -0.05) * Affine3A::from_rotation_x(-0.5) * up(0.0, 0.0, 0.0);
        s.lathe(at, sides, [44, 92, 84], &[[-0.13, 0.0], [-0.14, 0.085], [-0.03, 0.03], [0.01, 0.02], [0.01, 0.0]]);
    });
    m.part(Stuff::Paint, |s| {
        slab(s, [-0.25, 0.745, 0.1], [0.21, 0.006, 0.297], 0.0, 0, [250, 250, 246]);
        slab(s, [-0.24, 0.75, 0.12], [0.21, 0.004, 0.29], 0.0, 0, [244, 242, 232]);
    });
}

fn office_chair(m: &mut Model) {
    let (soft, sides) = (m.soft(), m.sides());
    m.part(Stuff::Paint, |s| {
        for k in 0..5 {
            let (sn, c) = (std::f32::consts::TAU * k as f32 / 5.0).sin_cos();
            rod(s, [0.0, 0.1, 0.0], [0.3 * c, 0.06, 0.3 * sn], 0.02, sides / 2, DARK);
            s.ball(to(0.3 * c, 0.03, 0.3 * sn), 2 + sides / 8, DARK, |_| 0.03);
        }
        rod(s, [0.0, 0.06, 0.0], [0.0, 0.43, 0.0], 0.028, sides, STEEL);
        s.sweep(
            &[[0.0, 0.42, -0.1], [0.0, 0.42, -0.25], [0.0, 0.5, -0.3], [0.0, 0.75, -0.3]].map(Vec3::from),
            sides / 2,
            DARK,
            |_| 0.02,
        );
        for x in [-0.27, 0.27] {
            rod(s, [x, 0.46, 0.0], [x, 0.66, 0.0], 0.014, sides / 2, DARK);
            slab(s, [x, 0.66, 0.0], [0.05, 0.03, 0.24], 0.014, soft.min(5), DARK);
            rod(s, [0.7 * x, 0.46, 0.0], [x, 0.47, 0.0], 0.012, sides / 2, DARK);
        }
    });
    m.part(Stuff::Fabric, |s| {
        slab(s, [0.0, 0.43, 0.0], [0.5, 0.09, 0.48], 0.045, soft, [62, 66, 84]);
        let at = to(0.0, 0.82, -0.25) * Affine3A::from_rotation_x(-0.1);
        s.rounded(at, Vec3::new(0.23, 0.28, 0.04), 0.04, soft, [62, 66, 84]);
    });
}

/// A radiator of many ribs, back at z = 0.
fn radiator(m: &mut Model) {
    if m.level() == 0 {
        return m.part(Stuff::Paint, |s| slab(s, [0.0, 0.12, 0.08], [1.08, 0.54, 0.09], 0.0, 0, WHITE));
    }
    let sides = 3 + m.level();
    m.part(Stuff::Paint, |s| {
        for k in 0..18 {
            let x = -0.51 + 0.06 * k as f32;
            for z in [0.05, 0.11] {
                rod(s, [x, 0.14, z], [x, 0.64, z], 0.017, sides, WHITE);
            }
        }
        for y in [0.15, 0.63] {
            for z in [0.05, 0.11] {
                rod(s, [-0.54, y, z], [0.54, y, z], 0.022, sides, WHITE);
            }
        }
        rod(s, [0.5, 0.0, 0.08], [0.5, 0.15, 0.08], 0.012, sides, STEEL);
        rod(s, [-0.5, 0.0, 0.08], [-0.5, 0.15, 0.08], 0.012, sides, STEEL);
    });
}

fn globe(m: &mut Model) {
    let (sides, n) = (m.sides(), 4 + 2 * m.level());
    m.part(Stuff::Wood, |s| {
        let foot = [[0.0, 0.0], [0.0, 0.2], [0.03, 0.2], [0.06, 0.06], [0.3, 0.03], [0.5, 0.04], [0.52, 0.0]];
        s.lathe(up(0.0, 0.0, 0.0), sides, WALNUT, &foot);
    });
    m.part(Stuff::Paint, |s| {
        let first = s.mesh.positions.len();
        s.ball(to(0.0, 0.78, 0.0), n, [64, 110, 156], |_| 0.23);
        for (p, c) in s.mesh.positions[first..].iter().zip(&mut s.mesh.colors[first..]) {
            if crate::generate::noise::fbm(*p, 0.3, 4, 0.0, 3) > 0.06 {
                *c = [176, 168, 106, 255];
            }
        }
        s.ring_wheel(
            to(0.0, 0.78, 0.0) * Affine3A::from_rotation_z(1.15),
            sides / 3 + 3,
            2 * sides,
            [170, 140, 80],
            [0.25, 0.008],
        );
        rod(s, [0.0, 0.5, 0.0], [0.0, 0.56, 0.0], 0.012, sides / 2, [170, 140, 80]);
    });
}

fn toys(m: &mut Model) {
    let n = 3 + m.level();
    m.part(Stuff::Paint, |s| {
        for (x, z, r, paint) in
            [(0.0, 0.0, 0.11, [206, 54, 48]), (0.3, 0.12, 0.07, [60, 120, 190]), (0.18, -0.2, 0.05, [230, 190, 60])]
        {
            s.ball(to(x, r, z), n, paint, |_| r);
        }
        for (k, paint) in [[70, 150, 90], [222, 170, 60], [190, 70, 60], [70, 110, 180]].into_iter().enumerate() {
            let at =
                to(-0.3 + 0.01 * k as f32, 0.04 + 0.08 * k as f32, 0.1) * Affine3A::from_rotation_y(0.4 * k as f32);
            s.rounded(at, Vec3::splat(0.04), 0.006, m_edge(n), paint);
        }
    });
}

fn m_edge(n: u32) -> u32 {
    n / 4
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    out.push(thing("sofa", vec![put(2.45, 0.0, 8.55, 90.0)], |m| sofa(m, 3, [132, 128, 118])));
    let chairs = vec![put(4.2, 0.0, 7.35, 8.0), put(14.25, 0.0, 6.75, -62.0), put(4.9, 0.0, 9.25, -118.0)];
    out.push(thing("armchair", chairs, |m| sofa(m, 1, [104, 126, 108])));
    out.push(thing("coffee table", vec![put(3.8, 0.012, 8.5, 90.0)], coffee_table));
    out.push(thing("television", vec![put(8.08, 0.0, 8.6, -90.0)], television));
    out.push(thing("floor lamp", vec![put(0.62, 0.0, 6.9, 0.0), put(14.45, 0.0, 9.6, 0.0)], |m| lamp(m, 1.55)));
    let small = [(8.08, 0.505, 0.42), (10.32, 0.505, 0.42), (11.3, 0.81, 4.66), (7.5, 0.81, 1.6)];
    out.push(thing("table lamp", small.map(|(x, y, z)| put(x, y, z, 0.0)).to_vec(), |m| lamp(m, 0.46)));
    let hung = [(2.45, 3.3), (3.8, 8.5), (10.2, 8.6), (13.2, 8.6), (9.2, 2.4)];
    out.push(thing("pendant lamp", hung.map(|(x, z)| put(x, 2.6, z, 0.0)).to_vec(), pendant));
    let flat = [(5.9, 2.2), (13.0, 2.2), (6.5, 5.2), (9.6, 5.2), (12.7, 5.2)];
    out.push(thing("ceiling light", flat.map(|(x, z)| put(x, 2.6, z, 0.0)).to_vec(), ceiling_light));
    out.push(thing("living room rug", vec![put(3.75, 0.001, 8.5, 90.0)], |m| rug(m, 2.5, 1.8, [150, 62, 52])));
    out.push(thing("hall runner", vec![put(6.6, 0.001, 5.2, 0.0), put(10.6, 0.001, 5.2, 0.0)], |m| {
        rug(m, 2.8, 0.8, [70, 92, 120])
    }));
    let rugs = vec![put(10.2, 0.001, 7.6, 0.0), put(13.0, 0.001, 2.1, 90.0), put(9.2, 0.001, 3.0, 0.0)];
    out.push(thing("rug", rugs, |m| rug(m, 1.8, 1.2, [96, 116, 92])));
    let desks = vec![put(10.0, 0.0, 10.1, 180.0), put(13.1, 0.0, 0.62, 0.0)];
    out.push(thing("desk", desks, desk));
    let chairs = vec![put(10.05, 0.0, 9.35, 20.0), put(13.0, 0.0, 1.2, 165.0)];
    out.push(thing("office chair", chairs, office_chair));
    let warm = [
        put(0.152, 0.0, 4.4, 90.0),
        put(6.9, 0.0, 10.848, 180.0),
        put(13.2, 0.0, 10.848, 180.0),
        put(14.848, 0.0, 8.5, -90.0),
        put(14.848, 0.0, 2.1, -90.0),
    ];
    out.push(thing("radiator", warm.to_vec(), radiator));
    out.push(thing("globe", vec![put(11.15, 0.0, 6.5, 0.0)], globe));
    out.push(thing("toys", vec![put(12.4, 0.0, 1.9, 0.0)], toys));
    out.push(thing("hall bench", vec![put(7.6, 0.0, 4.66, 0.0)], |m| {
        let (n, soft) = (m.edge().min(4), m.soft());
        m.part(Stuff::Wood, |s| {
            slab(s, [0.0, 0.4, 0.0], [1.1, 0.035, 0.34], 0.01, n, PINE);
            slab(s, [0.0, 0.12, 0.0], [1.0, 0.025, 0.3], 0.006, n, PINE);
            for x in [-0.5, 0.5] {
                slab(s, [x, 0.0, 0.0], [0.04, 0.4, 0.32], 0.008, n, PINE);
            }
        });
        m.part(Stuff::Fabric, |s| slab(s, [0.0, 0.43, 0.0], [1.04, 0.05, 0.3], 0.025, soft, [180, 140, 90]));
    }));
}
