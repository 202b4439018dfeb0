//! A ray with what every box and triangle test needs of it, computed once.

use glam::{DVec3, Vec3};

/// A ray: points `origin + t * direction` for t in `t_min..=t_max`. `direction` need not have unit length.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// The origin rounded to 32 bits.
    pub(super) origin: Vec3,
    /// What rounding took from the origin.
    pub(super) rest: Vec3,
    /// 1 / direction; 0 where the ray is parallel to the axis' planes.
    pub(super) inverse: Vec3,
    /// 1 where the direction is negative.
    pub(super) negative: [usize; 3],
    /// Which axes' planes the ray is parallel to.
    pub(super) parallel: [bool; 3],
    /// Whether there is such an axis.
    pub(super) any_parallel: bool,
    /// Rows of the map to Woop's ray space: the ray runs along +z, t is z.
    pub(super) shear: [Vec3; 3],
    /// The least t.
    pub t_min: f32,
    /// The greatest t.
    pub t_max: f32,
}

/// Components smaller than this against the largest count as 0: they move nothing within 32 bits.
const PARALLEL: f32 = 1e-30;

impl Ray {
    /// The ray from `origin` along `direction`. `None` where it has no direction (not finite, or its largest component is not
    /// within 1e-30..1e30), or the origin is not finite in 32 bits.
    pub fn new(origin: DVec3, direction: Vec3, t_min: f32, t_max: f32) -> Option<Self> {
        let size = direction.abs();
        let longest = size.max_element();
        let high = origin.as_vec3();
        if !(direction.is_finite() && (PARALLEL..1.0 / PARALLEL).contains(&longest) && high.is_finite()) {
            return None;
        }
        let least = (PARALLEL * longest).max(1e-37);
        let d = direction.to_array().map(|c| if c.abs() < least { 0.0 } else { c });
        // Woop et al. 2013, section 2.1: z is the axis that the ray follows most; x and y are swapped where it runs
        // backwards, so that triangles keep their winding.
        let z = if size.x == longest {
            0
        } else if size.y == longest {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            (x, y) = (y, x);
        }
        let row = |axis: usize, along: f32, scale: f32| {
            let mut r = [0.0; 3];
            r[axis] = scale;
            r[z] += along;
            Vec3::from_array(r)
        };
        let parallel = d.map(|c| c == 0.0);
        Some(Self {
            origin: high,
            rest: (origin - high.as_dvec3()).as_vec3(),
            inverse: Vec3::from_array(d.map(|c| if c == 0.0 { 0.0 } else { 1.0 / c })),
            negative: d.map(|c| usize::from(c < 0.0)),
            parallel,
            any_parallel: parallel.contains(&true),
            shear: [row(x, -d[x] / d[z], 1.0), row(y, -d[y] / d[z], 1.0), row(z, 0.0, 1.0 / d[z])],
            t_min,
            t_max,
        })
    }
}
