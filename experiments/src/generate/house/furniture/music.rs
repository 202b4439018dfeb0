//! The music room: a grand piano with its lid up and 88 keys, a bench, a music stand.

use glam::{Affine3A, Vec2, Vec3};

use super::{DARK, STEEL, WALNUT, put, rod, slab, to, up};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::shapes::spline;

const LACQUER: [u8; 3] = [34, 28, 28];

/// The rim of the case from above, counter-clockwise, keyboard at +z; `grow` puts it outwards.
fn rim(steps: u32, grow: f32) -> Vec<Vec2> {
    // The bent side on the right, the straight one on the left.
    let bent = [
        [0.74, 0.35, 0.0, 0.0],
        [0.73, -0.1, 0.0, 0.0],
        [0.55, -0.45, 0.0, 0.0],
        [0.28, -0.7, 0.0, 0.0],
        [0.1, -1.05, 0.0, 0.0],
        [-0.15, -1.24, 0.0, 0.0],
        [-0.5, -1.25, 0.0, 0.0],
    ];
    let mut out: Vec<Vec2> = vec![Vec2::new(0.74, 0.45)];
    out.extend(spline(&bent, steps.max(1) as usize).iter().map(|k| Vec2::new(k[0], k[1])));
    out.extend([Vec2::new(-0.68, -1.12), Vec2::new(-0.74, -0.9), Vec2::new(-0.74, 0.45)]);
    let middle = Vec2::new(-0.2, -0.3);
    out.iter().map(|p| middle + (*p - middle) * (1.0 + grow)).collect()
}

fn piano(m: &mut Model) {
    let (steps, sides, n) = (1 + m.level() / 2, m.sides(), m.edge().min(4));
    let middle = Vec2::new(-0.3, -0.2);
    m.part(Stuff::Paint, |s| {
        let id = Affine3A::IDENTITY;
        s.prism(id, &rim(steps, 0.0), middle, [0.66, 0.93], LACQUER);
        // The sound board and the frame on it, a little above the case.
        s.prism(id, &rim(steps, -0.06), middle, [0.9, 0.936], [176, 132, 62]);
        // The lid, hinged on the straight side.
        let lid = to(-0.74, 0.975, 0.0) * Affine3A::from_rotation_z(0.62) * to(0.74, 0.0, 0.0);
        s.prism(lid, &rim(steps, 0.01), middle, [0.0, 0.022], LACQUER);
        rod(s, [0.6, 0.93, -0.2], [0.46, 1.69, -0.2], 0.01, sides / 2, LACQUER);
        // Key bed, cheeks, fall board, music desk.
        slab(s, [0.0, 0.66, 0.57], [1.48, 0.045, 0.27], 0.008, n, LACQUER);
        for x in [-0.7, 0.7] {
            slab(s, [x, 0.705, 0.57], [0.08, 0.1, 0.26], 0.02, n, LACQUER);
        }
        slab(s, [0.0, 0.7, 0.445], [1.32, 0.23, 0.02], 0.006, n, LACQUER);
        let desk = to(0.0, 0.94, 0.25) * Affine3A::from_rotation_x(-0.3);
        s.rounded(desk * to(0.0, 0.14, 0.0), Vec3::new(0.42, 0.14, 0.008), 0.006, n, LACQUER);
        for (x, z) in [(-0.6, 0.3), (0.6, 0.3), (-0.4, -0.95)] {
            let leg = [[0.0, 0.0], [0.0, 0.03], [0.05, 0.035], [0.08, 0.045], [0.5, 0.06], [0.66, 0.07], [0.66, 0.0]];
            s.lathe(up(x, 0.0, z), sides, LACQUER, &leg);
        }
        rod(s, [-0.06, 0.1, 0.3], [-0.06, 0.66, 0.2], 0.014, sides / 2, LACQUER);
        rod(s, [0.06, 0.1, 0.3], [0.06, 0.66, 0.2], 0.014, sides / 2, LACQUER);
        slab(s, [0.0, 0.06, 0.3], [0.24, 0.06, 0.1], 0.01, n, LACQUER);
        for x in [-0.06, 0.0, 0.06] {
            slab(s, [x, 0.05, 0.39], [0.025, 0.012, 0.11], 0.005, n, [196, 160, 84]);
        }
    });
    keys(m, n);
    strings(m);
}

fn keys(m: &mut Model, n: u32) {
    m.part(Stuff::Paint, |s| {
        let w = 1.3 / 52.0;
        for k in 0..52 {
            let x = -0.65 + w * (k as f32 + 0.5);
            slab(s, [x, 0.705, 0.575], [w - 0.0012, 0.022, 0.15], 0.003, n, [246, 242, 230]);
            // A black key after A, C, D, F, G: the lowest key is an A.
            if matches!(k % 7, 0 | 2 | 3 | 5 | 6) && k < 51 {
                slab(s, [x + 0.5 * w, 0.715, 0.54], [0.011, 0.024, 0.09], 0.003, n, [26, 24, 26]);
            }
        }
    });
}

fn strings(m: &mut Model) {
    let count = 10 + 4 * m.level().min(20);
    m.part(Stuff::Paint, |s| {
        for k in 0..count {
            let t = k as f32 / (count - 1) as f32;
            let x = -0.62 + 1.2 * t;
            let end = if t < 0.5 { -1.0 + 1.1 * t } else { -0.45 + 0.9 * (t - 0.5) };
            rod(s, [x, 0.945, 0.15], [x - 0.06, 0.945, end], 0.0018, 3, [206, 196, 160]);
        }
    });
}

fn stand(m: &mut Model) {
    let sides = 4 + m.level();
    m.part(Stuff::Paint, |s| {
        for k in 0..3 {
            let (sn, c) = (std::f32::consts::TAU * k as f32 / 3.0).sin_cos();
            rod(s, [0.0, 0.3, 0.0], [0.26 * sn, 0.006, 0.26 * c], 0.008, sides, DARK);
        }
        rod(s, [0.0, 0.28, 0.0], [0.0, 1.1, 0.0], 0.01, sides, DARK);
        let at = to(0.0, 1.18, 0.02) * Affine3A::from_rotation_x(-0.35);
        s.rounded(at, Vec3::new(0.24, 0.16, 0.006), 0.004, m_edge(sides), DARK);
        s.rounded(at * to(0.0, -0.15, 0.03), Vec3::new(0.24, 0.006, 0.03), 0.004, m_edge(sides), DARK);
        s.rounded(at * to(-0.1, -0.005, 0.009), Vec3::new(0.1, 0.135, 0.001), 0.0, 0, [250, 248, 238]);
        s.rounded(at * to(0.105, -0.005, 0.009), Vec3::new(0.1, 0.135, 0.001), 0.0, 0, [246, 244, 232]);
    });
}

fn m_edge(sides: u32) -> u32 {
    sides / 8
}

fn bench(m: &mut Model) {
    let (n, soft) = (m.edge().min(4), m.soft());
    m.part(Stuff::Wood, |s| {
        slab(s, [0.0, 0.38, 0.0], [0.76, 0.07, 0.34], 0.01, n, WALNUT);
        for (x, z) in [(-0.34, -0.13), (0.34, -0.13), (-0.34, 0.13), (0.34, 0.13)] {
            slab(s, [x, 0.0, z], [0.05, 0.38, 0.05], 0.008, n, WALNUT);
        }
    });
    m.part(Stuff::Fabric, |s| slab(s, [0.0, 0.448, 0.0], [0.74, 0.06, 0.32], 0.03, soft, [110, 40, 40]));
}

fn vases(m: &mut Model) {
    let sides = 2 * m.sides();
    m.part(Stuff::Paint, |s| {
        let tall =
            [[0.0, 0.0], [0.0, 0.06], [0.1, 0.09], [0.2, 0.08], [0.3, 0.03], [0.36, 0.045], [0.36, 0.038], [0.3, 0.0]];
        s.lathe(up(0.0, 0.0, 0.0), sides, [180, 96, 60], &tall);
        let low = [[0.0, 0.0], [0.0, 0.05], [0.06, 0.1], [0.12, 0.08], [0.13, 0.075], [0.06, 0.0]];
        s.lathe(up(0.24, 0.0, 0.03), sides, [208, 202, 186], &low);
        s.lathe(
            up(-0.22, 0.0, 0.02),
            sides,
            STEEL,
            &[[0.0, 0.0], [0.0, 0.05], [0.01, 0.05], [0.03, 0.012], [0.2, 0.01], [0.2, 0.0]],
        );
    });
}

pub(super) fn furnish(out: &mut Vec<Thing>) {
    out.push(thing("grand piano", vec![put(13.45, 0.0, 8.85, 180.0)], piano));
    out.push(thing("piano bench", vec![put(13.45, 0.0, 7.85, 180.0)], bench));
    out.push(thing("music stand", vec![put(12.15, 0.0, 7.7, 120.0)], stand));
    let on = [
        put(4.36, 0.811, 3.1, -90.0),
        put(7.48, 0.811, 2.15, 90.0),
        put(11.5, 0.811, 2.5, 90.0),
        put(10.75, 0.811, 4.64, 0.0),
    ];
    out.push(thing("vases", on.to_vec(), vases));
}
