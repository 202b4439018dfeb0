//! Which device to run on, and what it can do.
//!
//! Of the devices that have what the backend cannot do without (a queue for graphics and compute, dynamic rendering, synchronization2,
//! 32-bit float depth), and whose name holds the filter if there is one, the first of the best kind is taken: discrete
//! before integrated, virtual, software. What may be missing is degraded, in words.

use std::ffi::CStr;

use ash::{ext, khr, vk};
use farfield_core::Fault;
use farfield_shaders::warp::Atomics;

use crate::instance::{Instance, no_device};

/// Sub-pixel precision that is not worth a word: what GPUs and lavapipe have; Vulkan asks for 4 bits only.
const GOOD_SUB_PIXEL_BITS: u32 = 8;

/// What the device promises of accesses out of range, as wgpu-hal 30 asks for it, so that both stacks run the same shaders.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Robustness {
    /// robustBufferAccess.
    pub(crate) buffer: bool,
    /// VK_EXT_robustness2 is there: robustBufferAccess2, robustImageAccess2.
    pub(crate) two: Option<[bool; 2]>,
    /// robustImageAccess; the flag says whether through VK_EXT_image_robustness rather than Vulkan 1.3.
    pub(crate) image: Option<bool>,
}

impl Robustness {
    /// For the shaders: what needs no checks of its own.
    pub(crate) fn promised(&self) -> farfield_shaders::spirv::Robustness {
        farfield_shaders::spirv::Robustness {
            buffer: self.two.is_some_and(|t| t[0]),
            image: self.two.map_or(self.image.is_some(), |t| t[1]),
        }
    }
}

/// What the chosen device can do.
#[derive(Clone, Debug)]
pub(crate) struct Caps {
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) family: u32,
    /// "device, driver", as they name themselves.
    pub(crate) name: String,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    /// The largest allocation, and so the largest buffer, bytes.
    pub(crate) max_buffer: u64,
    /// Vulkan 1.2 is spoken: 64-bit atomics are no extension.
    pub(crate) core_1_2: bool,
    /// Vulkan 1.3 is spoken; else the two KHR extensions are there.
    pub(crate) core_1_3: bool,
    /// Bits of a timestamp; 0 where the queue has none.
    pub(crate) timestamp_bits: u32,
    pub(crate) statistics: bool,
    /// Many indirect draws in one call, each with its first instance.
    pub(crate) multi_draw: bool,
    /// Whole where shaderInt64 and shaderBufferInt64Atomics are there.
    pub(crate) atomics: Atomics,
    /// SPIR-V version that goes with the API version.
    pub(crate) spirv: (u8, u8),
    pub(crate) robustness: Robustness,
    /// What is missing and what is done instead.
    pub(crate) degraded: Vec<String>,
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

/// The best device whose name holds `filter` (case does not matter), used without the features of `without`.
///
/// # Errors
/// [`Fault::Device`] that lists the devices there are and why each does not serve.
pub(crate) fn choose(instance: &Instance, filter: Option<&str>, without: Without) -> Result<Caps, Fault> {
    // SAFETY: the instance is alive.
    let all = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(|e| no_device(format!("the devices cannot be listed: {e}")))?;
    let mut refused = vec![];
    let mut fit = vec![];
    for physical in all {
        match examine(instance, physical, without) {
            Ok((rank, caps)) if filter.is_none_or(|f| caps.name.to_lowercase().contains(&f.to_lowercase())) => {
                fit.push((rank, caps));
            }
            Ok((_, caps)) => refused.push(format!("{}: not asked for", caps.name)),
            Err(why) => refused.push(why),
        }
    }
    // `min_by_key` keeps the first of equals, so the loader's order decides among devices of one kind.
    fit.into_iter().min_by_key(|(rank, _)| *rank).map(|(_, caps)| caps).ok_or_else(|| {
        let asked = filter.map_or_else(String::new, |f| format!(" whose name holds \"{f}\""));
        let seen = if refused.is_empty() { "there are none".into() } else { refused.join("; ") };
        no_device(format!("no device{asked} serves: {seen}"))
    })
}

fn examine(instance: &Instance, physical: vk::PhysicalDevice, without: Without) -> Result<(u32, Caps), String> {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut most = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut two = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut most);
    // SAFETY: `physical` comes from this instance, which speaks at least 1.1; a driver that does not know the pushed
    // struct leaves it as it is.
    unsafe { instance.raw.get_physical_device_properties2(physical, &mut two) };
    let properties = two.properties;
    let text = |s: Result<&CStr, _>| s.map_or_else(|_| String::new(), |s| s.to_string_lossy().into_owned());
    let device = text(properties.device_name_as_c_str());
    let what = format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str()));
    let name = if what.trim().is_empty() { device } else { format!("{device}, {}", what.trim()) };
    let refuse = |why: &str| Err(format!("{name}: {why}"));

    // SAFETY: as above.
    let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let Some(family) = families.iter().position(|f| f.queue_flags.contains(both)) else {
        return refuse("it has no queue for graphics and compute");
    };

    let core_1_2 = properties.api_version.min(instance.api) >= vk::API_VERSION_1_2;
    let core_1_3 = properties.api_version.min(instance.api) >= vk::API_VERSION_1_3;
    // SAFETY: as above.
    let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    if !(core_1_3 || has(khr::dynamic_rendering::NAME) && has(khr::synchronization2::NAME)) {
        return refuse("it has neither Vulkan 1.3 nor VK_KHR_dynamic_rendering with VK_KHR_synchronization2");
    }
    let mut rendering = vk::PhysicalDeviceDynamicRenderingFeatures::default();
    let mut sync = vk::PhysicalDeviceSynchronization2Features::default();
    let mut two = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
    let mut image = vk::PhysicalDeviceImageRobustnessFeatures::default();
    let mut atomics = vk::PhysicalDeviceShaderAtomicInt64Features::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut rendering).push_next(&mut sync);
    let has_two = has(ext::robustness2::NAME);
    if has_two {
        features = features.push_next(&mut two);
    }
    if core_1_3 || has(ext::image_robustness::NAME) {
        features = features.push_next(&mut image);
    }
    if core_1_2 || has(khr::shader_atomic_int64::NAME) {
        features = features.push_next(&mut atomics);
    }
    // SAFETY: as above.
    unsafe { instance.raw.get_physical_device_features2(physical, &mut features) };
    let f = features.features;
    if rendering.dynamic_rendering == vk::FALSE || sync.synchronization2 == vk::FALSE {
        return refuse("its driver turns dynamic rendering or synchronization2 off");
    }
    // SAFETY: as above.
    let depth = unsafe { instance.raw.get_physical_device_format_properties(physical, vk::Format::D32_SFLOAT) };
    if !depth.optimal_tiling_features.contains(vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT) {
        return refuse("it has no 32-bit float depth");
    }

    let on = |v: vk::Bool32| v == vk::TRUE;
    let timestamp_bits = if without.timestamps { 0 } else { families[family].timestamp_valid_bits };
    let statistics = on(f.pipeline_statistics_query) && !without.statistics;
    let multi_draw = on(f.multi_draw_indirect) && on(f.draw_indirect_first_instance) && !without.indirect;
    let whole = on(f.shader_int64) && on(atomics.shader_buffer_int64_atomics) && !without.atomics_64;
    let mut degraded = vec![];
    let mut lacks = |there: bool, words: &str| {
        if !there {
            degraded.push(words.to_owned());
        }
    };
    lacks(timestamp_bits > 0, "no timestamps: gpu_ms is left out");
    lacks(statistics, "no pipeline statistics: clipped primitives are not counted");
    lacks(multi_draw, "no multi-draw-indirect with first instances: one direct draw call a record");
    lacks(whole, Atomics::LACKING);
    let robustness = Robustness {
        buffer: on(f.robust_buffer_access),
        two: has_two.then(|| [on(two.robust_buffer_access2), on(two.robust_image_access2)]),
        image: on(image.robust_image_access).then_some(!core_1_3),
    };
    let bits = properties.limits.sub_pixel_precision_bits;
    if bits < GOOD_SUB_PIXEL_BITS {
        // A corner is moved by up to half a step in each direction.
        let px = 0.5_f64.powi(bits as i32 + 1);
        degraded.push(format!(
            "{bits} bits of sub-pixel precision: corners move by up to {px} px, what they span with them"
        ));
    }
    let rank = match properties.device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => 0,
        vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
        vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
        vk::PhysicalDeviceType::CPU => 3,
        _ => 4,
    };
    let caps = Caps {
        physical,
        family: family as u32,
        name,
        limits: properties.limits,
        max_buffer: most.max_memory_allocation_size,
        core_1_2,
        core_1_3,
        timestamp_bits,
        statistics,
        multi_draw,
        atomics: if whole { Atomics::Whole } else { Atomics::Halves },
        spirv: match properties.api_version.min(instance.api) {
            v if v >= vk::API_VERSION_1_3 => (1, 6),
            v if v >= vk::API_VERSION_1_2 => (1, 5),
            _ => (1, 3),
        },
        robustness,
        degraded,
    };
    Ok((rank, caps))
}
