//! Edge collapse: one engine for every simplification in farfield.
//!
//! An edge (a, b) is contracted: one of its vertices dies, its triangles go over to the other one, and the triangles of
//! the edge vanish. What an edge costs and where the survivor sits is asked of a [`Cost`]; what may never happen
//! (fold-overs, changes of topology, moving a locked vertex) is checked here, by the [`Settings`].
//!
//! ```
//! use farfield_core::collapse::{LiveMesh, Placement, QuadricSettings, Quadrics, Settings, collapse};
//! use glam::vec3;
//!
//! // A flat square of four triangles round a vertex in the middle.
//! let positions = [vec3(0., 0., 0.), vec3(1., 0., 0.), vec3(1., 1., 0.), vec3(0., 1., 0.), vec3(0.5, 0.5, 0.)];
//! let indices = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4];
//! let mesh = LiveMesh::new(&positions, &indices, &[])?; // &[]: no vertex is locked
//! let mut cost = Quadrics::new(&mesh, QuadricSettings { placement: Placement::HalfEdge, ..Default::default() });
//! let out = collapse(mesh, &mut cost, &Settings { max_cost: 0.01, ..Default::default() });
//! assert_eq!(out.indices.len(), 6);
//! # Ok::<(), farfield_core::Fault>(())
//! ```
//!
//! **Vertices are welded by the caller**: two triangles are neighbours where they share an index, so attribute seams
//! must not split vertices (map positions to [`crate::mesh::position_ids`] first and read attributes back through
//! [`Collapsed::triangles`], which names each triangle's original).
//!
//! **Two modes.** [`Mode::Exact`] always takes the cheapest edge that is allowed (Garland and Heckbert 1997, section 4.1)
//! and re-prices what that changes. [`Mode::Batched`] goes in passes: it prices every edge once, then takes edges cheapest
//! first as long as their price is still true, up to a limit for the pass; faster, slightly worse.
//!
//! **Any cost.** [`collapse`] is generic, so [`Quadrics`] is inlined, and takes `&mut dyn Cost` as well: costs are asked for
//! a whole one-ring (exact) or a thousand edges (batched) in one call. Ties go to the smaller vertex ids (exact) or to the earlier
//! triangle (batched): the result depends on nothing but the input.
//!
//! **Input may be nasty**: edges of any number of triangles, duplicates, boundaries, isolated vertices, non-finite positions and
//! costs. Triangles that name a vertex twice are dropped. Non-finite costs forbid the edge.
//!
//! Cost: O(n log n) time for n edges of bounded valence (a hub of valence k costs O(k) a collapse at it). Memory beside the cost
//! object's own: 36 bytes a vertex and about 80 bytes a triangle, in either mode.
//!
//! **What limits it** (`cargo bench -p farfield-core --bench collapse` measures it beside meshoptimizer): memory latency and
//! mispredicted branches. On a scan of 200,000 triangles brought to a tenth, a collapse of exact mode takes 9,000 instructions,
//! 50 mispredicted branches and 70 cache lines from beyond 2 MB of cache: triangles, edges and vertices of two one-rings, then
//! the quadrics of their neighbours. Taking edges by price is random access by nature. Batched mode touches each vertex once a
//! pass in the order of memory: 5,000 instructions, 18 branches and 35 lines a collapse. (Counted by callgrind.) So neighbours on
//! the machine that empty its caches slow exact mode most.

mod batched;
mod exact;
mod lanes;
mod mesh;
mod prices;
mod quadric;
mod queue;
mod rings;
mod rules;
mod spots;
mod undo;

use glam::Vec3;

pub use mesh::LiveMesh;
pub use quadric::{Placement, QuadricSettings, Quadrics};

/// Where the survivor of an edge sits, and so who dies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// On the edge's first vertex, which stays; the second dies.
    First,
    /// On the edge's second vertex, which stays; the first dies.
    Second,
    /// At a new position. The second vertex dies, the first moves.
    At(Vec3),
}

/// What collapsing an edge costs, and its best place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// In the cost's own unit; infinite or NaN forbids the edge.
    pub cost: f32,
    /// Where the survivor sits.
    pub place: Place,
}

impl Candidate {
    /// An edge that must not be collapsed.
    pub const FORBIDDEN: Self = Self { cost: f32::INFINITY, place: Place::First };
}

/// How far a collapse changes other edges' costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// A cost depends on its edge's two vertices alone: only edges at the survivor change.
    Ends,
    /// A cost depends on the triangles round its edge's vertices too (on normals, for example): every edge changes that
    /// has an end at the survivor or at one of its neighbours.
    Ring,
}

/// What edges cost, with whatever it knows of vertices (quadrics, weights, view sets).
///
/// Required: [`Cost::costs`]. The answer may depend on the vertices and, as far as [`Cost::reach`] says, on their
/// neighbourhood, on nothing else: the engine keeps prices until a collapse within reach.
pub trait Cost {
    /// Prices `edges` (first id < second id) into `out`, which is as long.
    fn costs(&mut self, mesh: &LiveMesh, edges: &[[u32; 2]], out: &mut [Candidate]);

    /// `from` is about to die into `onto`, which will sit `at`. `mesh` is as it was before. Default: nothing to be done.
    fn collapsed(&mut self, mesh: &LiveMesh, from: u32, onto: u32, at: Vec3) {
        let _ = (mesh, from, onto, at);
    }

    /// Whether its prices are estimates that [`Cost::verify`] looks over at the end. Then survivors may only sit where they sat. Default: no.
    fn verifies(&self) -> bool {
        false
    }

    /// What each triangle is off by, in the cost's unit, in the order of the input; dead ones count nothing. Asked at the end, where it
    /// [`Cost::verifies`]: the collapses that made triangles which are off by more than [`Settings::max_cost`] are taken back, and it is asked again.
    /// Of `mesh` the corners of triangles, their being alive and positions are valid, not the triangles of vertices. Default: nothing is off.
    fn verify(&mut self, mesh: &LiveMesh) -> Vec<f32> {
        vec![0.0; mesh.all_triangles()]
    }

    /// How far a collapse changes costs. Default: [`Reach::Ends`].
    fn reach(&self) -> Reach {
        Reach::Ends
    }
}

/// In which order edges are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Always the cheapest allowed edge.
    #[default]
    Exact,
    /// Passes of edges that do not change each other's cost, cheapest first.
    Batched,
}

/// When to stop and what must not happen.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// The order.
    pub mode: Mode,
    /// Stop before an edge that costs more than this, in the cost's unit.
    pub max_cost: f32,
    /// Stop at this many triangles. One collapse takes two of them as a rule, so the result may be one below.
    pub min_triangles: usize,
    /// Keep the topology (Dey et al. 1999): closed manifolds stay closed manifolds of the same genus, borders stay borders.
    pub link_condition: bool,
    /// Refuse a collapse that turns a triangle's normal further than this, in radians; at pi and above anything goes.
    pub max_turn_rad: f32,
}

impl Default for Settings {
    /// Exact, to the end, topology kept, normals turned by at most 75 degrees.
    fn default() -> Self {
        Self {
            mode: Mode::Exact,
            max_cost: f32::MAX,
            min_triangles: 0,
            link_condition: true,
            max_turn_rad: 75f32.to_radians(),
        }
    }
}

/// A simplified mesh. Vertex ids are those of the input.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Collapsed {
    /// Three vertex ids a triangle, in the input's order.
    pub indices: Vec<u32>,
    /// For each triangle, which one of the input it was.
    pub triangles: Vec<u32>,
    /// All of the input's vertices, moved where they were; dead ones stay where they died.
    pub positions: Vec<Vec3>,
    /// For each vertex of the input the living one it ended on: itself where it lives.
    pub remap: Vec<u32>,
    /// Number of edges collapsed.
    pub collapses: usize,
    /// The highest cost paid or, where the cost verifies, the most that it found at the end; never above [`Settings::max_cost`]; in its unit; 0
    /// where nothing was collapsed.
    pub max_cost: f32,
}

/// Collapses edges of `mesh` until `settings` say stop or no edge is left.
pub fn collapse<C: Cost + ?Sized>(mesh: LiveMesh, cost: &mut C, settings: &Settings) -> Collapsed {
    match settings.mode {
        Mode::Exact => exact::run(mesh, cost, settings),
        Mode::Batched => batched::run(mesh, cost, settings),
    }
}

/// Prices edges `BLOCK` at a time.
const BLOCK: usize = 1024;

/// The survivor, the dying and the place that a candidate means for an edge.
fn resolve(mesh: &LiveMesh, edge: [u32; 2], place: Place) -> (u32, u32, Vec3) {
    let [a, b] = edge;
    match place {
        Place::First => (b, a, mesh.position(a)),
        Place::Second => (a, b, mesh.position(b)),
        Place::At(p) => (b, a, p),
    }
}
