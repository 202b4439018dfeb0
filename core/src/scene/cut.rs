//! Cutting a mesh into chunks: an octree in the mesh's own space, by the triangles' centroids, one material a chunk.
//! O(n log n).
//!
//! The octree is a rule that looks at one triangle at a time ([`Cell`]), so that meshes larger than memory can be divided on
//! disk by the same rule until a cell fits, and cut from there on ([`Cutter`]): the chunks are the same, bit for bit.

use glam::Vec3;

use crate::Aabb;
use crate::id::MaterialId;
use crate::mesh::{ChunkMesh, MeshChunk, TriangleMesh, position_ids};

/// The most triangles of a chunk: small enough to cull finely, large enough for one draw.
pub const MAX_CHUNK_TRIANGLES: usize = 4096;

/// A mesh in chunks: what is known of each, and each.
pub struct CutMesh {
    /// The chunks' descriptions.
    pub infos: Vec<MeshChunk>,
    /// The chunks.
    pub chunks: Vec<ChunkMesh>,
    /// Positions that differ.
    pub vertex_ids: u32,
}

/// Cuts `mesh` until no chunk has more than `max_triangles`. Normals are made where the mesh has none.
///
/// # Panics
/// When indices or sections of the mesh are out of range: importers check them.
pub fn cut(mut mesh: TriangleMesh, max_triangles: usize) -> CutMesh {
    if mesh.normals.len() != mesh.positions.len() {
        mesh.smooth_normals();
    }
    let first = position_ids(&mesh.positions);
    let mut names = vec![u32::MAX; mesh.positions.len()];
    let mut vertex_ids = 0;
    for (i, &f) in first.iter().enumerate() {
        if f as usize == i {
            names[i] = vertex_ids;
            vertex_ids += 1;
        }
    }
    let names: Vec<u32> = first.iter().map(|&f| names[f as usize]).collect();

    let (mut infos, mut chunks) = (vec![], vec![]);
    let mut cutter = Cutter::new(&mesh, &names, max_triangles);
    for (range, material) in &mesh.sections {
        let triangles: Vec<u32> = (range.start / 3..range.end / 3).collect();
        let root = Cell::root(Aabb::of(triangles.iter().map(|&t| cutter.centroid(t))));
        cutter.cut(root, triangles, *material, &mut |info, chunk| {
            infos.push(info);
            chunks.push(chunk);
        });
    }
    CutMesh { infos, chunks, vertex_ids }
}

/// What a triangle counts as in the octree.
pub fn centroid(corners: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners.map(|p| p / 3.0);
    a + b + c
}

/// A cell of the octree over centroids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Where the centroids of its triangles are.
    pub bounds: Aabb,
    /// 0 for the root.
    pub depth: u32,
}

impl Cell {
    /// Cells this deep are not divided by place but by number: that stops coincident centroids.
    pub const MAX_DEPTH: u32 = 24;

    /// The cell of everything; `bounds` is the box of all centroids.
    pub fn root(bounds: Aabb) -> Self {
        Self { bounds, depth: 0 }
    }

    /// Which of its eight children holds a centroid: x, y, z are bits 0, 1, 2.
    pub fn octant(&self, centroid: Vec3) -> usize {
        let (p, c) = (centroid, self.bounds.centre());
        usize::from(p.x > c.x) | usize::from(p.y > c.y) << 1 | usize::from(p.z > c.z) << 2
    }

    /// A child; chunks come in the order of the octants.
    pub fn child(&self, octant: usize) -> Self {
        let (b, c) = (self.bounds, self.bounds.centre());
        let high = glam::BVec3::new(octant & 1 != 0, octant & 2 != 0, octant & 4 != 0);
        let bounds = Aabb { min: Vec3::select(high, c, b.min), max: Vec3::select(high, b.max, c) };
        Self { bounds, depth: self.depth + 1 }
    }
}

/// Cuts cells of a mesh into chunks.
pub struct Cutter<'a> {
    mesh: &'a TriangleMesh,
    /// Of each vertex.
    names: &'a [u32],
    max_triangles: usize,
    /// Chunk-local numbers; all `u32::MAX` between chunks.
    local: Vec<u32>,
}

impl<'a> Cutter<'a> {
    /// For a mesh with normals; `names` are the mesh-wide names of its vertices' positions.
    pub fn new(mesh: &'a TriangleMesh, names: &'a [u32], max_triangles: usize) -> Self {
        Self { mesh, names, max_triangles: max_triangles.max(1), local: vec![u32::MAX; mesh.positions.len()] }
    }

    fn centroid(&self, t: u32) -> Vec3 {
        centroid([0, 1, 2].map(|k| self.mesh.positions[self.mesh.indices[3 * t as usize + k] as usize]))
    }

    /// Gives the chunks of the cell's triangles (numbers of triangles of the mesh), in Morton order.
    pub fn cut(
        &mut self,
        cell: Cell,
        triangles: Vec<u32>,
        material: MaterialId,
        emit: &mut dyn FnMut(MeshChunk, ChunkMesh),
    ) {
        if triangles.is_empty() {
            return;
        }
        if triangles.len() <= self.max_triangles || cell.depth == Cell::MAX_DEPTH {
            for part in triangles.chunks(self.max_triangles) {
                let (info, chunk) = self.compact(part, material);
                emit(info, chunk);
            }
            return;
        }
        let mut parts: [Vec<u32>; 8] = Default::default();
        for t in triangles {
            parts[cell.octant(self.centroid(t))].push(t);
        }
        for (i, part) in parts.into_iter().enumerate() {
            self.cut(cell.child(i), part, material, emit);
        }
    }

    fn compact(&mut self, triangles: &[u32], material: MaterialId) -> (MeshChunk, ChunkMesh) {
        let (mesh, local) = (self.mesh, &mut self.local);
        let mut out = ChunkMesh::default();
        let mut used = vec![];
        for &t in triangles {
            for k in 0..3 {
                let v = mesh.indices[3 * t as usize + k] as usize;
                if local[v] == u32::MAX {
                    local[v] = used.len() as u32;
                    used.push(v);
                }
                out.indices.push(local[v]);
            }
        }
        out.positions = used.iter().map(|&v| mesh.positions[v]).collect();
        out.normals = used.iter().map(|&v| mesh.normals[v]).collect();
        out.vertex_ids = used.iter().map(|&v| self.names[v]).collect();
        if !mesh.uvs.is_empty() {
            out.uvs = used.iter().map(|&v| mesh.uvs[v]).collect();
        }
        if !mesh.colors.is_empty() {
            out.colors = used.iter().map(|&v| mesh.colors[v]).collect();
        }
        used.iter().for_each(|&v| local[v] = u32::MAX);
        let info = MeshChunk {
            triangles: triangles.len() as u32,
            vertices: out.positions.len() as u32,
            bounds: Aabb::of(out.positions.iter().copied()),
            material,
        };
        (info, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: u32) -> TriangleMesh {
        let at = |x: u32, z: u32| x + z * (n + 1);
        let indices: Vec<u32> = (0..n * n)
            .flat_map(|i| {
                let (x, z) = (i % n, i / n);
                [at(x, z), at(x, z + 1), at(x + 1, z), at(x + 1, z), at(x, z + 1), at(x + 1, z + 1)]
            })
            .collect();
        TriangleMesh {
            positions: (0..(n + 1) * (n + 1))
                .map(|i| Vec3::new((i % (n + 1)) as f32, 0.0, (i / (n + 1)) as f32))
                .collect(),
            sections: vec![(0..indices.len() as u32, MaterialId(0))],
            indices,
            ..Default::default()
        }
    }

    #[test]
    fn chunks_hold_every_triangle_once_and_weld_back() {
        let mesh = grid(40);
        let cut = cut(mesh.clone(), 100);
        assert!(cut.infos.iter().all(|c| c.triangles <= 100));
        assert_eq!(cut.vertex_ids, 41 * 41);
        let mut position = vec![Vec3::NAN; 41 * 41];
        let mut back: Vec<[u32; 3]> = vec![];
        for c in &cut.chunks {
            c.vertex_ids.iter().zip(&c.positions).for_each(|(&i, &p)| position[i as usize] = p);
            back.extend(c.indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| c.vertex_ids[t[k] as usize])));
        }
        let key = |t: [Vec3; 3]| t.map(|p| [p.x as i32, p.z as i32]);
        let mut a: Vec<_> = back.iter().map(|t| key(t.map(|v| position[v as usize]))).collect();
        let mut b: Vec<_> =
            mesh.indices.chunks_exact(3).map(|t| key([0, 1, 2].map(|k| mesh.positions[t[k] as usize]))).collect();
        a.sort_unstable();
        b.sort_unstable();
        assert_eq!(a, b);
        assert!(cut.chunks.iter().all(|c| c.normals.iter().all(|n| n.distance(Vec3::Y) < 1e-6)));
    }

    #[test]
    fn coincident_triangles_are_cut_by_number() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z],
            indices: [0, 1, 2].repeat(1000),
            sections: vec![(0..3000, MaterialId(0))],
            ..Default::default()
        };
        assert_eq!(cut(mesh, 100).infos.len(), 10);
    }
}
