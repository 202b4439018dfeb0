//! Soft and swept forms on top of [`Solid`]: rounded boxes, lumpy balls, tubes along a polyline, upright prisms and hanging cloth.
//!
//! All are closed, face outward, and have equal positions, bit for bit, wherever two of their faces meet: each is one welded
//! surface. The number of triangles is said at each. O(triangles).

use std::f32::consts::TAU;

use glam::{Affine3A, Vec2, Vec3};

use super::solid::{Paint, Solid};

/// One of a box's six faces: its outward axis and sign, and the axes that span it, right-handed with the outward one.
fn faces() -> impl Iterator<Item = (usize, bool, usize, usize)> {
    (0..3).flat_map(|k| {
        let (u, v) = ((k + 1) % 3, (k + 2) % 3);
        [(k, true, u, v), (k, false, v, u)]
    })
}

impl Solid {
    /// A box of half extents `half` with rounded edges, `n` chords a quarter of a round: 12 (2 n + 1)^2 triangles; plain where `n` is 0.
    pub(super) fn rounded(&mut self, frame: Affine3A, half: Vec3, round: f32, n: u32, paint: Paint) {
        if n == 0 {
            return self.block(frame, half, paint);
        }
        let round = round.min(half.min_element());
        let inner = half - round;
        let last = 2 * n + 1;
        // Grid lines 0..=n lie on the lower rounding, n + 1..=last on the upper one.
        let line =
            |i: u32| if i <= n { (-1.0, i as f32 / n as f32 - 1.0) } else { (1.0, (i - n - 1) as f32 / n as f32) };
        // tan keeps the chords of a round nearly equal.
        let bow = |t: f32| (t * std::f32::consts::FRAC_PI_4).tan();
        self.gridded(frame, last, paint, |at| {
            let (mut side, mut d) = (Vec3::ZERO, Vec3::ZERO);
            for k in 0..3 {
                let (s, t) = line(at[k]);
                (side[k], d[k]) = (s, bow(t));
            }
            let d = d.normalize();
            (side * inner + d * round, d)
        });
    }

    /// A ball about the origin of `frame`, of radius `radius(direction)` in the frame's units, `n` chords an edge of its cube: 12 n^2
    /// triangles. Normals are those of the lumpy surface.
    pub(super) fn ball(&mut self, frame: Affine3A, n: u32, paint: Paint, radius: impl Fn(Vec3) -> f32) {
        let n = n.max(2);
        let first = self.mesh.positions.len();
        let line = |i: u32| ((2.0 * i as f32 / n as f32 - 1.0) * std::f32::consts::FRAC_PI_4).tan();
        self.gridded(frame, n, paint, |at| {
            let d = Vec3::from_array(at.map(line)).normalize();
            (d * radius(d), d)
        });
        self.smooth(first);
    }

    /// The surface of a cube of `last` x `last` squares a face whose grid points `point` puts somewhere, with a normal.
    fn gridded(&mut self, frame: Affine3A, last: u32, paint: Paint, point: impl Fn([u32; 3]) -> (Vec3, Vec3)) {
        let turn = frame.matrix3.inverse().transpose();
        for (k, high, u, v) in faces() {
            let first = self.mesh.positions.len() as u32;
            for j in 0..=last {
                for i in 0..=last {
                    let mut at = [0; 3];
                    (at[k], at[u], at[v]) = (if high { last } else { 0 }, i, j);
                    let (p, n) = point(at);
                    self.vertex(frame.transform_point3(p), Vec3::from(turn * glam::Vec3A::from(n)).normalize(), paint);
                }
            }
            self.squares(first, last + 1, last, last);
        }
    }

    /// Joins a grid of vertices, rows of `width`, into `across` x `down` squares, counter-clockwise where rows go up.
    fn squares(&mut self, first: u32, width: u32, across: u32, down: u32) {
        for j in 0..down {
            for i in 0..across {
                let a = first + j * width + i;
                self.mesh.indices.extend([a, a + 1, a + width + 1, a, a + width + 1, a + width]);
            }
        }
    }

    /// Area-weighted normals over equal positions for the vertices from `first` on.
    pub(super) fn smooth(&mut self, first: usize) {
        let from = self.mesh.indices.partition_point(|&i| (i as usize) < first);
        let ids = farfield_core::mesh::position_ids(&self.mesh.positions[first..]);
        let mut sums = vec![Vec3::ZERO; ids.len()];
        for t in self.mesh.indices[from..].chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| self.mesh.positions[t[k] as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|&v| sums[ids[v as usize - first] as usize] += n);
        }
        for (n, &i) in self.mesh.normals[first..].iter_mut().zip(&ids) {
            *n = sums[i as usize].try_normalize().unwrap_or(*n);
        }
    }

    /// A closed tube along a polyline, of radius `radius(share of the points passed)`, with flat ends: about 2 sides (points + 1)
    /// triangles. Its sides do not twist.
    pub(super) fn sweep(&mut self, points: &[Vec3], sides: u32, paint: Paint, radius: impl Fn(f32) -> f32) {
        let last = points.len() - 1;
        let along = |i: usize| (points[(i + 1).min(last)] - points[i.saturating_sub(1)]).normalize();
        let mut across = along(0).any_orthonormal_vector();
        let mut rings: Vec<Vec<(Vec3, Vec3)>> = vec![];
        for (i, &p) in points.iter().enumerate() {
            let d = along(i);
            across = (across - d * across.dot(d)).normalize();
            let other = d.cross(across);
            let r = radius(i as f32 / last as f32);
            let spoke = |j: u32| {
                let (s, c) = (TAU * j as f32 / sides as f32).sin_cos();
                let n = across * c + other * s;
                (p + n * r, n)
            };
            rings.push((0..sides).map(spoke).collect());
        }
        let first = self.mesh.positions.len() as u32;
        for (p, n) in rings.iter().flatten() {
            self.vertex(*p, *n, paint);
        }
        for i in 0..last as u32 {
            for j in 0..sides {
                let [a, b] = [j, (j + 1) % sides].map(|k| first + i * sides + k);
                self.mesh.indices.extend([a, b, b + sides, a, b + sides, a + sides]);
            }
        }
        for (ring, n, back) in [(&rings[0], -along(0), true), (&rings[last], along(last), false)] {
            let cap = self.mesh.positions.len() as u32;
            ring.iter().for_each(|q| _ = self.vertex(q.0, n, paint));
            for j in 1..sides - 1 {
                let (b, c) = if back { (j + 1, j) } else { (j, j + 1) };
                self.mesh.indices.extend([cap, cap + b, cap + c]);
            }
        }
    }

    /// The upright prism over a polygon of (x, z) that is counter-clockwise seen from above and star-shaped about `centre`,
    /// from `low` to `high`: 4 triangles a corner. Sides with less than 35 degrees between them are shaded smoothly.
    pub(super) fn prism(
        &mut self,
        frame: Affine3A,
        outline: &[Vec2],
        centre: Vec2,
        [low, high]: [f32; 2],
        paint: Paint,
    ) {
        let n = outline.len();
        let at = |p: Vec2, y: f32| frame.transform_point3(Vec3::new(p.x, y, p.y));
        let direction = |v: Vec3| frame.transform_vector3(v).normalize();
        // Counter-clockwise from above means that x turns towards -z.
        let side = |i: usize| {
            let d = outline[(i + 1) % n] - outline[i];
            Vec3::new(-d.y, 0.0, d.x).normalize()
        };
        for i in 0..n {
            let (own, before, after) = (side(i), side((i + n - 1) % n), side((i + 1) % n));
            let soft = |a: Vec3| if a.dot(own) > super::solid::CREASE_COS { (a + own).normalize() } else { own };
            let (a, b) = (outline[i], outline[(i + 1) % n]);
            let (na, nb) = (direction(soft(before)), direction(soft(after)));
            let [a0, b0, b1, a1] = [(a, low, na), (b, low, nb), (b, high, nb), (a, high, na)]
                .map(|(p, y, n)| self.vertex(at(p, y), n, paint));
            self.mesh.indices.extend([a0, b0, b1, a0, b1, a1]);
        }
        for (y, up) in [(low, false), (high, true)] {
            let normal = direction(if up { Vec3::Y } else { Vec3::NEG_Y });
            let hub = self.vertex(at(centre, y), normal, paint);
            let rim: Vec<u32> = outline.iter().map(|&p| self.vertex(at(p, y), normal, paint)).collect();
            for i in 0..n {
                let (a, b) = (rim[i], rim[(i + 1) % n]);
                self.mesh.indices.extend(if up { [hub, a, b] } else { [hub, b, a] });
            }
        }
    }

    /// Cloth that hangs from y = `high` to `low` over an open line of (x, z), `thick` thick: 8 triangles a point of the line, for `rows` = 1.
    pub(super) fn cloth(&mut self, frame: Affine3A, line: &[Vec2], thick: f32, [low, high]: [f32; 2], paint: Paint) {
        let n = line.len();
        let first = self.mesh.positions.len();
        let off = |i: usize| {
            let d = line[(i + 1).min(n - 1)] - line[i.saturating_sub(1)];
            Vec2::new(-d.y, d.x).normalize() * 0.5 * thick
        };
        // There on one side and back on the other, counter-clockwise from above.
        let ring: Vec<Vec2> = (0..n).map(|i| line[i] + off(i)).chain((0..n).rev().map(|i| line[i] - off(i))).collect();
        let at = |p: Vec2, y: f32| frame.transform_point3(Vec3::new(p.x, y, p.y));
        let m = ring.len() as u32;
        let base = first as u32;
        for y in [low, high] {
            ring.iter().for_each(|&p| _ = self.vertex(at(p, y), Vec3::Y, paint));
        }
        for i in 0..m {
            let (a, b) = (base + i, base + (i + 1) % m);
            self.mesh.indices.extend([a, b, b + m, a, b + m, a + m]);
        }
        self.smooth(first);
        for (y, up) in [(low, false), (high, true)] {
            let normal = frame.transform_vector3(if up { Vec3::Y } else { Vec3::NEG_Y }).normalize();
            let rim: Vec<u32> = ring.iter().map(|&p| self.vertex(at(p, y), normal, paint)).collect();
            for i in 0..n - 1 {
                let (a, b, c, d) = (rim[i], rim[i + 1], rim[2 * n - 2 - i], rim[2 * n - 1 - i]);
                self.mesh.indices.extend(if up { [a, b, c, a, c, d] } else { [a, c, b, a, d, c] });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::generate::solid::check::closed;

    const PAINT: Paint = [200, 100, 50];

    fn volume(make: impl Fn(&mut Solid)) -> f64 {
        let mut solid = Solid::default();
        make(&mut solid);
        closed(&solid.finish()).unwrap()
    }

    /// Every form is one closed, outward surface whose volume is near that of the body it stands for.
    #[test]
    fn forms_are_closed_and_hold_their_volume() {
        let turned = Affine3A::from_rotation_x(0.7) * Affine3A::from_translation(Vec3::new(3.0, -2.0, 5.0));
        let near = |got: f64, want: f64, off: f64| assert!((got / want - 1.0).abs() < off, "{got} for {want}");
        let half = Vec3::new(1.0, 0.4, 0.6);
        near(volume(|s| s.rounded(turned, half, 0.0, 0, PAINT)), 1.92, 1e-4);
        near(volume(|s| s.rounded(turned, half, 0.4, 6, PAINT)), 1.92, 0.15);
        near(volume(|s| s.ball(turned, 16, PAINT, |_| 0.5)), 4.0 / 3.0 * std::f64::consts::PI * 0.125, 0.02);
        let arc: Vec<Vec3> =
            (0..=32).map(|i| Vec3::new((i as f32 * 0.05).sin(), (i as f32 * 0.05).cos(), 0.0)).collect();
        near(volume(|s| s.sweep(&arc, 24, PAINT, |_| 0.1)), 1.6 * std::f64::consts::PI * 0.01, 0.02);
        let square = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)].map(|(x, z)| Vec2::new(x, z));
        near(volume(|s| s.prism(turned, &square, Vec2::ZERO, [0.0, 0.5], PAINT)), 2.0, 1e-4);
        let line: Vec<Vec2> = (0..20).map(|i| Vec2::new(0.1 * i as f32, 0.02 * (i as f32).sin())).collect();
        near(volume(|s| s.cloth(turned, &line, 0.01, [0.0, 2.0], PAINT)), 0.04, 0.05);
    }
}
