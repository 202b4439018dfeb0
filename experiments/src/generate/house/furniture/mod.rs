//! What stands in the rooms, hangs on the walls and lies on the tables: each thing is a mesh that is placed once or more.
//!
//! A thing's frame: it stands on y = 0 in the middle of its floor space, its front looks along +z; what hangs on a wall has its back at
//! z = 0. Lengths are metres. O(parts).

mod books;
mod hanging;
pub(super) mod kitchen;
mod living;
mod music;
mod plants;
mod sleeping;
mod water;

use glam::{Affine3A, DAffine3, DVec3, Vec3};

use super::stuff::Thing;
use crate::generate::solid::{Paint, Solid, frame};

pub(super) use plants::{bush, crown, hedge, leaf};

const STEEL: Paint = [186, 190, 194];
const DARK: Paint = [52, 50, 50];
const WHITE: Paint = [238, 238, 234];
const OAK: Paint = [196, 150, 100];
const WALNUT: Paint = [128, 84, 56];
const PINE: Paint = [226, 190, 142];

/// A translation.
pub(super) fn to(x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, y, z))
}

/// The frame of a lathe whose axis points up from a point.
pub(super) fn up(x: f32, y: f32, z: f32) -> Affine3A {
    frame(Vec3::new(x, y, z), Vec3::Y, Vec3::NEG_X)
}

/// At (x, y, z), turned by degrees counter-clockwise seen from above.
pub(super) fn put(x: f64, y: f64, z: f64, yaw_deg: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z)) * DAffine3::from_rotation_y(yaw_deg.to_radians())
}

/// Half extents.
fn half(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z) * 0.5
}

/// A box of full size that stands at height `y` over (x, z), its edges rounded.
fn slab(s: &mut Solid, [x, y, z]: [f32; 3], size: [f32; 3], round: f32, n: u32, paint: Paint) {
    let [w, h, d] = size;
    s.rounded(to(x, y + 0.5 * h, z), half(w, h, d), round, n, paint);
}

/// A straight round bar.
fn rod(s: &mut Solid, a: [f32; 3], b: [f32; 3], radius: f32, sides: u32, paint: Paint) {
    s.sweep(&[Vec3::from(a), Vec3::from(b)], sides, paint, |_| radius);
}

/// Everything, furnished from the seed.
pub(super) fn furniture(seed: u64) -> Vec<Thing> {
    let mut out = vec![];
    kitchen::furnish(&mut out);
    water::furnish(&mut out);
    sleeping::furnish(&mut out);
    living::furnish(&mut out);
    books::furnish(seed, &mut out);
    music::furnish(&mut out);
    plants::furnish(&mut out);
    hanging::furnish(&mut out);
    out
}
