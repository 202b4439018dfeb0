//! Solids as signed distance fields: rounded primitives joined by smooth unions, with relief on top.
//!
//! A [`Solid`] is an ordered list of parts; each is blended into what stands before it with the polynomial smooth minimum
//! (Quilez, "Smooth minimum", 2013): min(a, b) - h^2 k / 4 with h = max(k - |a - b|, 0) / k, which differs from min(a, b) only
//! where the two distances are closer than k. That makes pruning exact: a part whose bounding sphere is farther away than the
//! distance found so far plus k cannot change the result and is skipped. Distances are exact for round cones and boxes and of
//! first order for ellipsoids, hence true to sign everywhere and to size near the surface, which is what the mesher needs.
//! A grid lists the parts near each place ([`Index`]), so that a point costs
//! O(parts near it).

use glam::{Mat3, UVec3, Vec3};
use rayon::prelude::*;

use super::shapes::{Knot, Shape, spline, v};

/// The distance field of a sculpture, negative inside.
pub(super) struct Solid {
    parts: Vec<Part>,
    /// Depth of the fine carving at a point, in the sculpture's units; positive is outward.
    relief: Relief,
    /// Bound of |relief|.
    relief_max: f32,
    /// Lattice spacing, which thin parts are kept thicker than.
    spacing: f32,
    /// Spacing of the finished mesh, which the relief is band-limited to.
    detail: f32,
    seed: u32,
    index: Index,
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

impl Solid {
    /// Nothing yet; `relief_max` bounds what `relief` returns.
    pub(super) fn new(spacing: f32, seed: u32, relief: Relief, relief_max: f32) -> Self {
        Self { parts: Vec::new(), relief, relief_max, spacing, detail: spacing, seed, index: Index::default() }
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

    /// Cuts off what is below the ground and indexes the parts: call it when all parts are there. `detail` is the spacing of the
    /// finished mesh.
    pub(super) fn stand(&mut self, detail: f32) {
        self.detail = detail;
        self.carve_block(v(0.0, -200.0, 0.0), v(400.0, 200.0, 400.0), 0.0, Mat3::IDENTITY, 0.0);
        // Coarse first: the fine grid's cubes need only choose among their coarse cube's parts.
        for cubes_along in [Index::FINE / 4.0, Index::FINE] {
            self.index = Index::of(self, cubes_along);
        }
    }

    /// Distance without relief.
    pub(super) fn smooth_distance(&self, p: Vec3) -> f32 {
        match self.index.near(p) {
            Some(near) => self.blended(near.iter().map(|&i| &self.parts[i as usize]), p),
            None => self.blended(self.parts.iter(), p),
        }
    }

    fn blended<'a>(&self, parts: impl Iterator<Item = &'a Part>, p: Vec3) -> f32 {
        let mut d = f32::MAX;
        for part in parts {
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
        if d.abs() > 4.0 * self.relief_max { d } else { d - (self.relief)(p, self.detail, self.seed) }
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

    /// Spacing of the finished mesh.
    pub(super) fn detail(&self) -> f32 {
        self.detail
    }

    /// Spacing of the lattice.
    pub(super) fn spacing(&self) -> f32 {
        self.spacing
    }

    // Anything thinner than about a cell is lost or torn by the mesher: coarse meshes get thicker legs and horns instead.
    fn thinnest(&self) -> f32 {
        0.72 * self.spacing
    }

    fn cone(&mut self, a: Vec3, ra: f32, b: Vec3, rb: f32, blend: f32, carve: bool) {
        let least = if carve { 0.0 } else { self.thinnest() };
        let (ra, rb) = (ra.max(least), rb.max(least));
        let center = 0.5 * (a + b);
        let shape = Shape::RoundCone { a: a - center, ba: b - a, ra, rb };
        self.parts.push(Part { shape, blend, carve, center, radius: 0.5 * a.distance(b) + ra.max(rb) });
    }

    fn cuboid(&mut self, center: Vec3, half: Vec3, round: f32, axes: Mat3, blend: f32, carve: bool) {
        // Sharp edges come out jagged: they are rounded as far as the mesh needs it.
        let round = round.max(0.9 * self.spacing).min(half.min_element());
        let shape = Shape::Block { turn: axes.transpose(), half: half - round, round };
        self.parts.push(Part { shape, blend, carve, center, radius: half.length() });
    }
}

fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    if k <= 0.0 {
        return a.min(b);
    }
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k * 0.25
}

/// For each cube of a coarse grid over the sculpture the parts that can shape its surface there.
///
/// A part is left out of a cube where it is farther from every point of it than the surface can be, plus the widths of the blends
/// that it could take part in: it neither is the nearest nor blends with what is. With some hundred parts this is what makes big meshes affordable.
#[derive(Default)]
struct Index {
    origin: Vec3,
    size: f32,
    cubes: UVec3,
    starts: Vec<u32>,
    parts: Vec<u16>,
}

impl Index {
    /// Cubes along the longest side.
    const FINE: f32 = 64.0;

    /// Chooses among the parts that the index before it has for a cube's middle.
    fn of(solid: &Solid, cubes_along: f32) -> Self {
        let (lo, hi) = solid.bounds();
        let size = (hi - lo).max_element() / cubes_along;
        let cubes = ((hi - lo) / size).ceil().as_uvec3() + 1;
        // A part's own blend and a quarter (what a blend takes off), and the widest of those after it.
        let mut after = 0.0_f32;
        let mut margins: Vec<f32> = Vec::with_capacity(solid.parts.len());
        for part in solid.parts.iter().rev() {
            margins.push(1.25 * part.blend + after);
            after = after.max(part.blend);
        }
        margins.reverse();
        let half = 0.5 * size * 3.0_f32.sqrt();
        let lists: Vec<Vec<u16>> = (0..cubes.element_product())
            .into_par_iter()
            .map(|i| {
                let cube = UVec3::new(i % cubes.x, i / cubes.x % cubes.y, i / (cubes.x * cubes.y));
                let middle = lo + (cube.as_vec3() + 0.5) * size;
                // Half a diagonal for the part, one for the distance, and as much again since ellipsoid distances are of first order: what
                // is left of them is far below what can be seen (the test holds it to 1/250 of a spacing).
                let reach = solid.smooth_distance(middle).max(0.0) + 3.5 * half;
                let near = |&k: &u16| {
                    let part = &solid.parts[k as usize];
                    let reach = if part.carve { 2.5 * half } else { reach };
                    middle.distance(part.center) - part.radius < reach + margins[k as usize]
                };
                match solid.index.near(middle) {
                    Some(before) => before.iter().copied().filter(near).collect(),
                    None => (0..solid.parts.len() as u16).filter(near).collect(),
                }
            })
            .collect();
        let mut starts = vec![0];
        for list in &lists {
            starts.push(starts[starts.len() - 1] + list.len() as u32);
        }
        Self { origin: lo, size, cubes, starts, parts: lists.concat() }
    }

    fn near(&self, p: Vec3) -> Option<&[u16]> {
        let cube = ((p - self.origin) / self.size).floor();
        if cube.cmplt(Vec3::ZERO).any() || cube.cmpge(self.cubes.as_vec3()).any() {
            return None;
        }
        let c = cube.as_uvec3();
        let i = (c.x + self.cubes.x * (c.y + self.cubes.y * c.z)) as usize;
        let list = &self.parts[self.starts[i] as usize..self.starts[i + 1] as usize];
        // No list: far away from everything, where all parts have to be asked.
        (!list.is_empty()).then_some(list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{creatures, figures, quadrupeds};

    #[test]
    fn the_index_changes_nothing_that_can_be_seen() {
        let makers = [creatures::dragon, creatures::bunny, quadrupeds::horse, quadrupeds::cattle, figures::statue];
        for make in makers {
            let mut solid = make(0.5, 1);
            solid.stand(0.5);
            let (lo, hi) = solid.bounds();
            let mut compared = 0;
            for i in 0..40_000 {
                let t = v(0.754_877_7, 0.569_840_3, 0.438_579_6) * i as f32;
                let p = lo + (hi - lo) * (t - t.floor());
                let all = solid.blended(solid.parts.iter(), p);
                if all.abs() < 0.5 {
                    compared += 1;
                    let near = solid.smooth_distance(p);
                    assert!((near - all).abs() < 0.5 / 250.0, "{near} instead of {all} at {p}");
                }
            }
            assert!(compared > 500, "only {compared} points near the surface");
        }
    }
}
