//! Atlases: rectangles of texels packed into layers of one size.
//!
//! Rectangles go into layers with etagere's shelves, tallest first within a group; all of a group's are in one atlas, so that what is
//! textured from it depends on one payload. O(rectangles log rectangles).

use etagere::{AtlasAllocator, size2};

use glam::{Mat4, Vec3};

use crate::id::LocalPayload;
use crate::payload::{AtlasPart, Projector};
use crate::{Camera, Fault};

/// Where a rectangle lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Which atlas.
    pub atlas: u32,
    /// Its layer.
    pub layer: u32,
    /// x, y, width, height.
    pub rect: [u32; 4],
}

impl Slot {
    /// The projector that throws the slot from a camera's picture, of which it holds the rectangle that begins at the pixel `corner`.
    /// Positions that it is given, plus `offset`, are relative to the camera's eye. With v such a vector and z = v . forward the picture has
    ///
    /// ```text
    /// x = ((v . right) / z - left) sx,   sx = width / (right_tan - left)      pixels from the left
    /// y = (top - (v . up) / z) sy,       sy = height / (top - bottom)         pixels from the top
    /// ```
    ///
    /// and texels are pixels moved from `corner` to the slot's; all rows are multiplied by z, which is w.
    pub fn projector(&self, c: &Camera, corner: [u32; 2], offset: Vec3, atlas: LocalPayload) -> Projector {
        let [x, y] = [0, 1].map(|k| self.rect[k] as f32 - corner[k] as f32);
        let [w, h] = c.size.map(|v| v as f32);
        let (sx, sy) = (w / (c.right_tan - c.left), h / (c.top - c.bottom));
        let row_u = c.right * sx + c.forward * (x - c.left * sx);
        let row_v = c.forward * (y + c.top * sy) - c.up * sy;
        let row = |r: Vec3| r.extend(r.dot(offset));
        let matrix = Mat4::from_cols(row(row_u), row(row_v), row(c.forward), row(c.forward)).transpose();
        Projector { matrix, eye: -offset, atlas, layer: self.layer, rect: self.rect }
    }
}

/// Atlases for groups of rectangles: an atlas's side and number of layers each, and a slot for each rectangle.
#[derive(Debug, Default, PartialEq)]
pub struct Packing {
    /// Side and layers.
    pub atlases: Vec<(u32, u32)>,
    /// By group, by rectangle.
    pub slots: Vec<Vec<Slot>>,
}

/// Packs groups of rectangles; a group's are in one atlas. Atlases have sides of `side` texels, or of the next power of two
/// that holds the largest rectangle, and about `max_layers` layers at most (a group is never divided).
///
/// # Errors
/// [`Fault::Refused`] where a rectangle is larger than any device's textures.
pub fn pack(groups: &[Vec<[u32; 2]>], side: u32, max_layers: u32) -> Result<Packing, Fault> {
    let all = || groups.iter().flatten();
    let largest = all().map(|s| s[0].max(s[1])).max().unwrap_or(0);
    if largest > 16384 {
        return Err(Fault::Refused(format!(
            "a picture of {largest} pixels a side is larger than any texture: lower its density"
        )));
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
                return Err(Fault::Refused(format!("{w} x {h} texels do not fit an atlas of {side}")));
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

/// An empty atlas of layers of this width and height.
pub fn blank(size: [u32; 2], layers: u32) -> AtlasPart {
    let n = size[0] as usize * size[1] as usize * layers as usize;
    AtlasPart { size, layers, albedo: vec![[0; 4]; n], normal: vec![[128, 128, 128, 0]; n] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_projector_sends_a_point_to_the_texel_of_its_pixel(p in [-3f32..3.0, -3f32..3.0, -3f32..3.0]) {
            let p = Vec3::from(p);
            let eye = DVec3::new(20.0, 4.0, -11.0);
            let corners = Aabb { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) }.corners();
            let c = Camera::around(eye, -eye.as_vec3(), corners, 300.0, 2, 0.1).unwrap();
            let slot = Slot { atlas: 0, layer: 3, rect: [100, 40, c.size[0], c.size[1]] };
            let q = slot.projector(&c, [0; 2], (-eye).as_vec3(), LocalPayload(9));
            let (t, px) = (q.matrix * p.extend(1.0), c.project(p - eye.as_vec3()).unwrap());
            prop_assert!((t.x / t.w - 100.0 - px.x).abs() < 0.01 && (t.y / t.w - 40.0 - px.y).abs() < 0.01);
            prop_assert!((t.w - px.z).abs() < 1e-3 && (t.z - px.z).abs() < 1e-3);
        }

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
}
