//! Carrying out a plan: the frame's data is written, the passes are recorded with their barriers, submitted, waited for.
//!
//! Between frames the planes of a surface lie in layout SAMPLED and pictures in COPY_FROM, so that whoever reads them next
//! knows what was before. Cost: one submission a frame; recording is O(batches), or O(draws) without multi-draw-indirect.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use farfield_core::Fault;
use farfield_core::id::PayloadRef;
use farfield_shaders::layout::{ShadeUniform, ViewUniform};
use farfield_shaders::plan::{Batch, Bind, FramePlan, PassPlan, Work};
use farfield_shaders::pool::Stream;
use farfield_shaders::records::Cull;
use farfield_shaders::{Shader, quads};

use crate::blocks::Blocks;
use crate::descriptors::{Bound, Sets};
use crate::gpu::Gpu;
use crate::memory::{Buffer, Place};
use crate::pipelines::Pipelines;
use crate::queries::Queries;
use crate::record::{Recorder, Use};
use crate::submit::Submitter;
use crate::targets::{Shaded, Surface};
use crate::textures::{Atlas, Sampler, SceneTextures};
use crate::warp::{SampleSets, Splats};

/// What a pass writes and reads.
pub(crate) enum Target {
    /// A surface pass writes this.
    Surface(Arc<Surface>),
    /// A shading pass reads the first and writes the second.
    Shade(Arc<Surface>, Arc<Shaded>),
}

/// What all frames need.
pub(crate) struct Frames {
    gpu: Arc<Gpu>,
    pub(crate) pipelines: Pipelines,
    queries: Queries,
    sets: Sets,
    records: Buffer,
    commands: Buffer,
    uniforms: Buffer,
    /// The indices of all points and lines.
    quads: Buffer,
    /// Bound in slots that a part does not use.
    blank: Atlas,
    /// Bound where a part has no projectors.
    no_projectors: Buffer,
    clamp: Sampler,
    splats: Splats,
}

/// The descriptor sets of a frame.
struct FrameSets {
    surface: vk::DescriptorSet,
    shade: vk::DescriptorSet,
    binds: BTreeMap<Bind, vk::DescriptorSet>,
    /// Of each pass, the planes that it reads.
    planes: Vec<vk::DescriptorSet>,
    samples: SampleSets,
}

/// Time on the device, milliseconds, and primitives that reached the clipper, where it has either.
pub(crate) type Measured = (Option<f64>, Option<u64>);

const RECORDS: vk::BufferUsageFlags = vk::BufferUsageFlags::STORAGE_BUFFER;
const COMMANDS: vk::BufferUsageFlags = vk::BufferUsageFlags::INDIRECT_BUFFER;
const UNIFORMS: vk::BufferUsageFlags = vk::BufferUsageFlags::UNIFORM_BUFFER;
/// Room that the frame's buffers start with, bytes.
const FIRST_BYTES: u64 = 64 << 10;

impl Frames {
    /// Makes pipelines, queries and buffers.
    pub(crate) fn new(gpu: &Arc<Gpu>, blocks: &mut Blocks, by: &mut Submitter) -> Result<Self, Fault> {
        let buffer = |name, usage| Buffer::new(gpu, name, FIRST_BYTES, usage, Place::Upload);
        let pattern = quads::indices();
        let bytes: &[u8] = bytemuck::cast_slice(&pattern);
        let usage = vk::BufferUsageFlags::INDEX_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
        let quads = Buffer::new(gpu, "quads", bytes.len() as u64, usage, Place::Device)?;
        blocks.staging.write(by, quads.raw, 0, bytes)?;
        Ok(Self {
            gpu: gpu.clone(),
            quads,
            pipelines: Pipelines::new(gpu)?,
            queries: Queries::new(gpu)?,
            sets: Sets::new(gpu),
            records: buffer("records", RECORDS)?,
            commands: buffer("commands", COMMANDS)?,
            uniforms: buffer("uniforms", UNIFORMS)?,
            blank: Atlas::blank(gpu, &mut blocks.staging, by)?,
            no_projectors: buffer("no projectors", RECORDS)?,
            clamp: Sampler::new(gpu, vk::SamplerAddressMode::CLAMP_TO_EDGE)?,
            splats: Splats::new(gpu)?,
        })
    }

    /// Carries out `plan`; `targets` has one entry a pass. `after` records what is to follow each pass, by its index.
    ///
    /// # Errors
    /// [`Fault::Device`].
    pub(crate) fn carry_out(
        &mut self,
        plan: &FramePlan,
        targets: &[Target],
        blocks: &mut Blocks,
        textures: &SceneTextures,
        by: &mut Submitter,
        after: &dyn Fn(&Recorder<'_>, usize),
    ) -> Result<Measured, Fault> {
        blocks.staging.flush(by)?;
        self.fill(plan)?;
        let counted = plan.passes.iter().filter(|p| matches!(p.work, Work::Surface(_))).count() as u32;
        self.queries.reserve(counted)?;
        let sets = self.bind(plan, targets, blocks, textures)?;
        by.run(|record| {
            self.queries.start(record, counted);
            let mut query = 0;
            for (i, (pass, target)) in plan.passes.iter().zip(targets).enumerate() {
                match (&pass.work, target) {
                    (Work::Surface(batches), Target::Surface(to)) => {
                        self.queries
                            .count(record, query, || self.surface(record, plan, pass, batches, to, blocks, &sets));
                        query += 1;
                    }
                    (Work::Shade(_), Target::Shade(_, to)) => self.shade(record, pass, to, &sets, i),
                    _ => return Err(Fault::Refused(format!("pass {i} was given a target of another kind"))),
                }
                after(record, i);
            }
            self.queries.end(record);
            Ok(())
        })?;
        self.queries.results(counted)
    }

    /// Writes the plan's arrays where the device reads them.
    fn fill(&mut self, plan: &FramePlan) -> Result<(), Fault> {
        let arrays: [(&mut Buffer, &str, vk::BufferUsageFlags, &[u8]); 3] = [
            (&mut self.records, "records", RECORDS, bytemuck::cast_slice(&plan.records)),
            (&mut self.commands, "commands", COMMANDS, bytemuck::cast_slice(&plan.commands)),
            (&mut self.uniforms, "uniforms", UNIFORMS, &plan.uniforms),
        ];
        for (buffer, name, usage, bytes) in arrays {
            if bytes.len() as u64 > buffer.bytes {
                let room = (bytes.len() as u64).next_power_of_two();
                *buffer = Buffer::new(&self.gpu, name, room, usage, Place::Upload)?;
            }
            buffer.mapped_mut()[..bytes.len()].copy_from_slice(bytes);
        }
        Ok(())
    }

    /// Makes the frame's descriptor sets; those of the frame before are given back.
    fn bind(
        &mut self,
        plan: &FramePlan,
        targets: &[Target],
        blocks: &Blocks,
        textures: &SceneTextures,
    ) -> Result<FrameSets, Fault> {
        self.sets.reset()?;
        let layouts = &self.pipelines.sets;
        let uniform = |bytes: usize| Bound::Uniform { buffer: self.uniforms.raw, bytes: bytes as u64 };
        let records = Bound::Storage(self.records.raw);
        let surface = self.sets.make(layouts.frame, &[uniform(size_of::<ViewUniform>()), records])?;
        let shade = self.sets.make(layouts.shade, &[uniform(size_of::<ShadeUniform>())])?;
        let (mut binds, mut planes) = (BTreeMap::new(), vec![]);
        for (pass, target) in plan.passes.iter().zip(targets) {
            planes.push(match target {
                Target::Surface(_) => vk::DescriptorSet::null(),
                Target::Shade(from, _) => {
                    self.sets.make(layouts.planes, &from.planes.each_ref().map(|p| Bound::Image(p.view)))?
                }
            });
            let Work::Surface(batches) = &pass.work else { continue };
            for bind in batches.iter().map(|b| b.key.bind) {
                if binds.contains_key(&bind) {
                    continue;
                }
                let set = match bind {
                    Bind::Nothing => continue,
                    Bind::Texture(texture) => textures.set(texture.map(|t| t.index())),
                    Bind::Pulled { stream, page } => match blocks.page(stream, page) {
                        Some(page) => self.sets.make(layouts.pulled, &[Bound::Storage(page.raw)])?,
                        None => continue,
                    },
                    Bind::Atlases { asset, atlases, projector_page } => {
                        let page = projector_page.and_then(|p| blocks.page(Stream::Projectors, p));
                        let mut bound = vec![
                            Bound::Storage(page.unwrap_or(&self.no_projectors).raw),
                            Bound::Sampler(self.clamp.raw),
                        ];
                        for slot in atlases {
                            let atlas = slot.and_then(|id| blocks.atlas(PayloadRef { asset, id }));
                            let atlas = atlas.unwrap_or(&self.blank);
                            bound.extend([Bound::Image(atlas.albedo.view), Bound::Image(atlas.normal.view)]);
                        }
                        self.sets.make(layouts.projection, &bound)?
                    }
                };
                binds.insert(bind, set);
            }
        }
        let samples = self.splats.bind(plan, &mut self.sets, layouts.samples, self.uniforms.raw, blocks)?;
        Ok(FrameSets { surface, shade, binds, planes, samples })
    }

    #[expect(clippy::too_many_arguments, reason = "what one pass needs of the frame, the blocks and the plan")]
    fn surface(
        &self,
        record: &Recorder<'_>,
        plan: &FramePlan,
        pass: &PassPlan,
        batches: &[Batch],
        to: &Surface,
        blocks: &Blocks,
        sets: &FrameSets,
    ) {
        self.splats.warp(record, pass, &self.pipelines, &sets.samples);
        let mut changes: Vec<_> = to.planes.iter().map(|p| (p, Use::DISCARD, Use::COLOR)).collect();
        changes.push((&to.depth, Use::DISCARD, Use::DEPTH));
        record.images(&changes);
        record.pass(&to.planes, Some(&to.depth), to.size, || {
            for batch in batches {
                let key = &batch.key;
                // A page that does not exist is named by draws of nothing only.
                let pages = match key.shader.vertices() {
                    Some(stream) => {
                        let vertices = blocks.page(stream, key.vertex_page);
                        vertices.zip(blocks.page(Stream::Indices, key.index_page)).map(|(v, i)| (Some(v), i))
                    }
                    // Pulled out of group 1.
                    None => Some((None, &self.quads)),
                };
                let Some((vertices, indices)) = pages else { continue };
                let layout = self.pipelines.layout(key.shader);
                record.pipeline(self.pipelines.get(key.shader, key.cull));
                record.set(layout, 0, sets.surface, Some(pass.uniform_offset));
                if let Some(&set) = sets.binds.get(&key.bind) {
                    record.set(layout, 1, set, None);
                }
                if let Some(vertices) = vertices {
                    record.vertices(vertices);
                }
                record.indices(indices);
                let commands = &plan.commands[batch.commands.start as usize..batch.commands.end as usize];
                record.draws(&self.commands, batch.commands.start, commands);
            }
            self.splats.resolve(record, pass, &self.pipelines, &sets.samples);
        });
        let rest: Vec<_> = to.planes.iter().map(|p| (p, Use::COLOR, Use::SAMPLED)).collect();
        record.images(&rest);
    }

    fn shade(&self, record: &Recorder<'_>, pass: &PassPlan, to: &Shaded, sets: &FrameSets, index: usize) {
        record.images(&[(&to.image, Use::DISCARD, Use::COLOR)]);
        record.pass(std::slice::from_ref(&to.image), None, to.size, || {
            let layout = self.pipelines.layout(Shader::Shade);
            record.pipeline(self.pipelines.get(Shader::Shade, Cull::None));
            record.set(layout, 0, sets.shade, Some(pass.uniform_offset));
            record.set(layout, 1, sets.planes[index], None);
            record.cover();
        });
        record.images(&[(&to.image, Use::COLOR, Use::COPY_FROM)]);
    }
}
