//! The backend trait on top of it all, and captures in batches.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData, Counted, DeviceInfo};
use farfield_core::context::Shot;
use farfield_core::draw::{Draw, DrawList, DrawWhat, Pass, PassKind};
use farfield_core::id::{Block, TargetId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::scene::Scene;
use farfield_shaders::plan::{FramePlan, Limits, Work, Written, plan};
use farfield_shaders::records::SceneTable;

use crate::blocks::Blocks;
use crate::choose::Without;
use crate::frame::{Frames, Target};
use crate::gpu::Gpu;
use crate::instance::Journal;
use crate::readback::{Readback, copy_surface, surface_at, surface_bytes};
use crate::record::Use;
use crate::submit::Submitter;
use crate::targets::{Shaded, Surface};
use crate::textures::SceneTextures;

/// How captures are cut into submissions: the most bytes read back at once.
const CAPTURE_BYTES: u64 = 128 << 20;

/// How to open a [`VulkanBackend`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Run under the Khronos validation layer with synchronisation validation, and keep what it says
    /// ([`VulkanBackend::messages`]). Slow; for tests.
    pub validation: bool,
    /// Take only a device whose name, "device, driver", holds this; case does not matter.
    pub device: Option<String>,
    /// Optional features that are treated as if the device lacked them: a way to try the fallbacks.
    pub without: Without,
}

/// Draws on a Vulkan device.
///
/// Each frame is one submission that is waited for. Blocks share pages of device memory; chunks and payload parts that
/// share what is bound are drawn by one multi-draw-indirect.
pub struct VulkanBackend {
    gpu: Arc<Gpu>,
    info: DeviceInfo,
    table: SceneTable,
    written: Written,
    by: Submitter,
    textures: SceneTextures,
    blocks: Blocks,
    frames: Frames,
    readback: Readback,
    surfaces: BTreeMap<TargetId, Arc<Surface>>,
    pictures: BTreeMap<TargetId, Arc<Shaded>>,
}

/// The name of the device that [`VulkanBackend::new`] would take by default.
///
/// # Errors
/// [`Fault::Device`] that says why there is none: no loader, no driver, or what each device lacks.
pub fn available() -> Result<String, Fault> {
    Ok(Gpu::open(false, None, Without::default())?.caps.name.clone())
}

impl VulkanBackend {
    /// Opens a device for `scene` and uploads its textures; no block is resident yet.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no loader, no driver, no device that serves, or validation is asked for and not
    /// installed; [`Fault::Data`] naming a texture that is unsound or too large for the device.
    pub fn new(scene: &Scene, options: Options) -> Result<Self, Fault> {
        let gpu = Arc::new(Gpu::open(options.validation, options.device.as_deref(), options.without)?);
        let info =
            DeviceInfo { backend: "vulkan".into(), device: gpu.caps.name.clone(), degraded: gpu.caps.degraded.clone() };
        let mut by = Submitter::new(&gpu)?;
        let mut blocks = Blocks::new(&gpu)?;
        let frames = Frames::new(&gpu, &mut blocks, &mut by)?;
        let textures = SceneTextures::new(&gpu, &frames.pipelines.sets, &mut blocks.staging, &mut by, scene)?;
        let readback = Readback::new(&gpu);
        Ok(Self {
            info,
            table: SceneTable::new(scene),
            written: Written::default(),
            by,
            textures,
            blocks,
            frames,
            readback,
            surfaces: BTreeMap::new(),
            pictures: BTreeMap::new(),
            gpu,
        })
    }

    /// What validation has said so far; empty where it was not asked for.
    pub fn messages(&self) -> Vec<String> {
        self.journal().messages()
    }

    /// The list behind [`VulkanBackend::messages`]; it outlives the backend, and so tells of leaks too.
    pub fn journal(&self) -> Journal {
        self.gpu.instance.journal.clone()
    }

    /// Surface images of resident chunks, in order: as many shots as fit go into one submission and are read back together.
    /// Targets of draw lists are not touched.
    ///
    /// # Errors
    /// As [`Backend::render`].
    pub fn capture(&mut self, shots: &[Shot]) -> Result<Vec<SurfaceImage>, Fault> {
        let mut images = Vec::with_capacity(shots.len());
        let mut rest = shots;
        while !rest.is_empty() {
            let mut bytes = 0;
            let fits = rest.iter().take_while(|s| {
                bytes += surface_bytes(s.camera.size);
                bytes <= CAPTURE_BYTES
            });
            let (now, later) = rest.split_at(fits.count().max(1));
            self.capture_together(now, &mut images)?;
            rest = later;
        }
        Ok(images)
    }

    fn capture_together(&mut self, shots: &[Shot], images: &mut Vec<SurfaceImage>) -> Result<(), Fault> {
        let passes = shots.iter().map(|s| Pass {
            kind: PassKind::Surface,
            camera: s.camera,
            writes: TargetId(0),
            draws: vec![Draw {
                what: DrawWhat::Chunks(s.chunks.clone()),
                bounds: farfield_core::Aabb::EMPTY,
                error_px: 0.0,
            }],
        });
        let list = DrawList { passes: passes.collect() };
        let plan = plan(&list, &self.table, &self.blocks.residency, &Written::default(), self.limits())?;
        // Shots of one size share a target: each is copied away before the next is drawn.
        let mut by_size: BTreeMap<[u32; 2], Arc<Surface>> = BTreeMap::new();
        let (mut targets, mut offsets, mut bytes) = (vec![], vec![], 0);
        for pass in &plan.passes {
            let surface = match by_size.get(&pass.size) {
                Some(s) => s.clone(),
                None => Arc::new(Surface::new(&self.gpu, pass.size)?),
            };
            by_size.insert(pass.size, surface.clone());
            targets.push(Target::Surface(surface));
            offsets.push(bytes);
            bytes += surface_bytes(pass.size);
        }
        let buffer = self.readback.room(bytes)?;
        self.frames.carry_out(&plan, &targets, &mut self.blocks, &self.textures, &mut self.by, &|record, i| {
            if let Target::Surface(surface) = &targets[i] {
                copy_surface(record, surface, buffer, offsets[i]);
            }
            if i + 1 == targets.len() {
                record.memory(Use::COPY_TO, Use::HOST);
            }
        })?;
        images.extend(plan.passes.iter().zip(offsets).map(|(pass, at)| surface_at(buffer, pass.size, at)));
        Ok(())
    }

    fn limits(&self) -> Limits {
        let l = &self.gpu.caps.limits;
        Limits {
            target_px: l.max_image_dimension2_d.min(l.max_framebuffer_width).min(l.max_framebuffer_height),
            storage_bytes: u64::from(l.max_storage_buffer_range),
        }
    }

    /// A target for each pass. Targets of another size than before are made anew; the old ones stay until the frame's end,
    /// since earlier passes of the same frame may use them.
    fn targets(&self, plan: &FramePlan) -> Result<Targets, Fault> {
        let mut t = Targets { surfaces: self.surfaces.clone(), pictures: self.pictures.clone(), passes: vec![] };
        for pass in &plan.passes {
            let target = match &pass.work {
                Work::Surface(_) => {
                    let kept = t.surfaces.get(&pass.target).filter(|s| s.size == pass.size).cloned();
                    let surface = kept.map_or_else(|| Surface::new(&self.gpu, pass.size).map(Arc::new), Ok)?;
                    t.surfaces.insert(pass.target, surface.clone());
                    Target::Surface(surface)
                }
                Work::Shade(from) => {
                    let kept = t.pictures.get(&pass.target).filter(|s| s.size == pass.size).cloned();
                    let to = kept.map_or_else(|| Shaded::new(&self.gpu, pass.size).map(Arc::new), Ok)?;
                    t.pictures.insert(pass.target, to.clone());
                    let missing = || Fault::Refused(format!("target {} was not written by a surface pass", from.0));
                    Target::Shade(t.surfaces.get(from).cloned().ok_or_else(missing)?, to)
                }
            };
            t.passes.push(target);
        }
        Ok(t)
    }
}

/// Targets after a frame, and those of each of its passes.
struct Targets {
    surfaces: BTreeMap<TargetId, Arc<Surface>>,
    pictures: BTreeMap<TargetId, Arc<Shaded>>,
    passes: Vec<Target>,
}

impl Backend for VulkanBackend {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn upload(&mut self, block: Block, data: &BlockData<'_>) -> Result<u64, Fault> {
        self.blocks.upload(&mut self.by, block, data)
    }

    fn release(&mut self, block: Block) {
        self.blocks.release(block);
    }

    fn render(&mut self, list: &DrawList) -> Result<Counted, Fault> {
        let start = Instant::now();
        let plan = plan(list, &self.table, &self.blocks.residency, &self.written, self.limits())?;
        let targets = self.targets(&plan)?;
        let nothing = |_: &crate::record::Recorder<'_>, _: usize| {};
        let (gpu_ms, clipped_primitives) =
            self.frames.carry_out(&plan, &targets.passes, &mut self.blocks, &self.textures, &mut self.by, &nothing)?;
        (self.surfaces, self.pictures) = (targets.surfaces, targets.pictures);
        self.written.note(&plan);
        Ok(Counted {
            gpu_ms,
            wall_ms: start.elapsed().as_secs_f64() * 1e3,
            near_triangles: plan.near_triangles,
            far_triangles: plan.far_triangles,
            samples: plan.samples,
            points: plan.points,
            lines: plan.lines,
            clipped_primitives,
        })
    }

    fn read_surface(&mut self, target: TargetId) -> Result<SurfaceImage, Fault> {
        self.written.surface(target)?;
        let none = || Fault::Refused(format!("target {} holds no surface", target.0));
        let surface = self.surfaces.get(&target).cloned().ok_or_else(none)?;
        self.readback.surface(&mut self.by, &surface)
    }

    fn read_picture(&mut self, target: TargetId) -> Result<Picture, Fault> {
        self.written.picture(target)?;
        let none = || Fault::Refused(format!("target {} holds no picture", target.0));
        let shaded = self.pictures.get(&target).cloned().ok_or_else(none)?;
        self.readback.picture(&mut self.by, &shaded)
    }
}
