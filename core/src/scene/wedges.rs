//! Original geometry gathered for bakes: placed chunks welded into one mesh, with what its corners look like.
//!
//! Positions are welded by the names that chunks share mesh-wide, within each object. A *wedge* is a vertex with one normal and one
//! albedo: seams have several wedges a vertex, so that collapsing does not tear them open and attributes do not bleed over them.
//! O(vertices + triangles).

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::{Material, Scene, Texture, normal_matrix, vertex_albedo, vertex_tint};
use crate::Fault;
use crate::color::byte_of_linear;
use crate::id::{ChunkId, ObjectId};
use crate::mesh::ChunkMesh;
use crate::payload::MeshPart;

/// A vertex as one side of a seam sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wedge {
    /// Index of the welded position.
    pub vertex: u32,
    /// Unit normal, local frame.
    pub normal: Vec3,
    /// sRGB.
    pub albedo: [u8; 4],
}

/// A triangle whose inside looks otherwise than its corners: it wears a texture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Textured {
    /// Index of the triangle.
    pub triangle: u32,
    /// Index into the scene's textures.
    pub texture: u32,
    /// Texture coordinates of its corners.
    pub uv: [Vec2; 3],
    /// What the texture is multiplied by at the corners, linear.
    pub tint: [Vec3; 3],
}

/// Placed chunks in one piece. Triangles are counter-clockwise seen from in front as they are placed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gathered {
    /// Where positions start from, local frame.
    pub origin: DVec3,
    /// Welded, relative to the origin.
    pub positions: Vec<Vec3>,
    /// Looks of vertices.
    pub wedges: Vec<Wedge>,
    /// A wedge a corner.
    pub corners: Vec<[u32; 3]>,
    /// Whether a triangle is seen from behind too.
    pub two_sided: Vec<bool>,
    /// The triangles with textures.
    pub textured: Vec<Textured>,
    /// Whose vertex each position is, by the name that the object's chunks share.
    pub names: Vec<(ObjectId, u32)>,
}

/// Which wedges vertices have.
#[derive(Clone, Debug)]
pub struct WedgesOfVertices {
    ends: Vec<u32>,
    wedges: Vec<u32>,
}

impl WedgesOfVertices {
    /// One vertex's.
    pub fn of(&self, vertex: u32) -> &[u32] {
        let start = vertex.checked_sub(1).map_or(0, |v| self.ends[v as usize]);
        &self.wedges[start as usize..self.ends[vertex as usize] as usize]
    }

    /// Each vertex's, in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.ends.len() as u32).map(|v| self.of(v))
    }
}

impl Gathered {
    /// The three vertices of a triangle.
    pub fn vertices(&self, corners: [u32; 3]) -> [u32; 3] {
        corners.map(|w| self.wedges[w as usize].vertex)
    }

    /// The places of a triangle's corners.
    pub fn places(&self, corners: [u32; 3]) -> [Vec3; 3] {
        self.vertices(corners).map(|v| self.positions[v as usize])
    }

    /// For each vertex its wedges, ascending. O(vertices + wedges); 4 bytes each.
    pub fn wedges_of_vertices(&self) -> WedgesOfVertices {
        let mut ends = vec![0u32; self.positions.len()];
        self.wedges.iter().for_each(|w| ends[w.vertex as usize] += 1);
        // Where each vertex's begin; moved to where they end while they are put there.
        let mut sum = 0;
        ends.iter_mut().for_each(|e| sum += std::mem::replace(e, sum));
        let mut wedges = vec![0; self.wedges.len()];
        for (i, w) in (0u32..).zip(&self.wedges) {
            let at = &mut ends[w.vertex as usize];
            wedges[*at as usize] = i;
            *at += 1;
        }
        WedgesOfVertices { ends, wedges }
    }

    /// The wedge that looks most like another: least squared difference of normals and of albedo (over 255), the first of equals.
    pub fn alike(&self, among: &[u32], to: &Wedge) -> u32 {
        let off = |w: &u32| {
            let w = &self.wedges[*w as usize];
            w.normal.distance_squared(to.normal) + unit(w.albedo).distance_squared(unit(to.albedo))
        };
        among.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default()
    }

    /// Triangles as parts to draw: one-sided ones before two-sided ones, none without triangles.
    pub fn parts(&self, corners: &[[u32; 3]], two_sided: &[bool]) -> Vec<MeshPart> {
        let of = |two: bool| {
            let mut part = MeshPart { two_sided: two, ..MeshPart::default() };
            let mut local = vec![u32::MAX; self.wedges.len()];
            for &w in corners.iter().zip(two_sided).filter(|(_, t)| **t == two).flat_map(|(c, _)| c) {
                let (at, wedge) = (&mut local[w as usize], &self.wedges[w as usize]);
                if *at == u32::MAX {
                    *at = part.positions.len() as u32;
                    part.positions.push(self.positions[wedge.vertex as usize]);
                    part.normals.push(wedge.normal);
                    part.albedo.push(wedge.albedo);
                }
                part.indices.push(*at);
            }
            part
        };
        [false, true].map(of).into_iter().filter(|p| !p.indices.is_empty()).collect()
    }
}

fn unit(c: [u8; 4]) -> Vec3 {
    Vec3::new(f32::from(c[0]), f32::from(c[1]), f32::from(c[2])) / 255.0
}

/// Names of wedges: vertex, bits of the normal, albedo.
type Names = HashMap<(u32, [u32; 3], [u8; 4]), u32>;

/// Placed chunks in one piece, positions relative to `origin`.
///
/// # Errors
/// What reading the geometry gives.
pub fn gather(scene: &Scene, chunks: impl IntoIterator<Item = ChunkId>, origin: DVec3) -> Result<Gathered, Fault> {
    let mut out = Gathered { origin, ..Gathered::default() };
    let mut local: HashMap<(ObjectId, u32), u32> = HashMap::new();
    let mut names = Names::new();
    for c in chunks {
        let placed = &scene.chunks[c.index()];
        let object = &scene.objects[placed.object.index()];
        let place = DAffine3::from_translation(-origin) * object.placement;
        let turn = normal_matrix(&object.placement.matrix3);
        let material = scene.materials.get(scene.material_of(c).index()).cloned().unwrap_or_default();
        let texture = material.texture.and_then(|t| Some((t.0, scene.textures.get(t.index())?)));
        scene.geometry.with(placed.source, &mut |chunk| {
            let looks = Looks { chunk, material: &material, texture };
            let wedges: Vec<u32> = (0..chunk.positions.len())
                .map(|i| {
                    let name = (placed.object, chunk.vertex_ids[i]);
                    let vertex = *local.entry(name).or_insert_with(|| {
                        out.positions.push(place.transform_point3(chunk.positions[i].as_dvec3()).as_vec3());
                        out.names.push(name);
                        out.positions.len() as u32 - 1
                    });
                    looks.wedge(i, vertex, &turn, &mut names, &mut out.wedges)
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
