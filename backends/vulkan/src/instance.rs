//! The Vulkan instance: loader, validation layer, and the messenger that keeps what validation says.
//!
//! With validation asked for, the Khronos layer runs with synchronisation validation, and every message of severity
//! WARNING or ERROR lands in the [`Journal`]. The journal outlives the instance, so that what is said while objects are
//! destroyed (leaks) can be read too. Remarks of the loader about other drivers (type GENERAL) are not ours and not kept.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

use ash::{ext, vk};
use farfield_core::Fault;

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What validation has said so far. Clones share their content.
#[derive(Clone, Debug, Default)]
pub struct Journal(Arc<Mutex<Vec<String>>>);

impl Journal {
    /// The messages, in the order they came.
    pub fn messages(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Owns the loader and the instance; destroys messenger and instance when dropped.
pub(crate) struct Instance {
    pub(crate) raw: ash::Instance,
    /// The API version that the instance speaks, at most 1.3.
    pub(crate) api: u32,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(crate) journal: Journal,
    _entry: ash::Entry,
}

/// A fault of something that is not a device yet.
pub(crate) fn no_device(cause: impl Into<String>) -> Fault {
    Fault::Device { device: "Vulkan".into(), cause: cause.into() }
}

impl Instance {
    /// Loads Vulkan and makes an instance.
    ///
    /// # Errors
    /// [`Fault::Device`] where there is no loader or no driver, or where validation is asked for and not installed.
    pub(crate) fn new(validation: bool) -> Result<Self, Fault> {
        // SAFETY: the loader is the system's own shared library; nothing else of this process unloads it.
        let entry = unsafe { ash::Entry::load() }
            .map_err(|e| no_device(format!("the Vulkan loader (libvulkan) cannot be opened: {e}")))?;
        // SAFETY: `entry` is loaded.
        let offered = unsafe { entry.try_enumerate_instance_version() }
            .map_err(|e| no_device(format!("the loader does not say its version: {e}")))?
            .unwrap_or(vk::API_VERSION_1_0);
        if offered < vk::API_VERSION_1_1 {
            return Err(no_device("the loader speaks Vulkan 1.0 only; 1.1 is the least that serves"));
        }
        let api = offered.min(vk::API_VERSION_1_3);
        if validation && !has_validation(&entry)? {
            return Err(no_device("validation was asked for, but VK_LAYER_KHRONOS_validation is not installed"));
        }

        let journal = Journal::default();
        let app =
            vk::ApplicationInfo::default().application_name(c"farfield").engine_name(c"farfield").api_version(api);
        let layers = [VALIDATION.as_ptr()];
        let extensions = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        let mut early = messenger_info(&journal);
        let mut info = vk::InstanceCreateInfo::default().application_info(&app);
        if validation {
            info = info
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut features)
                .push_next(&mut early);
        }
        // SAFETY: everything that `info` points to lives until the call returns; the journal behind the messenger lives
        // as long as the instance, since both go into one struct whose `drop` destroys the instance first.
        let raw = unsafe { entry.create_instance(&info, None) }
            .map_err(|e| no_device(format!("no Vulkan instance (is a driver installed?): {e}")))?;
        let mut instance = Self { raw, api, messenger: None, journal, _entry: entry };
        if validation {
            let utils = ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            // SAFETY: the instance was made with VK_EXT_debug_utils; the journal lives as long as it does.
            let made = unsafe { utils.create_debug_utils_messenger(&messenger_info(&instance.journal), None) }
                .map_err(|e| no_device(format!("no messenger for validation: {e}")))?;
            instance.messenger = Some((utils, made));
        }
        Ok(instance)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some((utils, messenger)) = self.messenger.take() {
            // SAFETY: made from this instance, destroyed once.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: the device holds the instance, so no device of it is left; destroyed once.
        unsafe { self.raw.destroy_instance(None) };
    }
}

fn has_validation(entry: &ash::Entry) -> Result<bool, Fault> {
    // SAFETY: `entry` is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(|e| no_device(format!("the loader does not list its layers: {e}")))?;
    Ok(layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION)))
}

/// The messenger's settings; `journal` must outlive what is made from them.
fn messenger_info(journal: &Journal) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(keep))
        .user_data(Arc::as_ptr(&journal.0).cast_mut().cast())
}

/// Called by the layer, from any thread.
unsafe extern "system" fn keep(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data or null, and `user` is the journal's list, alive as long as the instance.
    let (Some(data), Some(list)) = (unsafe { data.as_ref() }, unsafe { user.cast::<Mutex<Vec<String>>>().as_ref() })
    else {
        return vk::FALSE;
    };
    // SAFETY: the message is null or a terminated string that lives during the call.
    let text = unsafe { data.message_as_c_str() }.map_or_else(String::new, |m| m.to_string_lossy().into_owned());
    let kind = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) { "error" } else { "warning" };
    list.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{kind}: {text}"));
    vk::FALSE
}
