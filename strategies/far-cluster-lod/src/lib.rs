//! `cluster-lod`: each object as a hierarchy of clusters of triangles, cut to the view without cracks. The baseline that a user would pick
//! today for finely tessellated models.
//!
//! Follows Nanite as its authors describe it (Karis, Stubbe, Wihlidal, *Nanite: a deep dive*, SIGGRAPH 2021 course *Advances in real-time
//! rendering in games*), which builds on Ponchio (*Multiresolution structures for interactive visualization of very large 3D datasets*, 2009)
//! and on Yoon, Salomon, Gayle and Manocha (*Quick-VDR*, 2004), with meshoptimizer's simplifier, clusterizer and partition of clusters. Groups
//! of neighbouring clusters are locked at their borders, merged, simplified to half, and split again, until one group is left (see
//! `hierarchy`, `group`). Errors and bounds of groups grow upwards. A cluster is drawn where its own group is off by no more than the view
//! allows and the group that replaces it is; all clusters of a group decide alike, so neighbours fit (see `cut`).
//!
//! Chosen here:
//!
//! * A payload is a group; its parts are the clusters that one group above replaces together, since those are always drawn together.
//! * The finest level is the scene's own chunks: clusters of the first groups would never be told apart, and chunks are there anyway, are
//!   shared by the objects that place them, and wear their textures.
//! * A missing payload is replaced by the coarser groups above it (where the top is missing, by finer ones), never by a hole or by what overlaps.
//! * Clusters are drawn as triangles like everything else: no culling of clusters by occlusion, no rasterizer of its own, no compression.
//!
//! **Nothing is claimed**: meshoptimizer's error is an estimate. The bench `dragon` measures how far sampled distances exceed it; the book has
//! the figures.
//!
//! Limits:
//!
//! * Payloads have no transform: each placed object has a hierarchy of its own, also where many place one mesh.
//! * Clusters carry albedo and normals at vertices, no textures; what wears a texture keeps its original until triangles are as short as the
//!   error allowed (`keep_textures`).
//! * Objects do not know each other: where two touch, they may gape by their errors. Within an object nothing gapes, but where one-sided
//!   triangles meet two-sided ones their shared vertices never go.
//! * Soups of unconnected triangles (leaves) thin out: a triangle that goes is off by its own size, and that many of them are gone is no
//!   error to the simplifier.
//!
//! Bake: O(n log n) an object for n triangles, groups in parallel; one object's mesh in memory, of small ones one a thread. Stored: about as
//! many triangles as the original has. A frame: O(groups of the objects in view).

mod cut;
mod group;
mod hierarchy;
mod index;
mod view;

use std::collections::{BTreeMap, HashMap};

use farfield_core::cell::Cell;
use farfield_core::context::{Context, Executor, Serial, collect, remembered};
use farfield_core::id::{AssetId, ChunkId, LocalPayload};
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::scene::{Gathered, Scene, gather};
use farfield_core::strategy::{CellJob, Covers, FarField, FarView, LeftOut, Needs, SceneJob, Sink};
use farfield_core::{Aabb, Fault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use hierarchy::{Hierarchy, Unit};
use index::{Group, Index, ObjectGroups, Patch};

/// Objects of more triangles are built one after the other, their groups in parallel, and remembered across interruptions; smaller ones in
/// parallel.
const LARGE_TRIANGLES: u64 = 100_000;

/// Hierarchies of clusters.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClusterLod {
    /// The most that a group may be off by, as far as meshoptimizer's estimate says, where it is drawn.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f32,
    /// The most triangles of a cluster; a multiple of 4.
    #[serde(default = "cluster")]
    #[schemars(range(min = 12, max = 256), extend("unit" = "triangles"))]
    pub cluster_triangles: u32,
    /// About how many clusters are simplified together: they are also loaded together.
    #[serde(default = "sixteen")]
    #[schemars(range(min = 2, max = 256), extend("unit" = "clusters"))]
    pub group_clusters: u32,
    /// No object is drawn with less.
    #[serde(default = "thirty_two")]
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub least_triangles: u32,
    /// The error that a difference of normals of length 1 stands for, in sizes of the group.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0))]
    pub normal_weight: f32,
    /// The error that a difference of albedo from black to white in a channel stands for, in sizes of the group.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0))]
    pub albedo_weight: f32,
    /// Losing a texture counts as an error as long as a triangle's edge: clusters have colours at vertices only.
    #[serde(default = "yes")]
    pub keep_textures: bool,
}

fn one() -> f32 {
    1.0
}
fn cluster() -> u32 {
    128
}
fn sixteen() -> u32 {
    16
}
fn thirty_two() -> u32 {
    32
}
fn half() -> f32 {
    0.5
}
fn yes() -> bool {
    true
}

impl Default for ClusterLod {
    fn default() -> Self {
        Self {
            max_px: one(),
            cluster_triangles: cluster(),
            group_clusters: sixteen(),
            least_triangles: thirty_two(),
            normal_weight: half(),
            albedo_weight: half(),
            keep_textures: yes(),
        }
    }
}

impl ClusterLod {
    fn check(&self) -> Result<(), Fault> {
        let refuse = |why: String| Err(Fault::Refused(format!("cluster-lod: {why}")));
        if !(self.max_px.is_finite() && self.max_px >= 0.0) {
            return refuse(format!("max_px = {} is not a length", self.max_px));
        }
        if !(12..=256).contains(&self.cluster_triangles) || !self.cluster_triangles.is_multiple_of(4) {
            return refuse(format!(
                "cluster_triangles = {} is not a multiple of 4 between 12 and 256",
                self.cluster_triangles
            ));
        }
        if !(2..=256).contains(&self.group_clusters) {
            return refuse(format!("group_clusters = {} does not lie between 2 and 256", self.group_clusters));
        }
        if self.least_triangles == 0 {
            return refuse("least_triangles = 0; an object of none is no object".into());
        }
        for (name, weight) in [("normal_weight", self.normal_weight), ("albedo_weight", self.albedo_weight)] {
            if !(weight.is_finite() && weight >= 0.0) {
                return refuse(format!("{name} = {weight} is not a weight"));
            }
        }
        Ok(())
    }

    /// Whether an object has too few triangles for a single group.
    fn too_small(&self, scene: &Scene, object: usize) -> bool {
        scene.meshes[scene.objects[object].mesh.index()].triangles / 2 < u64::from(self.least_triangles)
    }

    /// One object's groups, put out under ids from `first` on; `None` where it has none.
    fn bake(
        &self,
        job: &SceneJob<'_>,
        (object, first): (u32, u32),
        run: &dyn Executor,
        out: &dyn Sink,
        cx: &Context<'_>,
    ) -> Result<Option<ObjectGroups>, Fault> {
        cx.check()?;
        let scene = job.scene;
        if self.too_small(scene, object as usize) {
            return Ok(None);
        }
        let placed = &scene.objects[object as usize];
        let chunks = placed.chunks.clone();
        let source = gather(scene, chunks.clone().map(ChunkId), placed.bounds.centre().as_dvec3())?;
        let made = hierarchy::build(self, &source, leaves(scene, chunks.clone(), &source), run, cx)?;
        let replaced: Vec<Option<u32>> = made.units[..chunks.len()].iter().map(|u| u.replaced_by).collect();
        let parts = parts_of(&made);
        let groups = collect(run, made.groups.len(), &|g| {
            cx.check()?;
            let id = first + g as u32;
            let (payload, parts) = payload(&source, &made, &parts[g]);
            let group = &made.groups[g];
            let bytes = payload.parts.iter().map(|p| if let Part::Mesh(m) = p { m.bytes() } else { 0 }).sum();
            if payload.parts.len() > usize::from(u16::MAX) {
                return Err(Fault::Refused(format!(
                    "cluster-lod: object {object} has a group of more than {} parts; lower group_clusters",
                    u16::MAX
                )));
            }
            out.put(LocalPayload(id), &payload)?;
            Ok(Group { payload: id, bytes, error: group.error, bounds: group.bounds, parts })
        })?;
        Ok((!groups.is_empty()).then_some(ObjectGroups { object, chunks: replaced, groups }))
    }
}

/// An object's chunks as the units of the first round.
fn leaves(scene: &Scene, chunks: std::ops::Range<u32>, source: &Gathered) -> Vec<Unit> {
    let mut textured = source.textured.iter().map(|t| t.triangle).peekable();
    let mut first = 0;
    chunks
        .map(|c| {
            let placed = &scene.chunks[c as usize];
            let end = first + placed.triangles;
            let corners = source.corners[first as usize..end as usize].to_vec();
            let two_sided = source.two_sided.get(first as usize).copied().unwrap_or(false);
            let wears = std::iter::from_fn(|| textured.next_if(|&t| t < end)).count() > 0;
            first = end;
            Unit { made_by: None, replaced_by: None, corners, bounds: placed.bounds, textured: wears, two_sided }
        })
        .collect()
}

/// For each group its units, by the group that replaces them; those at the top first.
fn parts_of(made: &Hierarchy) -> Vec<BTreeMap<Option<u32>, Vec<usize>>> {
    let mut out = vec![BTreeMap::<_, Vec<usize>>::new(); made.groups.len()];
    for (u, unit) in made.units.iter().enumerate() {
        if let Some(g) = unit.made_by {
            out[g as usize].entry(unit.replaced_by).or_default().push(u);
        }
    }
    out
}

fn payload(source: &Gathered, made: &Hierarchy, parts: &BTreeMap<Option<u32>, Vec<usize>>) -> (Payload, Vec<Patch>) {
    let mut out = Payload { origin: source.origin, bounds: Aabb::EMPTY, parts: vec![] };
    let mut patches = vec![];
    for (&replaced_by, units) in parts {
        let mut part = MeshPart::default();
        let mut local = HashMap::new();
        for &u in units {
            part.two_sided = made.units[u].two_sided;
            for &w in made.units[u].corners.iter().flatten() {
                let at = *local.entry(w).or_insert_with(|| {
                    let wedge = &source.wedges[w as usize];
                    part.positions.push(source.positions[wedge.vertex as usize]);
                    part.normals.push(wedge.normal);
                    part.albedo.push(wedge.albedo);
                    part.positions.len() as u32 - 1
                });
                part.indices.push(at);
            }
        }
        let bounds = Aabb::of(part.positions.iter().map(|p| (source.origin + p.as_dvec3()).as_vec3()));
        patches.push(Patch { replaced_by, triangles: part.indices.len() as u32 / 3, bounds });
        out.bounds = out.bounds.union(bounds);
        out.parts.push(Part::Mesh(part));
    }
    (out, patches)
}

#[typetag::serde(name = "cluster-lod")]
impl FarField for ClusterLod {
    fn needs(&self, scene: &Scene, _cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        let small = (0..scene.objects.len()).filter(|&o| self.too_small(scene, o)).count();
        let wearing = scene.materials.iter().filter(|m| m.texture.is_some()).count();
        let left_out = |stage: &str, reason: String| LeftOut { stage: stage.into(), reason, decided: "plan".into() };
        let clusters = (small > 0).then(|| {
            let (all, least) = (scene.objects.len(), self.least_triangles);
            left_out("clusters", format!("{small} of {all} objects would be less than {least} triangles simplified"))
        });
        let textures = (wearing > 0).then(|| {
            let kept = match self.keep_textures {
                true => "originals with textures are kept until their triangles are as short as the error allowed",
                false => "keep_textures = false lets them go",
            };
            left_out("textures of clusters", format!("clusters have colours at vertices only; {kept}"))
        });
        Ok(Needs {
            scene_asset: true,
            cell_asset: false,
            captures: false,
            neighbour_cells: false,
            covers: Covers::Everything,
            left_out: clusters.into_iter().chain(textures).collect(),
        })
    }

    fn frame_settings(&self) -> &'static [&'static str] {
        &["max_px"]
    }

    fn bake_scene(&self, job: &SceneJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        // Every group has at least one triangle less than what it replaces, so an object has fewer groups than triangles.
        let (mut firsts, mut sum) = (vec![], 0u64);
        for o in &job.scene.objects {
            firsts.push(sum as u32);
            sum += job.scene.meshes[o.mesh.index()].triangles;
        }
        if sum > u64::from(u32::MAX) {
            return Err(Fault::Refused(format!("cluster-lod: {sum} triangles in all; it takes at most {}", u32::MAX)));
        }
        let triangles = |o: &u32| job.scene.meshes[job.scene.objects[*o as usize].mesh.index()].triangles;
        let (large, small): (Vec<u32>, Vec<u32>) =
            (0..firsts.len() as u32).partition(|o| triangles(o) > LARGE_TRIANGLES);
        let bake = |o: u32, run: &dyn Executor| self.bake(job, (o, firsts[o as usize]), run, out, cx);
        let payloads = |made: &Option<ObjectGroups>| {
            made.iter().flat_map(|m| &m.groups).map(|g| LocalPayload(g.payload)).collect()
        };
        let mut objects = collect(cx.run, small.len(), &|i| bake(small[i], &Serial))?;
        for o in large {
            objects.push(remembered(&o.to_le_bytes(), &payloads, &mut || bake(o, cx.run), out, cx)?);
        }
        let mut objects: Vec<ObjectGroups> = objects.into_iter().flatten().collect();
        objects.sort_by_key(|o| o.object);
        Index { objects }.encode()
    }

    fn bake_cell(&self, _job: &CellJob<'_>, _out: &dyn Sink, _cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        Ok(vec![])
    }

    fn open(&self, shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        if !cell.1.is_empty() {
            let cause = format!("{} bytes where cluster-lod keeps none", cell.1.len());
            return Err(Fault::Data { place: format!("asset {}", cell.0.0), cause });
        }
        let Some((asset, bytes)) = shared else {
            return Err(Fault::Data { place: "cluster-lod".into(), cause: "the scene has no clusters".into() });
        };
        let index = Index::decode(&format!("asset {}", asset.0), bytes)?;
        Ok(Box::new(view::Clusters::new(asset, index, self.max_px)))
    }
}

#[cfg(test)]
mod tests;
