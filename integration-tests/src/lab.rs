//! Experiments inside tests: from an experiment's text to built pipelines, pictures and counts, through the harness's own steps.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use farfield_core::id::{Block, CellId};
use farfield_experiments::config::{self, BackendName, Experiment};
use farfield_experiments::failure::Failure;
use farfield_experiments::list::entries;
use farfield_experiments::measure::{self, FrameErrors, Metrics, Rendered};
use farfield_experiments::run::{self, Options, Prepared};
use farfield_experiments::store::Store;
use farfield_experiments::walk::{self, Device, Opened, device};
use miette::Diagnostic;

/// An experiment with its scene and a store of its own.
pub struct Lab {
    /// The experiment.
    pub experiment: Experiment,
    /// Its scene, path and cells.
    pub prepared: Prepared,
    store: Store,
    _folder: tempfile::TempDir,
}

/// A frame with what it drew.
pub struct Frame {
    /// The picture and the surface.
    pub rendered: Rendered,
    /// The cell that served it.
    pub cell: Option<CellId>,
    /// Original triangles.
    pub near_triangles: u64,
    /// Triangles of payloads.
    pub far_triangles: u64,
}

static NEVER: AtomicBool = AtomicBool::new(false);

fn options(store: &Path) -> Options<'static> {
    Options { store: store.to_owned(), quiet: true, cancel: &NEVER, say: &|line| eprintln!("{line}") }
}

/// A failure with its cause, in one line.
pub fn told(f: &Failure) -> String {
    format!("{f}: {}", f.help().map(|h| h.to_string()).unwrap_or_default())
}

impl Lab {
    /// From an experiment's text; relative paths start in `folder`.
    ///
    /// # Errors
    /// What the user would be told: mistakes, refusals.
    pub fn new(text: &str, folder: &Path) -> Result<Self, String> {
        let experiment = config::parse("experiment", text, &[], folder, &entries()).map_err(|m| format!("{m:?}"))?;
        let own = tempfile::tempdir().map_err(|e| e.to_string())?;
        let options = options(own.path());
        let prepared = run::prepare(&experiment, &options).map_err(|f| told(&f))?;
        let store = Store::open(own.path(), Arc::new(|m| eprintln!("{m}"))).map_err(|e| e.to_string())?;
        Ok(Self { experiment, prepared, store, _folder: own })
    }

    /// Builds a pipeline and hands it to `f`, opened.
    ///
    /// # Errors
    /// What building and opening say.
    pub fn with<R>(&self, pipeline: usize, f: impl FnOnce(&Opened<'_>) -> R) -> Result<R, String> {
        Ok(f(&self.opened(pipeline)?))
    }

    /// Builds a pipeline and opens it.
    ///
    /// # Errors
    /// What building and opening say.
    pub fn opened(&self, pipeline: usize) -> Result<Opened<'_>, String> {
        let options = options(self.store.root());
        let mut built = run::build_pipelines(&self.experiment, &self.prepared, &[pipeline], &self.store, &options)
            .map_err(|f| told(&f))?;
        let (p, division) = (&self.experiment.pipelines[pipeline], &self.prepared.divisions[pipeline]);
        Opened::new(p, division, built.remove(0), &self.prepared.scene, &self.store).map_err(|f| told(&f))
    }

    /// The folder of its store.
    pub fn store(&self) -> &Path {
        self.store.root()
    }

    /// A device with the scene resident.
    ///
    /// # Errors
    /// What opening it says.
    pub fn device(&self, backend: BackendName) -> Result<Device, String> {
        let mut out = Device::new(device::open(backend, &self.prepared.scene).map_err(|f| told(&f))?);
        let none = |b: Block| Err(farfield_core::Fault::Refused(format!("{b:?} is no chunk")));
        for id in self.prepared.scene.mesh_chunk_ids() {
            out.load(Block::Chunk(id), &self.prepared.scene, &none).map_err(|f| f.to_string())?;
        }
        Ok(out)
    }

    /// Frames of a pipeline, everything that they may draw resident.
    ///
    /// # Errors
    /// What building, loading and drawing say.
    pub fn frames(&self, pipeline: usize, frames: &[usize], device: &mut Device) -> Result<Vec<Frame>, String> {
        device.free_payloads();
        self.with(pipeline, |opened| frames.iter().map(|&i| self.frame(opened, i, device)).collect())?
    }

    fn frame(&self, opened: &Opened<'_>, number: usize, device: &mut Device) -> Result<Frame, String> {
        let (p, camera) = (&self.prepared, &self.prepared.cameras[number]);
        let cell = opened.cell_of(camera);
        for block in cell.map(|c| opened.payloads(c)).unwrap_or_default() {
            device.load(block, &p.scene, &|b| opened.fetch(b)).map_err(|f| f.to_string())?;
        }
        let drawn = opened.draws(cell, camera, &|_| true);
        let list = walk::frame(camera, drawn.draws, &p.lit(number));
        let counted = device.backend.render(&list).map_err(|f| f.to_string())?;
        let rendered = walk::read(&mut *device.backend).map_err(|f| f.to_string())?;
        let (near_triangles, far_triangles) = (counted.near_triangles, counted.far_triangles);
        Ok(Frame { rendered, cell, near_triangles, far_triangles })
    }
}

/// A candidate's errors against its reference, without the costly metrics.
pub fn errors(reference: &Frame, candidate: &Frame) -> FrameErrors {
    measure::frame(&reference.rendered, &candidate.rendered, Metrics { ssim: false, flip: false })
}

/// The backends that the registry knows, those that this machine lacks left out, visibly; with `FARFIELD_EXPECT_DEVICE=1`
/// lacking one is a failure.
///
/// # Panics
/// When a device is expected and missing, or the registry names a backend that experiment files do not.
pub fn backends(test: &str) -> Vec<BackendName> {
    let all = entries();
    let names = all.iter().filter(|e| e.kind == farfield_core::registry::Kind::Backend).map(|e| e.name);
    let known = |n: &str| serde_json::from_value::<BackendName>(n.into()).expect("an experiment file's backend");
    let there = |b: &BackendName| match device::available(*b) {
        Ok(()) => true,
        Err(f) if std::env::var_os("FARFIELD_EXPECT_DEVICE").is_some_and(|v| v == "1") => panic!("{}", told(&f)),
        Err(f) => {
            eprintln!("SKIPPED: {test} on {}: {}", b.name(), told(&f));
            false
        }
    };
    names.map(known).filter(there).collect()
}

/// The folder of real meshes that `FARFIELD_MODELS` names; `None`, visibly, where there is none; with
/// `FARFIELD_EXPECT_MODELS=1` that is a failure.
///
/// # Panics
/// When models are expected and missing.
pub fn models(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("FARFIELD_MODELS").map(PathBuf::from).filter(|p| p.is_dir());
    if folder.is_none() {
        let expected = std::env::var_os("FARFIELD_EXPECT_MODELS").is_some_and(|v| v == "1");
        assert!(!expected, "FARFIELD_EXPECT_MODELS=1, but FARFIELD_MODELS names no folder");
        eprintln!("SKIPPED: {test}: FARFIELD_MODELS names no folder");
    }
    folder
}
