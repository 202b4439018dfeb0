//! A draw list as batches: what is bound once, and how many draws share it.
//!
//! One record and one command a placed chunk or payload part, over the whole frame; a batch is a run of commands that share
//! pipeline, pages and textures, so that a device with multi-draw-indirect takes each in one call (points and lines have a command
//! for every [`quads::QUADS`] of theirs). Draws keep their order
//! within a batch, batches are sorted by their key: the same list over the same residency is the same plan. Layered depth images
//! keep their order and follow the batches of their pass. O(n log batches).

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use farfield_core::covered::Screen;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind, Shading};
use farfield_core::id::{AssetId, Block, LocalPayload, TargetId, TextureId};
use farfield_core::scene::LightKind;
use farfield_core::{Camera, Fault};
use glam::{DVec3, Vec3};

use crate::layout::{
    ATLAS_SLOTS, DrawCommand, GpuLight, Record, ShadeUniform, UNIFORM_ALIGN, ViewUniform, WarpUniform,
};
use crate::pool::{Span, Stream};
use crate::records::{Cull, SceneTable, payload_record};
use crate::residency::{LayeredSlot, PartSlot, Residency, Slot};
use crate::warp::{self, LayeredDraw, SPLAT_BYTES};
use crate::{Shader, quads};

/// A frame, ready to be carried out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FramePlan {
    /// The passes in order.
    pub passes: Vec<PassPlan>,
    /// The draw records of all passes: one storage buffer.
    pub records: Vec<Record>,
    /// The draws of all passes: one indirect buffer.
    pub commands: Vec<DrawCommand>,
    /// The uniforms of all passes: one buffer, bound with dynamic offsets.
    pub uniforms: Vec<u8>,
    /// Original triangles submitted.
    pub near_triangles: u64,
    /// Triangles of payloads submitted.
    pub far_triangles: u64,
    /// Samples of layered depth images submitted.
    pub samples: u64,
    /// Points submitted.
    pub points: u64,
    /// Lines submitted.
    pub lines: u64,
}

/// A pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassPlan {
    /// What it writes.
    pub target: TargetId,
    /// Width and height of what it writes, pixels.
    pub size: [u32; 2],
    /// Where its [`ViewUniform`] or [`ShadeUniform`] starts in the frame's uniforms, bytes.
    pub uniform_offset: u32,
    /// What it does.
    pub work: Work,
    /// Layered depth images drawn over the batches of a surface pass, in order.
    pub layered: Vec<LayeredDraw>,
}

impl PassPlan {
    /// Bytes of its splats: 0 where it draws no layered depth image.
    pub fn splat_bytes(&self) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        if self.layered.is_empty() { 0 } else { SPLAT_BYTES * pixels }
    }
}

/// What a pass does.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Draws batches into a surface target.
    Surface(Vec<Batch>),
    /// Lights the surface target, which is as large as the picture.
    Shade(TargetId),
}

/// A run of draws that share what is bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// What is bound.
    pub key: BatchKey,
    /// Which of the frame's commands.
    pub commands: Range<u32>,
}

/// What is bound for a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BatchKey {
    /// The shader; it says which stream the vertices are of, or that they are pulled.
    pub shader: Shader,
    /// Which faces are left out.
    pub cull: Cull,
    /// The page of vertices; that of [`Bind::Pulled`] where they are pulled.
    pub vertex_page: u32,
    /// The page of indices; 0 where vertices are pulled and [`quads::indices`] serve.
    pub index_page: u32,
    /// The bindings of group 1.
    pub bind: Bind,
}

/// The bindings of group 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Bind {
    /// None: plain payload meshes.
    Nothing,
    /// A scene texture, or one white texel.
    Texture(Option<TextureId>),
    /// The elements that vertices are pulled out of.
    Pulled {
        /// What they are.
        stream: Stream,
        /// Their page.
        page: u32,
    },
    /// Projectors and atlases.
    Atlases {
        /// The asset whose payloads hold the atlases.
        asset: AssetId,
        /// The payload in each slot; any texture serves for an empty one.
        atlases: [Option<LocalPayload>; ATLAS_SLOTS],
        /// The page of projectors; any buffer serves where the part has none.
        projector_page: Option<u32>,
    },
}

/// What earlier frames wrote, with sizes.
#[derive(Clone, Debug, Default)]
pub struct Written {
    /// By surface passes.
    pub surfaces: HashMap<TargetId, [u32; 2]>,
    /// By shading passes.
    pub pictures: HashMap<TargetId, [u32; 2]>,
}

impl FramePlan {
    /// Bytes of the largest pass's splats, 0 where no pass has any.
    pub fn splat_bytes(&self) -> u64 {
        self.passes.iter().map(PassPlan::splat_bytes).max().unwrap_or(0)
    }

    /// Appends a uniform and returns its offset.
    fn uniform(&mut self, bytes: &[u8]) -> u32 {
        let at = self.uniforms.len() as u32;
        self.uniforms.extend_from_slice(bytes);
        self.uniforms.resize(self.uniforms.len().next_multiple_of(UNIFORM_ALIGN), 0);
        at
    }
}

impl Written {
    /// To be called when a plan was carried out.
    pub fn note(&mut self, plan: &FramePlan) {
        for p in &plan.passes {
            match p.work {
                Work::Surface(_) => self.surfaces.insert(p.target, p.size),
                Work::Shade(_) => self.pictures.insert(p.target, p.size),
            };
        }
    }

    /// The size of a surface target, to read it.
    ///
    /// # Errors
    /// [`Fault::Refused`] where no surface pass wrote it.
    pub fn surface(&self, t: TargetId) -> Result<[u32; 2], Fault> {
        let none = || Fault::Refused(format!("target {} was not written by a surface pass", t.0));
        self.surfaces.get(&t).copied().ok_or_else(none)
    }

    /// The size of a picture, to read it.
    ///
    /// # Errors
    /// [`Fault::Refused`] where no shading pass wrote it.
    pub fn picture(&self, t: TargetId) -> Result<[u32; 2], Fault> {
        let none = || Fault::Refused(format!("target {} was not written by a shading pass", t.0));
        self.pictures.get(&t).copied().ok_or_else(none)
    }
}

/// What the device bounds in a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The largest width or height of a target, pixels.
    pub target_px: u32,
    /// The largest storage binding, bytes: it holds the frame's records, or a pass's splats.
    pub storage_bytes: u64,
}

/// Turns a draw list into a plan.
///
/// # Errors
/// [`Fault::Refused`] where a draw names a block that is not resident, a chunk, a part or an atlas that does not exist, where a
/// shading pass reads what no earlier pass wrote or what has another size, has too many lights, where a surface pass has more
/// than [`warp::MAX_IMAGES`] layered depth images, or where the list does not fit the device's limits.
pub fn plan(
    list: &DrawList,
    table: &SceneTable,
    residency: &Residency,
    written: &Written,
    limits: Limits,
) -> Result<FramePlan, Fault> {
    let mut out = FramePlan::default();
    let mut surfaces = written.surfaces.clone();
    for pass in &list.passes {
        let size = pass.camera.size;
        if size.contains(&0) || size.iter().any(|&s| s > limits.target_px) {
            let cause =
                format!("a target of {} x {} pixels; this device takes 1 to {}", size[0], size[1], limits.target_px);
            return Err(Fault::Refused(cause));
        }
        let mut layered = vec![];
        let (uniform_offset, work) = match &pass.kind {
            PassKind::Surface => {
                let at = out.uniform(bytemuck::bytes_of(&view_uniform(&pass.camera)));
                surfaces.insert(pass.writes, size);
                (at, Work::Surface(surface(pass, table, residency, &mut out, &mut layered)?))
            }
            PassKind::Shade { surface, shading } => {
                match surfaces.get(surface) {
                    Some(&s) if s == size => {}
                    Some(s) => {
                        return Err(Fault::Refused(format!(
                            "a shading pass of {} x {} pixels over target {} of {} x {}",
                            size[0], size[1], surface.0, s[0], s[1]
                        )));
                    }
                    None => {
                        let cause = format!("a shading pass reads target {}, which no surface pass wrote", surface.0);
                        return Err(Fault::Refused(cause));
                    }
                }
                let at = out.uniform(bytemuck::bytes_of(&shade_uniform(&pass.camera, shading)?));
                (at, Work::Shade(*surface))
            }
        };
        let made = PassPlan { target: pass.writes, size, uniform_offset, work, layered };
        if made.splat_bytes() > limits.storage_bytes {
            return Err(Fault::Refused(format!(
                "layered depth images over {} x {} pixels need {} bytes of splats; this device binds {}",
                size[0],
                size[1],
                made.splat_bytes(),
                limits.storage_bytes
            )));
        }
        out.passes.push(made);
    }
    let bytes = (out.records.len() * size_of::<Record>()) as u64;
    if bytes > limits.storage_bytes {
        return Err(Fault::Refused(format!(
            "a frame of {} draws needs {bytes} bytes of records; this device binds {}",
            out.records.len(),
            limits.storage_bytes
        )));
    }
    Ok(out)
}

/// Collects the draws of a pass by what they bind.
#[derive(Default)]
struct Batches {
    index: BTreeMap<BatchKey, usize>,
    draws: Vec<Vec<DrawCommand>>,
    last: Option<(BatchKey, usize)>,
}

impl Batches {
    /// Indexed triangles.
    fn push(&mut self, key: BatchKey, slot: Slot, record: u32) {
        let command = DrawCommand {
            index_count: slot.indices.len,
            instance_count: 1,
            first_index: slot.indices.first,
            base_vertex: slot.vertices.first as i32,
            first_instance: record,
        };
        self.add(key, std::iter::once(command));
    }

    /// Elements whose vertices are pulled.
    fn push_pulled(&mut self, shader: Shader, stream: Stream, span: Span, record: u32) {
        // Nothing has no page to bind.
        if span.len == 0 {
            return;
        }
        let bind = Bind::Pulled { stream, page: span.page };
        let key = BatchKey { shader, cull: Cull::None, vertex_page: span.page, index_page: 0, bind };
        self.add(key, quads::commands(span, record));
    }

    fn add(&mut self, key: BatchKey, commands: impl Iterator<Item = DrawCommand>) {
        let i = match self.last {
            Some((k, i)) if k == key => i,
            _ => *self.index.entry(key).or_insert_with(|| {
                self.draws.push(vec![]);
                self.draws.len() - 1
            }),
        };
        self.last = Some((key, i));
        self.draws[i].extend(commands);
    }
}

fn surface(
    pass: &Pass,
    table: &SceneTable,
    residency: &Residency,
    out: &mut FramePlan,
    layered: &mut Vec<LayeredDraw>,
) -> Result<Vec<Batch>, Fault> {
    let mut batches = Batches::default();
    // Images are counted by what the list names, so that which are empty does not decide what is refused.
    let mut images = 0;
    for draw in &pass.draws {
        match image_of(draw, residency)? {
            Some((slot, origin)) => {
                let first = warp::uniform(&slot, origin, &pass.camera, images)?;
                images += 1;
                if slot.samples == 0 {
                    continue;
                }
                let uniform_offset = out.uniform(bytemuck::bytes_of(&first));
                out.uniform(bytemuck::bytes_of(&WarpUniform { phase: 1, ..first }));
                let workgroups = warp::workgroups(slot.samples);
                layered.push(LayeredDraw { page: slot.span.page, uniform_offset, workgroups });
                out.samples += u64::from(slot.samples);
            }
            None => push_draw(draw, &pass.camera, table, residency, out, &mut batches)?,
        }
    }
    let mut done = vec![];
    for (key, i) in batches.index {
        let first = out.commands.len() as u32;
        out.commands.extend_from_slice(&batches.draws[i]);
        done.push(Batch { key, commands: first..out.commands.len() as u32 });
    }
    Ok(done)
}

/// The layered depth image that a draw names and where its payload stands; `None` where it names something else.
fn image_of(draw: &Draw, residency: &Residency) -> Result<Option<(LayeredSlot, DVec3)>, Fault> {
    let DrawWhat::Payload { id, part, object } = &draw.what else { return Ok(None) };
    let Some(payload) = residency.payload_slot(*id) else { return Ok(None) };
    match payload.parts.get(usize::from(*part)) {
        Some(PartSlot::Layered(_)) if *object != 0 => {
            Err(Fault::Refused(format!("part {part} of {id:?}: the samples have objects of their own")))
        }
        Some(PartSlot::Layered(slot)) => Ok(Some((*slot, payload.origin))),
        _ => Ok(None),
    }
}

fn push_draw(
    draw: &Draw,
    camera: &Camera,
    table: &SceneTable,
    residency: &Residency,
    out: &mut FramePlan,
    batches: &mut Batches,
) -> Result<(), Fault> {
    let missing = |block: Block| Fault::Refused(format!("a draw names {block:?}, which was not uploaded"));
    match &draw.what {
        DrawWhat::Chunks(set) => {
            for id in set.iter() {
                let chunk = table.chunk(id, camera.eye).ok_or_else(|| {
                    Fault::Refused(format!("a draw names placed chunk {} of {}", id.0, table.chunks().end))
                })?;
                let (slot, has_uvs) =
                    residency.chunk(chunk.source).ok_or_else(|| missing(Block::Chunk(chunk.source)))?;
                let bind = Bind::Texture(chunk.texture.filter(|_| has_uvs));
                let key = key(Shader::Chunk, chunk.cull, slot, bind);
                out.near_triangles += u64::from(slot.indices.len / 3);
                batches.push(key, slot, out.records.len() as u32);
                out.records.push(chunk.record);
            }
        }
        DrawWhat::Payload { id, part, object } => {
            let payload = residency.payload_slot(*id).ok_or_else(|| missing(Block::Payload(*id)))?;
            let of = || format!("part {part} of {id:?}");
            if *object == 0 {
                return Err(Fault::Refused(format!("{}: object 0 means nothing hit; a draw cannot carry it", of())));
            }
            match payload.parts.get(usize::from(*part)) {
                Some(&PartSlot::Points { span, radius, two_sided }) => {
                    batches.push_pulled(Shader::Points, Stream::Points, span, out.records.len() as u32);
                    let record = payload_record(payload.origin, camera.eye, *object, two_sided, 0);
                    out.records.push(Record { radius, ..record });
                    out.points += u64::from(span.len);
                    return Ok(());
                }
                Some(&PartSlot::Lines { span }) => {
                    batches.push_pulled(Shader::Lines, Stream::Lines, span, out.records.len() as u32);
                    out.records.push(payload_record(payload.origin, camera.eye, *object, true, 0));
                    out.lines += u64::from(span.len);
                    return Ok(());
                }
                _ => {}
            }
            let cull = |two_sided| if two_sided { Cull::None } else { Cull::Back };
            let (key, slot, two_sided, first_projector) = match payload.parts.get(usize::from(*part)) {
                Some(PartSlot::Mesh { slot, two_sided }) => {
                    (key(Shader::Mesh, cull(*two_sided), *slot, Bind::Nothing), *slot, *two_sided, 0)
                }
                Some(PartSlot::Projected { slot, two_sided, projectors, atlases }) => {
                    if let Some(a) = atlases.iter().flatten().find(|&&a| !residency.has_atlas(id.asset, a)) {
                        let atlas = farfield_core::id::PayloadRef { asset: id.asset, id: *a };
                        return Err(Fault::Refused(format!("{}: {atlas:?} is no resident atlas", of())));
                    }
                    let projector_page = (projectors.len > 0).then_some(projectors.page);
                    let bind = Bind::Atlases { asset: id.asset, atlases: *atlases, projector_page };
                    (key(Shader::Projected, cull(*two_sided), *slot, bind), *slot, *two_sided, projectors.first)
                }
                Some(PartSlot::Atlas { .. }) => {
                    return Err(Fault::Refused(format!("{} is an atlas: not drawable", of())));
                }
                Some(PartSlot::Layered(_) | PartSlot::Points { .. } | PartSlot::Lines { .. }) | None => {
                    return Err(Fault::Refused(format!("{}: there is no such part", of())));
                }
            };
            out.far_triangles += u64::from(slot.indices.len / 3);
            batches.push(key, slot, out.records.len() as u32);
            out.records.push(payload_record(payload.origin, camera.eye, *object, two_sided, first_projector));
        }
    }
    Ok(())
}

fn key(shader: Shader, cull: Cull, slot: Slot, bind: Bind) -> BatchKey {
    BatchKey { shader, cull, vertex_page: slot.vertices.page, index_page: slot.indices.page, bind }
}

/// A surface pass's uniform.
fn view_uniform(camera: &Camera) -> ViewUniform {
    let screen = Screen::new(camera);
    ViewUniform {
        projection: camera.projection().to_cols_array_2d(),
        across: screen.across.extend(screen.px_per_tan.x).to_array(),
        down: screen.down.extend(screen.px_per_tan.y).to_array(),
        ahead: screen.ahead.extend(screen.near).to_array(),
        size: screen.size.map(|s| s as f32),
        unused: [0.0; 2],
    }
}

/// A shading pass's uniform.
///
/// # Errors
/// [`Fault::Refused`] where there are more than [`Shading::MAX_LIGHTS`] lights.
pub fn shade_uniform(camera: &Camera, shading: &Shading) -> Result<ShadeUniform, Fault> {
    if shading.lights.len() > Shading::MAX_LIGHTS {
        return Err(Fault::Refused(format!(
            "a shading pass with {} lights; it takes {}",
            shading.lights.len(),
            Shading::MAX_LIGHTS
        )));
    }
    let vector = |v: Vec3| [v.x, v.y, v.z, 0.0];
    let encoded = |c: [u8; 3]| [c[0], c[1], c[2], 255].map(|b| f32::from(b) / 255.0);
    let mut lights = [GpuLight::default(); Shading::MAX_LIGHTS];
    for (to, light) in lights.iter_mut().zip(&shading.lights) {
        to.place = match light.kind {
            LightKind::Directional { to_light, .. } => vector(to_light),
            LightKind::Point { position, .. } => (position.as_dvec3() - camera.eye).as_vec3().extend(1.0).to_array(),
        };
        to.color = vector(light.color);
    }
    Ok(ShadeUniform {
        right: vector(camera.right),
        up: vector(camera.up),
        forward: vector(camera.forward),
        tangents: [camera.left, camera.right_tan, camera.bottom, camera.top],
        ambient: vector(shading.ambient),
        sky: encoded(shading.sky),
        ground: encoded(shading.ground),
        size: camera.size.map(|s| s as f32),
        light_count: shading.lights.len() as u32,
        unused: 0,
        lights,
    })
}

#[cfg(test)]
mod tests;
