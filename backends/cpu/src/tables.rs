//! What the backend keeps of a scene: its tables and textures, without triangles.

use std::ops::Range;

use farfield_core::id::{MaterialId, MeshChunkId};
use farfield_core::scene::{Material, Scene, Texture};
use farfield_core::{Aabb, Fault};
use glam::{DAffine3, DMat3, Vec3};

/// An object's transform in the forms that casting needs.
pub(crate) struct Placed {
    /// From mesh space to the local frame.
    pub(crate) placement: DAffine3,
    /// Back again.
    pub(crate) inverse: DAffine3,
    /// For normals: the inverse transpose.
    pub(crate) normals: DMat3,
    /// Whether it mirrors, so that the winding turns round.
    pub(crate) mirrors: bool,
}

/// A chunk where an object puts it.
pub(crate) struct PlacedChunk {
    pub(crate) object: u32,
    pub(crate) source: MeshChunkId,
    pub(crate) triangles: u32,
    pub(crate) material: MaterialId,
    /// In mesh space.
    pub(crate) bounds: Aabb,
}

/// See the module.
pub(crate) struct Tables {
    pub(crate) objects: Vec<Placed>,
    pub(crate) chunks: Vec<PlacedChunk>,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
}

impl Tables {
    pub(crate) fn new(scene: &Scene) -> Self {
        let objects = scene
            .objects
            .iter()
            .map(|o| {
                let inverse = o.placement.inverse();
                Placed {
                    placement: o.placement,
                    inverse,
                    normals: inverse.matrix3.transpose(),
                    mirrors: o.placement.matrix3.determinant() < 0.0,
                }
            })
            .collect();
        let chunks = scene
            .chunks
            .iter()
            .map(|c| {
                let info = &scene.meshes[c.source.mesh.index()].chunks[c.source.chunk as usize];
                PlacedChunk {
                    object: c.object.0,
                    source: c.source,
                    triangles: c.triangles,
                    material: info.material,
                    bounds: info.bounds,
                }
            })
            .collect();
        Self { objects, chunks, materials: scene.materials.clone(), textures: scene.textures.clone() }
    }

    /// A run of placed chunks.
    ///
    /// # Errors
    /// [`Fault::Refused`] where the scene has fewer.
    pub(crate) fn run(&self, r: Range<u32>) -> Result<&[PlacedChunk], Fault> {
        self.chunks.get(r.start as usize..r.end as usize).ok_or_else(|| {
            Fault::Refused(format!("a draw names placed chunks {r:?} of a scene with {}", self.chunks.len()))
        })
    }

    /// The texture and the linear base colour of a material.
    pub(crate) fn material(&self, id: MaterialId) -> (Option<&Texture>, Vec3) {
        let m = &self.materials[id.index()];
        let [r, g, b, _] = m.base_color;
        (m.texture.and_then(|t| self.textures.get(t.index())), Vec3::new(r, g, b))
    }
}
