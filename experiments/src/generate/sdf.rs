//! Solids as signed distance fields: rounded primitives joined by smooth unions, with relief on top.
//!
//! A [`Solid`] is an ordered list of parts; each is blended into what stands before it with the polynomial smooth minimum
//! (Quilez, "Smooth minimum", 2013): min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k, which differs from min(a, b) only
//! where the two distances are closer than k. That makes pruning exact: a part whose bounding sphere is farther away than the
//! distance found so far plus k cannot change the result and is skipped. Distances are exact for round cones and boxes and of
//! first order for ellipsoids, hence true to sign everywhere and to size near the surface, which is what the mesher needs.
//! O(parts) a point, mostly sphere tests.

use glam::{Mat3, Vec3};

/// The distance field of a sculpture, negative inside.
pub(super) struct Solid {
    parts: Vec<Part>,
    /// Depth of the fine carving at a point, in the sculpture's units; positive is outward.
    relief: Relief,
    /// Bound of |relief|.
    relief_max: f32,
    /// Mesh spacing that the relief is band-limited to and that thin parts are kept thicker than.
    spacing: f32,
    seed: u32,
}

/// Fine carving: place, mesh spacing, seed -> outward displacement.
pub(super) type Relief = fn(Vec3, f32, u32) -> f32;

struct Part {
    shape: Shape,
    /// Blend width; the sign is that of the operation: parts are added or carved away.
    blend: f32,
    carve: bool,
    center: Vec3,
    radius: f32,
}

enum Shape {
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

impl Solid {
    /// Nothing yet; `relief_max` bounds what `relief` returns.
    pub(super) fn new(spacing: f32, seed: u32, relief: Relief, relief_max: f32) -> Self {
        Self { parts: Vec::new(), relief, relief_max, spacing, seed }
    }

    /// Adds a limb: the hull of a ball at `a` and one at `b`.
    pub(super) fn limb(&mut self, a: Vec3, ra: f32, b: Vec3, rb: f32, blend: f32) {
        self.cone(a, ra, b, rb, blend, false);
    }

    /// Adds a ball.
    pub(super) fn ball(&mut self, center: Vec3, radius: f32, blend: f32) {
        self.egg(center, Vec3::splat(radius), Mat3::IDENTITY, blend);
    }

    /// Adds an ellipsoid whose axes are the columns of `axes`.
    pub(super) fn egg(&mut self, center: Vec3, radii: Vec3, axes: Mat3, blend: f32) {
        let radii = radii.max(Vec3::splat(self.thinnest()));
        let shape = Shape::Ellipsoid { turn: axes.transpose(), radii };
        self.parts.push(Part { shape, blend, carve: false, center, radius: radii.max_element() });
    }

    /// Carves an ellipsoid away.
    pub(super) fn carve_egg(&mut self, center: Vec3, radii: Vec3, axes: Mat3, blend: f32) {
        let shape = Shape::Ellipsoid { turn: axes.transpose(), radii };
        self.parts.push(Part { shape, blend, carve: true, center, radius: radii.max_element() });
    }

    /// Adds a box with rounded edges.
    pub(super) fn block(&mut self, center: Vec3, half: Vec3, round: f32, axes: Mat3, blend: f32) {
        self.cuboid(center, half.max(Vec3::splat(self.thinnest())), round, axes, blend, false);
    }

    /// Carves a box with rounded edges away.
    pub(super) fn carve_block(&mut self, center: Vec3, half: Vec3, round: f32, axes: Mat3, blend: f32) {
        self.cuboid(center, half, round, axes, blend, true);
    }

    /// Carves a groove: the hull of two balls.
    pub(super) fn carve_limb(&mut self, a: Vec3, ra: f32, b: Vec3, rb: f32, blend: f32) {
        self.cone(a, ra, b, rb, blend, true);
    }

    /// Adds a ring about the y axis of `axes`.
    pub(super) fn ring(&mut self, center: Vec3, major: f32, minor: f32, axes: Mat3, blend: f32) {
        let minor = minor.max(self.thinnest());
        let shape = Shape::Ring { turn: axes.transpose(), major, minor };
        self.parts.push(Part { shape, blend, carve: false, center, radius: major + minor });
    }

    /// Adds a tube along the Catmull-Rom spline through `knots`, `steps` pieces a span.
    pub(super) fn tube(&mut self, knots: &[Knot], steps: usize, blend: f32) {
        let points = spline(knots, steps);
        for (i, w) in points.windows(2).enumerate() {
            // Pieces of one tube overlap in a ball; a small blend hides the kink, the first piece joins the body.
            let k = if i == 0 { blend } else { 0.25 * w[0][3] };
            self.limb(v(w[0][0], w[0][1], w[0][2]), w[0][3], v(w[1][0], w[1][1], w[1][2]), w[1][3], k);
        }
    }

    /// Distance without relief.
    pub(super) fn smooth_distance(&self, p: Vec3) -> f32 {
        let mut d = f32::MAX;
        for part in &self.parts {
            let lower = p.distance(part.center) - part.radius;
            let skip = if part.carve { lower > part.blend - d } else { lower > d + part.blend };
            if skip {
                continue;
            }
            let s = part.shape.distance(p - part.center);
            d = if part.carve { -smooth_min(-d, s, part.blend) } else { smooth_min(d, s, part.blend) };
        }
        d
    }

    /// Distance of the finished sculpture.
    pub(super) fn distance(&self, p: Vec3) -> f32 {
        let d = self.smooth_distance(p);
        // Relief fades out away from the surface, so that it costs nothing there.
        if d.abs() > 4.0 * self.relief_max { d } else { d - (self.relief)(p, self.spacing, self.seed) }
    }

    /// Gradient of the distance by tetrahedral differences over `step`, and the distance itself: four evaluations.
    pub(super) fn gradient(&self, p: Vec3, step: f32) -> (Vec3, f32) {
        const CORNERS: [Vec3; 4] = [v(1.0, -1.0, -1.0), v(-1.0, -1.0, 1.0), v(-1.0, 1.0, -1.0), v(1.0, 1.0, 1.0)];
        let mut sum = Vec3::ZERO;
        let mut mean = 0.0;
        for c in CORNERS {
            let d = self.distance(p + c * step);
            sum += c * d;
            mean += 0.25 * d;
        }
        (sum / (4.0 * step), mean)
    }

    /// Bound of |relief|.
    pub(super) fn relief_max(&self) -> f32 {
        self.relief_max
    }

    /// A box that holds the whole sculpture.
    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for part in self.parts.iter().filter(|p| !p.carve) {
            let (a, b) = part.shape.extent();
            lo = lo.min(part.center + a - part.blend);
            hi = hi.max(part.center + b + part.blend);
        }
        (lo - self.relief_max, hi + self.relief_max)
    }

    /// The mesh's spacing.
    pub(super) fn spacing(&self) -> f32 {
        self.spacing
    }

    // Anything thinner than about a cell is lost or torn by the mesher: coarse meshes get thicker legs and horns instead.
    fn thinnest(&self) -> f32 {
        0.62 * self.spacing
    }

    fn cone(&mut self, a: Vec3, ra: f32, b: Vec3, rb: f32, blend: f32, carve: bool) {
        let least = if carve { 0.0 } else { self.thinnest() };
        let (ra, rb) = (ra.max(least), rb.max(least));
        let center = 0.5 * (a + b);
        let shape = Shape::RoundCone { a: a - center, ba: b - a, ra, rb };
        self.parts.push(Part { shape, blend, carve, center, radius: 0.5 * a.distance(b) + ra.max(rb) });
    }

    fn cuboid(&mut self, center: Vec3, half: Vec3, round: f32, axes: Mat3, blend: f32, carve: bool) {
        let round = round.min(half.min_element());
        let shape = Shape::Block { turn: axes.transpose(), half: half - round, round };
        self.parts.push(Part { shape, blend, carve, center, radius: half.length() });
    }
}

impl Shape {
    fn distance(&self, p: Vec3) -> f32 {
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

    /// Box about the part's centre.
    fn extent(&self) -> (Vec3, Vec3) {
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

fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    if k <= 0.0 {
        return a.min(b);
    }
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
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
