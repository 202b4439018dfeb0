//! Blocks made ready: a hierarchy over the triangles, and what paints them; points and lines as they are drawn.

use farfield_core::Fault;
use farfield_core::backend::{BlockData, validate};
use farfield_core::bvh::TriangleBvh;
use farfield_core::extent::{Extent, Takes};
use farfield_core::id::Block;
use farfield_core::image::octahedral;
use farfield_core::layered::LayeredPart;
use farfield_core::mesh::ChunkMesh;
use farfield_core::payload::{AtlasPart, LinesPart, MeshPart, Part, PointsPart, Projector};
use glam::{DVec3, Vec2, Vec3};

/// What building a hierarchy takes for a while, bytes a triangle: boxes, a binary tree twice, and the tree between it and the wide one.
const BUILD_BYTES: u64 = 320;

/// Triangles with attributes.
pub(crate) struct Surface {
    pub(crate) bvh: TriangleBvh,
    pub(crate) indices: Vec<u32>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    /// sRGB; empty where there are none.
    pub(crate) colors: Vec<[u8; 4]>,
}

/// A part of a payload.
pub(crate) enum ReadyPart {
    Mesh { surface: Surface, two_sided: bool },
    Projected { surface: Surface, two_sided: bool, views: Vec<u32>, projectors: Vec<Projector> },
    Atlas(AtlasPart),
    Layered(LayeredPart),
    Points(Points),
    Lines(Lines),
}

/// A point, or an end of lines.
pub(crate) struct Vertex {
    /// Relative to the payload's origin.
    pub(crate) position: Vec3,
    /// Octahedral, as every backend keeps it.
    pub(crate) normal: u32,
    /// sRGB.
    pub(crate) albedo: [u8; 4],
}

/// Points.
pub(crate) struct Points {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) radius: f32,
    pub(crate) two_sided: bool,
}

/// Lines.
pub(crate) struct Lines {
    pub(crate) vertices: Vec<Vertex>,
    /// Two a line.
    pub(crate) indices: Vec<u32>,
}

/// A block.
pub(crate) enum Ready {
    Chunk(Surface),
    Payload { origin: DVec3, parts: Vec<ReadyPart> },
}

impl Surface {
    pub(crate) fn chunk(c: &ChunkMesh) -> Self {
        Self {
            bvh: TriangleBvh::build(&c.positions, &c.indices),
            indices: c.indices.clone(),
            normals: c.normals.clone(),
            uvs: c.uvs.clone(),
            colors: c.colors.clone(),
        }
    }

    fn part(m: &MeshPart) -> Self {
        Self {
            bvh: TriangleBvh::build(&m.positions, &m.indices),
            indices: m.indices.clone(),
            normals: m.normals.clone(),
            uvs: vec![],
            colors: m.albedo.clone(),
        }
    }

    fn bytes(&self) -> usize {
        self.bvh.bytes()
            + size_of_val(&self.indices[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.colors[..])
    }

    /// The vertices of a triangle.
    pub(crate) fn triangle(&self, i: u32) -> [usize; 3] {
        let i = 3 * i as usize;
        [self.indices[i] as usize, self.indices[i + 1] as usize, self.indices[i + 2] as usize]
    }
}

fn vertices(positions: &[Vec3], normals: &[Vec3], albedo: &[[u8; 4]]) -> Vec<Vertex> {
    let all = positions.iter().zip(normals).zip(albedo);
    all.map(|((&position, &normal), &albedo)| Vertex { position, normal: octahedral(normal), albedo }).collect()
}

/// At most what a block takes. A triangle: three indices, three vertices and a number in the hierarchy, at worst a node of 128 bytes; while
/// the hierarchy is built at most [`BUILD_BYTES`] more.
pub(crate) fn takes(e: &Extent) -> Takes {
    let resident_bytes = (12 + 48 + 4 + 128) * e.triangles
        + 24 * e.chunk_vertices
        + 16 * e.vertices
        + 4 * e.projected_triangles
        + size_of::<Projector>() as u64 * e.projectors
        + 8 * (e.texels + e.lines)
        + e.pixels
        + 10 * e.samples
        + 4 * e.objects
        + size_of::<Vertex>() as u64 * (e.points + e.line_vertices)
        + size_of::<ReadyPart>() as u64 * e.parts
        + size_of::<Ready>() as u64;
    Takes { resident_bytes, passing_bytes: BUILD_BYTES * e.triangles }
}

impl Ready {
    /// # Errors
    /// [`Fault::Data`] where the block contradicts itself.
    pub(crate) fn new(block: Block, data: &BlockData<'_>) -> Result<Self, Fault> {
        validate(block, data)?;
        Ok(match data {
            BlockData::Chunk(c) => Self::Chunk(Surface::chunk(c)),
            BlockData::Payload(p) => Self::Payload {
                origin: p.origin,
                parts: p
                    .parts
                    .iter()
                    .map(|part| match part {
                        Part::Mesh(m) => ReadyPart::Mesh { surface: Surface::part(m), two_sided: m.two_sided },
                        Part::Projected(q) => ReadyPart::Projected {
                            surface: Surface::part(&q.mesh),
                            two_sided: q.mesh.two_sided,
                            views: q.views.clone(),
                            projectors: q.projectors.clone(),
                        },
                        Part::Atlas(a) => ReadyPart::Atlas(a.clone()),
                        Part::Layered(l) => ReadyPart::Layered(l.clone()),
                        Part::Points(PointsPart { positions, normals, albedo, radius, two_sided }) => {
                            let vertices = vertices(positions, normals, albedo);
                            ReadyPart::Points(Points { vertices, radius: *radius, two_sided: *two_sided })
                        }
                        Part::Lines(LinesPart { positions, normals, albedo, indices }) => ReadyPart::Lines(Lines {
                            vertices: vertices(positions, normals, albedo),
                            indices: indices.clone(),
                        }),
                    })
                    .collect(),
            },
        })
    }

    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Chunk(s) => s.bytes(),
            Self::Payload { parts, .. } => parts
                .iter()
                .map(|p| match p {
                    ReadyPart::Mesh { surface, .. } => surface.bytes(),
                    ReadyPart::Projected { surface, views, projectors, .. } => {
                        surface.bytes() + size_of_val(&views[..]) + size_of_val(&projectors[..])
                    }
                    ReadyPart::Atlas(a) => size_of_val(&a.albedo[..]) + size_of_val(&a.normal[..]),
                    ReadyPart::Layered(l) => l.bytes() as usize,
                    ReadyPart::Points(p) => size_of_val(&p.vertices[..]),
                    ReadyPart::Lines(l) => size_of_val(&l.vertices[..]) + size_of_val(&l.indices[..]),
                })
                .sum(),
        };
        bytes as u64
    }
}
