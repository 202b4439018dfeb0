//! Layered depth images drawn over what was cast: samples are thrown one by one, the images composed by depth, then all of them
//! with the rest.
//!
//! Within an image no depths are compared by default: samples are drawn in McMillan's *occlusion-compatible order* (McMillan and
//! Bishop 1995). In the plane through both eyes and a ray, the way from the viewer to a sample crosses only rays nearer to the epipole, the
//! viewer's own image, so that drawing towards the epipole (away from it where the viewer stands behind the image's eye) and
//! each pixel from back to front is drawing from back to front. [`SplatOrder::Nearest`] compares depths instead, as the GPU
//! backends do: the nearest sample of a pixel wins, of equal ones the last. The two differ where splats larger than a pixel overlap.
//!
//! Among images the nearer covers a pixel, of equally near ones the one drawn first; a smoothed pixel averages those of its neighbours
//! that the same image covers *so*. A GPU backend, where all images of a pass compete for one buffer, sees no others.
//!
//! O(samples * splat area + pixels * images), on one thread: the reference.

use farfield_core::Camera;
use farfield_core::image::{SurfaceImage, octahedral};
use farfield_core::layered::{LayeredPart, Warp};
use glam::{DVec3, Vec3};

use crate::texel;

/// How the samples of one layered depth image hide each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SplatOrder {
    /// Drawn from back to front, no depth compared.
    #[default]
    OcclusionCompatible,
    /// The nearest wins.
    Nearest,
}

/// Weights of the smoothing kernel, by the distance in rows plus columns from the middle.
const KERNEL: [f32; 3] = [4.0, 2.0, 1.0];

/// What covers a pixel.
#[derive(Clone, Copy)]
struct Cover {
    depth: f32,
    /// Which of the pass's images.
    image: u32,
    sample: u32,
}

/// Draws layered depth images, each with where its payload stands, over a surface image.
pub(crate) fn over(into: &mut SurfaceImage, to: &Camera, images: &[(DVec3, &LayeredPart)], order: SplatOrder) {
    let mut cover: Vec<Option<Cover>> = vec![None; into.depth.len()];
    for (number, &(origin, image)) in (0u32..).zip(images) {
        for (nearest, own) in cover.iter_mut().zip(thrown(to, origin, image, order)) {
            if let Some((depth, sample)) = own
                && nearest.is_none_or(|n| depth < n.depth)
            {
                *nearest = Some(Cover { depth, image: number, sample });
            }
        }
    }
    let [w, h] = to.size.map(|s| s as usize);
    for (i, covered) in cover.iter().enumerate() {
        let Some(Cover { depth, image: number, sample }) = *covered else { continue };
        if depth >= into.depth[i] {
            continue;
        }
        let image = images[number as usize].1;
        let (albedo, normal) =
            if image.smooth { smoothed(image, number, &cover, [w, h], i) } else { look(image, sample) };
        into.depth[i] = depth;
        into.object[i] = image.objects[usize::from(image.object[sample as usize])];
        into.albedo[i] = texel::encode(albedo);
        into.normal[i] = octahedral(normal);
    }
}

/// Linear albedo and normal of a sample.
fn look(image: &LayeredPart, sample: u32) -> (Vec3, Vec3) {
    let [r, g, b] = image.albedo[sample as usize];
    (texel::decode([r, g, b, 255]), image.normal_at(sample as usize))
}

/// The average over a pixel and those around it that the same image covers.
fn smoothed(image: &LayeredPart, number: u32, cover: &[Option<Cover>], [w, h]: [usize; 2], i: usize) -> (Vec3, Vec3) {
    let (x, y) = (i % w, i / w);
    let (mut albedo, mut normal, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for v in y.saturating_sub(1)..(y + 2).min(h) {
        for u in x.saturating_sub(1)..(x + 2).min(w) {
            if let Some(Cover { sample, .. }) = cover[v * w + u].filter(|c| c.image == number) {
                let k = KERNEL[u.abs_diff(x) + v.abs_diff(y)];
                let (a, n) = look(image, sample);
                (albedo, normal, weight) = (albedo + a * k, normal + n * k, weight + k);
            }
        }
    }
    (albedo / weight, normal.normalize_or_zero())
}

/// Depth and sample that one image puts in each pixel.
fn thrown(to: &Camera, origin: DVec3, image: &LayeredPart, order: SplatOrder) -> Vec<Option<(f32, u32)>> {
    let width = to.size[0] as usize;
    let mut cover: Vec<Option<(f32, u32)>> = vec![None; width * to.size[1] as usize];
    let warp = Warp::new(&image.camera, origin, to);
    let first = image.first_samples();
    let mut throw = |x: u32, y: u32, sample: u32| {
        let i = sample as usize;
        let Some(splat) = warp.splat(x, y, image.depth_at(i), image.normal_at(i)) else { return };
        let [columns, rows] = splat.pixels(to.size);
        for row in rows {
            for c in &mut cover[row as usize * width..][columns.start as usize..columns.end as usize] {
                let hides = order == SplatOrder::OcclusionCompatible
                    || c.is_none_or(|(d, s)| splat.depth < d || (splat.depth == d && sample > s));
                if hides {
                    *c = Some((splat.depth, sample));
                }
            }
        }
    };
    let [columns, rows] = traversal(&image.camera, -warp.offset);
    let w = image.camera.size[0];
    for &y in &rows {
        for &x in &columns {
            let p = (y * w + x) as usize;
            (first[p]..first[p + 1]).rev().for_each(|s| throw(x, y, s));
        }
    }
    cover
}

/// The columns and rows of an image in occlusion-compatible order for a viewer `at` from its eye.
fn traversal(image: &Camera, at: Vec3) -> [Vec<u32>; 2] {
    // Not -0, whose quotients would be on the other side.
    let ahead = at.dot(image.forward) + 0.0;
    let [w, h] = image.size;
    let pixel = |across: f32, low: f32, high: f32, n: u32| {
        // The epipole's column; at no depth it lies infinitely far to one side.
        let t = if across == 0.0 { 0.0 } else { across / ahead };
        ((t - low) / (high - low) * n as f32).clamp(0.0, n as f32) as u32
    };
    let x = pixel(at.dot(image.right), image.left, image.right_tan, w);
    let y = pixel(-at.dot(image.up), -image.top, -image.bottom, h);
    let towards = |e: u32, n: u32| -> Vec<u32> { (0..e).chain((e..n).rev()).collect() };
    let mut order = [towards(x, w), towards(y, h)];
    if ahead < 0.0 {
        order.iter_mut().for_each(|o| o.reverse());
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Of two rays in one plane with both eyes, the one nearer to the epipole may hide the other and is drawn later.
        #[test]
        fn the_order_hides_what_lies_behind(
            at in [-1f32..1.0, -1f32..1.0, -1f32..1.0], x in 0u32..16, y in 0u32..12,
            z in 1f32..20.0, along in 0.05f32..0.95
        ) {
            let image = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.2, [16, 12], 0.01);
            let at = Vec3::from(at);
            let far = image.ray(x as f32 + 0.5, y as f32 + 0.5) * z;
            // A point on the way from the viewer to the far one.
            let near = at.lerp(far, along);
            let Some(px) = image.project(near) else { return Ok(()) };
            let inside = px.x >= 0.0 && px.y >= 0.0 && px.x < 16.0 && px.y < 12.0;
            let (nx, ny) = (px.x as u32, px.y as u32);
            prop_assume!(inside && (nx, ny) != (x, y));
            let [columns, rows] = traversal(&image, at);
            let place = |order: &[u32], v: u32| order.iter().position(|&o| o == v).unwrap();
            prop_assert!(place(&columns, nx) >= place(&columns, x), "column {x} after {nx}, viewer {at}");
            prop_assert!(place(&rows, ny) >= place(&rows, y), "row {y} after {ny}, viewer {at}");
        }
    }

    #[test]
    fn a_viewer_beside_the_image_is_drawn_towards_whatever_the_sign_of_zero() {
        let image = Camera::looking(DVec3::ZERO, Vec3::X, Vec3::Y, 1.2, [16, 12], 0.01);
        let left = -image.right;
        let [columns, _] = traversal(&image, left);
        assert_eq!(columns, (0..16).rev().collect::<Vec<u32>>(), "what is nearer to the viewer comes last");
        assert_eq!(traversal(&image, left * Vec3::new(-0.0, 1.0, 1.0))[0], columns);
    }
}
