//! The draw records of a frame: where things stand relative to the eye, how normals turn, which material.
//!
//! Positions reach the device relative to the eye: the placement's translation less the eye is taken in 64 bits and rounded
//! once, so that a scene far from its origin is drawn as one at home.

use std::ops::Range;

use farfield_core::Fault;
use farfield_core::id::{ChunkId, MeshChunkId, TextureId};
use farfield_core::scene::{Object, Scene};
use glam::{DMat3, DVec3};

use crate::layout::Record;

/// Which faces are left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cull {
    /// None: two-sided.
    None,
    /// Those whose corners run clockwise as seen, after placement: one that mirrors turns front faces into back faces.
    Back,
}

/// What a backend keeps of a scene: enough to make draw records.
#[derive(Clone, Debug)]
pub struct SceneTable {
    chunks: Vec<ChunkRow>,
    objects: Vec<ObjectRow>,
    materials: Vec<MaterialRow>,
}

#[derive(Clone, Copy, Debug)]
struct ChunkRow {
    source: MeshChunkId,
    object: u32,
    material: u32,
}

#[derive(Clone, Copy, Debug)]
struct ObjectRow {
    linear: [[f32; 3]; 3],
    translation: DVec3,
    normal: [[f32; 4]; 3],
}

#[derive(Clone, Copy, Debug)]
struct MaterialRow {
    base_color: [f32; 4],
    texture: Option<TextureId>,
    two_sided: bool,
}

/// A placed chunk, ready to be drawn.
#[derive(Clone, Copy, Debug)]
pub struct ChunkDraw {
    /// Its triangles.
    pub source: MeshChunkId,
    /// Its record.
    pub record: Record,
    /// Its texture.
    pub texture: Option<TextureId>,
    /// Its faces.
    pub cull: Cull,
}

impl SceneTable {
    /// The table of a scene.
    pub fn new(scene: &Scene) -> Self {
        Self {
            chunks: (0..scene.chunks.len())
                .map(|i| ChunkRow {
                    source: scene.chunks[i].source,
                    object: scene.chunks[i].object.0,
                    material: scene.material_of(ChunkId(i as u32)).0,
                })
                .collect(),
            objects: scene.objects.iter().map(ObjectRow::new).collect(),
            materials: scene
                .materials
                .iter()
                .map(|m| MaterialRow { base_color: m.base_color, texture: m.texture, two_sided: m.two_sided })
                .collect(),
        }
    }

    /// How many placed chunks there are.
    pub fn chunks(&self) -> Range<u32> {
        0..self.chunks.len() as u32
    }

    /// A placed chunk as seen from `eye`. `None` where there is no such chunk.
    pub fn chunk(&self, id: ChunkId, eye: DVec3) -> Option<ChunkDraw> {
        let row = self.chunks.get(id.index())?;
        let object = &self.objects[row.object as usize];
        let material = &self.materials[row.material as usize];
        let t = (object.translation - eye).as_vec3().to_array();
        let l = &object.linear;
        let record = Record {
            to_eye: std::array::from_fn(|i| [l[i][0], l[i][1], l[i][2], t[i]]),
            normal: object.normal,
            base_color: material.base_color,
            object: row.object + 1,
            two_sided: u32::from(material.two_sided),
            first_projector: 0,
            radius: 0.0,
        };
        let cull = if material.two_sided { Cull::None } else { Cull::Back };
        Some(ChunkDraw { source: row.source, record, texture: material.texture, cull })
    }
}

impl ObjectRow {
    fn new(o: &Object) -> Self {
        let m = o.placement.matrix3;
        // Normals turn by the inverse transpose; its length does not matter, so it is scaled to stay within 32 bits.
        let inverse_transpose = m.inverse().transpose();
        let scale = inverse_transpose.to_cols_array().iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let normal = if scale > 0.0 && scale.is_finite() { inverse_transpose * (1.0 / scale) } else { DMat3::IDENTITY };
        let rows = |m: DMat3| [0, 1, 2].map(|i| m.row(i).as_vec3().to_array());
        Self {
            linear: rows(m),
            translation: o.placement.translation,
            normal: rows(normal).map(|[x, y, z]| [x, y, z, 0.0]),
        }
    }
}

/// Checks that a scene's textures are sound, no wider or higher than `max_px`, and that materials name only textures that there
/// are.
///
/// # Errors
/// [`Fault::Data`] naming the texture or material.
pub fn check_textures(scene: &Scene, max_px: u32) -> Result<(), Fault> {
    let bad = |place: String, cause: String| Err(Fault::Data { place, cause });
    for t in &scene.textures {
        let [w, h] = t.size;
        let place = format!("texture \"{}\"", t.name);
        if w == 0 || h == 0 || t.rgba.len() != w as usize * h as usize {
            return bad(place, format!("{} texels for {w} x {h}", t.rgba.len()));
        }
        if w > max_px || h > max_px {
            return bad(place, format!("{w} x {h} texels; this device takes {max_px} x {max_px}"));
        }
    }
    for m in &scene.materials {
        if let Some(t) = m.texture.filter(|t| t.index() >= scene.textures.len()) {
            return bad(format!("material \"{}\"", m.name), format!("texture {} of {}", t.0, scene.textures.len()));
        }
    }
    Ok(())
}

/// The record of a payload part without radius: nothing is turned, its origin stands where it stands.
pub fn payload_record(origin: DVec3, eye: DVec3, object: u32, two_sided: bool, first_projector: u32) -> Record {
    let t = (origin - eye).as_vec3();
    Record {
        to_eye: [[1.0, 0.0, 0.0, t.x], [0.0, 1.0, 0.0, t.y], [0.0, 0.0, 1.0, t.z]],
        normal: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        base_color: [1.0; 4],
        object,
        two_sided: u32::from(two_sided),
        first_projector,
        radius: 0.0,
    }
}
