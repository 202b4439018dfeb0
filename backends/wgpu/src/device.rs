//! Finding an adapter, asking it for what it has, and catching what it says.

use std::sync::{Arc, Mutex, PoisonError};

use farfield_core::Fault;
use farfield_core::backend::DeviceInfo;
use farfield_shaders::warp::Atomics;
use wgpu::Features;

/// Which adapter, and how closely it is watched.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Part of the adapter's name, in any case; `None` takes the fastest kind there is.
    pub adapter: Option<String>,
    /// Only software adapters.
    pub software: bool,
    /// Runs the driver under its validation layers, which log to the `log` crate. Needs them installed.
    pub validation: bool,
    /// Optional features that are treated as if the device lacked them: a way to try the fallbacks.
    pub without: Without,
}

/// Optional features to leave unused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Without {
    /// Draws go one by one.
    pub indirect: bool,
    /// No time on the device is measured.
    pub timestamps: bool,
    /// No primitives are counted.
    pub statistics: bool,
    /// Layered depth images are warped by 32-bit atomics, in two phases.
    pub atomics_64: bool,
}

/// The first thing a device complained about since it was last asked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Complaints(Arc<Mutex<Option<String>>>);

impl Complaints {
    fn note(&self, what: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(what);
    }

    /// What was noted, taken out.
    pub(crate) fn take(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// An opened device.
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: DeviceInfo,
    pub(crate) limits: wgpu::Limits,
    /// Indirect draws may start at any instance.
    pub(crate) indirect: bool,
    pub(crate) timestamps: bool,
    pub(crate) statistics: bool,
    pub(crate) atomics: Atomics,
    complaints: Complaints,
}

/// A message without an adapter to blame.
fn fault(cause: impl Into<String>) -> Fault {
    Fault::Device { device: "wgpu".into(), cause: cause.into() }
}

fn adapters(validation: bool) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    // Indirect draws are made by this crate alone, so wgpu need not check them on the device. Without the DEBUG flag: the
    // SPIR-V that it asks for names WGSL as its source, which layers older than 2023 take for an error.
    descriptor.flags = if validation { wgpu::InstanceFlags::VALIDATION } else { wgpu::InstanceFlags::empty() };
    let instance = wgpu::Instance::new(descriptor);
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN))
}

fn choose(options: &Options) -> Result<wgpu::Adapter, Fault> {
    let found = adapters(options.validation);
    if found.is_empty() {
        return Err(fault("no Vulkan driver was found (Debian: mesa-vulkan-drivers has one in software)"));
    }
    let names: Vec<String> = found.iter().map(|a| a.get_info().name).collect();
    let rank = |kind| match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let wanted = options.adapter.as_ref().map(|w| w.to_lowercase());
    found
        .into_iter()
        .filter(|a| wanted.as_ref().is_none_or(|w| a.get_info().name.to_lowercase().contains(w)))
        .filter(|a| !options.software || a.get_info().device_type == wgpu::DeviceType::Cpu)
        .min_by_key(|a| rank(a.get_info().device_type))
        .ok_or_else(|| {
            let kind = if options.software { "software adapter" } else { "adapter" };
            let named = options.adapter.as_ref().map_or(String::new(), |w| format!(" named like \"{w}\""));
            fault(format!("no {kind}{named}; there are: {}", names.join(", ")))
        })
}

/// The adapter that [`Options::default`] would take, by name. Opens no device.
///
/// # Errors
/// [`Fault::Device`] where there is none.
pub fn available() -> Result<String, Fault> {
    let info = choose(&Options::default())?.get_info();
    Ok(format!("{} ({})", info.name, info.driver_info))
}

impl Gpu {
    pub(crate) fn open(options: &Options) -> Result<Self, Fault> {
        let adapter = choose(options)?;
        let about = adapter.get_info();
        let has = adapter.features();
        let mut features = Features::empty();
        let mut degraded = vec![];
        let mut ask = |feature: Features, left_out: bool, instead: &str| {
            let used = has.contains(feature) && !left_out;
            if used {
                features |= feature;
            } else {
                degraded.push(instead.to_owned());
            }
            used
        };
        let indirect = ask(
            Features::INDIRECT_FIRST_INSTANCE,
            options.without.indirect,
            "no indirect draws that start at an instance: draws go one by one",
        );
        let timestamps = ask(
            Features::TIMESTAMP_QUERY,
            options.without.timestamps,
            "no timestamps: the time on the device is not measured",
        );
        let statistics = ask(
            Features::PIPELINE_STATISTICS_QUERY,
            options.without.statistics,
            "no pipeline statistics: clipped primitives are not counted",
        );
        let whole = Features::SHADER_INT64 | Features::SHADER_INT64_ATOMIC_MIN_MAX;
        let whole = ask(whole, options.without.atomics_64, Atomics::LACKING);
        let atomics = if whole { Atomics::Whole } else { Atomics::Halves };
        let limits = adapter.limits();
        let device_name = format!("{} ({} {})", about.name, about.driver, about.driver_info);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("farfield"),
            required_features: features,
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        }))
        .map_err(|e| Fault::Device { device: device_name.clone(), cause: e.to_string() })?;
        let complaints = Complaints::default();
        let (of_errors, of_loss) = (complaints.clone(), complaints.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| of_errors.note(e.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                of_loss.note(format!("the device was lost: {message}"));
            }
        });
        let info = DeviceInfo { backend: "wgpu".into(), device: device_name, degraded };
        Ok(Self { device, queue, info, limits, indirect, timestamps, statistics, atomics, complaints })
    }

    pub(crate) fn fault(&self, cause: impl Into<String>) -> Fault {
        Fault::Device { device: self.info.device.clone(), cause: cause.into() }
    }

    /// Whether the device complained since it was last asked.
    pub(crate) fn check(&self) -> Result<(), Fault> {
        self.complaints.take().map_or(Ok(()), |cause| Err(self.fault(cause)))
    }

    /// Waits until everything submitted is done.
    pub(crate) fn wait(&self) -> Result<(), Fault> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| self.fault(e.to_string()))?;
        self.check()
    }

    /// A buffer; a refusal of the device is an error, not a message for later.
    pub(crate) fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, Fault> {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.max(4),
            usage,
            mapped_at_creation: false,
        });
        self.check()?;
        Ok(buffer)
    }

    /// The bytes of a mappable buffer, after everything submitted is done.
    pub(crate) fn read<T>(&self, buffer: &wgpu::Buffer, size: u64, f: impl FnOnce(&[u8]) -> T) -> Result<T, Fault> {
        if size == 0 {
            return Ok(f(&[]));
        }
        let slice = buffer.slice(..size);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.wait()?;
        let out = f(&slice.get_mapped_range().map_err(|e| self.fault(e.to_string()))?);
        buffer.unmap();
        Ok(out)
    }
}
