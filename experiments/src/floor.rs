//! The floor: what a frame costs whose every pixel is textured by projection and that has no geometry to speak of, one quadrilateral.
//! No textured far field can be faster on the device, so frame times are told as multiples of it too. Measured in the same run, on
//! the same device, at the same resolution, through the same passes.

use farfield_core::backend::{Backend, BlockData};
use farfield_core::camera::ViewModel;
use farfield_core::draw::{Draw, DrawWhat, Shading};
use farfield_core::id::{AssetId, Block, LocalPayload, PayloadRef};
use farfield_core::payload::{AtlasPart, MeshPart, Part, Payload, ProjectedPart, Projector};
use farfield_core::{Aabb, Fault};
use glam::{DVec3, Mat4, Vec3, Vec4};

use crate::results::Times;
use crate::walk::frame;

/// An asset that no cell uses.
const ASSET: AssetId = AssetId(u32::MAX);

/// Renders `frames` floor frames and gives their times, milliseconds: by the device where it can, else by the clock. What it uploads
/// is freed again.
///
/// # Errors
/// What the backend gives.
pub fn floor(backend: &mut dyn Backend, views: &ViewModel, shading: &Shading, frames: usize) -> Result<Times, Fault> {
    let camera = views.camera(DVec3::ZERO, 0.0, 0.0);
    let id = |n| PayloadRef { asset: ASSET, id: LocalPayload(n) };
    let [w, h] = views.resolution;
    let atlas = atlas(w, h);
    let far = 100.0 * views.near;
    // A quarter beyond the picture's edges on each side.
    let corner = |x: f32, y: f32| camera.ray(x * w as f32, y * h as f32) * far;
    let positions = vec![corner(-0.25, 1.25), corner(1.25, 1.25), corner(1.25, -0.25), corner(-0.25, -0.25)];
    let bounds = Aabb::of(positions.iter().copied());
    let px = camera.px_per_tan();
    let row = |axis: Vec3, middle: f32| (axis * px + camera.forward * middle).extend(0.0);
    let rows =
        [row(camera.right, 0.5 * w as f32), row(-camera.up, 0.5 * h as f32), Vec4::ZERO, camera.forward.extend(0.0)];
    let projector = Projector {
        matrix: Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(),
        eye: Vec3::ZERO,
        atlas: LocalPayload(0),
        layer: 0,
        rect: [0, 0, w, h],
    };
    let mesh = MeshPart {
        positions,
        normals: vec![-camera.forward; 4],
        albedo: vec![[128, 128, 128, 255]; 4],
        indices: vec![0, 1, 2, 0, 2, 3],
        two_sided: true,
    };
    let quad = ProjectedPart { mesh, views: vec![1, 1], projectors: vec![projector] };
    let payload = |part| Payload { origin: DVec3::ZERO, bounds, parts: vec![part] };
    let blocks = [(id(0), payload(Part::Atlas(atlas))), (id(1), payload(Part::Projected(quad)))];
    for (id, p) in &blocks {
        backend.upload(Block::Payload(*id), &BlockData::Payload(p))?;
    }
    let draw = || Draw { what: DrawWhat::Payload { id: id(1), part: 0, object: 1 }, bounds, error_px: 0.0 };
    let mut times = vec![];
    for _ in 0..frames {
        let counted = backend.render(&frame(&camera, vec![draw()], shading))?;
        times.push(counted.gpu_ms.unwrap_or(counted.wall_ms));
    }
    blocks.iter().for_each(|(id, _)| backend.release(Block::Payload(*id)));
    Ok(Times::of(&times))
}

/// Texels that differ from their neighbours, one a pixel.
fn atlas(w: u32, h: u32) -> AtlasPart {
    let texel = |i: u32| {
        let (x, y) = (i % w, i / w);
        [(x * 7 + y * 3) as u8, (x ^ y) as u8, (x + y) as u8, 255]
    };
    let albedo = (0..w * h).map(texel).collect();
    AtlasPart { size: [w, h], layers: 1, albedo, normal: vec![[128, 255, 128, 255]; w as usize * h as usize] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::walk::read;
    use farfield_core::scene::SceneBuilder;
    use farfield_cpu::{CpuBackend, CpuOptions};

    #[test]
    fn every_pixel_of_the_floor_is_textured_by_projection() {
        let scene = SceneBuilder::default().build().unwrap();
        let mut backend = CpuBackend::new(&scene, CpuOptions::default()).unwrap();
        let views = ViewModel {
            fov_y_rad: 1.0,
            resolution: [32, 24],
            near: 0.1,
            eye_height: [0.0, 1.0],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        };
        let shading = Shading { ambient: Vec3::ONE, lights: vec![], sky: [1, 2, 3], ground: [4, 5, 6] };
        let times = floor(&mut backend, &views, &shading, 3).unwrap();
        assert!(times.max > 0.0);
        let expected = atlas(32, 24).albedo;
        let surface = read(&mut backend).unwrap().surface;
        assert_eq!(surface.size, [32, 24]);
        let near = |a: [u8; 4], b: [u8; 4]| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(surface.albedo.iter().zip(&expected).all(|(&a, &b)| near(a, b)));
    }
}
