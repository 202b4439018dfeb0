//! Texels of captured views: what lies past outlines, and where they lie in the cell's atlases.
//!
//! *Dilation.* A simplified polygon reaches past the captured outline by a few pixels, and bilinear look-ups reach half a texel
//! further: background texels take the colour and normal of the nearest captured one, ring by ring (breadth first), so that no look-up
//! sees background. Their alpha stays 0.
//!
//! *Packing.* Rectangles go into layers of one size with etagere's shelves, tallest first within an object; all of an object's
//! views are in one atlas, so that it depends on one payload. O(texels).

use etagere::{AtlasAllocator, size2};
use farfield_core::Fault;
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

/// Where a rectangle lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slot {
    /// Which atlas.
    pub(crate) atlas: u32,
    /// Its layer.
    pub(crate) layer: u32,
    /// x, y, width, height.
    pub(crate) rect: [u32; 4],
}

/// Atlases for groups of rectangles: an atlas's side and number of layers each, and a slot for each rectangle.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Packing {
    /// Side and layers.
    pub(crate) atlases: Vec<(u32, u32)>,
    /// By group, by rectangle.
    pub(crate) slots: Vec<Vec<Slot>>,
}

/// Packs groups of rectangles; a group's are in one atlas. Atlases have sides of `side` texels, or of the next power of two
/// that holds the largest rectangle, and about `max_layers` layers at most (a group is never divided).
///
/// # Errors
/// [`Fault::Refused`] where a rectangle is larger than any device's textures.
pub(crate) fn pack(groups: &[Vec<[u32; 2]>], side: u32, max_layers: u32) -> Result<Packing, Fault> {
    let all = || groups.iter().flatten();
    let largest = all().map(|s| s[0].max(s[1])).max().unwrap_or(0);
    if largest > 16384 {
        return Err(Fault::Refused(format!("textured-lod-mesh: a picture of {largest} pixels a side: lower density")));
    }
    let area: f64 = all().map(|s| f64::from(s[0]) * f64::from(s[1])).sum();
    // No larger than what there is, no smaller than the largest.
    let enough = ((area * 1.3).sqrt().ceil() as u32).next_power_of_two();
    let side = side.next_power_of_two().min(enough).max(largest.next_power_of_two());
    let mut out = Packing::default();
    let mut layers: Vec<AtlasAllocator> = vec![];
    for group in groups {
        if group.is_empty() {
            out.slots.push(vec![]);
            continue;
        }
        if layers.len() as u32 >= max_layers || out.atlases.is_empty() {
            layers.clear();
            out.atlases.push((side, 0));
        }
        let atlas = out.atlases.len() as u32 - 1;
        let mut order: Vec<usize> = (0..group.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(group[i][1]), i));
        let mut slots = vec![Slot { atlas, layer: 0, rect: [0; 4] }; group.len()];
        for i in order {
            let [w, h] = group[i];
            let size = size2(w as i32, h as i32);
            let mut found = layers.iter_mut().enumerate().find_map(|(k, l)| Some((k, l.allocate(size)?)));
            if found.is_none() {
                layers.push(AtlasAllocator::new(size2(side as i32, side as i32)));
                let k = layers.len() - 1;
                found = layers[k].allocate(size).map(|a| (k, a));
            }
            let Some((k, a)) = found else {
                return Err(Fault::Refused(format!(
                    "textured-lod-mesh: {w} x {h} texels do not fit an atlas of {side}"
                )));
            };
            let at = a.rectangle.min;
            slots[i] = Slot { atlas, layer: k as u32, rect: [at.x as u32, at.y as u32, w, h] };
        }
        if let Some(last) = out.atlases.last_mut() {
            last.1 = layers.len() as u32;
        }
        out.slots.push(slots);
    }
    Ok(out)
}

/// An empty atlas.
pub(crate) fn blank(side: u32, layers: u32) -> AtlasPart {
    let n = side as usize * side as usize * layers as usize;
    AtlasPart { size: [side, side], layers, albedo: vec![[0; 4]; n], normal: vec![[128, 128, 128, 0]; n] }
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
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rectangles_lie_in_their_layer_and_never_on_each_other(
            groups in prop::collection::vec(prop::collection::vec((1u32..300, 1u32..300), 0..7), 0..40), max_layers in 1u32..4
        ) {
            let groups: Vec<Vec<[u32; 2]>> =
                groups.into_iter().map(|g| g.into_iter().map(|(w, h)| [w, h]).collect()).collect();
            let p = pack(&groups, 512, max_layers).unwrap();
            let mut placed: Vec<Slot> = vec![];
            for (group, slots) in groups.iter().zip(&p.slots) {
                prop_assert_eq!(group.len(), slots.len());
                prop_assert!(slots.windows(2).all(|s| s[0].atlas == s[1].atlas));
                for (size, s) in group.iter().zip(slots) {
                    let (side, layers) = p.atlases[s.atlas as usize];
                    prop_assert_eq!([s.rect[2], s.rect[3]], *size);
                    prop_assert!(s.layer < layers && s.rect[0] + s.rect[2] <= side && s.rect[1] + s.rect[3] <= side);
                    for o in placed.iter().filter(|o| (o.atlas, o.layer) == (s.atlas, s.layer)) {
                        let apart = |k: usize| s.rect[k] + s.rect[k + 2] <= o.rect[k] || o.rect[k] + o.rect[k + 2] <= s.rect[k];
                        prop_assert!(apart(0) || apart(1));
                    }
                    placed.push(*s);
                }
            }
        }
    }

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
