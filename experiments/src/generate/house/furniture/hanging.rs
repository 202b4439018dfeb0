//! What hangs on walls and at windows: curtains, pictures, mirrors, the coats in the hall, a clock.

use glam::{Affine3A, Vec2, Vec3};

use super::{DARK, OAK, STEEL, WALNUT, put, rod, slab, to};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::house::textures::picture;
use crate::generate::solid::{Paint, frame};

/// A pair of curtains on a pole for a window `w` wide, back at z = 0; from `low` up to 2.3.
fn curtains(m: &mut Model, w: f32, low: f32, paint: Paint) {
    let (sides, fine) = (m.sides(), 6 + 6 * m.level());
    m.part(Stuff::Paint, |s| {
        rod(s, [-0.5 * w - 0.4, 2.3, 0.17], [0.5 * w + 0.4, 2.3, 0.17], 0.014, sides, [110, 84, 60]);
        for x in [-1.0, 1.0] {
            s.ball(to(x * (0.5 * w + 0.42), 2.3, 0.17), 2 + sides / 8, [110, 84, 60], |_| 0.03);
            rod(
                s,
                [x * (0.5 * w + 0.33), 2.3, 0.0],
                [x * (0.5 * w + 0.33), 2.3, 0.17],
                0.009,
                sides / 2,
                [110, 84, 60],
            );
        }
    });
    m.part(Stuff::Fabric, |s| {
        for side in [-1.0, 1.0] {
            let line: Vec<Vec2> = (0..=fine)
                .map(|i| {
                    let t = i as f32 / fine as f32;
                    let x = side * (0.5 * w + 0.1) + 0.42 * (t - 0.5);
                    Vec2::new(x, 0.17 + 0.035 * (t * 31.0).sin() + 0.01 * (t * 11.0).sin())
                })
                .collect();
            s.cloth(Affine3A::IDENTITY, &line, 0.006, [low, 2.31], paint);
        }
    });
}

/// A framed picture w x h, its middle at y = 1.55, back at z = 0.
fn painting(m: &mut Model, w: f32, h: f32, pick: u32, wood: Paint) {
    let n = m.edge().min(3);
    let y = 1.55 - 0.5 * h;
    m.shown(picture(pick), |s| slab(s, [0.0, y, 0.012], [w, h, 0.018], 0.0, 0, [255; 3]));
    m.part(Stuff::Wood, |s| {
        for side in [-1.0, 1.0] {
            slab(s, [side * (0.5 * w + 0.018), y, 0.018], [0.04, h, 0.034], 0.008, n, wood);
            let at = if side > 0.0 { y + h - 0.002 } else { y - 0.038 };
            slab(s, [0.0, at, 0.018], [w + 0.076, 0.04, 0.034], 0.008, n, wood);
        }
    });
}

fn mirror(m: &mut Model) {
    let n = m.edge().min(3);
    m.part(Stuff::Paint, |s| slab(s, [0.0, 1.02, 0.012], [0.6, 0.9, 0.014], 0.003, n, [178, 204, 214]));
    m.part(Stuff::Wood, |s| {
        for side in [-1.0, 1.0] {
            slab(s, [side * 0.31, 1.0, 0.016], [0.04, 0.94, 0.03], 0.008, n, WALNUT);
            slab(s, [0.0, if side > 0.0 { 1.9 } else { 1.0 }, 0.016], [0.58, 0.04, 0.03], 0.008, n, WALNUT);
        }
    });
}

fn clock(m: &mut Model) {
    let sides = 2 * m.sides();
    m.part(Stuff::Paint, |s| {
        let at = frame(Vec3::new(0.0, 1.95, 0.0), Vec3::Z, Vec3::X);
        s.lathe(at, sides, DARK, &[[0.0, 0.0], [0.0, 0.17], [0.04, 0.17], [0.04, 0.15], [0.02, 0.15]]);
        s.lathe(at, sides, [248, 246, 238], &[[0.02, 0.15], [0.02, 0.0]]);
        slab(s, [0.0, 1.94, 0.028], [0.012, 0.12, 0.006], 0.0, 0, DARK);
        slab(s, [0.04, 1.945, 0.034], [0.09, 0.012, 0.004], 0.0, 0, DARK);
        for k in 0..12 {
            let turn = Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_6 * k as f32);
            let tick = to(0.0, 1.95, 0.022) * turn * to(0.0, 0.13, 0.0);
            s.block(tick, Vec3::new(0.004, 0.012, 0.003), DARK);
        }
    });
}

/// Hooks with coats, back at z = 0.
fn coats(m: &mut Model) {
    let (n, soft, sides) = (m.edge().min(3), m.soft(), 4 + m.level());
    m.part(Stuff::Wood, |s| slab(s, [0.0, 1.6, 0.012], [1.1, 0.1, 0.024], 0.008, n, OAK));
    m.part(Stuff::Paint, |s| {
        for k in 0..6 {
            let x = -0.45 + 0.18 * k as f32;
            let hook = [[x, 1.66, 0.02], [x, 1.645, 0.07], [x, 1.66, 0.09], [x, 1.69, 0.095]].map(Vec3::from);
            s.sweep(&hook, sides, STEEL, |_| 0.006);
        }
    });
    m.part(Stuff::Fabric, |s| {
        for (x, low, paint) in [(-0.45, 0.72, [70, 82, 104]), (-0.09, 0.9, [150, 112, 70]), (0.27, 0.66, [92, 96, 78])]
        {
            let first = s.mesh.positions.len();
            s.rounded(
                to(x, 0.5 * (low + 1.63), 0.085),
                Vec3::new(0.15, 0.5 * (1.63 - low), 0.05),
                0.05,
                soft.max(2),
                paint,
            );
            for p in &mut s.mesh.positions[first..] {
                let t = ((1.63 - p.y) / (1.63 - low)).clamp(0.0, 1.0);
                p.x = x + (p.x - x) * (0.3 + 0.75 * t.sqrt());
                p.z = 0.035 + (p.z - 0.035) * (0.6 + 0.5 * t) + 0.012 * (40.0 * (p.x - x)).sin() * t;
            }
            s.smooth(first);
        }
    });
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    let long = vec![put(0.152, 0.0, 8.6, 90.0), put(6.9, 0.0, 10.848, 180.0)];
    out.push(thing("living room curtains", long, |m| curtains(m, 2.2, 0.05, [196, 170, 126])));
    let beds = vec![put(9.2, 0.0, 0.152, 0.0), put(13.1, 0.0, 0.152, 0.0)];
    out.push(thing("bedroom curtains", beds, |m| curtains(m, 1.8, 0.5, [126, 146, 176])));
    let work = vec![put(10.0, 0.0, 10.848, 180.0), put(13.2, 0.0, 10.848, 180.0), put(14.848, 0.0, 8.5, -90.0)];
    out.push(thing("curtains", work, |m| curtains(m, 1.7, 0.45, [150, 74, 66])));
    // Where it hangs: x, z, turn.
    type Places = &'static [(f64, f64, f64)];
    let walls: [(u32, f32, f32, Paint, Places); 6] = [
        (0, 1.0, 0.7, WALNUT, &[(8.338, 7.0, -90.0), (7.262, 3.2, 90.0)]),
        (1, 0.6, 0.8, DARK, &[(11.662, 7.2, 90.0), (5.3, 5.938, 180.0)]),
        (2, 0.5, 0.4, OAK, &[(11.4, 5.938, 180.0), (4.538, 2.4, -90.0), (14.0, 4.338, 180.0)]),
        (3, 0.9, 0.6, OAK, &[(10.2, 4.338, 180.0), (14.2, 6.062, 0.0)]),
        (4, 0.5, 0.65, WALNUT, &[(8.1, 5.938, 180.0), (11.538, 7.4, -90.0), (4.662, 3.9, 90.0)]),
        (5, 1.2, 0.7, DARK, &[(0.152, 6.6, 90.0), (11.262, 3.4, 90.0)]),
    ];
    for (pick, w, h, wood, at) in walls {
        let at = at.iter().map(|&(x, z, yaw)| put(x, 0.0, z, yaw)).collect();
        out.push(thing(&format!("picture {}", pick + 1), at, move |m| painting(m, w, h, pick, wood)));
    }
    out.push(thing("mirror", vec![put(11.0, 0.0, 4.462, 0.0)], mirror));
    out.push(thing("clock", vec![put(4.538, 0.0, 4.2, -90.0)], clock));
    out.push(thing("coats", vec![put(7.6, 0.0, 4.462, 0.0)], coats));
}
