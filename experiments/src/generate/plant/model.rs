//! Meshes in the making and parts in their places.

use farfield_core::mesh::TriangleMesh;
use glam::{Affine3A, DAffine3, DVec3, Vec3};

use crate::generate::noise::fbm;
use crate::generate::solid::{Paint, Solid, frame};

/// Makes a part's mesh at a level of detail, 1 or more.
pub(super) type Make = Box<dyn Fn(u32) -> TriangleMesh + Send + Sync>;

/// A part and where it is.
pub(super) struct Placed {
    /// Its mesh's name.
    pub(super) name: String,
    /// Its mesh.
    pub(super) make: Make,
    /// Its places.
    pub(super) at: Vec<DAffine3>,
}

/// A part of paint, darker where it faces down and a little dirty.
pub(super) fn part(name: &str, at: Vec<DAffine3>, make: impl Fn(&mut Solid, u32) + Send + Sync + 'static) -> Placed {
    let make = move |level| {
        let mut solid = Solid::default();
        make(&mut solid, level);
        let mut mesh = solid.finish();
        for ((p, n), c) in mesh.positions.iter().zip(&mesh.normals).zip(&mut mesh.colors) {
            let by = (1.0 - 0.28 * (-n.y).max(0.0)) * (0.97 + 0.16 * fbm(*p, 1.6, 3, 0.0, 21));
            c[..3].iter_mut().for_each(|x| *x = (f32::from(*x) * by).clamp(0.0, 255.0) as u8);
        }
        mesh
    };
    Placed { name: name.into(), make: Box::new(make), at }
}

/// At a place, turned by quarters counter-clockwise seen from above.
pub(super) fn put(x: f32, y: f32, z: f32, quarters: u32) -> DAffine3 {
    let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2 * f64::from(quarters % 4));
    DAffine3::from_translation(DVec3::new(x.into(), y.into(), z.into())) * turn
}

/// A translation.
pub(super) fn to(x: f32, y: f32, z: f32) -> Affine3A {
    Affine3A::from_translation(Vec3::new(x, y, z))
}

/// The frame of a lathe whose axis points up.
pub(super) fn up(x: f32, y: f32, z: f32) -> Affine3A {
    frame(Vec3::new(x, y, z), Vec3::Y, Vec3::NEG_X)
}

/// A box by its lowest and highest corner.
pub(super) fn bar(s: &mut Solid, low: [f32; 3], high: [f32; 3], paint: Paint) {
    let (low, high) = (Vec3::from(low), Vec3::from(high));
    s.block(Affine3A::from_translation(0.5 * (low + high)), 0.5 * (high - low), paint);
}

/// A closed cylinder between two points.
pub(super) fn rod(s: &mut Solid, a: [f32; 3], b: [f32; 3], radius: f32, sides: u32, paint: Paint) {
    s.sweep(&[Vec3::from(a), Vec3::from(b)], sides, paint, |_| radius);
}

/// Sides of something round at a level.
pub(super) fn sides(level: u32) -> u32 {
    5 + 2 * level
}
