//! Backends by name, and which one a pipeline gets that names none.

use farfield_core::backend::Backend;
use farfield_core::scene::Scene;
use farfield_cpu::{CpuBackend, CpuOptions};
use farfield_vulkan::VulkanBackend;
use farfield_wgpu::WgpuBackend;

use crate::config::{BackendName, Pipeline};
use crate::failure::Failure;

/// What to install where there is no Vulkan driver.
pub const INSTALL: &str = "apt-get install mesa-vulkan-drivers libvulkan1";

/// The backend of each pipeline: the one it names, which has to be there; else wgpu where there is a Vulkan driver, else cpu, with
/// one line to `say` about it.
///
/// # Errors
/// [`Failure::Work`] where a backend that was asked for is missing.
pub fn choose(pipelines: &[Pipeline], say: &mut dyn FnMut(String)) -> Result<Vec<BackendName>, Failure> {
    let asked = |b: BackendName| pipelines.iter().any(|p| p.backend == Some(b));
    if asked(BackendName::Wgpu) {
        available(BackendName::Wgpu)?;
    }
    if asked(BackendName::Vulkan) {
        available(BackendName::Vulkan)?;
    }
    let mut default = BackendName::Wgpu;
    if pipelines.iter().any(|p| p.backend.is_none()) && farfield_wgpu::available().is_err() {
        default = BackendName::Cpu;
        say(format!(
            "no Vulkan driver: drawing with the cpu backend, whose times are the reference's; for wgpu: {INSTALL}"
        ));
    }
    Ok(pipelines.iter().map(|p| p.backend.unwrap_or(default)).collect())
}

/// Whether a backend that was asked for is there.
///
/// # Errors
/// [`Failure::Work`] saying what to install.
pub fn available(name: BackendName) -> Result<(), Failure> {
    let found = match name {
        BackendName::Cpu => return Ok(()),
        BackendName::Wgpu => farfield_wgpu::available(),
        BackendName::Vulkan => farfield_vulkan::available(),
    };
    let missing =
        |e| Failure::work(format!("the backend \"{}\" is not there: {e}", name.name()), format!("try: {INSTALL}"));
    found.map(|_| ()).map_err(missing)
}

/// Opens a backend for a scene.
///
/// # Errors
/// [`Failure::Work`] where its device fails.
pub fn open(name: BackendName, scene: &Scene) -> Result<Box<dyn Backend>, Failure> {
    let failed = |e| Failure::during(format!("opening the backend \"{}\"", name.name()), e);
    Ok(match name {
        BackendName::Cpu => Box::new(CpuBackend::new(scene, CpuOptions::default()).map_err(failed)?),
        BackendName::Wgpu => Box::new(WgpuBackend::new(scene, &farfield_wgpu::Options::default()).map_err(failed)?),
        BackendName::Vulkan => {
            Box::new(VulkanBackend::new(scene, farfield_vulkan::Options::default()).map_err(failed)?)
        }
    })
}
