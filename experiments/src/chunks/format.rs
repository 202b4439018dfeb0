//! The bytes of a chunk file.
//!
//! `header | blocks | index`. The header: magic with the version, the index's place, length and checksum, and a checksum of
//! all that. A block is a chunk's arrays one after another, little-endian, as they lie in memory, but indices in 16 bits
//! where they fit; or a texture's texels. The index ([`Kept`]) is postcard. Checksums are BLAKE3: of every block its own, so
//! that a block is checked when it is read. About 20 bytes a triangle without texture coordinates and colours.

use farfield_core::mesh::{ChunkMesh, MeshChunk};
use farfield_core::scene::{Material, MeshInfo};
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

const _: () = assert!(cfg!(target_endian = "little"), "chunk files are little-endian");

/// Begins every file, and holds the version: files of other versions are made anew.
pub(super) const MAGIC: &[u8; 8] = b"FFCHNK01";
/// Magic, index offset and length, checksum of the index, checksum of all of these.
pub(super) const HEADER: usize = 8 + 8 + 8 + 32 + 32;

/// Where a block stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// From the file's start.
    pub offset: u64,
    /// Its length.
    pub bytes: u64,
    /// Of its bytes.
    pub checksum: [u8; 32],
    /// Whether vertices have texture coordinates.
    pub uvs: bool,
    /// Whether vertices have colours.
    pub colors: bool,
}

/// The index: all of a scene but its triangles and texels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// Meshes.
    pub meshes: Vec<MeshInfo>,
    /// The blocks of their chunks.
    pub blocks: Vec<Vec<Block>>,
    /// Which mesh stands where, in the input's units and axes: columns of the transform.
    pub placements: Vec<(u32, [f64; 12])>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures: name, size in texels, block.
    pub textures: Vec<(String, [u32; 2], Block)>,
    /// What the importer left out or guessed.
    pub warnings: Vec<String>,
    /// Other files that were read, or looked for, with the digests of their contents.
    pub beside: Vec<(String, Option<[u8; 32]>)>,
}

/// The header of a file whose index stands at `offset`.
pub(super) fn header(offset: u64, index: &[u8]) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    out.extend(offset.to_le_bytes());
    out.extend((index.len() as u64).to_le_bytes());
    out.extend(blake3::hash(index).as_bytes());
    let all = *blake3::hash(&out).as_bytes();
    out.extend(all);
    out
}

/// Offset, length and checksum of the index, or what is wrong with the header.
pub(super) fn index_place(header: &[u8; HEADER]) -> Result<(u64, u64, [u8; 32]), &'static str> {
    let (rest, checksum) = header.split_at(HEADER - 32);
    if !rest.starts_with(MAGIC) {
        return Err("it is no chunk file of this version");
    }
    if blake3::hash(rest).as_bytes() != checksum {
        return Err("the checksum of its header fails");
    }
    let number = |at: usize| rest[at..at + 8].iter().rev().fold(0, |n, &b| n << 8 | u64::from(b));
    let mut index = [0; 32];
    index.copy_from_slice(&rest[24..56]);
    Ok((number(8), number(16), index))
}

/// A chunk as a block.
pub(super) fn encode(c: &ChunkMesh) -> Vec<u8> {
    let mut out = Vec::with_capacity(c.positions.len() * 40 + c.indices.len() * 4);
    for part in [
        bytemuck::cast_slice::<_, u8>(&c.positions),
        bytemuck::cast_slice(&c.normals),
        bytemuck::cast_slice(&c.vertex_ids),
        bytemuck::cast_slice(&c.uvs),
        bytemuck::cast_slice(&c.colors),
    ] {
        out.extend_from_slice(part);
    }
    if c.positions.len() <= 1 << 16 {
        c.indices.iter().for_each(|&i| out.extend((i as u16).to_le_bytes()));
    } else {
        out.extend_from_slice(bytemuck::cast_slice(&c.indices));
    }
    out
}

/// The chunk in a block; `None` where the length is not what the index says.
pub(super) fn decode(bytes: &[u8], info: &MeshChunk, block: &Block) -> Option<ChunkMesh> {
    let (n, corners) = (info.vertices as usize, 3 * info.triangles as usize);
    let mut rest = bytes;
    let mut next = |len: usize| -> Option<&[u8]> {
        let (part, after) = rest.split_at_checked(len)?;
        rest = after;
        Some(part)
    };
    let positions: Vec<Vec3> = bytemuck::pod_collect_to_vec(next(12 * n)?);
    let normals: Vec<Vec3> = bytemuck::pod_collect_to_vec(next(12 * n)?);
    let vertex_ids: Vec<u32> = bytemuck::pod_collect_to_vec(next(4 * n)?);
    let uvs: Vec<Vec2> = bytemuck::pod_collect_to_vec(next(if block.uvs { 8 * n } else { 0 })?);
    let colors: Vec<[u8; 4]> = bytemuck::pod_collect_to_vec(next(if block.colors { 4 * n } else { 0 })?);
    let indices = if n <= 1 << 16 {
        next(2 * corners)?.chunks_exact(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect()
    } else {
        bytemuck::pod_collect_to_vec(next(4 * corners)?)
    };
    rest.is_empty().then_some(ChunkMesh { positions, normals, uvs, colors, vertex_ids, indices })
}

/// What a chunk takes in memory.
pub(super) fn held_bytes(info: &MeshChunk, block: &Block) -> u64 {
    let vertex = 28 + if block.uvs { 8 } else { 0 } + if block.colors { 4 } else { 0 };
    size_of::<ChunkMesh>() as u64 + u64::from(info.vertices) * vertex + u64::from(info.triangles) * 12
}
