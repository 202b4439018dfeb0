//! What a viewpoint sees that no sample saw, by rays through the scene's own triangles: no picture of a sample, no skin.

use farfield_core::bvh::{Ray, TriangleBvh};
use farfield_core::panorama::pixel_solid_angle_sr;
use farfield_core::scene::{ChunkSet, Scene};
use farfield_core::{Camera, Fault};
use glam::{DVec3, Vec3};

/// A shadow ray ends this share before the point that it looks for.
const SHORT: f32 = 1e-3;

/// The triangles of some placed chunks, local frame.
pub struct Truth {
    bvh: TriangleBvh,
    /// A bit a triangle: seen from behind too.
    two_sided: Vec<bool>,
}

impl Truth {
    /// Of a scene's chunks.
    ///
    /// # Errors
    /// What reading triangles gives.
    pub fn new(scene: &Scene, chunks: &ChunkSet) -> Result<Self, Fault> {
        let (mut positions, mut indices, mut two_sided): (Vec<Vec3>, Vec<u32>, Vec<bool>) = (vec![], vec![], vec![]);
        for c in chunks.iter() {
            let placed = &scene.chunks[c.index()];
            let placement = scene.objects[placed.object.index()].placement;
            let both = scene.materials[scene.material_of(c).index()].two_sided;
            scene.geometry.with(placed.source, &mut |mesh| {
                let first = positions.len() as u32;
                positions.extend(mesh.positions.iter().map(|p| placement.transform_point3(p.as_dvec3()).as_vec3()));
                indices.extend(mesh.indices.iter().map(|i| first + i));
                two_sided.resize(indices.len() / 3, both);
            })?;
        }
        Ok(Self { bvh: TriangleBvh::build(&positions, &indices), two_sided })
    }

    /// Whether a point is seen from a viewpoint.
    pub fn sees(&self, from: DVec3, point: DVec3) -> bool {
        let Some(ray) = Ray::new(from, (point - from).as_vec3(), 0.0, 1.0 - SHORT) else { return true };
        !self.bvh.any_hit(&ray, |h| h.front || self.two_sided[h.triangle as usize])
    }

    /// The solid angle around `eye` in which it sees what none of the samples sees, steradians; by a ray a pixel of a cube.
    pub fn unseen_sr(&self, eye: DVec3, samples: &[DVec3], face_px: u32, near: f32) -> f64 {
        let mut sum = 0.0;
        for c in Camera::cube(eye, face_px, near) {
            for i in 0..face_px * face_px {
                let (x, y) = (i % face_px, i / face_px);
                let direction = c.ray(x as f32 + 0.5, y as f32 + 0.5);
                let Some(ray) = Ray::new(eye, direction, near, f32::INFINITY) else { continue };
                let hit = self.bvh.closest_hit(&ray, |h| h.front || self.two_sided[h.triangle as usize]);
                let point = hit.map(|h| eye + direction.as_dvec3() * f64::from(h.t));
                if point.is_some_and(|p| samples.iter().all(|&s| !self.sees(s, p))) {
                    sum += pixel_solid_angle_sr(&c, x, y);
                }
            }
        }
        sum
    }
}
