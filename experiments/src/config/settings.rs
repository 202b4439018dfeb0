//! The harness's own tables of an experiment file. Strategies bring theirs through the registry; both are walked alike.

use std::collections::BTreeMap;
use std::path::PathBuf;

use farfield_core::registry::{Setting, settings_of};
use farfield_core::strategy::{FarField, Partition, Scheduler};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::generate::{ASTEROID_1M, HOUSE_PAPER, PARK_2M, PIPES_1M, PLANT_1M};

/// Where a scene comes from, where it is not a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Generated {
    /// The asteroid.
    Asteroid,
    /// The furnished house.
    House,
    /// The statuary park.
    Park,
    /// The array of pipes.
    Pipes,
    /// The power plant.
    Plant,
}

impl Generated {
    /// Every one, in alphabetical order.
    pub const ALL: [Self; 5] = [Self::Asteroid, Self::House, Self::Park, Self::Pipes, Self::Plant];

    /// As experiment files and the command line spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Asteroid => "asteroid",
            Self::House => "house",
            Self::Park => "park",
            Self::Pipes => "pipes",
            Self::Plant => "plant",
        }
    }

    /// Triangles where nothing is said: the papers' house, 2M park and pipes, a million of a plant and of an asteroid.
    pub fn triangles(self) -> u64 {
        match self {
            Self::Asteroid => ASTEROID_1M,
            Self::House => HOUSE_PAPER,
            Self::Park => PARK_2M,
            Self::Pipes => PIPES_1M,
            Self::Plant => PLANT_1M,
        }
    }

    /// Whether it brings a route along, for `path = "route"`.
    pub fn has_route(self) -> bool {
        matches!(self, Self::House | Self::Plant)
    }
}

/// Which axis of a file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Up {
    /// Y.
    #[default]
    Y,
    /// Z.
    Z,
}

/// `[scene]`: exactly one of `source` and `path`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// A generated scene.
    pub source: Option<Generated>,
    /// A model file (.obj, .ply, .gltf, .glb, .stl, each also as .gz) or a folder of them in one coordinate frame, relative to the
    /// experiment file.
    pub path: Option<String>,
    /// Triangles of a generated scene, all objects together; without it 262,879 of a house, 2,017,700 of a park, 1,000,000 of pipes,
    /// of a plant and of an asteroid.
    #[schemars(range(min = 1))]
    pub triangles: Option<u64>,
    /// Seed of a generated scene.
    pub seed: u64,
    /// A folder with the mesh files of the paper's park, relative to the experiment file; without it statues are sculpted.
    pub models: Option<String>,
    /// Which axis of the model file points up.
    pub up: Up,
    /// Scene units in one unit of the file or of the generator.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Where the scene's origin stands in the world, 64 bit.
    #[schemars(extend("unit" = "scene units"))]
    pub offset: [f64; 3],
    /// Whether surfaces are seen from behind too; without it as the file says (generated scenes: false).
    pub two_sided: Option<bool>,
    /// Whether a model is cut into a file of the store, of which triangles are read while they are used; without it where the model's
    /// files (counted threefold where gzipped) are larger than a fifth of `memory_bytes` and can be read piece by piece: .ply, .obj, .gltf, .glb.
    pub out_of_core: Option<bool>,
    /// Out of core, the most bytes of original triangles that are held at once, and about the most while a model is cut.
    #[schemars(range(min = LEAST_MEMORY), extend("unit" = "bytes"))]
    pub memory_bytes: u64,
}

/// Room for a few of the largest chunks, bytes.
pub(super) const LEAST_MEMORY: u64 = 16 << 20;

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            source: None,
            path: None,
            triangles: None,
            seed: 1,
            models: None,
            up: Up::Y,
            scale: 1.0,
            offset: [0.0; 3],
            two_sided: None,
            out_of_core: None,
            memory_bytes: 2 << 30,
        }
    }
}

/// `[view]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ViewSettings {
    /// Width and height of a frame.
    #[schemars(extend("unit" = "px"))]
    pub resolution: [u32; 2],
    /// Full vertical field of view.
    #[schemars(extend("unit" = "degrees", "exclusiveMinimum" = 0.0, "maximum" = 170.0))]
    pub fov_y_deg: f32,
    /// Nothing nearer to the eye's plane is drawn; without it a 200th of `eye_height`, or a 10,000th of the scene.
    #[schemars(extend("unit" = "scene units", "exclusiveMinimum" = 0.0))]
    pub near: Option<f32>,
    /// Lowest and highest eye above the scene's lowest point; without it a hundredth of its longest horizontal side; in pipes
    /// half their height, in a house and a plant that of a standing person, where there is a way.
    #[schemars(extend("unit" = "scene units"))]
    pub eye_height: Option<[f32; 2]>,
    /// Lowest and highest pitch; 0 is level, positive looks up.
    #[schemars(extend("unit" = "degrees"))]
    pub pitch_deg: [f32; 2],
    /// Greatest speed of the eye; without it a 60th of the scene's longest horizontal side a second.
    #[schemars(extend("unit" = "scene units/s", "exclusiveMinimum" = 0.0))]
    pub max_speed: Option<f32>,
    /// Greatest turn of the eye.
    #[schemars(extend("unit" = "degrees/s", "exclusiveMinimum" = 0.0))]
    pub max_turn_deg_per_s: f32,
    /// Frames in a second of the path.
    #[schemars(extend("unit" = "1/s", "exclusiveMinimum" = 0.0))]
    pub frames_per_s: f32,
    /// `tour`, `route` (a house's or a plant's own), `orbit`, `line`, `still`, or a .csv of key frames (time_s,x,y,z,yaw_deg,pitch_deg), relative to the experiment file.
    pub path: String,
    /// Seed of the path.
    pub seed: u64,
    /// Frames of the path.
    #[schemars(range(min = 1))]
    pub frames: usize,
}

impl Default for ViewSettings {
    fn default() -> Self {
        Self {
            resolution: [1024, 1024],
            fov_y_deg: 60.0,
            near: None,
            eye_height: None,
            pitch_deg: [0.0; 2],
            max_speed: None,
            max_turn_deg_per_s: 45.0,
            frames_per_s: 30.0,
            path: "tour".into(),
            seed: 1,
            frames: 240,
        }
    }
}

/// `[light]`: one directional light, ambient light and the background. The same for every pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LightSettings {
    /// Direction from the surface to the light; any length but 0.
    pub to_light: [f32; 3],
    /// Linear colour of the light; all 0 for none.
    pub color: [f32; 3],
    /// Linear ambient light.
    pub ambient: [f32; 3],
    /// Background above the horizon, sRGB 0 to 255.
    pub sky: [u8; 3],
    /// Background below the horizon, sRGB 0 to 255.
    pub ground: [u8; 3],
    /// How fast the light turns about the vertical while the path is walked, counter-clockwise seen from above; frame 0 is lit
    /// from `to_light`.
    #[schemars(extend("unit" = "degrees/s"))]
    pub turn_deg_per_s: f32,
}

impl Default for LightSettings {
    fn default() -> Self {
        Self {
            to_light: [0.4, 0.8, 0.45],
            color: [0.8; 3],
            ambient: [0.25; 3],
            sky: [150, 185, 225],
            ground: [86, 112, 68],
            turn_deg_per_s: 0.0,
        }
    }
}

/// `[reference]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReferenceSettings {
    /// The pipeline that pictures are compared with; without it the first one.
    pub pipeline: Option<String>,
}

/// `[budget]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BudgetSettings {
    /// Most bytes that a walk ever holds of geometry and payloads: on the device, read and waiting, being read, being uploaded. What does not fit is
    /// missing, and counted. Without it all that is wanted; the reference is never limited.
    #[schemars(range(min = 1), extend("unit" = "bytes"))]
    pub memory_bytes: Option<u64>,
    /// Most bytes that a frame uploads of what the scheduler asks for, but always one block; the rest follows in later
    /// frames. Without it all at once.
    #[schemars(range(min = 1), extend("unit" = "bytes"))]
    pub upload_bytes_per_frame: Option<u64>,
}

/// `[measure]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeasureSettings {
    /// Pictures of every n-th frame are compared with the reference.
    #[schemars(range(min = 1), extend("unit" = "frames"))]
    pub every: usize,
    /// Change from frame to frame: the frame before each measured one is read too, and the two on both sides of every border between
    /// cells. Without it, changes are measured only where `every` = 1.
    pub temporal: bool,
    /// Structural similarity.
    pub ssim: bool,
    /// FLIP.
    pub flip: bool,
    /// How far what is shown lies from the original surface, and the other way round, in pixels: in measured frames, and where a far
    /// field claims it, in audits. Holds the whole scene in a search tree, about 100 bytes a triangle, and every payload that was drawn; not
    /// for scenes out of core.
    pub surface_distance: bool,
    /// Held-out viewpoints at which each pipeline's claims are audited, over all its cells.
    pub audit_views: usize,
    /// Frames shown in the report, a pipeline, beside its worst one.
    pub pictures: usize,
    /// Frames rendered and not timed before the walk.
    #[schemars(extend("unit" = "frames"))]
    pub warm_up: usize,
    /// Times each frame is rendered; the least time counts.
    #[schemars(range(min = 1))]
    pub repeats: usize,
}

impl Default for MeasureSettings {
    fn default() -> Self {
        Self {
            every: 4,
            temporal: true,
            ssim: true,
            flip: true,
            surface_distance: false,
            audit_views: 64,
            pictures: 2,
            warm_up: 1,
            repeats: 1,
        }
    }
}

/// `[build]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BuildSettings {
    /// What takes the pictures that payloads are made of. Part of every store key.
    pub capture: BackendName,
    /// Time that pipelines with build = "on-demand" may build for while they walk. What a cell takes beyond it, later frames
    /// wait for: over a walk the mean holds.
    #[schemars(range(min = 0), extend("unit" = "ms a frame"))]
    pub on_demand_ms: f64,
}

impl Default for BuildSettings {
    fn default() -> Self {
        Self { capture: BackendName::Cpu, on_demand_ms: 100.0 }
    }
}

/// When a pipeline's cells are built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BuildWhen {
    /// Before the walk, those that the path visits.
    #[default]
    Ahead,
    /// During the walk, those that the scheduler asks for, in its order.
    OnDemand,
}

impl BuildWhen {
    /// As experiment files spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ahead => "ahead",
            Self::OnDemand => "on-demand",
        }
    }
}

/// The backends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BackendName {
    /// The reference ray caster.
    Cpu,
    /// Through ash.
    Vulkan,
    /// Through wgpu.
    Wgpu,
}

impl BackendName {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Cpu, Self::Vulkan, Self::Wgpu];

    /// As experiment files spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Vulkan => "vulkan",
            Self::Wgpu => "wgpu",
        }
    }
}

/// One pipeline, resolved.
#[derive(Debug)]
pub struct Pipeline {
    /// Its name.
    pub name: String,
    /// What draws it; `None`: what this machine has.
    pub backend: Option<BackendName>,
    /// When its cells are built.
    pub build: BuildWhen,
    /// Its cells.
    pub partition: Box<dyn Partition>,
    /// Its far field.
    pub far_field: Box<dyn FarField>,
    /// Its scheduler.
    pub scheduler: Box<dyn Scheduler>,
    /// The whole table with every setting.
    pub resolved: Map<String, Value>,
}

/// An experiment, checked and resolved.
#[derive(Debug)]
pub struct Experiment {
    /// The file it came from.
    pub file: PathBuf,
    /// Every table with every setting, sweeps expanded: itself a valid experiment.
    pub resolved: Map<String, Value>,
    /// `[scene]`; paths are absolute.
    pub scene: SceneSettings,
    /// `[view]`.
    pub view: ViewSettings,
    /// `[light]`.
    pub light: LightSettings,
    /// The index of the reference in `pipelines`.
    pub reference: usize,
    /// `[budget]`.
    pub budget: BudgetSettings,
    /// `[measure]`.
    pub measure: MeasureSettings,
    /// `[build]`.
    pub build: BuildSettings,
    /// `[[pipeline]]`, sweeps expanded.
    pub pipelines: Vec<Pipeline>,
}

/// The harness's tables by name, for the walk and for the book.
pub fn tables() -> BTreeMap<&'static str, Vec<Setting>> {
    BTreeMap::from([
        ("budget", settings_of::<BudgetSettings>()),
        ("build", settings_of::<BuildSettings>()),
        ("light", settings_of::<LightSettings>()),
        ("measure", settings_of::<MeasureSettings>()),
        ("reference", settings_of::<ReferenceSettings>()),
        ("scene", settings_of::<SceneSettings>()),
        ("view", settings_of::<ViewSettings>()),
    ])
}
