//! Original geometry, gathered: the far chunks of one object, welded into one mesh.
//!
//! Chunks name their vertices mesh-wide, so welding is exact and linear. Positions are kept relative to the piece's own middle (64-bit
//! transforms, 32-bit offsets), so nothing depends on where in the scene it stands. A welded vertex has one shading normal and one
//! albedo: at seams those of the chunk that names it first, which matters only where no picture shows the surface.

use farfield_core::color::byte_of_linear;
use farfield_core::id::{ChunkId, ObjectId};
use farfield_core::scene::{ChunkSet, Scene, normal_matrix, vertex_albedo};
use farfield_core::{Aabb, Fault};
use glam::{DAffine3, DVec3, Vec3};

/// Far chunks of one object that are simplified together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    /// Whose.
    pub(crate) object: ObjectId,
    /// Which.
    pub(crate) chunks: ChunkSet,
    /// Their box, local frame.
    pub(crate) bounds: Aabb,
}

/// A welded piece. Triangles are counter-clockwise seen from in front as they are placed: a transform that mirrors turns them
/// inside out, as backends draw them.
#[derive(Debug, Default)]
pub(crate) struct Welded {
    /// Where positions start from, local frame.
    pub(crate) origin: DVec3,
    /// Positions relative to the origin.
    pub(crate) positions: Vec<Vec3>,
    /// Area-weighted normals of the welded triangles: what bends are measured on.
    pub(crate) normals: Vec<Vec3>,
    /// Shading normals.
    pub(crate) shading: Vec<Vec3>,
    /// sRGB albedo.
    pub(crate) albedo: Vec<[u8; 4]>,
    /// Three vertices a triangle.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Whether a triangle is seen from behind too.
    pub(crate) two_sided: Vec<bool>,
    /// Whether a vertex belongs to a chunk of the object outside the piece as well: it may not move.
    pub(crate) locked: Vec<bool>,
}

impl Welded {
    /// Twice a triangle's area vector; zero where it has no area.
    pub(crate) fn area_vector(&self, t: [u32; 3]) -> DVec3 {
        let [a, b, c] = t.map(|v| self.positions[v as usize].as_dvec3());
        (b - a).cross(c - a)
    }

    /// n . (eye - x) with n the area vector and x a corner: above 0 exactly where the triangle faces the eye (relative to the origin).
    pub(crate) fn facing(&self, t: [u32; 3], eye: DVec3) -> f64 {
        self.area_vector(t).dot(eye - self.positions[t[0] as usize].as_dvec3())
    }
}

/// Welds a piece. O(vertices + triangles of the object).
pub(crate) fn weld(scene: &Scene, piece: &Piece) -> Result<Welded, Fault> {
    let object = &scene.objects[piece.object.index()];
    let names = scene.meshes[object.mesh.index()].vertex_ids as usize;
    let origin = piece.bounds.centre().as_dvec3();
    let to_piece = DAffine3::from_translation(-origin) * object.placement;
    let turn = normal_matrix(&object.placement.matrix3);
    let mut out = Welded { origin, ..Welded::default() };
    let mut local = vec![u32::MAX; names];
    for c in piece.chunks.iter() {
        let placed = &scene.chunks[c.index()];
        let material = scene.materials.get(scene.material_of(c).index()).cloned().unwrap_or_default();
        let texture = material.texture.and_then(|t| scene.textures.get(t.index()));
        scene.geometry.with(placed.source, &mut |chunk| {
            for (i, &name) in chunk.vertex_ids.iter().enumerate() {
                if local[name as usize] == u32::MAX {
                    local[name as usize] = out.positions.len() as u32;
                    out.positions.push(to_piece.transform_point3(chunk.positions[i].as_dvec3()).as_vec3());
                    out.shading.push((turn * chunk.normals[i].as_dvec3()).normalize_or(DVec3::Y).as_vec3());
                    let [r, g, b] = vertex_albedo(chunk, i, &material, texture).to_array().map(byte_of_linear);
                    out.albedo.push([r, g, b, 255]);
                }
            }
            for t in chunk.indices.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|k| local[chunk.vertex_ids[t[k] as usize] as usize]);
                out.triangles.push([a, b, c]);
                out.two_sided.push(material.two_sided);
            }
        })?;
    }
    out.locked = vec![false; out.positions.len()];
    for c in object.chunks.clone().map(ChunkId).filter(|c| !piece.chunks.contains(*c)) {
        scene.geometry.with(scene.chunks[c.index()].source, &mut |chunk| {
            for &name in &chunk.vertex_ids {
                if let Some(locked) = out.locked.get_mut(local[name as usize] as usize) {
                    *locked = true;
                }
            }
        })?;
    }
    let mut sums = vec![DVec3::ZERO; out.positions.len()];
    for &t in &out.triangles {
        let n = out.area_vector(t);
        t.iter().for_each(|&v| sums[v as usize] += n);
    }
    out.normals = sums.iter().zip(&out.shading).map(|(n, s)| n.try_normalize().map_or(*s, |n| n.as_vec3())).collect();
    Ok(out)
}
