//! Bookcases full of books. Three fillings from the seed, placed many times.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{OAK, WALNUT, put, slab};
use crate::generate::house::stuff::{Model, Stuff, Thing, thing};
use crate::generate::house::textures::book;
use crate::generate::solid::Paint;
use glam::{DAffine3, Vec3};

/// Width, height, depth of a case, and its shelves.
const CASE: [f32; 3] = [0.8, 2.05, 0.3];
const SHELVES: u32 = 6;

fn case(m: &mut Model, paint: Paint) {
    let n = m.edge().min(3);
    let [w, h, d] = CASE;
    m.part(Stuff::Wood, |s| {
        for x in [-1.0, 1.0] {
            slab(s, [x * (0.5 * w - 0.011), 0.0, 0.5 * d], [0.022, h, d], 0.004, n, paint);
        }
        slab(s, [0.0, 0.0, 0.008], [w - 0.044, h, 0.012], 0.0, 0, paint);
        slab(s, [0.0, 0.0, 0.5 * d - 0.01], [w - 0.044, 0.07, d - 0.04], 0.0, 0, paint);
        for k in 0..=SHELVES {
            slab(s, [0.0, shelf(k) - 0.022, 0.5 * d + 0.002], [w - 0.044, 0.022, d - 0.016], 0.003, n.min(2), paint);
        }
        slab(s, [0.0, h, 0.5 * d], [w + 0.03, 0.03, d + 0.02], 0.01, n, paint);
    });
}

/// The height of a shelf's top.
fn shelf(k: u32) -> f32 {
    0.092 + k as f32 * (CASE[1] - 0.092) / SHELVES as f32
}

/// A row of books from the left, some lying, with a gap here and there.
fn row(m: &mut Model, y: f32, rng: &mut ChaCha8Rng) {
    let right = 0.5 * CASE[0] - 0.03;
    let mut x = -right;
    let room = (CASE[1] - 0.092) / SHELVES as f32 - 0.05;
    // Fewer and thicker books on low levels.
    let thick = 1.0 + 2.4 / m.level() as f32;
    let set = rng.random_bool(0.2).then(|| rng.random_range(0..128));
    let mut tall = rng.random_range(0.7..0.95);
    while x < right - 0.02 {
        if rng.random_bool(0.04) {
            x += rng.random_range(0.03..0.12);
            tall = rng.random_range(0.7..0.95);
        }
        let (w, h, deep) = (
            thick * rng.random_range(0.016..0.045),
            room * tall * rng.random_range(0.86..1.0),
            rng.random_range(0.16..0.23),
        );
        let pick = set.unwrap_or_else(|| rng.random_range(0..128));
        let back = rng.random_range(0.0..0.015);
        if x + w > right {
            break;
        }
        volume(m, [x + 0.5 * w, y, 0.27 - back], [w - 0.001, h, deep], pick);
        x += w;
    }
}

/// A book whose back is at z = `front`: a block, or covers about paler pages.
fn volume(m: &mut Model, [x, y, front]: [f32; 3], [w, h, d]: [f32; 3], pick: u32) {
    let level = m.level();
    let fine = (level / 8).min(3);
    if level < 4 {
        return m.shown(book(pick), |s| slab(s, [x, y, front - 0.5 * d], [w, h, d], 0.0, 0, [255; 3]));
    }
    let cover = 0.0025_f32.min(0.2 * w);
    let spine = cover + 0.002;
    m.shown(book(pick), |s| {
        if fine == 0 {
            slab(s, [x, y, front - 0.5 * spine], [w, h, spine], 0.0, 0, [255; 3]);
        } else {
            slab(s, [x, y, front - 0.006], [w, h, 0.012], 0.004, fine, [255; 3]);
        }
    });
    let [low, high] = book(pick);
    let edge = [glam::Vec2::new(low.x, low.y), glam::Vec2::new(low.x + 0.1 * (high.x - low.x), high.y)];
    for side in [-1.0, 1.0] {
        m.shown(edge, |s| {
            let at = Vec3::new(x + side * 0.5 * (w - cover), y + 0.5 * h, front - 0.5 * (d + spine));
            s.block(glam::Affine3A::from_translation(at), Vec3::new(cover, h, d - spine) * 0.5, [255; 3]);
        });
    }
    m.part(Stuff::Paint, |s| {
        slab(
            s,
            [x, y + 0.004, front - 0.5 * (d + spine) + 0.002],
            [w - 2.0 * cover, h - 0.008, d - spine - 0.004],
            0.0,
            0,
            [232, 222, 196],
        );
    });
}

fn full(m: &mut Model, paint: Paint, seed: u64) {
    case(m, paint);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for k in 0..SHELVES {
        row(m, shelf(k), &mut rng);
    }
}

pub(super) fn furnish(seed: u64, out: &mut Vec<Thing>) {
    let along =
        |at: &[(f64, f64, f64)]| -> Vec<DAffine3> { at.iter().map(|&(x, z, yaw)| put(x, 0.0, z, yaw)).collect() };
    let study = [(8.462, 6.6, 90.0), (8.462, 8.2, 90.0), (8.462, 9.82, 90.0), (11.538, 8.35, -90.0)];
    let other = [(8.462, 7.4, 90.0), (8.462, 9.01, 90.0), (11.538, 9.16, -90.0), (11.662, 9.9, 90.0)];
    let living = [(3.65, 6.062, 0.0), (4.46, 6.062, 0.0), (5.27, 6.062, 0.0), (11.262, 1.2, 90.0)];
    for (i, (at, paint)) in [(study, WALNUT), (other, WALNUT), (living, OAK)].into_iter().enumerate() {
        out.push(thing(&format!("bookcase {}", i + 1), along(&at), move |m| full(m, paint, seed * 8 + i as u64)));
    }
}
