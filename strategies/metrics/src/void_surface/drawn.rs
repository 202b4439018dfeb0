//! Quadrilaterals in patches that can be passed over as a whole, and the pixels that still ask for something.

use std::ops::Range;

use farfield_core::Aabb;
use farfield_core::panorama::raster::{Raster, Rect};
use glam::Vec3;

/// Quadrilaterals around one eye, neighbours together.
#[derive(Default)]
pub(super) struct Patches {
    points: Vec<Vec3>,
    quads: Vec<[u32; 4]>,
    patches: Vec<(Aabb, Range<usize>)>,
}

impl Patches {
    /// Quadrilaterals over shared points with a key each: those of one key become a patch.
    pub(super) fn new(points: Vec<Vec3>, mut keyed: Vec<(u32, [u32; 4])>) -> Self {
        keyed.sort_by_key(|k| k.0);
        let mut patches = vec![];
        let mut first = 0;
        for patch in keyed.chunk_by(|a, b| a.0 == b.0) {
            let corners = patch.iter().flat_map(|(_, q)| q.map(|v| points[v as usize]));
            patches.push((Aabb::of(corners), first..first + patch.len()));
            first += patch.len();
        }
        Self { points, quads: keyed.into_iter().map(|k| k.1).collect(), patches }
    }

    /// Draws what may lie before the limits; `moved` leads from the raster's eye to the patches'.
    pub(super) fn draw(&self, moved: Vec3, raster: &Raster, tiles: &Tiles, mut f: impl FnMut(usize, f32)) {
        for (bounds, quads) in &self.patches {
            let bounds = Aabb { min: bounds.min + moved, max: bounds.max + moved };
            for view in 0..raster.views() {
                let wanted =
                    raster.footprint(view, &bounds).is_some_and(|(rect, least)| tiles.reach(view, rect, least));
                if wanted {
                    for q in &self.quads[quads.clone()] {
                        raster.quad(view, q.map(|v| self.points[v as usize] + moved), &mut f);
                    }
                }
            }
        }
    }
}

/// Edge of a tile, pixels.
const TILE: u32 = 8;

/// The greatest limit of each square of pixels: what lies deeper interests none of them.
pub(super) struct Tiles {
    views: Vec<(u32, Vec<f32>)>,
}

impl Tiles {
    pub(super) fn new(raster: &Raster, limits: &[f32]) -> Self {
        let of = |view: usize| {
            let [w, h] = raster.camera(view).size;
            let (columns, rows) = (w.div_ceil(TILE), h.div_ceil(TILE));
            let mut greatest = vec![0f32; (columns * rows) as usize];
            for (y, row) in limits[raster.of_view(view)].chunks(w as usize).enumerate() {
                let tiles = &mut greatest[(y as u32 / TILE * columns) as usize..][..columns as usize];
                for (tile, part) in tiles.iter_mut().zip(row.chunks(TILE as usize)) {
                    *tile = part.iter().fold(*tile, |a, &b| a.max(b));
                }
            }
            (columns, greatest)
        };
        Self { views: (0..raster.views()).map(of).collect() }
    }

    /// Whether nothing is asked for any more.
    pub(super) fn done(&self) -> bool {
        self.views.iter().all(|(_, tiles)| tiles.iter().all(|&t| t <= 0.0))
    }

    fn reach(&self, view: usize, rect: Rect, least: f32) -> bool {
        let (columns, tiles) = &self.views[view];
        let [x, y] = [rect.x, rect.y].map(|[from, to]| from / TILE..to.div_ceil(TILE));
        y.into_iter().any(|y| {
            let row = &tiles[(y * columns) as usize..][..*columns as usize];
            row[x.start as usize..x.end as usize].iter().any(|&t| t > 0.0 && t >= least)
        })
    }
}
