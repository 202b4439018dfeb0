//! A surface pass made ready for casting: the instances that its draws name, relative to the eye, under one hierarchy.

use std::collections::BTreeMap;
use std::sync::Arc;

use farfield_core::bvh::BoxBvh;
use farfield_core::draw::{Draw, DrawWhat};
use farfield_core::id::{Block, MeshChunkId, PayloadRef};
use farfield_core::layered::LayeredPart;
use farfield_core::payload::{AtlasPart, Projector};
use farfield_core::scene::{ChunkSet, Texture};
use farfield_core::{Aabb, Fault};
use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};

use crate::block::{Lines, Points, Ready, ReadyPart, Surface};
use crate::tables::Tables;

/// Where blocks are found.
pub(crate) type Blocks = BTreeMap<Block, Arc<Ready>>;

/// Space in which several instances' triangles live: an object's mesh space, or a payload's.
pub(crate) struct Space {
    /// The eye in it.
    pub(crate) eye: DVec3,
    /// Takes directions into it.
    pub(crate) directions: DMat3,
    /// Takes its normals to the local frame.
    pub(crate) normals: Mat3,
    /// Whether it is mirrored against the local frame.
    pub(crate) mirrors: bool,
}

/// How an instance's pixels are painted.
pub(crate) enum Paint<'a> {
    /// By a scene material.
    Material { base: Vec3, texture: Option<&'a Texture> },
    /// By its vertices.
    Vertices,
    /// By projectors, each with its atlas.
    Projectors { views: &'a [u32], projectors: &'a [Projector], atlases: Vec<&'a AtlasPart> },
}

/// Triangles in their place.
pub(crate) struct Instance<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) space: u32,
    pub(crate) paint: Paint<'a>,
    pub(crate) two_sided: bool,
    /// What the object plane says.
    pub(crate) object: u32,
}

/// Points or lines in their place.
pub(crate) struct Placed<'a, T> {
    pub(crate) part: &'a T,
    /// The payload's origin from the eye.
    pub(crate) from_eye: Vec3,
    /// What the object plane says.
    pub(crate) object: u32,
}

/// See the module.
#[derive(Default)]
pub(crate) struct Frame<'a> {
    pub(crate) spaces: Vec<Space>,
    pub(crate) instances: Vec<Instance<'a>>,
    pub(crate) top: BoxBvh,
    /// Layered depth images, each with where its payload stands.
    pub(crate) images: Vec<(DVec3, &'a LayeredPart)>,
    /// Points, in the draws' order.
    pub(crate) points: Vec<Placed<'a, Points>>,
    /// Lines, in the draws' order.
    pub(crate) lines: Vec<Placed<'a, Lines>>,
    /// Triangles of original geometry and of payloads.
    pub(crate) near_triangles: u64,
    pub(crate) far_triangles: u64,
    boxes: Vec<Aabb>,
}

impl<'a> Frame<'a> {
    /// Collects the draws' instances.
    ///
    /// # Errors
    /// [`Fault::Refused`] naming what a draw asks for that is not there.
    pub(crate) fn of_draws(eye: DVec3, draws: &[Draw], tables: &'a Tables, blocks: &'a Blocks) -> Result<Self, Fault> {
        let mut frame = Self::default();
        for d in draws {
            match &d.what {
                DrawWhat::Chunks(set) => {
                    frame.chunks(eye, set, tables, |chunk| match blocks.get(&Block::Chunk(chunk)).map(|b| &**b) {
                        Some(Ready::Chunk(s)) => Ok(s),
                        _ => Err(missing(Block::Chunk(chunk))),
                    })?
                }
                &DrawWhat::Payload { id, part, object } => frame.payload(eye, id, part, object, blocks)?,
            }
        }
        frame.top = BoxBvh::build(&frame.boxes);
        Ok(frame)
    }

    /// The frame of a set of placed chunks, whose surfaces `find` gives.
    ///
    /// # Errors
    /// Those of `find`; [`Fault::Refused`] where the scene has no such chunk.
    pub(crate) fn of_chunks(
        eye: DVec3,
        set: &ChunkSet,
        tables: &'a Tables,
        find: impl Fn(MeshChunkId) -> Result<&'a Surface, Fault>,
    ) -> Result<Self, Fault> {
        let mut frame = Self::default();
        frame.chunks(eye, set, tables, find)?;
        frame.top = BoxBvh::build(&frame.boxes);
        Ok(frame)
    }

    fn chunks(
        &mut self,
        eye: DVec3,
        set: &ChunkSet,
        tables: &'a Tables,
        find: impl Fn(MeshChunkId) -> Result<&'a Surface, Fault>,
    ) -> Result<(), Fault> {
        let mut object = None;
        for run in set.runs() {
            for c in tables.run(run.clone())? {
                let placed = &tables.objects[c.object as usize];
                if object != Some(c.object) {
                    object = Some(c.object);
                    self.spaces.push(Space {
                        eye: placed.inverse.transform_point3(eye),
                        directions: placed.inverse.matrix3,
                        normals: unit_scale(placed.normals),
                        mirrors: placed.mirrors,
                    });
                }
                let (texture, base) = tables.material(c.material);
                self.near_triangles += u64::from(c.triangles);
                let from_eye = DAffine3::from_translation(-eye) * placed.placement;
                self.boxes.push(c.bounds.transformed(&from_eye));
                self.instances.push(Instance {
                    surface: find(c.source)?,
                    space: self.spaces.len() as u32 - 1,
                    paint: Paint::Material { base, texture },
                    two_sided: tables.materials[c.material.index()].two_sided,
                    object: c.object + 1,
                });
            }
        }
        Ok(())
    }

    fn payload(&mut self, eye: DVec3, id: PayloadRef, part: u16, object: u32, blocks: &'a Blocks) -> Result<(), Fault> {
        let Some(Ready::Payload { origin, parts }) = blocks.get(&Block::Payload(id)).map(|b| &**b) else {
            return Err(missing(Block::Payload(id)));
        };
        if let Some(ReadyPart::Layered(image)) = parts.get(part as usize) {
            if object != 0 {
                return Err(Fault::Refused(format!("part {part} of {id:?}: the samples have objects of their own")));
            }
            self.images.push((*origin, image));
            return Ok(());
        }
        if object == 0 {
            return Err(Fault::Refused(format!("part {part} of {id:?}: object 0 means nothing hit")));
        }
        let from_eye = (*origin - eye).as_vec3();
        let (surface, two_sided, paint) = match parts.get(part as usize) {
            Some(ReadyPart::Mesh { surface, two_sided }) => (surface, *two_sided, Paint::Vertices),
            Some(ReadyPart::Projected { surface, two_sided, views, projectors }) => {
                let atlases = projectors.iter().map(|p| atlas(id, p, blocks)).collect::<Result<_, _>>()?;
                (surface, *two_sided, Paint::Projectors { views, projectors, atlases })
            }
            Some(ReadyPart::Points(part)) => {
                self.points.push(Placed { part, from_eye, object });
                return Ok(());
            }
            Some(ReadyPart::Lines(part)) => {
                self.lines.push(Placed { part, from_eye, object });
                return Ok(());
            }
            Some(ReadyPart::Atlas(_)) => {
                return Err(Fault::Refused(format!("part {part} of {id:?} is an atlas and cannot be drawn")));
            }
            Some(ReadyPart::Layered(_)) | None => {
                return Err(Fault::Refused(format!("{id:?} has no part {part}, only {}", parts.len())));
            }
        };
        self.far_triangles += surface.indices.len() as u64 / 3;
        let Some(bounds) = surface.bvh.bounds() else { return Ok(()) };
        self.boxes.push(bounds.transformed(&DAffine3::from_translation(*origin - eye)));
        let space = Space { eye: eye - *origin, directions: DMat3::IDENTITY, normals: Mat3::IDENTITY, mirrors: false };
        self.spaces.push(space);
        let space = self.spaces.len() as u32 - 1;
        self.instances.push(Instance { surface, space, paint, two_sided, object });
        Ok(())
    }
}

/// A projector's atlas, once its layer and rectangle have been found to lie in it.
fn atlas<'a>(of: PayloadRef, p: &Projector, blocks: &'a Blocks) -> Result<&'a AtlasPart, Fault> {
    let id = PayloadRef { asset: of.asset, id: p.atlas };
    let Some(Ready::Payload { parts, .. }) = blocks.get(&Block::Payload(id)).map(|b| &**b) else {
        return Err(missing(Block::Payload(id)));
    };
    let Some(ReadyPart::Atlas(a)) = parts.first() else {
        return Err(Fault::Refused(format!("the first part of {id:?} is no atlas, as a projector of {of:?} expects")));
    };
    let inside = |k: usize| p.rect[k + 2] > 0 && u64::from(p.rect[k]) + u64::from(p.rect[k + 2]) <= a.size[k].into();
    if p.layer >= a.layers || !inside(0) || !inside(1) {
        return Err(Fault::Refused(format!(
            "a projector of {of:?} takes {:?} of layer {} from an atlas of {} layers of {:?} texels",
            p.rect, p.layer, a.layers, a.size
        )));
    }
    Ok(a)
}

fn missing(block: Block) -> Fault {
    Fault::Refused(format!("a draw needs {block:?}, which was not uploaded"))
}

/// The matrix scaled so that its largest entry is 1: only directions matter, and scales of 1e-6 or 1e6 stay within 32 bits.
fn unit_scale(m: DMat3) -> Mat3 {
    let largest = m.to_cols_array().into_iter().fold(0f64, |a, v| a.max(v.abs()));
    if largest > 0.0 && largest.is_finite() { (m * largest.recip()).as_mat3() } else { Mat3::IDENTITY }
}
