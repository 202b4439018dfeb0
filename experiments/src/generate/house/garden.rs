//! What is seen through the windows: lawn, terrace, paths, hedges, a fence, trees and bushes.

use glam::{DAffine3, Vec2, Vec3};

use super::furniture::kitchen::{chair, table};
use super::furniture::{bush, crown, hedge, put, to, up};
use super::plan::{GROUND, SIZE};
use super::stuff::{Model, Stuff, Thing, thing};
use crate::generate::noise::fbm;
use crate::generate::solid::{Paint, Solid};

/// The lawn's lower side: the scene's lowest point.
pub(super) const BOTTOM: f32 = -0.4;
/// How far the garden reaches beyond the house.
const REACH: f32 = 11.0;

/// Lowest and highest (x, z).
fn extent() -> [Vec2; 2] {
    [Vec2::splat(-REACH), SIZE + REACH]
}

/// The lawn as a slab whose top is cut into squares with uneven colours.
fn lawn(m: &mut Model) {
    let [low, high] = extent();
    let cells = 8 + 4 * m.level();
    m.part(Stuff::Grass, |s| {
        let line = |a: f32, b: f32| (0..=cells).map(move |i| a + (b - a) * i as f32 / cells as f32);
        let (xs, zs): (Vec<f32>, Vec<f32>) = (line(low.x, high.x).collect(), line(low.y, high.y).collect());
        let first = s.mesh.positions.len() as u32;
        for &z in &zs {
            for &x in &xs {
                let c = 226.0 + 56.0 * fbm(Vec3::new(x, 0.0, z), 5.0, 4, 0.1, 4);
                // Darker under the walls.
                let out = Vec2::new(x, z).clamp(Vec2::ZERO, SIZE).distance(Vec2::new(x, z));
                let by = 0.7 + 0.3 * (out / 0.9).min(1.0);
                s.vertex(Vec3::new(x, GROUND, z), Vec3::Y, [c * by, c * by, 0.94 * c * by].map(|v| v as u8));
            }
        }
        let w = cells + 1;
        for j in 0..cells {
            for i in 0..cells {
                let a = first + j * w + i;
                s.mesh.indices.extend([a, a + w, a + w + 1, a, a + w + 1, a + 1]);
            }
        }
        let sides = [
            (xs.iter().map(|&x| Vec2::new(x, high.y)).collect::<Vec<_>>(), Vec3::Z),
            (zs.iter().rev().map(|&z| Vec2::new(high.x, z)).collect(), Vec3::X),
            (xs.iter().rev().map(|&x| Vec2::new(x, low.y)).collect(), Vec3::NEG_Z),
            (zs.iter().map(|&z| Vec2::new(low.x, z)).collect(), Vec3::NEG_X),
        ];
        for (line, n) in sides {
            for p in line.windows(2) {
                let ids = [(p[0], BOTTOM), (p[1], BOTTOM), (p[1], GROUND), (p[0], GROUND)]
                    .map(|(p, y)| s.vertex(Vec3::new(p.x, y, p.y), n, [90, 70, 50]));
                let [a, b, c, d] = ids;
                s.mesh.indices.extend([a, b, c, a, c, d]);
            }
        }
        let base = s.mesh.positions.len() as u32;
        for z in &zs {
            xs.iter().for_each(|&x| _ = s.vertex(Vec3::new(x, BOTTOM, *z), Vec3::NEG_Y, [90, 70, 50]));
        }
        for j in 0..cells {
            for i in 0..cells {
                let a = base + j * w + i;
                s.mesh.indices.extend([a, a + w + 1, a + w, a, a + 1, a + w + 1]);
            }
        }
    });
}

/// Slabs laid side by side with joints.
fn paving(s: &mut Solid, low: Vec2, high: Vec2, edge: f32, n: u32) {
    let count = ((high - low) / edge).round().as_uvec2().max(glam::UVec2::ONE);
    let size = (high - low) / count.as_vec2();
    for j in 0..count.y {
        for i in 0..count.x {
            let c = low + size * (Vec2::new(i as f32, j as f32) + 0.5);
            let tone = 178.0 + 34.0 * crate::generate::noise::unit(i as i32, j as i32, 77);
            let paint = [tone, 0.97 * tone, 0.91 * tone].map(|v| v as u8);
            let half = Vec3::new(0.5 * size.x - 0.006, 0.06, 0.5 * size.y - 0.006);
            s.rounded(to(c.x, GROUND - 0.02, c.y), half, 0.008, n, paint);
        }
    }
}

/// A piece of picket fence along x, 2 m long.
fn fence(m: &mut Model) {
    let n = m.edge().min(2);
    m.part(Stuff::Wood, |s| {
        let white = [238, 234, 224];
        for k in 0..14 {
            let x = -0.93 + 0.143 * k as f32;
            let outline =
                [(0.035, 0.012), (0.035, -0.012), (-0.035, -0.012), (-0.035, 0.012)].map(|(x, z)| Vec2::new(x, z));
            s.prism(to(x, 0.0, 0.0), &outline, Vec2::ZERO, [0.08, 0.92 + 0.03 * (k % 2) as f32], white);
        }
        for y in [0.3, 0.72] {
            s.rounded(to(0.0, y, -0.03), Vec3::new(1.0, 0.035, 0.014), 0.004, n, white);
        }
        s.rounded(to(-0.99, 0.55, -0.08), Vec3::new(0.05, 0.55, 0.05), 0.01, n, white);
    });
}

fn parasol(m: &mut Model) {
    let sides = 8 * (1 + m.level() / 6);
    m.part(Stuff::Fabric, |s| {
        let roof = [[2.12, 1.55], [2.13, 1.56], [2.3, 1.1], [2.48, 0.5], [2.6, 0.0]];
        s.lathe(up(0.0, 0.0, 0.0), sides, [226, 212, 170], &roof);
        s.lathe(up(0.0, 0.0, 0.0), sides, [206, 192, 150], &[[2.58, 0.0], [2.46, 0.49], [2.28, 1.09], [2.12, 1.55]]);
    });
    m.part(Stuff::Wood, |s| {
        s.lathe(up(0.0, 0.0, 0.0), sides, [156, 112, 70], &[[0.0, 0.0], [0.0, 0.02], [2.6, 0.02], [2.68, 0.0]]);
        s.lathe(up(0.0, 0.0, 0.0), sides, [120, 120, 118], &[[0.0, 0.0], [0.0, 0.25], [0.06, 0.22], [0.06, 0.0]]);
    });
}

/// Long grass and clover in tufts.
fn tuft(m: &mut Model) {
    let blades = 4 + 2 * m.level();
    m.part(Stuff::Carpet, |s| {
        for k in 0..blades {
            let u = |j: i32| crate::generate::noise::unit(k as i32, j, 31);
            let (sn, c) = (std::f32::consts::TAU * u(1)).sin_cos();
            let foot = Vec3::new(0.09 * c, 0.0, 0.09 * sn) * u(2);
            let tip = foot + Vec3::new(0.13 * c * u(3), 0.1 + 0.16 * u(4), 0.13 * sn * u(3));
            super::furniture::leaf(s, foot, tip, 0.014, [92, 138, 52]);
        }
    });
}

fn on_ground(x: f64, z: f64, yaw: f64) -> DAffine3 {
    put(x, f64::from(GROUND), z, yaw)
}

pub(super) fn garden() -> Vec<Thing> {
    let mut out = vec![];
    out.push(Thing {
        name: "lawn".into(),
        make: Box::new(|level| {
            let mut m = Model::new(level);
            lawn(&mut m);
            m.bare()
        }),
        at: vec![DAffine3::IDENTITY],
    });
    out.push(Thing {
        name: "paving".into(),
        make: Box::new(|level| {
            let mut m = Model::new(level);
            let n = m.edge().min(2);
            m.part(Stuff::Plaster, |s| {
                paving(s, Vec2::new(0.6, SIZE.y + 0.16), Vec2::new(8.0, SIZE.y + 4.0), 0.75, n);
                paving(s, Vec2::new(SIZE.x + 0.16, 4.5), Vec2::new(SIZE.x + REACH, 6.0), 0.75, n);
            });
            m.bare()
        }),
        at: vec![DAffine3::IDENTITY],
    });
    let (w, d, r) = (f64::from(SIZE.x), f64::from(SIZE.y), f64::from(REACH));
    let length =
        |from: f64, to: f64, n: i32| (0..n).map(move |k| from + (to - from) * (f64::from(k) + 0.5) / f64::from(n));
    let mut hedges: Vec<DAffine3> = length(-r, w + r, 6).map(|x| on_ground(x, -r + 0.6, 0.0)).collect();
    hedges.extend(length(-r, d + r, 5).map(|z| on_ground(-r + 0.6, z, 90.0)));
    hedges.extend(length(-r, w + r, 6).map(|x| on_ground(x, d + r - 0.6, 180.0)));
    out.push(thing("hedge", hedges, |m| hedge(m, 6.4, 1.7, 5)));
    let fences = (0..16).map(|k| -r + 1.0 + 2.0 * f64::from(k)).filter(|z| (z - 5.0).abs() > 1.2);
    out.push(thing("fence", fences.map(|z| on_ground(w + r - 0.4, z, 90.0)).collect(), fence));
    let greens: [Paint; 3] = [[84, 124, 52], [104, 138, 62], [66, 110, 58]];
    let trees: [&[(f64, f64, f64)]; 3] = [
        &[(-6.5, 3.0, 0.0), (10.6, -6.4, 100.0), (19.6, -4.0, 30.0)],
        &[(-5.6, 14.5, 60.0), (3.0, -6.8, 210.0), (21.5, 13.0, 0.0)],
        &[(11.5, 17.8, 20.0), (21.0, 3.2, 140.0), (-4.9, -5.0, 270.0), (2.0, 19.5, 80.0)],
    ];
    for (i, at) in trees.into_iter().enumerate() {
        let at = at.iter().map(|&(x, z, yaw)| on_ground(x, z, yaw)).collect();
        let high = [5.6, 4.6, 6.2][i];
        out.push(thing(&format!("tree {}", i + 1), at, move |m| crown(m, high, greens[i], 40 + i as u64)));
    }
    let bushes: [&[(f64, f64)]; 3] = [
        &[(-1.1, 2.2), (9.6, 11.9), (16.0, 1.0)],
        &[(-1.0, 9.4), (4.4, -1.1), (11.0, -1.2), (16.1, 9.6)],
        &[(13.6, 12.0), (-1.2, 5.6), (13.3, -1.1), (7.4, -1.2)],
    ];
    let flowers: [Option<Paint>; 3] = [Some([222, 92, 120]), None, Some([240, 226, 120])];
    for (i, at) in bushes.into_iter().enumerate() {
        let at = at.iter().map(|&(x, z)| on_ground(x, z, 47.0 * x)).collect();
        out.push(thing(&format!("bush {}", i + 1), at, move |m| bush(m, greens[2 - i], flowers[i], 90 + i as u64)));
    }
    let white: Paint = [234, 234, 228];
    let up = 0.04;
    let place = |x: f64, z: f64, yaw: f64| put(x, f64::from(GROUND) + up, z, yaw);
    out.push(thing("garden table", vec![place(6.2, 13.2, 0.0)], move |m| table(m, 1.4, 0.9, white)));
    let chairs =
        vec![place(5.75, 12.55, 5.0), place(6.6, 12.5, -4.0), place(5.8, 13.95, 182.0), place(7.3, 13.3, -80.0)];
    out.push(thing("garden chair", chairs, move |m| chair(m, white, [92, 140, 120])));
    out.push(thing("parasol", vec![place(4.6, 14.4, 0.0)], parasol));
    let spot = |k: i32| {
        let u = |j: i32| f64::from(crate::generate::noise::unit(k, j, 9));
        (-r + 1.5 + (w + 2.0 * r - 3.0) * u(1), -r + 1.5 + (d + 2.0 * r - 3.0) * u(2), 360.0 * u(3))
    };
    let paved = |x: f64, z: f64| (z > d && z < d + 4.3 && x > 0.3 && x < 8.3) || (x > w && z > 4.2 && z < 6.3);
    let house = |x: f64, z: f64| x > -0.5 && x < w + 0.5 && z > -0.5 && z < d + 0.5;
    let tufts = (0..220).map(spot).filter(|s| !paved(s.0, s.1) && !house(s.0, s.1));
    out.push(thing("tuft", tufts.map(|(x, z, yaw)| on_ground(x, z, yaw)).collect(), tuft));
    out
}
