//! Panoramic samples: all that one viewpoint sees, with depth, and which of its pixels belong to one surface.
//!
//! A **panorama** is the pictures of one eye, as a rule the six faces of a cube ([`Camera::cube`]); a single window serves as
//! well. Pixels are numbered through all its pictures, and a pixel has eight neighbours, across the edges of the cube too
//! (seven at its corners). [`Joined`] says which neighbours belong to one surface and which edges are *skins*; [`Surface`]
//! covers every pixel's solid angle with a quadrilateral that joins its neighbours' without seams, and stands *walls* where a skin
//! is; [`pixel_solid_angle_sr`] weighs a pixel; [`raster`] draws all that as it is seen from elsewhere.
//!
//! Follows Wilson and Manocha ("Simplifying complex environments using incremental textured depth meshes", 2003, sections 3.3 and
//! 4.2.1). All positions are relative to the panorama's eye, so that they keep their precision wherever it stands.

mod joined;
pub mod raster;
mod solid_angle;
mod surface;
#[cfg(test)]
mod tests;

pub use joined::{Joined, SkinTests};
pub use solid_angle::pixel_solid_angle_sr;
pub use surface::{NONE, Surface};

use glam::{DVec3, Vec2, Vec3};

use crate::Camera;
use crate::image::SurfaceImage;

/// The eight directions to a pixel's neighbours as (x, y), y down the picture, counter-clockwise from the right. Opposite ones are four apart.
pub const AROUND: [(i32, i32); 8] = [(1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1)];

/// About `most` of the points that pictures show, spread over all of them, local frame.
pub fn spread(samples: &[(Camera, SurfaceImage)], most: usize) -> Vec<Vec3> {
    let pixels: usize = samples.iter().map(|s| s.1.depth.len()).sum();
    let every = pixels.div_ceil(most).max(1);
    let of = |(c, image): &(Camera, SurfaceImage)| -> Vec<Vec3> {
        let point = |i: usize| {
            let (x, y) = (i as u32 % c.size[0], i as u32 / c.size[0]);
            let ray = c.ray(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
            (c.eye + ray * f64::from(image.depth[i])).as_vec3()
        };
        (0..image.depth.len()).step_by(every).filter(|&i| image.hit(i)).map(point).collect()
    };
    samples.iter().flat_map(of).collect()
}

/// The pictures of one eye. Pictures do not overlap: a direction is seen in one of them, or in none.
pub struct Panorama<'a> {
    views: &'a [(Camera, SurfaceImage)],
    /// The number of each view's first pixel, and the number of pixels.
    first: Vec<u32>,
    /// For each view the neighbours beyond its border: above, below (from x = -1 on), left, right (from y = 0 on); [`NONE`] where
    /// there is none.
    beyond: Vec<Vec<u32>>,
}

/// A pixel by its picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Which picture.
    pub view: usize,
    /// Column from the left.
    pub x: u32,
    /// Row from the top.
    pub y: u32,
}

impl<'a> Panorama<'a> {
    /// The panorama of pictures that were taken from one eye.
    ///
    /// # Panics
    /// Without a picture.
    pub fn new(views: &'a [(Camera, SurfaceImage)]) -> Self {
        assert!(!views.is_empty(), "a panorama without a picture");
        let mut first = vec![0];
        for (c, _) in views {
            first.push(first[first.len() - 1] + c.size[0] * c.size[1]);
        }
        let mut out = Self { views, first, beyond: vec![] };
        out.beyond = (0..views.len()).map(|v| out.border(v)).collect();
        out
    }

    /// The panoramas of pictures that follow each other eye by eye.
    pub fn group(views: &'a [(Camera, SurfaceImage)]) -> Vec<Self> {
        views.chunk_by(|a, b| a.0.eye == b.0.eye).map(Self::new).collect()
    }

    /// Where it was taken, local frame.
    pub fn eye(&self) -> DVec3 {
        self.views[0].0.eye
    }

    /// Its pictures.
    pub fn views(&self) -> &'a [(Camera, SurfaceImage)] {
        self.views
    }

    /// Number of pixels in all its pictures.
    pub fn pixels(&self) -> u32 {
        self.first[self.views.len()]
    }

    /// The pixel numbers of a picture.
    pub fn of_view(&self, view: usize) -> std::ops::Range<u32> {
        self.first[view]..self.first[view + 1]
    }

    /// Where a pixel is.
    pub fn place(&self, pixel: u32) -> Place {
        let view = self.first.partition_point(|&f| f <= pixel) - 1;
        let (i, w) = (pixel - self.first[view], self.views[view].0.size[0]);
        Place { view, x: i % w, y: i / w }
    }

    /// The number of a pixel.
    pub fn pixel(&self, at: Place) -> u32 {
        self.first[at.view] + at.y * self.views[at.view].0.size[0] + at.x
    }

    /// Depth along the axis of the pixel's picture, scene units; infinite where nothing was hit.
    pub fn depth(&self, pixel: u32) -> f32 {
        let view = self.first.partition_point(|&f| f <= pixel) - 1;
        self.views[view].1.depth[(pixel - self.first[view]) as usize]
    }

    /// The surface point of a pixel's centre, relative to the eye; not finite where nothing was hit.
    pub fn point(&self, pixel: u32) -> Vec3 {
        let at = self.place(pixel);
        let (camera, image) = &self.views[at.view];
        camera.ray(at.x as f32 + 0.5, at.y as f32 + 0.5) * image.depth[image.at(at.x, at.y)]
    }

    /// The pixel towards a direction; `None` where no picture shows it.
    pub fn look(&self, towards: Vec3) -> Option<Place> {
        let (view, at) = self.project(towards)?;
        Some(Place { view, x: at.x as u32, y: at.y as u32 })
    }

    /// The picture that shows a direction, and where in it, pixels from its top left.
    pub fn project(&self, towards: Vec3) -> Option<(usize, Vec2)> {
        let within = |view: usize| {
            let (c, _) = &self.views[view];
            let p = c.project(towards)?;
            let shown = p.x >= 0.0 && p.y >= 0.0 && p.x < c.size[0] as f32 && p.y < c.size[1] as f32;
            shown.then_some((view, p.truncate()))
        };
        // Most often the picture whose axis is nearest; rounding may put an edge into another one.
        let along = |v: &usize| self.views[*v].0.forward.dot(towards);
        let nearest = (0..self.views.len()).max_by(|a, b| along(a).total_cmp(&along(b)))?;
        within(nearest).or_else(|| (0..self.views.len()).filter(|&v| v != nearest).find_map(within))
    }

    /// The least of the depths at the four pixel centres around a direction, and that direction's own depth a unit of length along
    /// it (so that a point p has depth 'factor |towards|'): what a bilinear look-up would mix. `None` where no picture shows it.
    pub fn nearest_around(&self, towards: Vec3) -> Option<(f32, f32)> {
        let (view, at) = self.project(towards)?;
        let (c, image) = &self.views[view];
        let [w, h] = c.size;
        let (x, y) = ((at.x - 0.5).max(0.0) as u32, (at.y - 0.5).max(0.0) as u32);
        let (x1, y1) = ((x + 1).min(w - 1), (y + 1).min(h - 1));
        let depth = |x: u32, y: u32| image.depth[image.at(x, y)];
        let least = depth(x, y).min(depth(x1, y)).min(depth(x, y1)).min(depth(x1, y1));
        Some((least, c.forward.dot(towards)))
    }

    /// The neighbour of a pixel in one of the directions of [`AROUND`]; [`NONE`] where there is none.
    pub fn neighbour(&self, pixel: u32, direction: usize) -> u32 {
        self.beside(self.place(pixel), direction)
    }

    /// As [`Panorama::neighbour`].
    pub fn beside(&self, at: Place, direction: usize) -> u32 {
        let [w, h] = self.views[at.view].0.size;
        let (dx, dy) = AROUND[direction];
        let (x, y) = (at.x as i32 + dx, at.y as i32 + dy);
        let beyond = &self.beyond[at.view];
        let row = w as usize + 2;
        if y < 0 {
            beyond[(x + 1) as usize]
        } else if y >= h as i32 {
            beyond[row + (x + 1) as usize]
        } else if x < 0 {
            beyond[2 * row + y as usize]
        } else if x >= w as i32 {
            beyond[2 * row + h as usize + y as usize]
        } else {
            self.first[at.view] + y as u32 * w + x as u32
        }
    }

    /// The ray to a pixel's corner (0: top left, 1: top right, 2: bottom right, 3: bottom left); depth along the picture's axis 1.
    pub fn corner_ray(&self, at: Place, corner: usize) -> Vec3 {
        let (dx, dy) = [(0, 0), (1, 0), (1, 1), (0, 1)][corner];
        self.views[at.view].0.ray((at.x + dx) as f32, (at.y + dy) as f32)
    }

    /// The neighbours beyond a picture's border.
    fn border(&self, view: usize) -> Vec<u32> {
        let c = &self.views[view].0;
        let [w, h] = c.size;
        // Just over the edge's middle: between pictures that meet in a cube's edge, pixels lie side by side.
        let over = 0.25 / w.max(h) as f32;
        let look = |x: f32, y: f32, out: Vec3| {
            let found = self.look(c.ray(x, y) + out * over).filter(|p| p.view != view);
            found.map_or(NONE, |p| self.pixel(p))
        };
        // A corner's neighbour over two edges does not exist.
        let row = |y: f32, out: Vec3| {
            let inner = (0..w).map(move |x| look(x as f32 + 0.5, y, out));
            std::iter::once(NONE).chain(inner).chain(std::iter::once(NONE))
        };
        let column = |x: f32, out: Vec3| (0..h).map(move |y| look(x, y as f32 + 0.5, out));
        let mut out: Vec<u32> = row(0.0, c.up).chain(row(h as f32, -c.up)).collect();
        out.extend(column(0.0, -c.right).chain(column(w as f32, c.right)));
        out
    }
}
