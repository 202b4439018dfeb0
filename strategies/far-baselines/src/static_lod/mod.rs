//! `static-lod`: a chain of discrete levels of detail an object, chosen by projected error. The baseline that image-based far fields are
//! compared with where objects are finely tessellated.
//!
//! Follows the static levels of detail that incremental textured depth meshes are held against (Wilson and Manocha 2003, section 5.4:
//! "several versions of an object, each with half the polygons of its predecessor"), made by quadric edge collapse (Garland and Heckbert
//! 1997). Level 0 is the original, drawn from its chunks, culled to the frustum chunk by chunk; a coarser level is drawn whole. The paper
//! does not say how its levels are chosen: here the coarsest is drawn that is off by at most `max_px` pixels at the object's nearest point.
//!
//! What a level is off by is measured, not what the quadrics estimate (see `deviation`): a bound on how far the original
//! lies from the level, the largest sampled distance back, and the reach of wrong colours. **Nothing is claimed**: the way back is a
//! sample, and neither holes nor silhouettes follow from a distance.
//!
//! Limits:
//!
//! * Payloads have no transform: each placed object has levels of its own, also where many place one mesh.
//! * Levels carry albedo at vertices, no textures. Texture detail that is lost counts as error, so an object with a fine texture keeps
//!   its original until its triangles project to `max_px`, where a chain with texture coordinates would go on; `max_albedo_off = 255`
//!   lets textures go.
//! * The shading that rough normals lose does not count.
//! * Objects are the unit: a long wall close by is drawn in full to its far end.
//!
//! Bake: O(n log n) an object for n triangles, some 4 s for 100,000, objects in parallel; one object's mesh in memory a thread.
//! Stored: a chain has about 1 / (1 - ratio) - 1 times the original's triangles.

mod deviation;
mod index;
mod levels;
mod view;

use farfield_core::cell::Cell;
use farfield_core::context::{Context, collect};
use farfield_core::id::{AssetId, ChunkId, LocalPayload};
use farfield_core::payload::{MeshPart, Part, Payload};
use farfield_core::scene::{Scene, gather};
use farfield_core::strategy::{CellJob, Covers, FarField, FarView, LeftOut, Needs, SceneJob, Sink};
use farfield_core::{Aabb, Fault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use index::{Chain, Entry, Index, MOST_LEVELS, payload_id};

/// Levels of detail.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StaticLod {
    /// Triangles of a level over those of the level before.
    #[serde(default = "half")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub ratio: f32,
    /// No level has less.
    #[serde(default = "thirty_two")]
    #[schemars(range(min = 1), extend("unit" = "triangles"))]
    pub least_triangles: u32,
    /// The most that a level may be off by where it is drawn.
    #[serde(default = "one")]
    #[schemars(range(min = 0.0), extend("unit" = "px"))]
    pub max_px: f32,
    /// A difference of albedo, in any channel, that does not count as off.
    #[serde(default = "sixteen")]
    #[schemars(extend("unit" = "grey levels"))]
    pub max_albedo_off: u8,
}

fn half() -> f32 {
    0.5
}
fn thirty_two() -> u32 {
    32
}
fn one() -> f32 {
    1.0
}
fn sixteen() -> u8 {
    16
}

impl Default for StaticLod {
    fn default() -> Self {
        Self { ratio: half(), least_triangles: thirty_two(), max_px: one(), max_albedo_off: sixteen() }
    }
}

impl StaticLod {
    fn check(&self) -> Result<(), Fault> {
        let refuse = |why: String| Err(Fault::Refused(format!("static-lod: {why}")));
        if !(self.ratio > 0.0 && self.ratio < 1.0) {
            return refuse(format!("ratio = {} does not lie between 0 and 1", self.ratio));
        }
        if self.least_triangles == 0 {
            return refuse("least_triangles = 0; a level of none is no object".into());
        }
        if !(self.max_px.is_finite() && self.max_px >= 0.0) {
            return refuse(format!("max_px = {} is not a length", self.max_px));
        }
        Ok(())
    }

    /// One object's levels, put out; `None` where it has none.
    fn bake(&self, job: &SceneJob<'_>, id: u32, out: &dyn Sink, cx: &Context<'_>) -> Result<Option<Chain>, Fault> {
        cx.check()?;
        let object = &job.scene.objects[id as usize];
        let triangles: u64 = job.scene.meshes[object.mesh.index()].triangles;
        if triangles < u64::from(self.least_triangles) {
            return Ok(None);
        }
        let chunks = object.chunks.clone().map(ChunkId);
        let source = gather(job.scene, chunks, object.bounds.centre().as_dvec3())?;
        let mut entries = vec![];
        for (i, level) in levels::levels(self, &source, &job.scene.textures, cx)?.into_iter().enumerate() {
            let Some(payload) = payload_id(id, i) else {
                return Err(Fault::Refused(format!(
                    "static-lod: object {id} has more than {MOST_LEVELS} levels, or is one of too many; lower ratio"
                )));
            };
            let bytes = level.parts.iter().map(MeshPart::bytes).sum();
            let at = |p: &glam::Vec3| (source.origin + p.as_dvec3()).as_vec3();
            let bounds = Aabb::of(level.parts.iter().flat_map(|p| &p.positions).map(at));
            let (parts, triangles) = (level.parts.len() as u16, level.corners.len() as u32);
            let parts_out = level.parts.into_iter().map(Part::Mesh).collect();
            out.put(LocalPayload(payload), &Payload { origin: source.origin, bounds, parts: parts_out })?;
            entries.push(Entry { payload, parts, triangles, bytes, error: level.error });
        }
        Ok((!entries.is_empty()).then_some(Chain { object: id, levels: entries }))
    }
}

#[typetag::serde(name = "static-lod")]
impl FarField for StaticLod {
    fn needs(&self, scene: &Scene, _cell: Option<&Cell>) -> Result<Needs, Fault> {
        self.check()?;
        let small = |m: &farfield_core::scene::MeshInfo| (m.triangles as f64 * f64::from(self.ratio)).round() as u64;
        let without = scene
            .objects
            .iter()
            .filter(|o| small(&scene.meshes[o.mesh.index()]) < u64::from(self.least_triangles))
            .count();
        let left_out = (without > 0).then(|| LeftOut {
            stage: "levels of detail".into(),
            reason: format!(
                "{without} of {} objects would have a first level of less than {} triangles",
                scene.objects.len(),
                self.least_triangles
            ),
            decided: "plan".into(),
        });
        Ok(Needs {
            scene_asset: true,
            cell_asset: false,
            captures: false,
            neighbour_cells: false,
            covers: Covers::Everything,
            left_out: left_out.into_iter().collect(),
        })
    }

    fn frame_settings(&self) -> &'static [&'static str] {
        &["max_px"]
    }

    fn bake_scene(&self, job: &SceneJob<'_>, out: &dyn Sink, cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        self.check()?;
        let one = |i: usize| self.bake(job, i as u32, out, cx);
        let chains = collect(cx.run, job.scene.objects.len(), &one)?.into_iter().flatten().collect();
        Index { chains }.encode()
    }

    fn bake_cell(&self, _job: &CellJob<'_>, _out: &dyn Sink, _cx: &Context<'_>) -> Result<Vec<u8>, Fault> {
        Ok(vec![])
    }

    fn open(&self, shared: Option<(AssetId, &[u8])>, cell: (AssetId, &[u8])) -> Result<Box<dyn FarView>, Fault> {
        if !cell.1.is_empty() {
            let cause = format!("{} bytes where static-lod keeps none", cell.1.len());
            return Err(Fault::Data { place: format!("asset {}", cell.0.0), cause });
        }
        let Some((asset, bytes)) = shared else {
            return Err(Fault::Data { place: "static-lod".into(), cause: "the scene has no levels".into() });
        };
        let index = Index::decode(&format!("asset {}", asset.0), bytes)?;
        Ok(Box::new(view::Levels { asset, index, max_px: self.max_px }))
    }
}

#[cfg(test)]
mod tests;
