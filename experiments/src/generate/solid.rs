//! Surfaces of revolution, bends and boxes: what pipework and much else is made of; [`super::forms`] has softer forms.
//!
//! Everything is open where another part joins and closed where it is seen; triangles face outward. A pipe part's frame: the pipe
//! runs along x, what sticks out of it (a bend's leg, a tee's branch, a valve's stem) along y. O(triangles).

use std::f32::consts::{FRAC_PI_2, TAU};

use farfield_core::mesh::TriangleMesh;
use glam::{Affine3A, Mat3, Vec3};

/// A point of a profile: along the axis, and away from it.
pub(super) type Knot = [f32; 2];

/// sRGB paint.
pub(super) type Paint = [u8; 3];

/// Cosine of the least angle of a crease, 35 degrees.
pub(super) const CREASE_COS: f32 = 0.82;

/// A mesh in the making.
#[derive(Default)]
pub(super) struct Solid {
    pub(super) mesh: TriangleMesh,
}

impl Solid {
    /// The mesh.
    pub(super) fn finish(self) -> TriangleMesh {
        self.mesh
    }

    pub(super) fn vertex(&mut self, p: Vec3, normal: Vec3, paint: Paint) -> u32 {
        let m = &mut self.mesh;
        m.positions.push(p);
        m.normals.push(normal);
        m.colors.push([paint[0], paint[1], paint[2], 255]);
        m.positions.len() as u32 - 1
    }

    /// Revolves a profile about the x axis of `frame` with `sides` sides. Walked along the profile, with x to the right and away
    /// from the axis up, the outside is on the left: a tube is drawn towards +x. Corners of more than 35 degrees are creases.
    pub(super) fn lathe(&mut self, frame: Affine3A, sides: u32, paint: Paint, profile: &[Knot]) {
        let n = profile.len() - 1;
        // The outward normal of a segment (dx, dr): (-dr, dx) / |(dx, dr)|.
        let slope = |i: usize| {
            let [dx, dr] = [profile[i + 1][0] - profile[i][0], profile[i + 1][1] - profile[i][1]];
            let l = dx.hypot(dr);
            [-dr / l, dx / l]
        };
        let smooth = |a: [f32; 2], b: [f32; 2]| {
            if a[0] * b[0] + a[1] * b[1] < CREASE_COS {
                return None;
            }
            let s = [a[0] + b[0], a[1] + b[1]];
            let l = s[0].hypot(s[1]);
            Some([s[0] / l, s[1] / l])
        };
        for i in 0..n {
            let own = slope(i);
            let before = (i > 0).then(|| smooth(slope(i - 1), own)).flatten().unwrap_or(own);
            let after = (i + 1 < n).then(|| smooth(own, slope(i + 1))).flatten().unwrap_or(own);
            self.band(frame, sides, paint, [profile[i], profile[i + 1]], [before, after]);
        }
    }

    fn band(&mut self, frame: Affine3A, sides: u32, paint: Paint, knots: [Knot; 2], normals: [[f32; 2]; 2]) {
        let first = self.mesh.positions.len() as u32;
        for (k, n) in knots.iter().zip(normals) {
            for j in 0..sides {
                let (s, c) = (TAU * j as f32 / sides as f32).sin_cos();
                let p = frame.transform_point3(Vec3::new(k[0], k[1] * c, k[1] * s));
                let n = frame.transform_vector3(Vec3::new(n[0], n[1] * c, n[1] * s)).normalize();
                self.vertex(p, n, paint);
            }
        }
        for j in 0..sides {
            let (a, b) = (first + j, first + (j + 1) % sides);
            let (c, d) = (a + sides, b + sides);
            if knots[1][1] > 0.0 {
                self.mesh.indices.extend([a, d, c]);
            }
            if knots[0][1] > 0.0 {
                self.mesh.indices.extend([a, b, d]);
            }
        }
    }

    /// A quarter of a torus of radii `major` and `minor`, from (-major, 0, 0) along x to (0, major, 0) along y.
    pub(super) fn bend(&mut self, sides: u32, rings: u32, paint: Paint, major: f32, minor: f32) {
        let first = self.mesh.positions.len() as u32;
        let centre = Vec3::new(-major, major, 0.0);
        for i in 0..=rings {
            let (s, c) = (FRAC_PI_2 * i as f32 / rings as f32).sin_cos();
            let out = Vec3::new(s, -c, 0.0);
            self.ring(centre + out * major, out, minor, sides, paint);
        }
        self.stitch(first, sides, rings, false);
    }

    /// A whole torus about the y axis of `frame`.
    pub(super) fn ring_wheel(&mut self, frame: Affine3A, sides: u32, rings: u32, paint: Paint, radii: [f32; 2]) {
        let from = self.mesh.positions.len();
        for i in 0..rings {
            let (s, c) = (TAU * i as f32 / rings as f32).sin_cos();
            for j in 0..sides {
                let (t, k) = (TAU * j as f32 / sides as f32).sin_cos();
                let normal = Vec3::new(c * k, t, s * k);
                let p = Vec3::new(c, 0.0, s) * radii[0] + normal * radii[1];
                self.vertex(frame.transform_point3(p), frame.transform_vector3(normal).normalize(), paint);
            }
        }
        self.stitch(from as u32, sides, rings, true);
    }

    /// A circle about `centre` in the plane of `out` and z.
    fn ring(&mut self, centre: Vec3, out: Vec3, radius: f32, sides: u32, paint: Paint) {
        for j in 0..sides {
            let (s, c) = (TAU * j as f32 / sides as f32).sin_cos();
            // Starts on the inner side, where a tube's first side is too.
            let normal = -out * c + Vec3::Z * s;
            self.vertex(centre + normal * radius, normal, paint);
        }
    }

    /// Joins consecutive circles of `sides` vertices.
    fn stitch(&mut self, first: u32, sides: u32, rings: u32, closed: bool) {
        for i in 0..rings {
            let next = if closed { (i + 1) % rings } else { i + 1 };
            for j in 0..sides {
                let [a, b] = [j, (j + 1) % sides].map(|k| first + i * sides + k);
                let [c, d] = [j, (j + 1) % sides].map(|k| first + next * sides + k);
                self.mesh.indices.extend([a, b, d, a, d, c]);
            }
        }
    }

    /// A box of half extents `half` about the origin of `frame`.
    pub(super) fn block(&mut self, frame: Affine3A, half: Vec3, paint: Paint) {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let normal = Vec3::AXES[axis] * sign;
                let (u, v) = (Vec3::AXES[(axis + 1) % 3] * sign, Vec3::AXES[(axis + 2) % 3]);
                let n = frame.transform_vector3(normal).normalize();
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(a, b)| self.vertex(frame.transform_point3((normal + u * a + v * b) * half), n, paint));
                let [a, b, c, d] = corners;
                self.mesh.indices.extend([a, b, c, a, c, d]);
            }
        }
    }
}

/// The frame at `origin` whose x axis is `x` and whose y axis is `y`.
pub(super) fn frame(origin: Vec3, x: Vec3, y: Vec3) -> Affine3A {
    Affine3A::from_mat3_translation(Mat3::from_cols(x, y, x.cross(y)), origin)
}

/// What tests ask of meshes.
#[cfg(test)]
pub(super) mod check {
    use std::collections::BTreeMap;

    use farfield_core::mesh::{TriangleMesh, position_ids};

    /// The volume of a mesh whose every edge is run through as often one way as the other; the first edge that is not, else.
    pub(crate) fn closed(mesh: &TriangleMesh) -> Result<f64, String> {
        let ids = position_ids(&mesh.positions);
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        let mut volume = 0.0;
        for t in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[t[k] as usize].as_dvec3());
            volume += a.dot(b.cross(c)) / 6.0;
            for k in 0..3 {
                let (a, b) = (ids[t[k] as usize], ids[t[(k + 1) % 3] as usize]);
                if a != b {
                    *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
                }
            }
        }
        match edges.iter().find(|e| *e.1 != 0) {
            Some(((a, b), n)) => {
                let [a, b] = [a, b].map(|&i| mesh.positions[i as usize]);
                Err(format!("the edge from {a} to {b} is open by {n}"))
            }
            None => Ok(volume),
        }
    }

    /// Whether positions and normals are what they should be, normals agree with the faces, and hardly any triangle is
    /// without area: the first complaint.
    pub(crate) fn sound(mesh: &TriangleMesh) -> Result<(), String> {
        if mesh.normals.len() != mesh.positions.len() || mesh.colors.len() != mesh.positions.len() {
            return Err("an attribute is missing".into());
        }
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            if !p.is_finite() || (n.length() - 1.0).abs() > 1e-3 {
                return Err(format!("normal {n} at {p}"));
            }
        }
        let (mut flat, mut against) = (0, 0);
        for t in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[t[k] as usize].as_dvec3());
            let n = (b - a).cross(c - a);
            let own: glam::DVec3 = t.iter().map(|&i| mesh.normals[i as usize].as_dvec3()).sum();
            flat += usize::from(n.length() < 1e-12);
            against += usize::from(n.length() > 1e-12 && n.dot(own) <= 0.0);
        }
        let all = mesh.triangles();
        if flat > all / 500 || against > all / 500 {
            return Err(format!("of {all} triangles {flat} are flat, {against} turn away from their normals"));
        }
        Ok(())
    }
}
