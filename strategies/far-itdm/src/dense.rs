//! The dense mesh of a sample: two triangles for each pixel that is kept.
//!
//! Follows Wilson and Manocha 2003, section 4.2.1. Pixels of one surface share their corners, over the faces of the cube too, so that the
//! mesh is one: its edges are open where surfaces end and where points were left to an ancestor. O(pixels).

use farfield_core::panorama::{NONE, Panorama, Surface};
use glam::Vec3;

/// A mesh around a sample's eye.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Dense {
    /// Relative to the eye.
    pub(crate) positions: Vec<Vec3>,
    /// Counter-clockwise seen from the eye.
    pub(crate) indices: Vec<u32>,
    /// For each triangle the picture that shows it.
    pub(crate) views: Vec<u8>,
    /// For each vertex the pictures of its triangles, a bit each: more than one on the edges of the cube.
    pub(crate) views_of: Vec<u8>,
}

/// The two triangles of a pixel's corners (top left, top right, bottom right, bottom left), along its shorter diagonal,
/// counter-clockwise seen from the eye.
pub(crate) fn split([tl, tr, br, bl]: [Vec3; 4]) -> [[usize; 3]; 2] {
    if tl.distance_squared(br) <= tr.distance_squared(bl) { [[0, 3, 2], [0, 2, 1]] } else { [[1, 0, 3], [1, 3, 2]] }
}

impl Dense {
    /// The mesh of the pixels that `keep` says.
    pub(crate) fn new(p: &Panorama<'_>, surface: &Surface, keep: &[bool]) -> Self {
        let mut out = Self::default();
        let mut own = vec![NONE; surface.points.len()];
        for view in 0..p.views().len() {
            for pixel in p.of_view(view) {
                let quad = surface.quads[pixel as usize];
                if !keep[pixel as usize] || quad[0] == NONE {
                    continue;
                }
                let own = quad.map(|v| out.vertex(&mut own, surface, v, view as u8));
                let two = split(own.map(|v| out.positions[v as usize]));
                out.indices.extend(two.into_iter().flatten().map(|k| own[k]));
                out.views.extend([view as u8; 2]);
            }
        }
        out
    }

    fn vertex(&mut self, own: &mut [u32], surface: &Surface, v: u32, view: u8) -> u32 {
        let id = &mut own[v as usize];
        if *id == NONE {
            *id = self.positions.len() as u32;
            self.positions.push(surface.points[v as usize]);
            self.views_of.push(0);
        }
        self.views_of[*id as usize] |= 1 << view;
        *id
    }

    /// For each vertex whether more than two of its edges are open: two borders meet there in a point, and neither may take it along.
    pub(crate) fn knots(&self) -> Vec<bool> {
        let edges = || self.indices.as_chunks::<3>().0.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
        let mut all: Vec<[u32; 2]> = edges().collect();
        all.sort_unstable();
        let mut open = vec![0u8; self.positions.len()];
        for [a, b] in edges().filter(|[a, b]| all.binary_search(&[*b, *a]).is_err()) {
            open[a as usize] = open[a as usize].saturating_add(1);
            open[b as usize] = open[b as usize].saturating_add(1);
        }
        open.into_iter().map(|n| n > 2).collect()
    }

    pub(crate) fn triangles(&self) -> usize {
        self.views.len()
    }
}
