//! From `[scene]` and `[light]` to a scene and its shading.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_core::draw::Shading;
use farfield_core::id::MaterialId;
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Light, LightKind, Material, Placement, Scene, SceneBuilder, Texture};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3, Vec3};

use crate::config::{Experiment, Generated, LightSettings, SceneSettings, Up};
use crate::export::{Export, ExportError, export};
use crate::failure::Failure;
use crate::generate::{
    self, AsteroidSettings, HouseScene, HouseSettings, PAPER_MODELS, ParkScene, ParkSettings, PipesScene,
    PipesSettings, PlantScene, PlantSettings, asteroid, house, park, park_of, pipes, plant,
};
use crate::load::stream::{self, Keep};
use crate::load::{self, LoadError, LoadOptions};
use crate::path::{ROUNDING, Route};
use crate::run::Options;
use crate::store::Store;

/// A loaded or generated scene.
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Where it came from, for results.
    pub source: String,
    /// What importers left out or guessed.
    pub warnings: Vec<String>,
    /// The way that it brings along, where it does.
    pub route: Option<Route>,
    /// Where its triangles stay on disk, the most bytes of them that may be held at once.
    pub limit_bytes: Option<u64>,
}

/// Loads or generates an experiment's scene.
///
/// # Errors
/// [`Failure::Input`] with the file, the place and the cause.
pub fn scene(experiment: &Experiment, options: &Options<'_>) -> Result<Loaded, Failure> {
    let s = &experiment.scene;
    let to_world = DAffine3::from_translation(DVec3::from(s.offset)) * DAffine3::from_scale(DVec3::splat(s.scale));
    match &s.path {
        Some(path) => file(experiment, path, options),
        None => generated(s, to_world),
    }
}

/// What a model takes in memory while it is loaded whole, in bytes of its file: 4.3 were measured on binary PLY, the densest.
const WHOLE_TAKES: u64 = 5;

fn file(experiment: &Experiment, path: &str, options: &Options<'_>) -> Result<Loaded, Failure> {
    let s = &experiment.scene;
    let up = match s.up {
        Up::Y => load::Up::Y,
        Up::Z => load::Up::Z,
    };
    let how = LoadOptions { up, scale: s.scale, two_sided: s.two_sided };
    let refused = |e: &dyn ToString| Failure::input("the scene was not loaded", e.to_string());
    let stream = match s.out_of_core {
        Some(chosen) => chosen,
        None => {
            let bytes = stream::bytes(Path::new(path)).map_err(|e| refused(&e))?;
            bytes.is_some_and(|b| b > s.memory_bytes / WHOLE_TAKES)
        }
    };
    if stream && experiment.measure.surface_distance {
        let cause = format!(
            "surface_distance = true in [measure] holds all of a scene in memory, and {path} is read out of core"
        );
        return Err(refused(&cause));
    }
    let (scene, warnings) = if stream {
        streamed(s, Path::new(path), &how, options)?
    } else {
        let mut imported = load::load(Path::new(path), &how).map_err(|e| refused(&e))?;
        imported.builder.shift(DVec3::from(s.offset));
        (imported.builder.build().map_err(|e| refused(&e))?, imported.warnings)
    };
    if scene.triangles() == 0 {
        return Err(refused(&format!("{path}: there is no triangle in it")));
    }
    let limit_bytes = stream.then_some(s.memory_bytes);
    Ok(Loaded { scene, source: path.to_owned(), warnings, route: None, limit_bytes })
}

/// A scene whose triangles stay on disk.
fn streamed(
    s: &SceneSettings,
    path: &Path,
    how: &LoadOptions,
    options: &Options<'_>,
) -> Result<(Scene, Vec<String>), Failure> {
    let refused = |e: &dyn ToString| Failure::input("the scene was not loaded", e.to_string());
    let failed = |e: std::io::Error| Failure::work("the scene cannot be kept on disk", e);
    // Commands that keep nothing get a store for as long as they last.
    let own = options.store.as_os_str().is_empty().then(tempfile::tempdir).transpose().map_err(failed)?;
    let folder = own.as_ref().map_or(options.store.as_path(), |d| d.path());
    let store = Store::open(folder, Arc::new(|message| eprintln!("{message}"))).map_err(failed)?;
    let keep = Keep { store: &store, memory_bytes: s.memory_bytes, cancel: options.cancel, say: options.say };
    let mut made = stream::open(path, how, &keep).map_err(|e| match e {
        LoadError::Cancelled => Failure::Cancelled,
        e @ LoadError::Temporary { .. } => Failure::work("the scene was not loaded", e),
        e => refused(&e),
    })?;
    made.builder.shift(DVec3::from(s.offset));
    // An open file outlives its folder.
    let scene = made.builder.build_over(Box::new(made.file)).map_err(|e| refused(&e))?;
    Ok((scene, made.warnings))
}

fn generated(s: &SceneSettings, to_world: DAffine3) -> Result<Loaded, Failure> {
    let refused = |e: &dyn ToString| Failure::input("the scene was not generated", e.to_string());
    let two_sided = s.two_sided.unwrap_or(false);
    let kind = s.source.unwrap_or(Generated::Park);
    let (mut parts, source) = match &s.models {
        None => (generate(kind, s.triangles, s.seed)?, kind.name().to_owned()),
        Some(folder) => {
            let settings = ParkSettings { triangles: s.triangles.unwrap_or(kind.triangles()), seed: s.seed };
            (of_models(&settings, Path::new(folder))?, format!("park of {folder}"))
        }
    };
    parts.materials.iter_mut().for_each(|m| m.two_sided = two_sided);
    let corners = std::mem::take(&mut parts.route);
    let scene = placed(parts, to_world).map_err(|e| refused(&e))?;
    let local = |p: &DVec2| {
        let q = to_world.transform_point3(DVec3::new(p.x, 0.0, p.y)) - scene.origin;
        DVec2::new(q.x, q.z)
    };
    let route = (!corners.is_empty())
        .then(|| Route { points: corners.iter().map(local).collect(), rounding: ROUNDING * s.scale });
    Ok(Loaded { scene, source, warnings: vec![], route, limit_bytes: None })
}

/// The park of the paper's models, read from a folder.
fn of_models(settings: &ParkSettings, folder: &Path) -> Result<Parts, Failure> {
    let refused = |e: &dyn ToString| Failure::input("the park's models were not loaded", e.to_string());
    let (mut materials, mut textures, mut meshes) = (vec![], vec![], vec![]);
    for model in &PAPER_MODELS {
        let options = LoadOptions { two_sided: Some(false), ..LoadOptions::default() };
        let (mut mesh, own, images) = load::load_mesh(&folder.join(model.file), &options).map_err(|e| refused(&e))?;
        let (first_material, first_texture) = (materials.len() as u32, textures.len() as u32);
        mesh.sections.iter_mut().for_each(|s| s.1 = MaterialId(s.1.0 + first_material));
        materials.extend(own.into_iter().map(|mut m: Material| {
            m.texture.iter_mut().for_each(|t| t.0 += first_texture);
            m
        }));
        textures.extend(images);
        meshes.push(mesh);
    }
    let meshes: [TriangleMesh; 8] = meshes.try_into().map_err(|_| refused(&"there are eight kinds of statues"))?;
    let park = park_of(settings, &PAPER_MODELS, meshes).map_err(|e| refused(&e))?;
    Ok(Parts { materials, textures, ..Parts::from(park) })
}

fn placed(parts: Parts, to_world: DAffine3) -> Result<Scene, farfield_core::Fault> {
    let mut builder = SceneBuilder::default();
    (builder.materials, builder.textures) = (parts.materials, parts.textures);
    let mut ids = vec![];
    for (name, mesh) in parts.meshes {
        ids.push(builder.mesh(&name, sectioned(mesh))?);
    }
    for (mesh, transform) in parts.placements {
        builder.place(Placement { mesh: ids[mesh], transform: to_world * transform });
    }
    builder.build()
}

/// A generated scene as meshes and where they are placed.
pub struct Parts {
    /// Meshes with their names.
    pub meshes: Vec<(String, TriangleMesh)>,
    /// Which mesh, and from its space to the scene.
    pub placements: Vec<(usize, DAffine3)>,
    /// Materials that the meshes' sections name; a mesh without sections is of the first.
    pub materials: Vec<Material>,
    /// Textures that materials name.
    pub textures: Vec<Texture>,
    /// Corners (x, z) of a closed way that is free at the default eye height; empty where there is none.
    pub route: Vec<DVec2>,
}

impl Parts {
    /// Triangles of all placed meshes together.
    pub fn triangles(&self) -> u64 {
        self.placements.iter().map(|p| self.meshes[p.0].1.triangles() as u64).sum()
    }
}

impl From<TriangleMesh> for Parts {
    fn from(mesh: TriangleMesh) -> Self {
        Self {
            meshes: vec![("asteroid".into(), mesh)],
            placements: vec![(0, DAffine3::IDENTITY)],
            materials: vec![painted("stone")],
            textures: vec![],
            route: vec![],
        }
    }
}

impl From<ParkScene> for Parts {
    fn from(park: ParkScene) -> Self {
        Self {
            placements: park.placements.iter().map(|p| (p.kind as usize, transform(p))).collect(),
            meshes: park.meshes.into_iter().map(|(n, m)| (n.to_owned(), m)).collect(),
            materials: vec![painted("statue")],
            textures: vec![],
            route: vec![],
        }
    }
}

impl From<PipesScene> for Parts {
    fn from(pipes: PipesScene) -> Self {
        let materials = vec![painted("paint")];
        Self { meshes: pipes.meshes, placements: pipes.placements, materials, textures: vec![], route: vec![] }
    }
}

impl From<HouseScene> for Parts {
    fn from(house: HouseScene) -> Self {
        let HouseScene { meshes, placements, materials, textures, route } = house;
        Self { meshes, placements, materials, textures, route }
    }
}

impl From<PlantScene> for Parts {
    fn from(plant: PlantScene) -> Self {
        let PlantScene { meshes, placements, route } = plant;
        Self { meshes, placements, materials: vec![painted("paint")], textures: vec![], route }
    }
}

/// A scene out of nothing but a seed; without `triangles` of the size that its kind has by default.
///
/// # Errors
/// [`Failure::Input`] where there is no such scene.
pub fn generate(kind: Generated, triangles: Option<u64>, seed: u64) -> Result<Parts, Failure> {
    let triangles = triangles.unwrap_or(kind.triangles());
    let made = match kind {
        Generated::Asteroid => asteroid(&AsteroidSettings { triangles, seed }).map(Parts::from),
        Generated::House => house(&HouseSettings { triangles, seed }).map(Parts::from),
        Generated::Park => park(&ParkSettings { triangles, seed }).map(Parts::from),
        Generated::Pipes => pipes(&PipesSettings { triangles, seed }).map(Parts::from),
        Generated::Plant => plant(&PlantSettings { triangles, seed }).map(Parts::from),
    };
    made.map_err(|e| Failure::input("the scene was not generated", e))
}

/// Writes an asteroid as PLY without holding it; returns its triangles.
///
/// # Errors
/// [`Failure::Input`] where there is none of that many triangles; [`Failure::Cancelled`]; what writing gives. No unfinished file is left.
pub fn write_asteroid(file: &Path, triangles: Option<u64>, seed: u64, cancel: &AtomicBool) -> Result<u64, Failure> {
    let settings = AsteroidSettings { triangles: triangles.unwrap_or(Generated::Asteroid.triangles()), seed };
    let failed = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::InvalidInput => Failure::input("the scene was not generated", e),
        std::io::ErrorKind::Interrupted => Failure::Cancelled,
        _ => Failure::work(format!("{} cannot be written", file.display()), e),
    };
    let folder = file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut new = tempfile::Builder::new();
    // As any other file: the user's mask decides who may read it.
    #[cfg(unix)]
    new.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut out = std::io::BufWriter::new(new.tempfile_in(folder).map_err(failed)?);
    let made = generate::asteroid::write_ply(&settings, &mut out, &|| stream::go_on(cancel)).map_err(failed)?;
    let whole = out.into_inner().map_err(|e| failed(e.into_error()))?;
    whole.persist(file).map_err(|e| failed(e.error))?;
    Ok(made)
}

/// Writes a generated scene: one node a placed mesh.
///
/// # Errors
/// What writing gives; a wrong format is [`Failure::Input`].
pub fn write(file: &Path, parts: Parts) -> Result<(), Failure> {
    let Parts { meshes, placements, materials, textures, .. } = parts;
    let meshes: Vec<(String, TriangleMesh)> = meshes.into_iter().map(|(n, m)| (n, sectioned(m))).collect();
    let scene = Export { meshes: &meshes, placements: &placements, materials: &materials, textures: &textures };
    export(file, &scene).map_err(|e| match e {
        ExportError::Unsupported { .. } => Failure::input("the scene was not written", e),
        ExportError::Write { .. } => Failure::work("the scene was not written", e),
    })
}

/// For meshes that carry their colours in their vertices.
fn painted(name: &str) -> Material {
    Material { name: name.into(), base_color: [1.0; 4], texture: None, two_sided: false }
}

/// Where a generated mesh names no material, all of it is the first.
fn sectioned(mut mesh: TriangleMesh) -> TriangleMesh {
    if mesh.sections.is_empty() {
        mesh.sections = vec![(0..mesh.indices.len() as u32, MaterialId(0))];
    }
    mesh
}

/// From a statue's mesh to the park.
fn transform(p: &generate::Placement) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_rotation_y(p.yaw_rad) * p.scale, p.position)
}

/// The shading that every pipeline gets at the start of the path.
pub fn shading(l: &LightSettings) -> Shading {
    let color = Vec3::from(l.color);
    let kind = LightKind::Directional { to_light: Vec3::from(l.to_light).normalize(), angle_rad: 0.0 };
    let lights = if color == Vec3::ZERO { vec![] } else { vec![Light { kind, color, moves: l.turn_deg_per_s != 0.0 }] };
    Shading { ambient: Vec3::from(l.ambient), lights, sky: l.sky, ground: l.ground }
}

/// The same with its directional lights turned about the vertical, counter-clockwise seen from above.
pub fn turned(shading: &Shading, angle_rad: f64) -> Shading {
    let mut out = shading.clone();
    for light in &mut out.lights {
        if let LightKind::Directional { to_light, .. } = &mut light.kind {
            *to_light = (DQuat::from_rotation_y(angle_rad) * to_light.as_dvec3()).as_vec3();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turning_light_keeps_its_height_and_comes_round() {
        let start = shading(&LightSettings { to_light: [1.0, 1.0, 0.0], ..LightSettings::default() });
        let at = |deg: f64| match turned(&start, deg.to_radians()).lights[0].kind {
            LightKind::Directional { to_light, .. } => to_light,
            LightKind::Point { .. } => panic!("a point light"),
        };
        let s = 0.5f32.sqrt();
        // Counter-clockwise from above leads from +x to -z.
        for (deg, expected) in [(0.0, [s, s, 0.0]), (90.0, [0.0, s, -s]), (180.0, [-s, s, 0.0]), (360.0, [s, s, 0.0])] {
            assert!(at(deg).distance(Vec3::from(expected)) < 1e-6, "{deg} degrees: {}", at(deg));
        }
        assert_eq!(turned(&start, 0.0), start);
    }
}
