//! Which texels of a sample its meshes still show, packed.
//!
//! A triangle shows the rectangle of its picture that it projects to, and look-ups reach half a texel further. Rectangles are gathered in a
//! loose quadtree over the picture: a triangle belongs to the node of its size that holds its middle; a node's rectangle is
//! the union of its triangles'; where a node and its descendants would take nearly as many texels as one rectangle around them all they
//! become one. What no rectangle holds is not stored. O(triangles log triangles).

use std::collections::BTreeMap;

use farfield_core::Camera;
use farfield_core::atlas::Slot;
use farfield_core::image::{SurfaceImage, from_octahedral};
use farfield_core::payload::AtlasPart;

use crate::simplify::Simplified;

/// Texels around a triangle's rectangle: look-ups reach half a texel, and corners may have moved by half a pixel.
const MARGIN: u32 = 1;
/// The smallest node's side, pixels: smaller rectangles cost more in margins and projectors than they save.
const SMALLEST: u32 = 8;
/// A node becomes one rectangle when that has at most so many times the texels of its parts.
const JOIN: f32 = 1.15;

/// A rectangle of a picture with the triangles that it textures.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Patch {
    /// Which picture.
    pub(crate) view: usize,
    /// x, y, width, height.
    pub(crate) rect: [u32; 4],
    /// Triangles of the mesh.
    pub(crate) triangles: Vec<u32>,
}

/// Lowest and highest pixel, the highest excluded.
type Range = ([u32; 2], [u32; 2]);

#[derive(Clone)]
struct Node {
    range: Range,
    triangles: Vec<u32>,
}

/// The patches of a mesh, picture by picture.
pub(crate) fn patches(cameras: &[Camera], mesh: &Simplified) -> Vec<Patch> {
    let mut by_view: Vec<BTreeMap<(u32, [u32; 2]), Node>> = vec![BTreeMap::new(); cameras.len()];
    for (i, t) in mesh.indices.as_chunks::<3>().0.iter().enumerate() {
        let view = mesh.views[i] as usize;
        let range = range(&cameras[view], t.map(|v| mesh.positions[v as usize]));
        let side = (0..2).map(|k| range.1[k] - range.0[k]).max().unwrap_or(1).next_power_of_two().max(SMALLEST);
        let at = [0, 1].map(|k| (range.0[k] + range.1[k]) / 2 / side);
        let node = by_view[view].entry((side, at)).or_insert(Node { range, triangles: vec![] });
        node.range = union(node.range, range);
        node.triangles.push(i as u32);
    }
    let patch = |view: usize, n: Node| {
        let ([x, y], [x1, y1]) = n.range;
        Patch { view, rect: [x, y, x1 - x, y1 - y], triangles: n.triangles }
    };
    let all = |(view, nodes): (usize, BTreeMap<_, Node>)| {
        gather(nodes, cameras[view].size).into_iter().map(move |n| patch(view, n))
    };
    by_view.into_iter().enumerate().flat_map(all).collect()
}

/// Joins nodes from the smallest up. What is given back are rectangles that stay apart.
fn gather(mut level: BTreeMap<(u32, [u32; 2]), Node>, size: [u32; 2]) -> Vec<Node> {
    let mut done: Vec<Node> = vec![];
    let whole = size[0].max(size[1]).next_power_of_two();
    let mut side = SMALLEST;
    while side < whole {
        // Nodes of this size by their parent, with the parent's own.
        let mut families: BTreeMap<[u32; 2], Vec<Node>> = BTreeMap::new();
        let this: Vec<_> = level.range((side, [0; 2])..(side + 1, [0; 2])).map(|(k, _)| *k).collect();
        for key in this {
            if let Some(node) = level.remove(&key) {
                families.entry(key.1.map(|v| v / 2)).or_default().push(node);
            }
        }
        for (at, mut members) in families {
            let key = (side * 2, at);
            let own = level.remove(&key);
            let all = own.iter().chain(&members);
            let sum: u64 = all.clone().map(|n| area(n.range)).sum();
            let joined = all.map(|n| n.range).reduce(union);
            match joined.filter(|j| area(*j) as f32 <= JOIN * sum as f32) {
                Some(range) => {
                    let mut triangles: Vec<u32> = own.into_iter().flat_map(|n| n.triangles).collect();
                    members.iter_mut().for_each(|n| triangles.append(&mut n.triangles));
                    level.insert(key, Node { range, triangles });
                }
                None => {
                    done.append(&mut members);
                    level.extend(own.map(|n| (key, n)));
                }
            }
        }
        side *= 2;
    }
    done.extend(level.into_values());
    for n in &mut done {
        n.triangles.sort_unstable();
        let ([x, y], [x1, y1]) = n.range;
        n.range = (
            [x.saturating_sub(MARGIN), y.saturating_sub(MARGIN)],
            [(x1 + MARGIN).min(size[0]), (y1 + MARGIN).min(size[1])],
        );
    }
    done
}

fn union(a: Range, b: Range) -> Range {
    ([a.0[0].min(b.0[0]), a.0[1].min(b.0[1])], [a.1[0].max(b.1[0]), a.1[1].max(b.1[1])])
}

fn area((lo, hi): Range) -> u64 {
    let side = |k: usize| u64::from(hi[k] - lo[k] + 2 * MARGIN);
    side(0) * side(1)
}

/// The pixels of a picture that a triangle projects to.
fn range(camera: &Camera, corners: [glam::Vec3; 3]) -> Range {
    let [w, h] = camera.size;
    let (mut lo, mut hi) = ([w - 1, h - 1], [1, 1]);
    for p in corners.into_iter().filter_map(|p| camera.project(p)) {
        for (k, v, most) in [(0, p.x, w), (1, p.y, h)] {
            lo[k] = lo[k].min(v.clamp(0.0, (most - 1) as f32) as u32);
            hi[k] = hi[k].max((v.ceil().clamp(1.0, most as f32)) as u32);
        }
    }
    (lo, [0, 1].map(|k| hi[k].max(lo[k] + 1)))
}

/// Copies a patch's texels into its slot.
pub(crate) fn write(atlas: &mut AtlasPart, slot: &Slot, image: &SurfaceImage, patch: &Patch) {
    let [px, py, w, h] = patch.rect;
    let [x, y, ..] = slot.rect;
    let [side, rows] = atlas.size.map(|v| v as usize);
    for row in 0..h {
        for column in 0..w {
            let i = image.at(px + column, py + row);
            let to = (slot.layer as usize * rows + (y + row) as usize) * side + (x + column) as usize;
            atlas.albedo[to] = image.albedo[i];
            let [nx, ny, nz] = from_octahedral(image.normal[i]).to_array().map(|v| (v * 127.5 + 128.0) as u8);
            atlas.normal[to] = if image.hit(i) { [nx, ny, nz, 255] } else { [128, 128, 128, 0] };
        }
    }
}
