//! The backend: blocks come and go, draw lists are carried out pass by pass.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use farfield_core::Fault;
use farfield_core::backend::{Backend, BlockData, Counted, DeviceInfo};
use farfield_core::draw::{DrawList, Pass, PassKind};
use farfield_core::extent::{Extent, Takes};
use farfield_core::id::{Block, TargetId};
use farfield_core::image::{Picture, SurfaceImage};
use farfield_core::scene::Scene;

use crate::block::{Ready, takes};
use crate::frame::{Blocks, Frame};
use crate::tables::Tables;
use crate::warp::SplatOrder;
use crate::{light, paint, splat, warp};

/// How the backend works.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CpuOptions {
    /// Threads of a pool of its own; `None` for the pool that the caller is in. Pictures do not depend on it.
    pub threads: Option<usize>,
    /// How the samples of a layered depth image hide each other.
    pub splats: SplatOrder,
}

/// What a target holds.
enum Target {
    Surface(SurfaceImage),
    Picture(Picture),
}

/// The reference backend. See the crate.
pub struct CpuBackend {
    info: DeviceInfo,
    tables: Tables,
    blocks: Blocks,
    targets: BTreeMap<TargetId, Target>,
    pool: Option<rayon::ThreadPool>,
    splats: SplatOrder,
}

impl CpuBackend {
    /// A backend for a scene, with nothing uploaded.
    ///
    /// # Errors
    /// [`Fault::Device`] where the threads cannot be had.
    pub fn new(scene: &Scene, options: CpuOptions) -> Result<Self, Fault> {
        let pool = options.threads.map(|n| rayon::ThreadPoolBuilder::new().num_threads(n.max(1)).build()).transpose();
        let pool = pool.map_err(|e| Fault::Device { device: "cpu".into(), cause: e.to_string() })?;
        let info = DeviceInfo { backend: "cpu".into(), device: device(), degraded: vec![] };
        Ok(Self {
            info,
            tables: Tables::new(scene),
            blocks: Blocks::new(),
            targets: BTreeMap::new(),
            pool,
            splats: options.splats,
        })
    }

    /// Does `work` in the backend's own pool, where it has one.
    fn within<R: Send>(pool: Option<&rayon::ThreadPool>, work: impl FnOnce() -> R + Send) -> R {
        match pool {
            Some(p) => p.install(work),
            None => work(),
        }
    }

    fn pass(&mut self, pass: &Pass, counted: &mut Counted) -> Result<(), Fault> {
        let pool = self.pool.as_ref();
        let written = match &pass.kind {
            PassKind::Surface => {
                let frame = Frame::of_draws(pass.camera.eye, &pass.draws, &self.tables, &self.blocks)?;
                counted.near_triangles += frame.near_triangles;
                counted.far_triangles += frame.far_triangles;
                counted.samples += frame.images.iter().map(|(_, i)| i.samples() as u64).sum::<u64>();
                counted.points += frame.points.iter().map(|d| d.part.vertices.len() as u64).sum::<u64>();
                counted.lines += frame.lines.iter().map(|d| d.part.indices.len() as u64 / 2).sum::<u64>();
                let mut image = Self::within(pool, || paint::surface(&frame, &pass.camera, true));
                // As on a GPU: of what lies at one depth triangles are seen first, then points, then lines.
                splat::points(&mut image, &pass.camera, &frame.points);
                splat::lines(&mut image, &pass.camera, &frame.lines);
                if !frame.images.is_empty() {
                    warp::over(&mut image, &pass.camera, &frame.images, self.splats);
                }
                Target::Surface(image)
            }
            PassKind::Shade { surface, shading } => {
                let Some(Target::Surface(s)) = self.targets.get(surface) else {
                    return Err(unwritten(*surface, "surface"));
                };
                Target::Picture(Self::within(pool, || light::shade(s, &pass.camera, shading))?)
            }
        };
        self.targets.insert(pass.writes, written);
        Ok(())
    }
}

impl Backend for CpuBackend {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn upload(&mut self, block: Block, data: &BlockData<'_>) -> Result<u64, Fault> {
        let ready = Ready::new(block, data)?;
        let bytes = ready.bytes();
        self.blocks.insert(block, Arc::new(ready));
        Ok(bytes)
    }

    fn takes(&self, extent: &Extent) -> Takes {
        takes(extent)
    }

    fn release(&mut self, block: Block) {
        self.blocks.remove(&block);
    }

    fn render(&mut self, list: &DrawList) -> Result<Counted, Fault> {
        let start = Instant::now();
        let mut counted = Counted::default();
        list.passes.iter().try_for_each(|p| self.pass(p, &mut counted))?;
        counted.wall_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(counted)
    }

    fn read_surface(&mut self, target: TargetId) -> Result<SurfaceImage, Fault> {
        match self.targets.get(&target) {
            Some(Target::Surface(s)) => Ok(s.clone()),
            _ => Err(unwritten(target, "surface")),
        }
    }

    fn read_picture(&mut self, target: TargetId) -> Result<Picture, Fault> {
        match self.targets.get(&target) {
            Some(Target::Picture(p)) => Ok(p.clone()),
            _ => Err(unwritten(target, "shading")),
        }
    }
}

fn unwritten(target: TargetId, kind: &str) -> Fault {
    Fault::Refused(format!("no {kind} pass wrote target {}", target.0))
}

/// The processor as its system names it, where it does.
fn device() -> String {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':').map(|(_, n)| n.trim()));
    format!("{} ({threads} threads)", name.unwrap_or(std::env::consts::ARCH))
}
