//! What `hausdorff` and `appearance` price edges by: how far the original vertices lie from what the collapse would leave.
//!
//! Every dead vertex is kept under the triangle that covers it and looked at again whenever that triangle changes, so that prices are
//! distances from the original, never sums of steps: what one collapse moves up and the next one down costs the larger of the two. Between vertices
//! a price is an estimate; at the end [`Measure`] finds a bound of the whole.
//!
//! A patch, the triangles that a collapse moves, is projected onto the plane across the sum of the old triangles' areas; a vertex lies
//! under the new triangle that covers it there. Where the projection folds, or nothing covers it (a border that moved), it lies under
//! the nearest triangle. O(vertices under the patch) a price.

use farfield_core::bvh::nearest_on_triangle;
use farfield_core::collapse::{Candidate, Cost, LiveMesh, Place, Reach};
use farfield_core::strategy::MeshView;
use glam::{Vec2, Vec3};

use crate::appearance::Looks;
use crate::measured::Measure;

/// How far parts of an edge or of a triangle may lie outside it after rounding.
const ROUNDING: f32 = 1e-4;
/// What is kept free for what lies between vertices: on scans the bound of the whole was up to 1.5 times what vertices gave, but for a few
/// triangles in a hundred less than 1.1 times. What turns out to need more is taken back.
pub(crate) const MARGIN: f32 = 1.1;
/// Prices are estimates, told apart to such a part of what may be paid: symmetric ones, as those of a vertex onto either end of the edge that
/// it leaves behind, are equal then, and order decides between them, not rounding.
const STEPS: f32 = 64.0;
/// No vertex.
const NONE: u32 = u32::MAX;

/// The distance of the original vertices from the surface that is left, in pixels, with what they look like where that counts.
pub(crate) struct Deviation<'a> {
    px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
    /// Costs above it are as good as infinite.
    most: f32,
    mesh: MeshView<'a>,
    looks: Option<Looks<'a>>,
    under: Under,
    /// Vertices that died on a border.
    border: Vec<bool>,
    /// For each triangle the most that vertices and their looks were ever off on it, scene units; nothing where looks do not count.
    looked: Vec<f32>,
    patch: Patch,
    measure: Option<Measure<'a>>,
}

/// For each triangle the dead vertices that it covers: lists through the vertices.
struct Under {
    first: Vec<u32>,
    next: Vec<u32>,
}

/// What a collapse moves.
#[derive(Default)]
struct Patch {
    /// Triangles that vanish.
    gone: Vec<u32>,
    /// Those that stay, with their new corners: the survivor first.
    moved: Vec<Moved>,
    /// Unit normal of the plane that all is projected onto; zero where that folds it.
    normal: Vec3,
    across: Vec3,
    up: Vec3,
    /// The survivor's position.
    onto: Vec3,
    /// Where the dying vertex is on a border and goes along it: the other end of the border's new edge.
    end: Option<u32>,
    /// Then: that edge, and other edges of its triangle and of the one that vanishes that are borders.
    edges: Vec<[u32; 2]>,
    /// Neighbours that the dying vertex had beside the survivor, projected, with their heights.
    spokes: Vec<(Vec2, f32)>,
    /// The original vertices that lie under it, with the triangles that they lay under.
    covered: Vec<(u32, Option<u32>)>,
}

/// A triangle after the collapse, from the survivor.
#[derive(Clone, Copy)]
struct Moved {
    triangle: u32,
    corners: [u32; 3],
    /// Projected, from the survivor.
    a: Vec2,
    b: Vec2,
    /// Heights over the survivor.
    heights: [f32; 2],
    /// The cosine of its tilt against the plane: of a height over it, what is distance.
    upright: f32,
}

/// Where a vertex lies on the new surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// Of the patch's.
    moved: usize,
    /// The triangle's corners and the weights of them.
    pub(crate) corners: [u32; 3],
    pub(crate) weights: [f32; 3],
    /// Distance, scene units.
    off: f32,
}

impl<'a> Deviation<'a> {
    /// `most` is the cost above which nothing is collapsed.
    pub(crate) fn new(
        mesh: MeshView<'a>,
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        looks: Option<Looks<'a>>,
        most: f32,
    ) -> Self {
        let under = Under { first: vec![NONE; mesh.indices.len() / 3], next: vec![NONE; mesh.positions.len()] };
        let border = vec![false; mesh.positions.len()];
        let looked = vec![0.0; mesh.indices.len() / 3];
        Self { px, most, mesh, looks, under, border, looked, patch: Patch::default(), measure: None }
    }

    /// The most pixels that a length takes at a place.
    fn pixels(&self, p: Vec3, length: f32) -> f32 {
        Vec3::AXES.iter().map(|&x| (self.px)(p, p + x * length)).fold(0.0, f32::max)
    }

    /// The cost of `from` going onto `onto`, pixels.
    fn price(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> f32 {
        let p = mesh.position(from);
        let length = p.distance(mesh.position(onto));
        let scale = if length > 0.0 { self.pixels(p, length) / length } else { 0.0 };
        if !self.patch.gather(mesh, from, onto) {
            return f32::INFINITY;
        }
        let limit = if scale > 0.0 { self.most / (MARGIN * scale) } else { f32::INFINITY };
        // Where nothing projects, its triangles follow the dying vertex: no point moves farther than it does.
        let mut most = if self.patch.normal == Vec3::ZERO { length } else { 0.0 };
        if most > limit {
            return f32::INFINITY;
        }
        let off = |v: u32, bordering: bool| {
            let foot = self.patch.foot(mesh, self.mesh.positions, self.looks.as_ref(), v);
            // Where no triangle moves nothing is left to show what it looks like.
            let lost = if self.looks.is_some() { f32::INFINITY } else { length };
            let mut off = foot.map_or(lost, |(_, off)| off);
            if bordering && !self.patch.edges.is_empty() {
                let p = self.mesh.positions[v as usize];
                let edges = self.patch.edges.iter().map(|&[a, b]| from_segment(p, mesh.position(a), mesh.position(b)));
                off = off.max(edges.fold(f32::INFINITY, f32::min));
            }
            off
        };
        // The dying vertex decides most often.
        most = most.max(off(from, true));
        if most > limit {
            return f32::INFINITY;
        }
        if self.patch.normal != Vec3::ZERO {
            most = most.max(self.patch.crossed(p));
            if most > limit {
                return f32::INFINITY;
            }
        }
        let at_end = |m: &&Moved| self.patch.end.is_some_and(|e| m.corners.contains(&e));
        let gone = self.patch.gone.iter().map(|&t| (t, true));
        for (t, bordering) in gone.chain(self.patch.moved.iter().map(|m| (m.triangle, at_end(&m)))) {
            let mut v = self.under.first[t as usize];
            while v != NONE {
                most = most.max(off(v, bordering && self.border[v as usize]));
                if most > limit {
                    return f32::INFINITY;
                }
                v = self.under.next[v as usize];
            }
        }
        let step = if self.most < f32::MAX { self.most / STEPS } else { 0.0 };
        let cost = if step > 0.0 { (most * scale / step).round() * step } else { most * scale };
        if cost.is_finite() { cost } else { f32::INFINITY }
    }
}

impl Cost for Deviation<'_> {
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]) {
        for (&[a, b], out) in edges.iter().zip(out) {
            let mut way = |from: u32, onto: u32| {
                if mesh.is_locked(from) { f32::INFINITY } else { self.price(mesh, from, onto) }
            };
            let (first, second) = (way(b, a), way(a, b));
            *out = if first <= second {
                Candidate { cost: first, place: Place::First }
            } else {
                Candidate { cost: second, place: Place::Second }
            };
        }
    }

    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, _at: Vec3) {
        self.patch.gather(mesh, from, onto);
        self.border[from as usize] = mesh.is_border(from);
        let Self { patch, under, .. } = self;
        let mut covered = std::mem::take(&mut patch.covered);
        covered.clear();
        covered.push((from, None));
        for t in patch.gone.iter().copied().chain(patch.moved.iter().map(|m| m.triangle)) {
            let mut v = std::mem::replace(&mut under.first[t as usize], NONE);
            while v != NONE {
                covered.push((v, Some(t)));
                v = under.next[v as usize];
            }
        }
        for &(v, was) in &covered {
            let foot = patch.foot(mesh, self.mesh.positions, self.looks.as_ref(), v);
            let over = || foot.map(|(f, _)| patch.moved[f.moved].triangle);
            let of_border = || {
                was.filter(|t| !patch.gone.contains(t))
                    .or_else(|| patch.heir(mesh, [from, onto], was, self.mesh.positions[v as usize]))
            };
            let own = if self.border[v as usize] { of_border().or_else(over) } else { over() };
            let other = || mesh.triangles_of(onto).iter().copied().find(|t| !patch.gone.contains(t));
            if let Some(t) = own.or_else(other) {
                if let (Some(_), Some((_, off))) = (&self.looks, foot) {
                    self.looked[t as usize] = self.looked[t as usize].max(off);
                }
                under.next[v as usize] = std::mem::replace(&mut under.first[t as usize], v);
            }
        }
        patch.covered = covered;
    }

    fn verifies(&self) -> bool {
        true
    }

    /// A bound of the two-sided distance, and what dead vertices look like.
    fn verify(&mut self, mesh: &LiveMesh) -> Vec<f32> {
        let length = |t: u32| mesh.position(mesh.corners(t)[0]).distance(mesh.position(mesh.corners(t)[1]));
        let scale = |t: u32| self.pixels(mesh.position(mesh.corners(t)[0]), length(t)) / length(t);
        let living = || (0..mesh.all_triangles() as u32).filter(|&t| mesh.is_alive(t));
        // How fine is measured goes by what may be paid, at the most pixels a length.
        let scale = living().map(scale).filter(|s| s.is_finite()).fold(0.0, f32::max);
        let fine = if scale > 0.0 { self.most / scale } else { 0.0 };
        let measure = self.measure.get_or_insert_with(|| Measure::new(self.mesh.positions, self.mesh.indices));
        let mut off = measure.off(mesh, fine);
        let original = |t: u32| [0, 1, 2].map(|k| self.mesh.indices[3 * t as usize + k]);
        for t in living().filter(|&t| mesh.corners(t) != original(t)) {
            off[t as usize] = off[t as usize].max(self.looked[t as usize]);
        }
        for t in living().filter(|&t| off[t as usize] > 0.0).collect::<Vec<_>>() {
            let px = mesh.corners(t).map(|v| self.pixels(mesh.position(v), off[t as usize]));
            off[t as usize] = px.into_iter().fold(0.0, f32::max);
        }
        off
    }

    fn reach(&self) -> Reach {
        Reach::Ring
    }
}

fn from_segment(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(a + along * if t.is_nan() { 0.0 } else { t })
}

impl Patch {
    /// Whether what vanishes stays on the surface, as an edge.
    fn gather(&mut self, mesh: &LiveMesh, from: u32, onto: u32) -> bool {
        self.gone.clear();
        self.moved.clear();
        (self.onto, self.normal) = (mesh.position(onto), Vec3::ZERO);
        let p = mesh.position(from);
        let mut sum = Vec3::ZERO;
        for &t in mesh.triangles_of(from) {
            let c = mesh.corners(t);
            let k = usize::from(c[1] == from) + 2 * usize::from(c[2] == from);
            let [x, y] = [c[(k + 1) % 3], c[(k + 2) % 3]];
            sum += (mesh.position(x) - p).cross(mesh.position(y) - p);
            if x == onto || y == onto {
                self.gone.push(t);
            } else {
                let (a, b, heights) = (Vec2::ZERO, Vec2::ZERO, [0.0; 2]);
                self.moved.push(Moved { triangle: t, corners: [onto, x, y], a, b, heights, upright: 1.0 });
            }
        }
        // A triangle that vanishes becomes an edge: one that nobody else has would be no surface.
        let third = |t: u32| mesh.corners(t).into_iter().find(|&v| v != from && v != onto);
        let whole = self.gone.iter().all(|&t| {
            let Some(x) = third(t) else { return false };
            let stays = |&o: &u32| mesh.corners(o).contains(&x) && !self.gone.contains(&o);
            self.moved.iter().any(|m| m.corners[1] == x || m.corners[2] == x)
                || mesh.triangles_of(onto).iter().any(stays)
        });
        self.end = self.border_end(mesh, from, onto);
        self.edges.clear();
        if let Some(end) = self.end {
            self.edges.push([onto, end]);
            let alone =
                |a: u32, b: u32| mesh.triangles_of(a).iter().filter(|&&t| mesh.corners(t).contains(&b)).count() == 1;
            self.edges
                .extend(self.gone.iter().filter_map(|&t| third(t)).filter(|&x| alone(onto, x)).map(|x| [onto, x]));
            let outer = self.moved.iter().map(|m| [m.corners[1], m.corners[2]]).filter(|c| c.contains(&end));
            self.edges.extend(outer.filter(|&[x, y]| alone(x, y)));
        }
        // On a border only a collapse along it is looked at as a patch.
        if whole
            && (self.end.is_some() || !mesh.is_border(from))
            && let Some(normal) = sum.try_normalize()
        {
            self.project(mesh, normal);
        }
        whole
    }

    fn border_end(&self, mesh: &LiveMesh, from: u32, onto: u32) -> Option<u32> {
        let &[gone] = &self.gone[..] else { return None };
        let third = mesh.corners(gone).into_iter().find(|&v| v != from && v != onto);
        let pairs = || self.moved.iter().flat_map(|m| [m.corners[1], m.corners[2]]);
        let mut once = pairs().filter(|&v| Some(v) != third && pairs().filter(|&o| o == v).count() == 1);
        if self.moved.is_empty() { third } else { once.next() }
    }

    /// The moved triangle that gets a vertex of the border of one that vanishes: with the border's new edge, or with the edge to its third
    /// corner, whichever is nearer.
    fn heir(&self, mesh: &LiveMesh, [from, onto]: [u32; 2], gone: Option<u32>, p: Vec3) -> Option<u32> {
        let third = gone.and_then(|t| mesh.corners(t).into_iter().find(|&v| v != from && v != onto));
        let off = |&v: &u32| from_segment(p, self.onto, mesh.position(v));
        let next = self.end.into_iter().chain(third).min_by(|a, b| off(a).total_cmp(&off(b)))?;
        self.moved.iter().find(|m| m.corners.contains(&next)).map(|m| m.triangle)
    }

    /// Onto the plane across a normal, if no new triangle folds over.
    fn project(&mut self, mesh: &LiveMesh, normal: Vec3) {
        (self.across, self.up) = normal.any_orthonormal_pair();
        for m in &mut self.moved {
            let [a, b] = [m.corners[1], m.corners[2]].map(|v| mesh.position(v) - self.onto);
            (m.a, m.b) = (Vec2::new(a.dot(self.across), a.dot(self.up)), Vec2::new(b.dot(self.across), b.dot(self.up)));
            m.heights = [a.dot(normal), b.dot(normal)];
            let (flat, area) = (m.a.perp_dot(m.b), a.cross(b).length());
            // Written so that NaN folds.
            if !(flat > 0.0 && area > 0.0) {
                return;
            }
            m.upright = (flat / area).min(1.0);
        }
        self.normal = normal;
        self.spokes.clear();
        for m in &self.moved {
            self.spokes.push((m.a, m.heights[0]));
            if self.moved.iter().all(|o| o.corners[1] != m.corners[2]) {
                self.spokes.push((m.b, m.heights[1]));
            }
        }
    }

    /// The largest distance of edges that go from edges that take their place, where they cross, scene units: no vertex need lie between
    /// a sliver's long edge and the surface.
    fn crossed(&self, from: Vec3) -> f32 {
        let from = from - self.onto;
        let (flat, height) = (Vec2::new(from.dot(self.across), from.dot(self.up)), from.dot(self.normal));
        let mut most = 0f32;
        for &(x, hx) in &self.spokes {
            let d = x - flat;
            for &(y, hy) in &self.spokes {
                // flat + s d = t y
                let area = d.perp_dot(y);
                let (s, t) = (-flat.perp_dot(y) / area, -flat.perp_dot(d) / area);
                if s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0 {
                    most = most.max((height + s * (hx - height) - t * hy).abs());
                }
            }
        }
        most
    }

    /// Where a vertex lies on the new surface, and how far it and its looks are off there, scene units. Of several triangles, on an edge, the one
    /// that is nearest, so that rounding does not choose. `None` where no triangle moves.
    fn foot(&self, mesh: &LiveMesh, positions: &[Vec3], looks: Option<&Looks<'_>>, v: u32) -> Option<(Foot, f32)> {
        let at = positions[v as usize];
        let off = |f: &Foot| looks.map_or(f.off, |l| f.off.hypot(l.off(positions, v, f)));
        let mut best: Option<(Foot, f32)> = None;
        if self.normal != Vec3::ZERO {
            let from = at - self.onto;
            let (flat, height) = (Vec2::new(from.dot(self.across), from.dot(self.up)), from.dot(self.normal));
            for (i, m) in self.moved.iter().enumerate() {
                let area = m.a.perp_dot(m.b);
                let (u, w) = (flat.perp_dot(m.b) / area, m.a.perp_dot(flat) / area);
                if u.min(w).min(1.0 - u - w) >= -ROUNDING {
                    let over = height - (u * m.heights[0] + w * m.heights[1]);
                    // Looks are compared at the nearest place, which on a steep triangle is not the one straight below.
                    let foot = if looks.is_some() {
                        self.nearest(mesh, at, i)
                    } else {
                        let weights = [1.0 - u - w, u, w];
                        Foot { moved: i, corners: m.corners, weights, off: over.abs() * m.upright }
                    };
                    let off = off(&foot);
                    if best.is_none_or(|b| off < b.1) {
                        best = Some((foot, off));
                    }
                }
            }
        }
        best.or_else(|| {
            let all = (0..self.moved.len()).map(|i| self.nearest(mesh, at, i));
            let nearest = all.reduce(|a, b| if b.off < a.off { b } else { a });
            nearest.map(|f| (f, off(&f)))
        })
    }

    /// The place of a moved triangle that is nearest to a point.
    fn nearest(&self, mesh: &LiveMesh, at: Vec3, moved: usize) -> Foot {
        let (at, corners) = (at.as_dvec3(), self.moved[moved].corners);
        let (point, w) = nearest_on_triangle(at, corners.map(|c| mesh.position(c).as_dvec3()));
        Foot { moved, corners, weights: w.map(|w| w as f32), off: point.distance(at) as f32 }
    }
}
