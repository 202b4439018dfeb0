//! Far chunks into pieces: what one picture can show.
//!
//! As a rule a piece is an object. One that fills too much of the view from the cell's centre (a terrain, a building round the
//! cell) is halved chunk by chunk until each piece fits a picture; borders between pieces are locked like those towards near
//! chunks. A single chunk that still does not fit is drawn as it is.

use farfield_core::id::{ChunkId, ObjectId};
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::{Aabb, Camera};
use glam::Vec3;

use crate::object::Piece;

/// A picture reaches this far to each side, as a tangent (50 degrees): beyond, pixels at its border are stretched too much.
pub(crate) const WIDEST_TAN: f32 = 1.2;

/// The far chunks in pieces, and those that no picture can hold.
pub(crate) fn pieces(scene: &Scene, far: &ChunkSet, centre: Vec3, near: f32) -> (Vec<Piece>, ChunkSet) {
    let (mut out, mut plain) = (vec![], vec![]);
    let mut by_object: Vec<(ObjectId, Vec<ChunkId>)> = vec![];
    for c in far.iter() {
        let object = scene.chunks[c.index()].object;
        match by_object.last_mut() {
            Some((last, chunks)) if *last == object => chunks.push(c),
            _ => by_object.push((object, vec![c])),
        }
    }
    for (object, chunks) in by_object {
        divide(scene, object, chunks, centre, near, &mut out, &mut plain);
    }
    (out, plain.into_iter().collect())
}

fn divide(
    scene: &Scene,
    object: ObjectId,
    mut chunks: Vec<ChunkId>,
    centre: Vec3,
    near: f32,
    out: &mut Vec<Piece>,
    plain: &mut Vec<ChunkId>,
) {
    let bounds = chunks.iter().fold(Aabb::EMPTY, |b, c| b.union(scene.chunks[c.index()].bounds));
    if fits(&bounds, centre, near) {
        out.push(Piece { object, chunks: chunks.into_iter().collect(), bounds });
        return;
    }
    if chunks.len() == 1 {
        plain.extend(chunks);
        return;
    }
    let middle = |c: &ChunkId| scene.chunks[c.index()].bounds.centre();
    let size = Aabb::of(chunks.iter().map(middle)).size();
    let axis = if size.x >= size.y.max(size.z) {
        Vec3::X
    } else if size.y >= size.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    chunks.sort_by(|a, b| middle(a).dot(axis).total_cmp(&middle(b).dot(axis)).then(a.cmp(b)));
    let upper = chunks.split_off(chunks.len() / 2);
    divide(scene, object, chunks, centre, near, out, plain);
    divide(scene, object, upper, centre, near, out, plain);
}

/// Whether a picture from `eye` along the line to the box's middle can hold it.
pub(crate) fn fits(b: &Aabb, eye: Vec3, near: f32) -> bool {
    let camera = Camera::around(eye.as_dvec3(), b.centre() - eye, b.corners(), 1024.0, 0, near);
    camera.is_some_and(|c| c.left.min(c.bottom) >= -WIDEST_TAN && c.right_tan.max(c.top) <= WIDEST_TAN)
}
