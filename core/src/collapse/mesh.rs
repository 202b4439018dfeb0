//! A triangle mesh under collapse: corners of triangles, triangles of vertices, positions.
//!
//! Flat arrays only. The triangles of a vertex are a run in one long list, laid out vertex by vertex at first; a collapse
//! writes the survivor's merged run at the list's end, and the list is squeezed when it has doubled. Runs stay contiguous, so
//! walking a one-ring is a linear read; a squeeze is paid for by the appends since the last one.

use glam::{Vec3, Vec4};

use super::Collapsed;
use super::rings::Rings;
use crate::Fault;

/// Marks a dead triangle's first corner.
pub(super) const DEAD: u32 = u32::MAX;

const LOCKED: u8 = 1;
/// One of its edges has other than two triangles.
pub(super) const BORDER: u8 = 2;
/// One of its edges has not as many triangles running forwards as backwards.
pub(super) const ODD: u8 = 4;

/// What is known of a vertex: one fetch from memory.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Vertex {
    /// And 0: four such rows become lanes without a copy.
    position: Vec4,
    /// Its run in the list of triangles.
    start: u32,
    len: u32,
    /// Whom it died into; itself while it lives.
    remap: u32,
    flags: u8,
}

/// A mesh under collapse, as costs see it. Ids are those of the input.
#[derive(Clone, Debug)]
pub struct LiveMesh {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
    lists: Vec<u32>,
    /// Squeeze `lists` at this length.
    squeeze_at: usize,
    live: usize,
    /// Triangles of the edge that collapses, each with its third vertex.
    dying: Vec<[u32; 2]>,
    /// A power of two that brings the mesh to about unit size: products of several lengths neither over- nor underflow.
    unit: f32,
}

impl LiveMesh {
    /// Builds the connectivity. `locked` is empty or says for each vertex whether it must neither move nor die.
    ///
    /// Triangles that name a vertex twice are dropped.
    ///
    /// # Errors
    /// [`Fault::Data`] where `indices` are no triples, name a vertex that is not there or are more than 2^29 triangles, or where
    /// `locked` has another length than `positions`.
    pub fn new(positions: &[Vec3], indices: &[u32], locked: &[bool]) -> Result<Self, Fault> {
        let bad = |cause: String| Err(Fault::Data { place: "mesh to collapse".into(), cause });
        let n = positions.len();
        if !indices.len().is_multiple_of(3) {
            return bad(format!("{} indices are no triangles", indices.len()));
        }
        if indices.len() / 3 > 1 << 29 || n >= DEAD as usize {
            return bad(format!("{} triangles and {n} vertices are too many", indices.len() / 3));
        }
        // The highest first: unlike a search it is vectors' work.
        if indices.iter().copied().max().is_some_and(|most| most as usize >= n) {
            let i = indices.iter().position(|&i| i as usize >= n).unwrap_or_default();
            return bad(format!("triangle {} names vertex {} of {n}", i / 3, indices[i]));
        }
        if !locked.is_empty() && locked.len() != n {
            return bad(format!("{} lock flags for {n} vertices", locked.len()));
        }
        let mut triangles = indices.as_chunks::<3>().0.to_vec();
        for t in &mut triangles {
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                *t = [DEAD; 3];
            }
        }
        let rings = Rings::new(n, &triangles);
        let flags = rings.borders();
        let vertex = |(i, &position): (usize, &Vec3)| {
            let (start, end) = rings.range(i);
            let locked = if locked.get(i) == Some(&true) { LOCKED } else { 0 };
            Vertex {
                position: position.extend(0.0),
                start: start as u32,
                len: (end - start) as u32,
                remap: i as u32,
                flags: flags[i] | locked,
            }
        };
        let vertices = positions.iter().enumerate().map(vertex).collect();
        let lists = rings.triangles;
        Ok(Self {
            vertices,
            triangles,
            live: lists.len() / 3,
            dying: Vec::new(),
            squeeze_at: (2 * lists.len()).max(1024),
            lists,
            unit: unit(positions),
        })
    }

    /// Number of vertices, dead and isolated ones included.
    #[inline]
    pub fn vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Where a vertex is.
    #[inline]
    pub fn position(&self, vertex: u32) -> Vec3 {
        self.vertices[vertex as usize].position.truncate()
    }

    /// Where a vertex is, and 0.
    #[inline]
    pub(super) fn row(&self, vertex: u32) -> Vec4 {
        self.vertices[vertex as usize].position
    }

    /// The living triangles of a vertex; none where it is dead or isolated.
    #[inline]
    pub fn triangles_of(&self, vertex: u32) -> &[u32] {
        let Vertex { start, len, .. } = self.vertices[vertex as usize];
        &self.lists[start as usize..(start + len) as usize]
    }

    /// The three vertices of a living triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize]
    }

    /// Whether the triangle is alive.
    #[inline]
    pub fn is_alive(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize][0] != DEAD
    }

    /// Number of living triangles.
    #[inline]
    pub fn live_triangles(&self) -> usize {
        self.live
    }

    /// Whether the vertex must neither move nor die.
    #[inline]
    pub fn is_locked(&self, vertex: u32) -> bool {
        self.vertices[vertex as usize].flags & LOCKED != 0
    }

    /// Whether an edge of other than two triangles ended at this vertex, or at one that died into it, in the input.
    #[inline]
    pub fn is_border(&self, vertex: u32) -> bool {
        self.vertices[vertex as usize].flags & BORDER != 0
    }

    /// Whether one of the vertex's edges may lack a triangle in one of its two directions. Where either end of an edge is not
    /// odd, it has one in both: collapses keep edges balanced.
    #[inline]
    pub(super) fn is_odd(&self, vertex: u32) -> bool {
        self.vertices[vertex as usize].flags & ODD != 0
    }

    /// 1 / (the mesh's size), rounded to a power of two; 1 where there is no finite size. Unit: 1 / the positions' unit.
    #[inline]
    pub fn unit(&self) -> f32 {
        self.unit
    }

    /// Where a vertex has ended up.
    pub(super) fn survivor(&self, mut vertex: u32) -> u32 {
        while self.vertices[vertex as usize].remap != vertex {
            vertex = self.vertices[vertex as usize].remap;
        }
        vertex
    }

    /// Number of triangles of the input, dead ones included.
    #[inline]
    pub fn all_triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Merges `from` into `onto`, which moves to `at`. They share at least one triangle or none; both live.
    pub(super) fn apply(&mut self, from: u32, onto: u32, at: Vec3) {
        if self.lists.len() >= self.squeeze_at {
            self.squeeze();
        }
        let start = self.lists.len();
        let run = |v: u32| {
            let Vertex { start, len, .. } = self.vertices[v as usize];
            start as usize..(start + len) as usize
        };
        let (stays, comes) = (run(onto), run(from));
        self.lists.resize(start + stays.len() + comes.len(), 0);
        let (old, new) = self.lists.split_at_mut(start);
        // Written always and kept if alive: branches would be mispredicted at every other collapse.
        let mut filled = 0;
        for &t in &old[stays] {
            new[filled] = t;
            filled += !has(self.triangles[t as usize], from) as usize;
        }
        self.dying.clear();
        for &t in &old[comes] {
            let corners = &mut self.triangles[t as usize];
            let dies = has(*corners, onto);
            if dies {
                let third = corners[0] ^ corners[1] ^ corners[2] ^ from ^ onto;
                self.dying.push([t, third]);
            }
            *corners = corners.map(|x| {
                if dies {
                    DEAD
                } else if x == from {
                    onto
                } else {
                    x
                }
            });
            new[filled] = t;
            filled += !dies as usize;
        }
        self.lists.truncate(start + filled);
        self.live -= self.dying.len();
        for i in 0..self.dying.len() {
            let [t, third] = self.dying[i];
            self.unlist(third, t);
        }
        let dying = &mut self.vertices[from as usize];
        (dying.start, dying.len, dying.remap) = (0, 0, onto);
        let flags = dying.flags;
        let stays = &mut self.vertices[onto as usize];
        (stays.start, stays.len) = (start as u32, (self.lists.len() - start) as u32);
        stays.position = at.extend(0.0);
        stays.flags |= flags & (BORDER | ODD);
    }

    /// Whom a vertex died into.
    pub(super) fn died_into(&self, vertex: u32) -> u32 {
        self.vertices[vertex as usize].remap
    }

    /// A triangle as it was; lists stay as they are.
    pub(super) fn restore_triangle(&mut self, triangle: u32, corners: [u32; 3]) {
        self.live += !self.is_alive(triangle) as usize;
        self.triangles[triangle as usize] = corners;
    }

    /// A dead vertex lives again; lists stay as they are.
    pub(super) fn restore_vertex(&mut self, vertex: u32) {
        self.vertices[vertex as usize].remap = vertex;
    }

    fn unlist(&mut self, vertex: u32, triangle: u32) {
        let Vertex { start, len, .. } = &mut self.vertices[vertex as usize];
        let run = &mut self.lists[*start as usize..(*start + *len) as usize];
        let mut kept = 0;
        for i in 0..run.len() {
            run[kept] = run[i];
            kept += (run[i] != triangle) as usize;
        }
        *len = kept as u32;
    }

    fn squeeze(&mut self) {
        let mut lists = Vec::with_capacity(self.live * 6 + 64);
        for v in &mut self.vertices {
            let start = lists.len() as u32;
            lists.extend_from_slice(&self.lists[v.start as usize..(v.start + v.len) as usize]);
            v.start = start;
        }
        self.lists = lists;
        self.squeeze_at = (2 * self.lists.len()).max(1024);
    }

    /// Gives the living triangles out.
    pub(super) fn finish(self, collapses: usize, max_cost: f32) -> Collapsed {
        // Deaths are chained (a died into b, b into c): follow each chain once, halving it on the way.
        let mut remap: Vec<u32> = self.vertices.iter().map(|v| v.remap).collect();
        for v in 0..remap.len() {
            let mut end = v;
            while remap[end] as usize != end {
                remap[end] = remap[remap[end] as usize];
                end = remap[end] as usize;
            }
            remap[v] = end as u32;
        }
        let mut out = Collapsed { collapses, max_cost, ..Collapsed::default() };
        out.indices.reserve_exact(self.live * 3);
        out.triangles.reserve_exact(self.live);
        for (i, t) in self.triangles.iter().enumerate().filter(|(_, t)| t[0] != DEAD) {
            out.indices.extend_from_slice(t);
            out.triangles.push(i as u32);
        }
        out.positions = self.vertices.iter().map(|v| v.position.truncate()).collect();
        out.remap = remap;
        out
    }
}

/// The corner of a triangle that is `v`, the next one and the one before. No branch: it would be mispredicted two times in three.
#[inline]
pub(super) fn corner(t: [u32; 3], v: u32) -> [usize; 3] {
    const TURNS: [[usize; 3]; 3] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
    TURNS[((t[1] == v) as usize) | (((t[2] == v) as usize) << 1)]
}

/// Whether `v` is a corner. No branch.
#[inline]
pub(super) fn has(t: [u32; 3], v: u32) -> bool {
    (t[0] == v) | (t[1] == v) | (t[2] == v)
}

/// The two vertices of a triangle beside `v`, in the triangle's order beginning after `v`.
#[inline]
pub(super) fn others(t: [u32; 3], v: u32) -> [u32; 2] {
    let [_, next, last] = corner(t, v);
    [t[next], t[last]]
}

fn unit(positions: &[Vec3]) -> f32 {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for p in positions.iter().filter(|p| p.is_finite()) {
        (low, high) = (low.min(*p), high.max(*p));
    }
    // f64: the box of coordinates at the f32 limits has no f32 size.
    let size = (high.as_dvec3() - low.as_dvec3()).max_element();
    if size.is_finite() && size > 0.0 { (-size.log2().ceil()).clamp(-120.0, 120.0).exp2() as f32 } else { 1.0 }
}

/// A set of vertices that is emptied in O(1).
pub(super) struct Marks {
    now: u32,
    of: Vec<u32>,
}

impl Marks {
    pub(super) fn new(n: usize) -> Self {
        Self { now: 0, of: vec![0; n] }
    }

    pub(super) fn clear(&mut self) {
        if self.now == u32::MAX {
            self.of.fill(0);
            self.now = 0;
        }
        self.now += 1;
    }

    /// Returns whether it was not there yet.
    #[inline]
    pub(super) fn insert(&mut self, v: u32) -> bool {
        std::mem::replace(&mut self.of[v as usize], self.now) != self.now
    }

    #[inline]
    pub(super) fn remove(&mut self, v: u32) {
        self.of[v as usize] = 0;
    }

    #[inline]
    pub(super) fn has(&self, v: u32) -> bool {
        self.of[v as usize] == self.now
    }
}
