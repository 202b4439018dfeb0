//! The bathroom: tub, basin, mirror, toilet, washing machine, towels.

use glam::{Affine3A, Vec2, Vec3};

use super::{DARK, STEEL, WHITE, put, rod, slab, to, up};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::solid::{Paint, Solid, frame};

const PORCELAIN: Paint = [244, 246, 246];

/// A vessel whose cross-sections are superellipses: (height, half x, half z) from the foot over the rim down to the inner
/// bottom; the two ends are closed.
fn vessel(s: &mut Solid, at: Affine3A, around: u32, rings: &[[f32; 3]], paint: Paint) {
    let ring = |[y, a, b]: [f32; 3]| {
        (0..around).map(move |j| {
            let t = std::f32::consts::TAU * j as f32 / around as f32;
            let (sn, cs) = t.sin_cos();
            let round = |v: f32| v.signum() * v.abs().powf(0.65);
            at.transform_point3(Vec3::new(a * round(cs), y, -b * round(sn)))
        })
    };
    let start = s.mesh.positions.len();
    let first = start as u32;
    let last = rings.len() as u32 - 1;
    rings.iter().for_each(|&r| ring(r).for_each(|p| _ = s.vertex(p, Vec3::Y, paint)));
    let hubs = [0, last].map(|k| s.vertex(at.transform_point3(Vec3::Y * rings[k as usize][0]), Vec3::Y, paint));
    for j in 0..around {
        let next = (j + 1) % around;
        for i in 0..last {
            let [a, b] = [j, next].map(|k| first + i * around + k);
            s.mesh.indices.extend([a, b, b + around, a, b + around, a + around]);
        }
        s.mesh.indices.extend([hubs[0], first + next, first + j]);
        let top = first + last * around;
        s.mesh.indices.extend([hubs[1], top + j, top + next]);
    }
    s.smooth(start);
}

fn tub(m: &mut Model) {
    let (around, sides) = (8 + 4 * m.level(), m.sides());
    m.part(Stuff::Paint, |s| {
        let rings = [
            [0.0, 0.72, 0.28],
            [0.05, 0.76, 0.31],
            [0.5, 0.83, 0.365],
            [0.545, 0.85, 0.385],
            [0.57, 0.85, 0.385],
            [0.575, 0.83, 0.36],
            [0.56, 0.80, 0.33],
            [0.5, 0.775, 0.31],
            [0.25, 0.70, 0.26],
            [0.16, 0.60, 0.2],
            [0.14, 0.3, 0.1],
        ];
        vessel(s, to(0.0, 0.0, 0.0), around, &rings, PORCELAIN);
        rod(s, [0.95, 0.75, -0.0], [0.72, 0.75, 0.0], 0.018, sides, STEEL);
        rod(s, [0.74, 0.76, 0.0], [0.74, 0.70, 0.0], 0.014, sides, STEEL);
        for z in [-0.09, 0.09] {
            rod(s, [0.95, 0.75, z], [0.89, 0.75, z], 0.025, sides, STEEL);
        }
        s.sweep(
            &[[0.94, 0.7, 0.2], [0.92, 1.2, 0.2], [0.9, 1.85, 0.2], [0.82, 1.93, 0.2]].map(Vec3::from),
            sides / 2,
            STEEL,
            |_| 0.011,
        );
        s.lathe(up(0.8, 1.89, 0.2), sides, STEEL, &[[0.0, 0.0], [0.0, 0.06], [0.02, 0.06], [0.05, 0.015], [0.05, 0.0]]);
    });
}

fn toilet(m: &mut Model) {
    let (around, n) = (8 + 3 * m.level(), m.edge().min(6));
    m.part(Stuff::Paint, |s| {
        let rings = [
            [0.0, 0.11, 0.16],
            [0.03, 0.12, 0.17],
            [0.2, 0.12, 0.17],
            [0.34, 0.17, 0.23],
            [0.39, 0.18, 0.24],
            [0.4, 0.175, 0.235],
            [0.4, 0.13, 0.18],
            [0.34, 0.11, 0.15],
            [0.28, 0.05, 0.08],
        ];
        vessel(s, to(0.0, 0.0, 0.4), around, &rings, PORCELAIN);
        let seat = [[0.4, 0.17, 0.225], [0.405, 0.182, 0.242], [0.425, 0.18, 0.24], [0.43, 0.15, 0.2]];
        vessel(s, to(0.0, 0.003, 0.4), around, &seat, WHITE);
        slab(s, [0.0, 0.0, 0.13], [0.2, 0.38, 0.22], 0.03, n, PORCELAIN);
        slab(s, [0.0, 0.38, 0.09], [0.38, 0.36, 0.17], 0.03, n, PORCELAIN);
        slab(s, [0.0, 0.742, 0.09], [0.4, 0.03, 0.185], 0.012, n, PORCELAIN);
        s.lathe(up(0.0, 0.77, 0.09), 2 * around / 3, STEEL, &[[0.0, 0.0], [0.0, 0.025], [0.01, 0.025], [0.01, 0.0]]);
    });
}

fn basin(m: &mut Model) {
    let (around, sides, n) = (8 + 3 * m.level(), m.sides(), m.edge().min(6));
    m.part(Stuff::Paint, |s| {
        let bowl = [
            [0.7, 0.1, 0.1],
            [0.74, 0.2, 0.15],
            [0.84, 0.3, 0.22],
            [0.86, 0.3, 0.22],
            [0.86, 0.25, 0.17],
            [0.8, 0.2, 0.14],
            [0.75, 0.08, 0.06],
        ];
        vessel(s, to(0.0, 0.0, 0.24), around, &bowl, PORCELAIN);
        let foot = [[0.0, 0.0], [0.0, 0.11], [0.05, 0.1], [0.2, 0.075], [0.5, 0.07], [0.72, 0.11], [0.72, 0.0]];
        s.lathe(up(0.0, 0.0, 0.2), sides, PORCELAIN, &foot);
        s.sweep(
            &[[0.0, 0.85, 0.05], [0.0, 0.97, 0.055], [0.0, 1.0, 0.09], [0.0, 0.99, 0.15]].map(Vec3::from),
            sides / 2,
            STEEL,
            |_| 0.013,
        );
        // The mirror cabinet above.
        slab(s, [0.0, 1.3, 0.06], [0.7, 0.7, 0.12], 0.008, n, WHITE);
        for x in [-0.172, 0.172] {
            slab(s, [x, 1.32, 0.122], [0.335, 0.66, 0.008], 0.003, n, [186, 208, 216]);
        }
        slab(s, [0.0, 2.03, 0.08], [0.5, 0.05, 0.06], 0.02, n, [255, 250, 230]);
    });
}

fn washer(m: &mut Model) {
    let (n, sides) = (m.edge().min(6), 2 * m.sides());
    m.part(Stuff::Paint, |s| {
        slab(s, [0.0, 0.01, 0.0], [0.6, 0.84, 0.58], 0.015, n, WHITE);
        let at = frame(Vec3::new(0.0, 0.42, 0.28), Vec3::Z, Vec3::X);
        let ring = [[0.0, 0.0], [0.0, 0.2], [0.03, 0.19], [0.035, 0.155], [0.02, 0.15], [0.045, 0.08], [0.05, 0.0]];
        s.lathe(at, sides, STEEL, &ring[..5].iter().copied().chain([[0.02, 0.0]]).collect::<Vec<_>>());
        s.lathe(at, sides, [70, 78, 88], &[[0.019, 0.0], [0.0195, 0.148], [0.05, 0.1], [0.06, 0.0]]);
        slab(s, [0.0, 0.72, 0.292], [0.56, 0.1, 0.012], 0.004, n, [206, 208, 212]);
        let knob = frame(Vec3::new(0.18, 0.77, 0.295), Vec3::Z, Vec3::X);
        s.lathe(knob, sides, DARK, &[[0.0, 0.0], [0.0, 0.035], [0.03, 0.03], [0.03, 0.0]]);
    });
}

fn towels(m: &mut Model) {
    let sides = m.sides();
    let fine = 6 + 4 * m.level();
    m.part(Stuff::Paint, |s| {
        for y in [0.7, 1.2] {
            rod(s, [-0.33, y, 0.07], [0.33, y, 0.07], 0.011, sides, STEEL);
            for x in [-0.33, 0.33] {
                rod(s, [x, y, 0.0], [x, y, 0.075], 0.009, sides, STEEL);
            }
        }
    });
    m.part(Stuff::Fabric, |s| {
        for (x, w, low, paint) in [(-0.13, 0.34, 0.75, [86, 132, 150]), (0.2, 0.22, 0.86, [222, 206, 178])] {
            let line: Vec<Vec2> = (0..=fine)
                .map(|i| {
                    let t = i as f32 / fine as f32;
                    Vec2::new(x + w * (t - 0.5), 0.088 + 0.004 * (t * 14.0).sin())
                })
                .collect();
            s.cloth(Affine3A::IDENTITY, &line, 0.012, [low, 1.215], paint);
        }
    });
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    out.push(thing("bath tub", vec![put(5.06, 0.0, 1.2, 90.0)], tub));
    out.push(thing("toilet", vec![put(6.65, 0.0, 0.155, 0.0)], toilet));
    out.push(thing("basin", vec![put(7.138, 0.0, 2.1, -90.0)], basin));
    out.push(thing("washing machine", vec![put(6.84, 0.0, 3.3, -90.0)], washer));
    out.push(thing("towels", vec![put(4.662, 0.0, 3.2, 90.0)], towels));
    out.push(thing("bath mat", vec![put(5.85, 0.001, 1.3, 90.0)], |m| {
        super::living::rug(m, 0.9, 0.6, [120, 160, 172])
    }));
}
