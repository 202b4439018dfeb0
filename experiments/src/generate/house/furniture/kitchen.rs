//! The kitchen: units, sink, stove, fridge, the dining table and its chairs.

use glam::Vec3;

use super::{DARK, OAK, PINE, STEEL, WHITE, put, rod, slab, to, up};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::solid::Paint;

const FRONT: Paint = [206, 214, 204];
const TOP: Paint = [122, 92, 68];

/// A handle across a front.
fn handle(m: &mut Model, x: f32, y: f32, z: f32, long: f32) {
    if m.level() == 0 {
        return m.part(Stuff::Paint, |s| slab(s, [x, y, z + 0.02], [long, 0.012, 0.03], 0.0, 0, STEEL));
    }
    let n = 4 + m.level();
    m.part(Stuff::Paint, |s| {
        let h = 0.5 * long;
        s.sweep(
            &[
                Vec3::new(x - h, y, z),
                Vec3::new(x - h, y, z + 0.028),
                Vec3::new(x - h + 0.01, y, z + 0.034),
                Vec3::new(x + h - 0.01, y, z + 0.034),
                Vec3::new(x + h, y, z + 0.028),
                Vec3::new(x + h, y, z),
            ],
            n,
            STEEL,
            |_| 0.006,
        );
    });
}

/// Carcass, plinth and worktop of a unit 0.6 wide.
fn carcass(m: &mut Model) {
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.0, -0.02], [0.598, 0.1, 0.5], 0.0, 0, DARK);
        slab(s, [0.0, 0.1, 0.0], [0.598, 0.76, 0.54], 0.0, 0, WHITE);
    });
    let n = m.edge().min(3);
    m.part(Stuff::Wood, |s| slab(s, [0.0, 0.86, 0.01], [0.599, 0.04, 0.6], 0.008, n, TOP));
}

/// A front panel with a recessed field.
fn front(m: &mut Model, [y, h]: [f32; 2], w: f32, z: f32) {
    let n = m.edge().min(3);
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, y, z], [w, h, 0.02], 0.006, n, FRONT);
        if h > 0.3 {
            slab(s, [0.0, y + 0.05, z + 0.008], [w - 0.12, h - 0.1, 0.014], 0.006, n, FRONT.map(|c| c - 10));
        }
    });
}

fn unit(m: &mut Model, drawers: bool) {
    carcass(m);
    if drawers {
        for [y, h] in [[0.12, 0.25], [0.38, 0.25], [0.64, 0.2]] {
            front(m, [y, h], 0.59, 0.28);
            handle(m, 0.0, y + h - 0.05, 0.29, 0.2);
        }
    } else {
        front(m, [0.12, 0.72], 0.59, 0.28);
        handle(m, 0.15, 0.78, 0.295, 0.14);
    }
}

fn sink(m: &mut Model) {
    unit(m, false);
    let (n, sides) = (m.soft(), m.sides());
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.9, 0.02], [0.5, 0.012, 0.42], 0.006, n.min(4), STEEL);
        slab(s, [0.0, 0.905, 0.03], [0.4, 0.009, 0.3], 0.004, n.min(4), [92, 96, 100]);
        let arc = 3 + m_arc(sides);
        let bow: Vec<Vec3> = (0..=arc)
            .map(|i| {
                let a = std::f32::consts::PI * i as f32 / arc as f32;
                Vec3::new(0.0, 1.13 + 0.09 * a.sin(), -0.06 - 0.09 * a.cos())
            })
            .collect();
        let mut line = vec![Vec3::new(0.0, 0.905, -0.15)];
        line.extend(bow);
        line.push(Vec3::new(0.0, 1.08, 0.03));
        s.sweep(&line, sides / 2, STEEL, |_| 0.013);
        rod(s, [0.02, 0.95, -0.15], [0.09, 0.98, -0.15], 0.008, sides / 2, STEEL);
    });
}

fn m_arc(sides: u32) -> u32 {
    sides / 3
}

fn stove(m: &mut Model) {
    let (n, sides) = (m.edge().min(4), m.sides());
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.0, -0.02], [0.598, 0.1, 0.5], 0.0, 0, DARK);
        slab(s, [0.0, 0.1, 0.0], [0.598, 0.8, 0.56], 0.006, n, [214, 216, 218]);
        slab(s, [0.0, 0.2, 0.285], [0.56, 0.48, 0.022], 0.008, n, [42, 42, 46]);
        slab(s, [0.0, 0.27, 0.298], [0.42, 0.3, 0.006], 0.003, n, [74, 72, 78]);
        slab(s, [0.0, 0.9, 0.0], [0.57, 0.01, 0.54], 0.004, n, [34, 34, 38]);
        for (x, z, r) in [(-0.14, -0.12, 0.09), (0.14, -0.12, 0.07), (-0.14, 0.13, 0.07), (0.14, 0.13, 0.1)] {
            let ring = [[0.908, 0.0], [0.908, r], [0.916, r], [0.916, r - 0.012], [0.912, r - 0.014], [0.912, 0.0]];
            s.lathe(up(x, 0.0, z), sides, [96, 60, 56], &ring);
        }
        for i in 0..5 {
            let x = -0.2 + 0.1 * i as f32;
            let knob = [[0.27, 0.0], [0.27, 0.02], [0.305, 0.016], [0.305, 0.0]];
            let at = crate::generate::solid::frame(Vec3::new(x, 0.76, 0.0), Vec3::Z, Vec3::X);
            s.lathe(at, sides, DARK, &knob);
        }
    });
    handle(m, 0.0, 0.7, 0.295, 0.46);
}

fn cupboard(m: &mut Model) {
    m.part(Stuff::Paint, |s| slab(s, [0.0, 1.42, 0.15], [0.598, 0.72, 0.3], 0.0, 0, WHITE));
    let n = m.edge().min(3);
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 1.425, 0.31], [0.59, 0.71, 0.02], 0.006, n, FRONT);
        slab(s, [0.0, 1.475, 0.3175], [0.47, 0.61, 0.014], 0.006, n, FRONT.map(|c| c - 10));
    });
    handle(m, 0.18, 1.48, 0.325, 0.12);
}

fn fridge(m: &mut Model) {
    let n = m.edge().min(6);
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.03, -0.02], [0.62, 1.82, 0.58], 0.012, n, [222, 224, 226]);
        slab(s, [0.0, 0.06, 0.3], [0.615, 0.62, 0.05], 0.015, n, [232, 234, 236]);
        slab(s, [0.0, 0.69, 0.3], [0.615, 1.15, 0.05], 0.015, n, [232, 234, 236]);
        slab(s, [0.0, 0.0, -0.02], [0.56, 0.03, 0.5], 0.0, 0, DARK);
        rod(s, [0.25, 0.78, 0.35], [0.25, 1.2, 0.35], 0.012, 6 + m_arc(n * 6), STEEL);
        rod(s, [0.25, 0.3, 0.35], [0.25, 0.6, 0.35], 0.012, 6 + m_arc(n * 6), STEEL);
        for y in [0.33, 0.57, 0.81, 1.17] {
            rod(s, [0.25, y, 0.31], [0.25, y, 0.35], 0.008, 6, STEEL);
        }
    });
}

/// A table w x d, 0.75 high, on four turned legs.
pub(in crate::generate::house) fn table(m: &mut Model, w: f32, d: f32, paint: Paint) {
    let (n, sides) = (m.edge().min(6), m.sides());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.715, 0.0], [w, 0.035, d], 0.012, n, paint);
        for z in [-1.0, 1.0] {
            slab(s, [0.0, 0.62, z * (0.5 * d - 0.09)], [w - 0.2, 0.095, 0.025], 0.0, 0, paint);
        }
        for x in [-1.0, 1.0] {
            slab(s, [x * (0.5 * w - 0.09), 0.62, 0.0], [0.025, 0.095, d - 0.2], 0.0, 0, paint);
            for z in [-1.0, 1.0] {
                let leg = [
                    [0.0, 0.0],
                    [0.0, 0.022],
                    [0.06, 0.03],
                    [0.09, 0.022],
                    [0.3, 0.03],
                    [0.48, 0.038],
                    [0.5, 0.03],
                    [0.53, 0.04],
                    [0.715, 0.04],
                    [0.715, 0.0],
                ];
                s.lathe(up(x * (0.5 * w - 0.09), 0.0, z * (0.5 * d - 0.09)), sides, paint, &leg);
            }
        }
    });
}

/// A wooden chair with a slatted, bent back and a seat pad.
pub(in crate::generate::house) fn chair(m: &mut Model, paint: Paint, pad: Paint) {
    let (n, soft, sides) = (m.edge().min(4), m.soft(), 4 + m.level());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.42, 0.0], [0.43, 0.03, 0.42], 0.012, n, paint);
        for x in [-0.185, 0.185] {
            s.sweep(&[Vec3::new(x, 0.0, 0.18), Vec3::new(x, 0.43, 0.175)], sides, paint, |t| 0.014 + 0.006 * t);
            let back = [[0.0, -0.22], [0.25, -0.2], [0.45, -0.19], [0.7, -0.215], [0.92, -0.27]];
            s.sweep(&back.map(|[y, z]| Vec3::new(x, y, z)), sides, paint, |t| 0.015 + 0.006 * (1.0 - t));
            rod(s, [x, 0.2, -0.2], [x, 0.2, 0.18], 0.010, sides, paint);
        }
        rod(s, [-0.185, 0.24, 0.0], [0.185, 0.24, 0.0], 0.010, sides, paint);
        for k in 0..4 {
            let (y, z) = (0.56 + 0.11 * k as f32, -0.197 - 0.018 * k as f32);
            s.rounded(to(0.0, y, z), Vec3::new(0.185, 0.026, 0.008), 0.008, n, paint);
        }
    });
    m.part(Stuff::Fabric, |s| slab(s, [0.0, 0.447, 0.01], [0.39, 0.04, 0.37], 0.02, soft, pad));
}

fn plate(m: &mut Model) {
    let sides = m.sides();
    m.part(Stuff::Paint, |s| {
        let disc = [[0.0, 0.0], [0.0, 0.07], [0.014, 0.125], [0.018, 0.125], [0.008, 0.075], [0.006, 0.0]];
        s.lathe(up(0.0, 0.0, 0.0), sides, WHITE, &disc);
        let cup =
            [[0.0, 0.0], [0.0, 0.028], [0.02, 0.036], [0.075, 0.042], [0.078, 0.04], [0.022, 0.033], [0.012, 0.0]];
        s.lathe(up(0.17, 0.0, -0.1), sides, [90, 130, 168], &cup);
        for (x, long) in [(-0.16, 0.2), (-0.18, 0.19)] {
            rod(s, [x, 0.004, -0.09], [x, 0.004, -0.09 + long], 0.004, 5, STEEL);
        }
    });
}

fn bowl(m: &mut Model) {
    let (sides, n) = (m.sides(), 2 + m.level());
    m.part(Stuff::Paint, |s| {
        let bowl = [
            [0.0, 0.0],
            [0.0, 0.07],
            [0.012, 0.07],
            [0.03, 0.11],
            [0.08, 0.16],
            [0.09, 0.162],
            [0.088, 0.154],
            [0.04, 0.105],
            [0.03, 0.0],
        ];
        s.lathe(up(0.0, 0.0, 0.0), sides, [206, 196, 178], &bowl);
        let fruit = [
            (0.05, 0.085, 0.03, [196, 52, 40]),
            (-0.05, 0.085, 0.04, [214, 168, 48]),
            (0.0, 0.085, -0.06, [120, 160, 56]),
            (0.02, 0.145, -0.005, [222, 128, 36]),
            (-0.075, 0.1, -0.03, [200, 60, 48]),
        ];
        for (x, y, z, paint) in fruit {
            s.ball(to(x, y, z), n, paint, |d| 0.042 * (1.0 - 0.14 * d.y.abs().powi(8)));
        }
    });
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    let (mut plain, mut drawers) = (vec![], vec![]);
    for i in 0..7 {
        let at = put(0.47 + 0.6 * f64::from(i), 0.0, 0.44, 0.0);
        match i {
            3 | 5 => {}
            1 | 4 => drawers.push(at),
            _ => plain.push(at),
        }
    }
    out.push(thing("kitchen unit", plain, |m| unit(m, false)));
    out.push(thing("kitchen drawers", drawers, |m| unit(m, true)));
    out.push(thing("sink", vec![put(0.47 + 1.8, 0.0, 0.44, 0.0)], sink));
    out.push(thing("stove", vec![put(0.47 + 3.0, 0.0, 0.44, 0.0)], stove));
    let high = [0.47, 1.07, 3.47, 4.07].map(|x| put(x, 0.0, 0.152, 0.0)).to_vec();
    out.push(thing("cupboard", high, cupboard));
    out.push(thing("fridge", vec![put(4.2, 0.0, 1.35, -90.0)], fridge));
    let [x, z] = [2.45, 3.3];
    out.push(thing("dining table", vec![put(x, 0.0, z, 90.0)], |m| table(m, 1.7, 0.9, OAK)));
    let sides = [(-0.62, -0.45, 90.0), (-0.62, 0.45, 84.0), (0.62, -0.45, -90.0), (0.62, 0.45, -97.0)];
    let mut chairs: Vec<_> = sides.map(|(dx, dz, yaw)| put(x + dx, 0.0, z + dz, yaw)).to_vec();
    chairs.extend([put(x, 0.0, z - 1.05, 0.0), put(x + 0.04, 0.0, z + 1.08, 172.0)]);
    out.push(thing("chair", chairs, |m| chair(m, OAK, [168, 84, 62])));
    let places = [(-0.27, -0.45, 90.0), (-0.27, 0.45, 90.0), (0.27, -0.45, -90.0), (0.27, 0.45, -90.0)];
    let places = places.map(|(dx, dz, yaw)| put(x + dx, 0.751, z + dz, yaw));
    out.push(thing("plate", places.to_vec(), plate));
    out.push(thing("fruit bowl", vec![put(x, 0.751, z, 0.0), put(1.07, 0.901, 0.42, 40.0)], bowl));
    out.push(thing("kitchen board", vec![put(4.36, 0.0, 3.1, -90.0)], |m| {
        super::sleeping::drawers(m, 1.4, 0.36, PINE)
    }));
}
