//! The primitives that sculptures are made of, and curves to string them on.

use glam::{Mat3, Vec3};

/// A solid about the origin.
pub(super) enum Shape {
    /// Convex hull of two balls.
    RoundCone { a: Vec3, ba: Vec3, ra: f32, rb: f32 },
    /// `turn` takes the world to the ellipsoid's axes.
    Ellipsoid { turn: Mat3, radii: Vec3 },
    /// A box of half extents `half` (rounding taken off) and rounding radius `round`.
    Block { turn: Mat3, half: Vec3, round: f32 },
    /// A ring about the turned y axis.
    Ring { turn: Mat3, major: f32, minor: f32 },
}

/// A point of a tube: x, y, z, radius.
pub(super) type Knot = [f32; 4];

/// Shorthand for a vector.
pub(super) const fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Rotation by degrees about x, then y, then z.
pub(super) fn turn(x_deg: f32, y_deg: f32, z_deg: f32) -> Mat3 {
    Mat3::from_rotation_z(z_deg.to_radians())
        * Mat3::from_rotation_y(y_deg.to_radians())
        * Mat3::from_rotation_x(x_deg.to_radians())
}

impl Shape {
    /// Distance of `p`, negative inside: exact, for ellipsoids of first order.
    pub(super) fn distance(&self, p: Vec3) -> f32 {
        match *self {
            Shape::RoundCone { a, ba, ra, rb } => round_cone(p - a, ba, ra, rb),
            Shape::Ellipsoid { turn, radii } => {
                let q = turn * p;
                let k0 = (q / radii).length();
                let k1 = (q / (radii * radii)).length();
                if k1 < 1e-6 { -radii.min_element() } else { k0 * (k0 - 1.0) / k1 }
            }
            Shape::Block { turn, half, round } => {
                let q = (turn * p).abs() - half;
                q.max(Vec3::ZERO).length() + q.max_element().min(0.0) - round
            }
            Shape::Ring { turn, major, minor } => {
                let q = turn * p;
                let r = (q.x * q.x + q.z * q.z).sqrt() - major;
                (r * r + q.y * q.y).sqrt() - minor
            }
        }
    }

    /// Corners of a box that holds it.
    pub(super) fn extent(&self) -> (Vec3, Vec3) {
        let turned = |turn: Mat3, half: Vec3| {
            let t = turn.transpose();
            (t.x_axis * half.x).abs() + (t.y_axis * half.y).abs() + (t.z_axis * half.z).abs()
        };
        match *self {
            Shape::RoundCone { a, ba, ra, rb } => ((a - ra).min(a + ba - rb), (a + ra).max(a + ba + rb)),
            Shape::Ellipsoid { turn, radii } => {
                let e = turned(turn, radii);
                (-e, e)
            }
            Shape::Block { turn, half, round } => {
                let e = turned(turn, half + round);
                (-e, e)
            }
            Shape::Ring { turn, major, minor } => {
                let e = turned(turn, v(major + minor, minor, major + minor));
                (-e, e)
            }
        }
    }
}

/// Exact distance to the hull of a ball of radius `ra` at the origin and one of radius `rb` at `ba` (Quilez, "round cone").
fn round_cone(p: Vec3, ba: Vec3, ra: f32, rb: f32) -> f32 {
    let l2 = ba.length_squared();
    let rr = ra - rb;
    let a2 = l2 - rr * rr;
    if a2 <= 0.0 {
        // One ball holds the other.
        return if ra >= rb { p.length() - ra } else { (p - ba).length() - rb };
    }
    let il2 = 1.0 / l2;
    let y = p.dot(ba);
    let z = y - l2;
    let x2 = (p * l2 - ba * y).length_squared();
    let y2 = y * y * l2;
    let z2 = z * z * l2;
    let k = rr.signum() * rr * rr * x2;
    if z.signum() * a2 * z2 > k {
        return (x2 + z2).sqrt() * il2 - rb;
    }
    if y.signum() * a2 * y2 < k {
        return (x2 + y2).sqrt() * il2 - ra;
    }
    ((x2 * a2 * il2).sqrt() + y * rr) * il2 - ra
}

/// Points of the Catmull-Rom spline through `knots`, `steps` a span, both ends included.
pub(super) fn spline(knots: &[Knot], steps: usize) -> Vec<Knot> {
    let at = |i: isize| knots[i.clamp(0, knots.len() as isize - 1) as usize];
    let mut out = Vec::with_capacity((knots.len() - 1) * steps + 1);
    for i in 0..knots.len() as isize - 1 {
        let [p0, p1, p2, p3] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
        for s in 0..steps {
            let t = s as f32 / steps as f32;
            out.push(std::array::from_fn(|c| {
                let (a, b, c2, d) = (p0[c], p1[c], p2[c], p3[c]);
                0.5 * (2.0 * b
                    + (c2 - a) * t
                    + (2.0 * a - 5.0 * b + 4.0 * c2 - d) * t * t
                    + (3.0 * b - a - 3.0 * c2 + d) * t * t * t)
            }));
        }
    }
    out.push(knots[knots.len() - 1]);
    out
}
