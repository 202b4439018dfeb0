//! Texels of captured views: what lies past outlines.
//!
//! A simplified polygon reaches past the captured outline by a few pixels, and bilinear look-ups reach half a texel
//! further: background texels take the colour and normal of the nearest captured one, ring by ring (breadth first), so that no look-up
//! sees background. Their alpha stays 0. O(texels).

use farfield_core::atlas::Slot;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::payload::AtlasPart;

/// Albedo and normals of one view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Texels {
    pub(crate) size: [u32; 2],
    pub(crate) albedo: Vec<[u8; 4]>,
    pub(crate) normal: Vec<[u8; 4]>,
}

/// A picture's texels, with `rings` rings of its background filled.
pub(crate) fn texels(image: &SurfaceImage, rings: u32) -> Texels {
    let [w, h] = image.size;
    let mut out =
        Texels { size: image.size, albedo: image.albedo.clone(), normal: vec![[128, 128, 128, 0]; image.depth.len()] };
    let mut filled: Vec<bool> = (0..image.depth.len()).map(|i| image.hit(i)).collect();
    for (i, n) in out.normal.iter_mut().enumerate().filter(|(i, _)| filled[*i]) {
        let [x, y, z] = from_octahedral(image.normal[i]).to_array().map(|v| (v * 127.5 + 128.0) as u8);
        *n = [x, y, z, 255];
    }
    let neighbours = |i: u32| {
        let (x, y) = (i % w, i / w);
        [(x > 0).then(|| i - 1), (x + 1 < w).then(|| i + 1), (y > 0).then(|| i - w), (y + 1 < h).then(|| i + w)]
    };
    let mut front: Vec<u32> = (0..w * h)
        .filter(|&i| filled[i as usize] && neighbours(i).into_iter().flatten().any(|n| !filled[n as usize]))
        .collect();
    for _ in 0..rings {
        let mut next = vec![];
        for i in front {
            for n in neighbours(i).into_iter().flatten() {
                if !std::mem::replace(&mut filled[n as usize], true) {
                    let ([r, g, b, _], [x, y, z, _]) = (out.albedo[i as usize], out.normal[i as usize]);
                    out.albedo[n as usize] = [r, g, b, 0];
                    out.normal[n as usize] = [x, y, z, 0];
                    next.push(n);
                }
            }
        }
        front = next;
    }
    out
}

/// Copies texels to their slot.
pub(crate) fn write(atlas: &mut AtlasPart, slot: &Slot, texels: &Texels) {
    let [x, y, w, h] = slot.rect.map(|v| v as usize);
    let side = atlas.size[0] as usize;
    for row in 0..h {
        let to = (slot.layer as usize * atlas.size[1] as usize + y + row) * side + x;
        atlas.albedo[to..to + w].copy_from_slice(&texels.albedo[row * w..(row + 1) * w]);
        atlas.normal[to..to + w].copy_from_slice(&texels.normal[row * w..(row + 1) * w]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::image::octahedral;
    use glam::Vec3;

    #[test]
    fn background_takes_the_nearest_texel_ring_by_ring_and_stays_background() {
        let (w, h) = (9u32, 5u32);
        let mut image = SurfaceImage {
            size: [w, h],
            albedo: vec![[0; 4]; 45],
            normal: vec![0; 45],
            depth: vec![f32::INFINITY; 45],
            object: vec![0; 45],
        };
        for (x, c) in [(1, [200, 0, 0, 255]), (7, [0, 0, 90, 255])] {
            let i = image.at(x, 2);
            (image.albedo[i], image.normal[i], image.depth[i], image.object[i]) = (c, octahedral(Vec3::X), 1.0, 1);
        }
        let t = texels(&image, 2);
        assert_eq!(t.albedo[image.at(1, 2)], [200, 0, 0, 255]);
        assert_eq!(t.albedo[image.at(2, 2)], [200, 0, 0, 0]);
        assert_eq!(t.albedo[image.at(3, 2)], [200, 0, 0, 0]);
        assert_eq!(t.albedo[image.at(5, 2)], [0, 0, 90, 0]);
        assert_eq!(t.albedo[image.at(4, 2)], [0; 4], "three rings away");
        assert_eq!(t.normal[image.at(0, 2)], [255, 128, 128, 0]);
        assert!(texels(&image, 40).albedo.iter().all(|c| *c != [0; 4]));
    }
}
