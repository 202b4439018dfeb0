//! Putting a scene together.

use glam::{DAffine3, DVec3, Vec3};

use super::{
    CutMesh, Geometry, InMemory, MAX_CHUNK_TRIANGLES, Material, MeshInfo, Object, PlacedChunk, Scene, Texture, cut,
};
use crate::id::{MeshChunkId, MeshId, ObjectId};
use crate::mesh::{ChunkMesh, TriangleMesh};
use crate::octree::Octree;
use crate::{Aabb, Fault};

/// A mesh and where it stands in the world.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Which mesh.
    pub mesh: MeshId,
    /// From mesh space to the world.
    pub transform: DAffine3,
}

/// Collects meshes, placements, materials and textures, then builds the scene.
#[derive(Default)]
pub struct SceneBuilder {
    /// Materials, named by index in the meshes' sections.
    pub materials: Vec<Material>,
    /// Textures, named by index in the materials.
    pub textures: Vec<Texture>,
    meshes: Vec<MeshInfo>,
    /// The chunks of each mesh; none of those that are kept elsewhere.
    chunks: Vec<Vec<ChunkMesh>>,
    placements: Vec<Placement>,
}

/// The digest of a mesh's chunks, which are added one after another.
#[derive(Default)]
pub struct ChunkDigest(blake3::Hasher);

impl ChunkDigest {
    /// Adds the next chunk. Vertex ids follow from the positions and are left out.
    pub fn add(&mut self, c: &ChunkMesh) {
        for part in [
            bytemuck::cast_slice::<_, u8>(&c.positions),
            bytemuck::cast_slice(&c.normals),
            bytemuck::cast_slice(&c.uvs),
            bytemuck::cast_slice(&c.colors),
            bytemuck::cast_slice(&c.indices),
        ] {
            self.0.update(part);
        }
    }

    /// Of all that was added.
    pub fn finish(&self) -> [u8; 32] {
        *self.0.finalize().as_bytes()
    }
}

impl SceneBuilder {
    /// Adds a mesh.
    ///
    /// # Errors
    /// [`Fault::Data`] naming the mesh, where an index, a section, an attribute's length or a position is wrong.
    pub fn mesh(&mut self, name: &str, mesh: TriangleMesh) -> Result<MeshId, Fault> {
        check(&mesh).map_err(|cause| Fault::Data { place: format!("mesh \"{name}\""), cause })?;
        let CutMesh { infos, chunks, vertex_ids } = cut(mesh, MAX_CHUNK_TRIANGLES);
        let mut digest = ChunkDigest::default();
        chunks.iter().for_each(|c| digest.add(c));
        self.meshes.push(MeshInfo::new(name, infos, vertex_ids, digest.finish()));
        self.chunks.push(chunks);
        Ok(MeshId(self.meshes.len() as u32 - 1))
    }

    /// Adds a mesh whose chunks are kept elsewhere: [`SceneBuilder::build_over`] gets them.
    pub fn kept(&mut self, mesh: MeshInfo) -> MeshId {
        self.meshes.push(mesh);
        self.chunks.push(vec![]);
        MeshId(self.meshes.len() as u32 - 1)
    }

    /// Places a mesh.
    pub fn place(&mut self, placement: Placement) {
        self.placements.push(placement);
    }

    /// Moves everything placed so far through the world.
    pub fn shift(&mut self, by: DVec3) {
        self.placements.iter_mut().for_each(|p| p.transform = DAffine3::from_translation(by) * p.transform);
    }

    /// Builds the scene. Its local frame starts in the middle of everything placed, at the lowest point's height.
    ///
    /// # Errors
    /// [`Fault::Data`] where a placement is not finite or names no mesh, or a section names no material.
    pub fn build(mut self) -> Result<Scene, Fault> {
        let geometry = InMemory(std::mem::take(&mut self.chunks));
        self.build_over(Box::new(geometry))
    }

    /// The same, with `geometry` for the way to triangles: it has the chunks of every mesh, in the order in which meshes were added.
    ///
    /// # Errors
    /// As [`SceneBuilder::build`].
    pub fn build_over(self, geometry: Box<dyn Geometry>) -> Result<Scene, Fault> {
        let place = |i: usize| format!("object {i}");
        let infos = self.meshes;
        let mut hash = blake3::Hasher::new();
        for m in &infos {
            if let Some(c) = m.chunks.iter().find(|c| c.material.index() >= self.materials.len()) {
                return Err(Fault::Data {
                    place: format!("mesh \"{}\"", m.name),
                    cause: format!("material {} of {}", c.material.0, self.materials.len()),
                });
            }
            hash.update(&m.digest);
            for c in &m.chunks {
                hash.update(bytemuck::cast_slice(&[c.material.0, c.triangles, c.vertices]));
            }
        }
        for m in &self.materials {
            hash.update(serde_json::to_string(m).unwrap_or_default().as_bytes());
        }
        for t in &self.textures {
            hash.update(bytemuck::cast_slice(&t.size));
            hash.update(bytemuck::cast_slice(&t.rgba));
        }

        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (i, p) in self.placements.iter().enumerate() {
            let mesh = infos.get(p.mesh.index()).ok_or_else(|| Fault::Data {
                place: place(i),
                cause: format!("mesh {} of {}", p.mesh.0, infos.len()),
            })?;
            if mesh.bounds.is_empty() {
                continue;
            }
            for c in mesh.bounds.corners() {
                let w = p.transform.transform_point3(c.as_dvec3());
                (low, high) = (low.min(w), high.max(w));
            }
        }
        let empty = !low.cmple(high).all();
        let origin =
            if empty { DVec3::ZERO } else { DVec3::new(0.5 * (low.x + high.x), low.y, 0.5 * (low.z + high.z)) };
        if !origin.is_finite() || !(high - low).as_vec3().is_finite() && !empty {
            return Err(Fault::Data { place: "placements".into(), cause: "the scene's extent is not finite".into() });
        }

        let (mut objects, mut chunks) = (vec![], vec![]);
        for (i, p) in self.placements.iter().enumerate() {
            let mesh = &infos[p.mesh.index()];
            let placement = DAffine3::from_translation(-origin) * p.transform;
            if !placement.is_finite() || placement.matrix3.determinant() == 0.0 {
                return Err(Fault::Data {
                    place: place(i),
                    cause: "its transform is not finite or flattens it".into(),
                });
            }
            let first = chunks.len() as u32;
            for (k, c) in mesh.chunks.iter().enumerate() {
                chunks.push(PlacedChunk {
                    object: ObjectId(i as u32),
                    source: MeshChunkId { mesh: p.mesh, chunk: k as u32 },
                    triangles: c.triangles,
                    bounds: c.bounds.transformed(&placement),
                });
            }
            let bounds = chunks[first as usize..].iter().fold(Aabb::EMPTY, |b, c: &PlacedChunk| b.union(c.bounds));
            hash.update(&p.mesh.0.to_le_bytes());
            hash.update(bytemuck::cast_slice(&placement.to_cols_array()));
            objects.push(Object { mesh: p.mesh, placement, chunks: first..chunks.len() as u32, bounds });
        }
        let bounds = objects.iter().fold(Aabb::EMPTY, |b, o| b.union(o.bounds));
        let boxes: Vec<(Aabb, u32)> = chunks.iter().map(|c: &PlacedChunk| (c.bounds, c.triangles)).collect();
        Ok(Scene {
            origin,
            bounds: if bounds.is_empty() { Aabb::of([Vec3::ZERO]) } else { bounds },
            meshes: infos,
            objects,
            octree: Octree::over(&boxes, 20_000),
            chunks,
            materials: self.materials,
            textures: self.textures,
            digest: *hash.finalize().as_bytes(),
            geometry,
        })
    }
}

fn check(m: &TriangleMesh) -> Result<(), String> {
    let n = m.positions.len();
    for (what, len) in [("normals", m.normals.len()), ("uvs", m.uvs.len()), ("colours", m.colors.len())] {
        if len != 0 && len != n {
            return Err(format!("{len} {what} for {n} vertices"));
        }
    }
    if !m.indices.len().is_multiple_of(3) {
        return Err(format!("{} indices are not whole triangles", m.indices.len()));
    }
    if let Some((i, v)) = m.indices.iter().enumerate().find(|&(_, &v)| v as usize >= n) {
        return Err(format!("triangle {} names vertex {v} of {n}", i / 3));
    }
    if let Some(i) = m.positions.iter().position(|p| !p.is_finite()) {
        return Err(format!("vertex {i} is not finite"));
    }
    let mut at = 0;
    for (r, _) in &m.sections {
        if r.start != at || r.end < r.start || !r.end.is_multiple_of(3) {
            return Err(format!("sections do not join at index {at}"));
        }
        at = r.end;
    }
    if at as usize != m.indices.len() {
        return Err(format!("sections cover {at} of {} indices", m.indices.len()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::MaterialId;

    fn triangle() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![0, 1, 2],
            sections: vec![(0..3, MaterialId(0))],
            ..Default::default()
        }
    }
    fn scene_at(offset: DVec3) -> Scene {
        let mut b = SceneBuilder { materials: vec![Material::default()], ..Default::default() };
        let mesh = b.mesh("triangle", triangle()).unwrap();
        for x in [0.1, 7.3] {
            b.place(Placement { mesh, transform: DAffine3::from_translation(offset + DVec3::X * x) });
        }
        b.build().unwrap()
    }

    #[test]
    fn a_scene_far_away_is_the_same_scene() {
        let (home, away) = (scene_at(DVec3::ZERO), scene_at(DVec3::splat(1e7)));
        assert!((away.origin - home.origin - DVec3::splat(1e7)).length() < 1e-6);
        for (a, b) in home.chunks.iter().zip(&away.chunks) {
            assert!(a.bounds.min.distance(b.bounds.min) < 1e-6 && a.bounds.max.distance(b.bounds.max) < 1e-6);
        }
    }

    #[test]
    fn the_digest_tells_which_material_a_mesh_wears() {
        let of = |material: u32| {
            let red = Material { base_color: [1.0, 0.0, 0.0, 1.0], ..Material::default() };
            let mut b = SceneBuilder { materials: vec![Material::default(), red], ..Default::default() };
            let sections = vec![(0..3, MaterialId(material))];
            let mesh = b.mesh("triangle", TriangleMesh { sections, ..triangle() }).unwrap();
            b.place(Placement { mesh, transform: DAffine3::IDENTITY });
            b.build().unwrap().digest
        };
        assert_eq!(of(0), of(0));
        assert_ne!(of(0), of(1));
    }

    #[test]
    fn wrong_meshes_are_refused_with_their_cause() {
        let refused = |change: &dyn Fn(&mut TriangleMesh)| {
            let mut m = triangle();
            change(&mut m);
            SceneBuilder::default().mesh("bad", m).unwrap_err().to_string()
        };
        assert_eq!(refused(&|m| m.indices[1] = 9), "mesh \"bad\": triangle 0 names vertex 9 of 3");
        assert_eq!(refused(&|m| m.positions[2].x = f32::NAN), "mesh \"bad\": vertex 2 is not finite");
        assert_eq!(refused(&|m| m.sections.clear()), "mesh \"bad\": sections cover 0 of 3 indices");
        assert_eq!(refused(&|m| m.normals.push(Vec3::X)), "mesh \"bad\": 1 normals for 3 vertices");
    }

    #[test]
    fn an_empty_scene_is_a_scene() {
        let s = SceneBuilder::default().build().unwrap();
        assert_eq!((s.triangles(), s.chunks.len()), (0, 0));
    }
}
