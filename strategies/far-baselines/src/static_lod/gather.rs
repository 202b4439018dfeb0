//! An object's original geometry, gathered: all its chunks welded into one mesh, with what its corners look like.
//!
//! Positions are welded by the names that chunks share mesh-wide. A *wedge* is a vertex with one normal and one albedo: seams have
//! several wedges a vertex, so that collapsing does not tear them open and attributes do not bleed over them. O(vertices + triangles).

use std::collections::HashMap;

use farfield_core::Fault;
use farfield_core::color::byte_of_linear;
use farfield_core::id::{ChunkId, ObjectId};
use farfield_core::mesh::ChunkMesh;
use farfield_core::scene::{Material, Scene, Texture, normal_matrix, vertex_albedo, vertex_tint};
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};

/// A vertex as one side of a seam sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wedge {
    pub(super) vertex: u32,
    /// Unit normal, local frame.
    pub(super) normal: Vec3,
    /// sRGB.
    pub(super) albedo: [u8; 4],
}

/// A triangle whose inside looks otherwise than its corners: it wears a texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Textured {
    pub(super) triangle: u32,
    /// Index into the scene's textures.
    pub(super) texture: u32,
    pub(super) uv: [Vec2; 3],
    /// What the texture is multiplied by at the corners, linear.
    pub(super) tint: [Vec3; 3],
}

/// An object in one piece. Triangles are counter-clockwise seen from in front as they are placed.
#[derive(Debug, Default)]
pub(super) struct Source {
    /// Where positions start from, local frame.
    pub(super) origin: DVec3,
    /// Welded, relative to the origin.
    pub(super) positions: Vec<Vec3>,
    pub(super) wedges: Vec<Wedge>,
    /// A wedge a corner.
    pub(super) corners: Vec<[u32; 3]>,
    /// Whether a triangle is seen from behind too.
    pub(super) two_sided: Vec<bool>,
    pub(super) textured: Vec<Textured>,
}

impl Source {
    /// The three vertices of a triangle.
    pub(super) fn vertices(&self, corners: [u32; 3]) -> [u32; 3] {
        corners.map(|w| self.wedges[w as usize].vertex)
    }

    /// The places of a triangle's corners.
    pub(super) fn places(&self, corners: [u32; 3]) -> [Vec3; 3] {
        self.vertices(corners).map(|v| self.positions[v as usize])
    }
}

/// Names of wedges: vertex, bits of the normal, albedo.
type Names = HashMap<(u32, [u32; 3], [u8; 4]), u32>;

/// All chunks of an object.
///
/// # Errors
/// What reading the geometry gives.
pub(super) fn gather(scene: &Scene, id: ObjectId) -> Result<Source, Fault> {
    let object = &scene.objects[id.index()];
    let origin = object.bounds.centre().as_dvec3();
    let place = DAffine3::from_translation(-origin) * object.placement;
    let turn = normal_matrix(&object.placement.matrix3);
    let mut out = Source { origin, ..Source::default() };
    let mut local = vec![u32::MAX; scene.meshes[object.mesh.index()].vertex_ids as usize];
    let mut names = Names::new();
    for c in object.chunks.clone().map(ChunkId) {
        let material = scene.materials.get(scene.material_of(c).index()).cloned().unwrap_or_default();
        let texture = material.texture.and_then(|t| Some((t.0, scene.textures.get(t.index())?)));
        scene.geometry.with(scene.chunks[c.index()].source, &mut |chunk| {
            let looks = Looks { chunk, material: &material, texture };
            let wedges: Vec<u32> = (0..chunk.positions.len())
                .map(|i| {
                    let vertex = &mut local[chunk.vertex_ids[i] as usize];
                    if *vertex == u32::MAX {
                        *vertex = out.positions.len() as u32;
                        out.positions.push(place.transform_point3(chunk.positions[i].as_dvec3()).as_vec3());
                    }
                    looks.wedge(i, *vertex, &turn, &mut names, &mut out.wedges)
                })
                .collect();
            for t in chunk.indices.chunks_exact(3) {
                let triangle = out.corners.len() as u32;
                out.corners.push([0, 1, 2].map(|k| wedges[t[k] as usize]));
                out.two_sided.push(material.two_sided);
                out.textured.extend(looks.textured(triangle, [0, 1, 2].map(|k| t[k] as usize)));
            }
        })?;
    }
    Ok(out)
}

/// A chunk with what it wears.
struct Looks<'a> {
    chunk: &'a ChunkMesh,
    material: &'a Material,
    texture: Option<(u32, &'a Texture)>,
}

impl Looks<'_> {
    fn wedge(&self, i: usize, vertex: u32, turn: &DMat3, names: &mut Names, all: &mut Vec<Wedge>) -> u32 {
        let normal = (*turn * self.chunk.normals[i].as_dvec3()).normalize_or(DVec3::Y).as_vec3();
        let albedo = vertex_albedo(self.chunk, i, self.material, self.texture.map(|t| t.1));
        let [r, g, b] = albedo.to_array().map(byte_of_linear);
        let albedo = [r, g, b, 255];
        *names.entry((vertex, normal.to_array().map(f32::to_bits), albedo)).or_insert_with(|| {
            all.push(Wedge { vertex, normal, albedo });
            all.len() as u32 - 1
        })
    }

    fn textured(&self, triangle: u32, t: [usize; 3]) -> Option<Textured> {
        let (texture, _) = self.texture?;
        let uv = |k: usize| self.chunk.uvs.get(t[k]).copied();
        let tint = t.map(|i| vertex_tint(self.chunk, i, self.material));
        Some(Textured { triangle, texture, uv: [uv(0)?, uv(1)?, uv(2)?], tint })
    }
}
