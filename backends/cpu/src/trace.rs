//! One ray through a frame: the first surface that is drawn along it.

use std::ops::ControlFlow;

use farfield_core::bvh::{Hit, Ray};
use glam::{DVec3, Vec3};

use crate::frame::Frame;

/// The instance that a ray meets first, and where.
pub(crate) struct Met {
    pub(crate) instance: u32,
    pub(crate) hit: Hit,
}

/// Casts the ray from the eye along `direction` (its component along the camera's forward axis is 1, so that t is linear depth).
/// Of instances met at the same depth the one drawn first wins, as it does under a strict depth test.
pub(crate) fn first(frame: &Frame<'_>, direction: Vec3, near: f32) -> Option<Met> {
    let ray = Ray::new(DVec3::ZERO, direction, near, f32::INFINITY)?;
    let wide = direction.as_dvec3();
    let mut best: Option<Met> = None;
    // Chunks of one object follow one another: its ray is made once.
    let mut held: (u32, Option<Ray>) = (u32::MAX, None);
    frame.top.cast(&ray, |i, limit| {
        let instance = &frame.instances[i as usize];
        let space = &frame.spaces[instance.space as usize];
        if held.0 != instance.space {
            held = (instance.space, Ray::new(space.eye, (space.directions * wide).as_vec3(), near, f32::INFINITY));
        }
        let Some(local) = held.1.as_mut() else { return ControlFlow::Continue(()) };
        local.t_max = *limit;
        let hit = if instance.two_sided {
            instance.surface.bvh.closest_hit(local, |_| true)
        } else {
            instance.surface.bvh.closest_hit(local, |h| h.front != space.mirrors)
        };
        if let Some(hit) = hit
            && best.as_ref().is_none_or(|b| hit.t < b.hit.t || i < b.instance)
        {
            *limit = hit.t;
            best = Some(Met { instance: i, hit });
        }
        ControlFlow::Continue(())
    });
    best
}
