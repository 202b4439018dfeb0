//! The strategy traits: partitions, far fields, metrics, schedulers. Interfaces only; no algorithm lives here.
//!
//! Settings are serde structs behind `typetag` trait objects; a strategy never knows another strategy or a backend.

use std::fmt::Debug;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::camera::ViewModel;
use crate::cell::{Active, Cell, Outline, sees};
use crate::claim::{Claim, Quantity};
use crate::collapse::Cost;
use crate::context::Context;
use crate::draw::Draw;
use crate::id::{AssetId, Block, CellId, LocalPayload, SectorId, SplitId};
use crate::image::SurfaceImage;
use crate::payload::Payload;
use crate::scene::Scene;
use crate::{Aabb, Camera, Fault};

/// Divides the viewpoints. One method required.
#[typetag::serde(tag = "type")]
pub trait Partition: Send + Sync + Debug {
    /// The outlines of all cells and the way to find one. Cheap: what needs work waits for [`Cells::inside`].
    ///
    /// # Errors
    /// [`Fault::Refused`] where the settings do not fit the scene or the views.
    fn divide(&self, scene: &Scene, views: &ViewModel, cx: &Context<'_>) -> Result<Box<dyn Cells>, Fault>;

    /// Raised whenever the same settings give other cells: part of every store key. By default 1.
    fn version(&self) -> u32 {
        1
    }
}

/// Divided viewpoints. Three methods required.
pub trait Cells: Send + Sync {
    /// Every cell's outline; a cell's id is its index.
    fn outlines(&self) -> &[Outline];

    /// The cell that serves a camera; `None` outside the space of cells (plain geometry is drawn there, and counted).
    fn find(&self, camera: &Camera) -> Option<CellId>;

    /// One cell's inside. Pure, called in parallel, stored by content.
    ///
    /// # Errors
    /// What the partition's own work gives.
    fn inside(&self, id: CellId, scene: &Scene, cx: &Context<'_>) -> Result<Cell, Fault>;

    /// What a camera uses of a cell; by default split 0 and the windows that its frustum meets.
    fn active(&self, cell: &Cell, camera: &Camera) -> Active {
        let meets = |s: &u32| sees(camera, &cell.sectors[*s as usize].window);
        let sectors = (0..cell.sectors.len() as u32).filter(meets).map(SectorId).collect();
        Active { cell: cell.outline.id, split: SplitId(0), sectors }
    }
}

/// Something that a stage leaves out, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The stage.
    pub stage: String,
    /// Why it would be pointless here.
    pub reason: String,
    /// When that was known: `plan` or `build`.
    pub decided: String,
}

/// What a far field needs, known before any work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Needs {
    /// [`FarField::bake_scene`] has work.
    pub scene_asset: bool,
    /// [`FarField::bake_cell`] has work for the cell.
    pub cell_asset: bool,
    /// It takes pictures.
    pub captures: bool,
    /// It looks at the neighbours' centres.
    pub neighbour_cells: bool,
    /// What it draws.
    pub covers: Covers,
    /// What it leaves out.
    pub left_out: Vec<LeftOut>,
}

/// What a far field draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Covers {
    /// The split's far chunks; near geometry is drawn beside it.
    Far,
    /// Near and far.
    Everything,
}

/// The work of a scene-wide bake.
pub struct SceneJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The views to come.
    pub views: &'a ViewModel,
}

/// The work of one cell's bake.
pub struct CellJob<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The views to come.
    pub views: &'a ViewModel,
    /// The cell.
    pub cell: &'a Cell,
    /// All cells' outlines.
    pub outlines: &'a [Outline],
    /// The index of the scene's asset, where there is one.
    pub shared: Option<&'a [u8]>,
}

/// Where a bake puts what it makes: payloads leave one by one, so that no bake must hold all of them.
pub trait Sink: Sync {
    /// Stores a payload.
    ///
    /// # Errors
    /// What the storage behind it gives.
    fn put(&self, id: LocalPayload, payload: &Payload) -> Result<(), Fault>;

    /// Whether all of these payloads are there, whole, from the same bake before it was interrupted; they then count as put. By default never.
    ///
    /// # Errors
    /// What the storage behind it gives.
    fn kept(&self, _ids: &[LocalPayload]) -> Result<bool, Fault> {
        Ok(false)
    }

    /// States a bound.
    fn claim(&self, claim: Claim);

    /// States something that was left out, decided while building.
    fn left_out(&self, what: LeftOut);
}

/// A level of a hierarchy of detail: its share in a census.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Level {
    /// 0 for the coarsest.
    pub level: u32,
    /// Nodes of it.
    pub nodes: u64,
    /// Triangles of all its nodes; `None` as long as they are not built.
    pub triangles: Option<u64>,
    /// Points of all its nodes; `None` as long as they are not built.
    pub points: Option<u64>,
}

/// A far-field representation: its offline half. Three methods required.
#[typetag::serde(tag = "type")]
pub trait FarField: Send + Sync + Debug {
    /// What it will need, for the scene (`None`) or for one cell.
    ///
    /// # Errors
    /// [`Fault::Refused`] where it cannot serve the cell: image-based far fields refuse a region that meets far chunks.
    fn needs(&self, scene: &Scene, cell: Option<&Cell>) -> Result<Needs, Fault>;

    /// Builds one cell's payloads and returns its index, bytes of its own. Pure: the same job gives the same bytes.
    ///
    /// # Errors
    /// [`Fault::Cancelled`], or what captures and storage give.
    fn bake_cell(&self, job: &CellJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault>;

    /// Opens a cell's index, and the scene's where there is one.
    ///
    /// # Errors
    /// [`Fault::Data`] where the bytes are not what the bake wrote.
    fn open(&self, shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault>;

    /// Builds what all cells share, once, before any cell; by default nothing.
    ///
    /// # Errors
    /// As [`FarField::bake_cell`].
    fn bake_scene(&self, _job: &SceneJob<'_>, _out: &dyn Sink, _cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        Ok(vec![])
    }

    /// The levels of its hierarchy, coarsest first, by the index of the scene's asset, or, where that is not built, as far as the scene alone
    /// tells; by default it has none.
    ///
    /// # Errors
    /// [`Fault::Data`] where the bytes are not what the bake wrote.
    fn census(&self, _scene: &Scene, _shared: Option<&[u8]>) -> Result<Vec<Level>, Fault> {
        Ok(vec![])
    }

    /// The limits that its settings put on what a frame draws; by default none. Claims speak of frames that no budget cuts short.
    fn draw_budget(&self) -> DrawBudget {
        DrawBudget::default()
    }

    /// What its settings promise of every frame for which all that it wants is there; by default nothing. What is known only by baking is claimed
    /// there.
    fn frame_claims(&self) -> Vec<Claim> {
        vec![]
    }

    /// The settings that only frames depend on: what is baked is the same whatever they say, so that they are no part of a store
    /// key. By default none.
    fn frame_settings(&self) -> &'static [&'static str] {
        &[]
    }

    /// Raised whenever the same job gives other bytes: part of every store key. By default 1.
    fn version(&self) -> u32 {
        1
    }
}

/// A far field at run time. Two methods required.
pub trait FarView: Send + Sync {
    /// The blocks that frames from here on may want.
    fn wanted(&self, view: &View<'_>, out: &mut Vec<Candidate>);

    /// The draws of this frame, of blocks that are resident.
    fn draw(&self, resident: &dyn Fn(Block) -> bool, view: &View<'_>, out: &mut Vec<Draw>) -> Achieved;

    /// Where the payloads of a split were sampled from, local frame; `cell` is the one that was baked. By default none: what was not
    /// made of samples has no viewpoints.
    fn viewpoints(&self, _cell: &Cell, _split: SplitId) -> Vec<DVec3> {
        vec![]
    }
}

/// A view to draw: of an eye or of a light.
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub camera: &'a Camera,
    /// The active split and windows.
    pub at: &'a Active,
    /// The error allowed at a place, scene units.
    pub tolerance: &'a (dyn Fn(&Aabb) -> f32 + Sync),
    /// Limits on what is drawn.
    pub budget: DrawBudget,
    /// The cell, where the camera has one.
    pub cell: Option<&'a Cell>,
}

/// Limits on a view's draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawBudget {
    /// The most payloads.
    pub payloads: Option<u32>,
    /// The most triangles.
    pub triangles: Option<u64>,
}

/// What a far view managed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Achieved {
    /// The error it believes in, pixels.
    pub error_px: f32,
    /// Blocks that it missed: counted holes.
    pub missing: u32,
    /// A limit of the budget cut it short.
    pub budget_hit: bool,
}

/// A block that a far view may want.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Which.
    pub block: Block,
    /// Its bytes in memory.
    pub bytes: u64,
    /// Where it stands.
    pub bounds: Aabb,
    /// The error without it, pixels.
    pub error_px_without: f32,
    /// Needed for this very view.
    pub in_view: bool,
    /// Useless without this one.
    pub after: Option<Block>,
}

/// How the viewer moves.
pub struct Motion<'a> {
    /// Time on the path, seconds.
    pub time_s: f64,
    /// Moved since the last frame, scene units.
    pub moved: f32,
    /// Turned since the last frame, radians.
    pub turned_rad: f32,
    /// The eye.
    pub eye: &'a Camera,
    /// The lights' views.
    pub lights: &'a [Camera],
    /// The views to come, for an oracle.
    pub future: Option<&'a [Camera]>,
}

/// What far fields want, asked on a scheduler's behalf.
pub trait Demand {
    /// The built cells within `radius` of the eye, near to far.
    fn near(&self, eye: &Camera, radius: f32) -> Vec<CellId>;
    /// What a cell's far view wants for a camera.
    fn of(&self, cell: CellId, from: &Camera, out: &mut Vec<Candidate>);
    /// Whether a block is there.
    fn resident(&self, block: Block) -> bool;
    /// From the eye to a cell's region, scene units; by default 0: as if the eye were about to enter.
    fn distance(&self, _cell: CellId, _eye: &Camera) -> f32 {
        0.0
    }
}

/// What to load, to free and to call off.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// To load, first to last.
    pub fetch: Vec<Block>,
    /// To free.
    pub evict: Vec<Block>,
    /// Asked for earlier and no longer wanted.
    pub cancel: Vec<Block>,
}

/// Decides what is resident. One method required.
#[typetag::serde(tag = "type")]
pub trait Scheduler: Send + Sync + Debug {
    /// A planner at the start of a walk; settings are shared, so they are not the state.
    fn start(&self) -> Box<dyn Planner>;
}

/// A scheduler at work.
pub trait Planner: Send {
    /// The plan for a frame, given what may be held, bytes.
    fn plan(&mut self, motion: &Motion<'_>, demand: &dyn Demand, byte_budget: u64) -> Plan;
}

/// What a simplification metric may know of a vertex: filled in by the far field from its captures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VertexSeen {
    /// Importance, 0..=1 (textured LOD meshes, 2003: 0.05 to 0.5).
    pub weight: f32,
    /// The set of views that see it.
    pub views: u32,
    /// May neither move nor go.
    pub locked: bool,
}

/// A mesh to simplify: welded positions, a normal each, three indices a triangle.
#[derive(Clone, Copy, Debug)]
pub struct MeshView<'a> {
    /// Positions.
    pub positions: &'a [Vec3],
    /// Unit normals.
    pub normals: &'a [Vec3],
    /// sRGB albedo; empty where metrics are not to look at it.
    pub albedo: &'a [[u8; 4]],
    /// Indices.
    pub indices: &'a [u32],
}

/// The price of collapsing edges. One method required.
#[typetag::serde(tag = "type")]
pub trait SimplificationMetric: Send + Sync + Debug {
    /// A worker for one mesh, and the cost above which nothing is collapsed. `px` gives the projected length of a segment
    /// as the far field's viewpoints see it, pixels; `max_px` is the far field's tolerance.
    ///
    /// # Errors
    /// [`Fault::Refused`] where settings contradict each other, [`Fault::Data`] where the mesh contradicts itself.
    fn begin<'a>(
        &self,
        mesh: MeshView<'a>,
        seen: &'a [VertexSeen],
        px: &'a (dyn Fn(Vec3, Vec3) -> f32 + Sync),
        max_px: f32,
    ) -> Result<(Box<dyn Cost + 'a>, f32), Fault>;

    /// Whether the highest cost paid bounds, in the unit of `px`, how far any point of the original lies from the simplified surface and
    /// the other way round. By default not.
    fn bounds_distance(&self) -> bool {
        false
    }
}

/// What a visibility metric judges: an object as a cell sees it.
pub struct Subject<'a> {
    /// The cell.
    pub cell: &'a Cell,
    /// The views.
    pub views: &'a ViewModel,
    /// The object's box, local frame.
    pub bounds: Aabb,
    /// Positions of the vertices of its polygons that are front-facing to the cell, local frame.
    pub facing: &'a [Vec3],
    /// Pixels a unit of tangent.
    pub px_per_tan: f32,
    /// Captures that were taken, with their cameras.
    pub samples: &'a [(Camera, SurfaceImage)],
}

/// A visibility metric's word on a subject.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// The estimate that decides.
    pub value: f64,
    /// What is claimed: no viewpoint of the cell sees more than this.
    pub claim: f64,
    /// Of what.
    pub quantity: Quantity,
    /// Under the metric's own threshold.
    pub passes: bool,
}

/// Whether one viewpoint's samples serve a whole cell. One method required.
#[typetag::serde(tag = "type")]
pub trait VisibilityMetric: Send + Sync + Debug {
    /// The verdict.
    ///
    /// # Errors
    /// What captures give.
    fn judge(&self, subject: &Subject<'_>, cx: &Context<'_>) -> Result<Verdict, Fault>;

    /// Where to sample next; `None` when it is good enough. Closed-form metrics never ask.
    ///
    /// # Errors
    /// What captures give.
    fn next(&self, _subject: &Subject<'_>, _cx: &Context<'_>) -> Result<Option<Vec3>, Fault> {
        Ok(None)
    }
}
