//! The Vulkan loader and instance: the way to the devices, and the place where validation messages arrive.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::{ext, khr, vk};

use super::device::Device;
use super::error::{Error, Result};
use super::profile::{self, DeviceReport};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
/// A driver gone wrong may repeat a message for ever.
const MOST_MESSAGES: usize = 1000;

/// How much the validation layer checks. Everything but `Off` needs `VK_LAYER_KHRONOS_validation`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// Nothing.
    #[default]
    Off,
    /// That calls are used as the specification says.
    On,
    /// The same, and that no hazards lie between the passes of a submission (synchronization validation).
    Sync,
}

/// Which device to open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The best fit one: discrete before integrated before CPU, with ray query before without.
    #[default]
    Auto,
    /// The index of a device, or a part of its or its driver's name in any case.
    Named(String),
}

/// The loaded Vulkan loader with one instance.
pub struct Instance {
    pub(super) raw: ash::Instance,
    pub(super) debug_utils: bool,
    pub(super) entry: ash::Entry,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // Boxed: the messenger holds its address.
    messages: Box<Mutex<Vec<String>>>,
    owned: bool,
}

impl Instance {
    /// Loads the loader and makes an instance.
    ///
    /// # Errors
    /// No loader, one older than Vulkan 1.2, no validation layer where validation was asked for, or a failing driver.
    pub fn new(validation: Validation) -> Result<Arc<Instance>> {
        // SAFETY: the system's Vulkan loader is trusted to be one.
        let entry = unsafe { ash::Entry::load() }.map_err(Error::NoLoader)?;
        let call = |call| move |result| Error::Call { call, result };
        // SAFETY: `entry` is a loaded loader.
        let found = unsafe { entry.try_enumerate_instance_version() }
            .map_err(call("vkEnumerateInstanceVersion"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if found < vk::API_VERSION_1_2 {
            return Err(Error::OldLoader { found: profile::version(found) });
        }
        // SAFETY: as above.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(call("vkEnumerateInstanceLayerProperties"))?;
        let has_layer = layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER));
        if validation != Validation::Off && !has_layer {
            return Err(Error::NoValidationLayer);
        }
        let mut extensions = Vec::new();
        for layer in [None, Some(VALIDATION_LAYER)] {
            if layer.is_none() || validation != Validation::Off {
                // SAFETY: as above; the layer was found.
                let found = unsafe { entry.enumerate_instance_extension_properties(layer) }
                    .map_err(call("vkEnumerateInstanceExtensionProperties"))?;
                extensions.extend(found);
            }
        }
        let has = |name: &CStr| extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        // Without validation it still gives buffers and passes their names in a capture (RenderDoc, Nsight).
        let debug_utils = has(ext::debug_utils::NAME);

        let messages = Box::new(Mutex::new(Vec::new()));
        let mut messenger_info = messenger_info(&messages);
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        let application = vk::ApplicationInfo::default()
            .application_name(c"neubrdf")
            .engine_name(c"neubrdf")
            .api_version(found.min(vk::API_VERSION_1_3));
        let mut layer_names = Vec::new();
        let mut extension_names = Vec::new();
        let mut info = vk::InstanceCreateInfo::default().application_info(&application);
        // Without it loaders keep quiet about Vulkan over another interface (MoltenVK).
        if has(khr::portability_enumeration::NAME) {
            extension_names.push(khr::portability_enumeration::NAME.as_ptr());
            info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        }
        if debug_utils {
            extension_names.push(ext::debug_utils::NAME.as_ptr());
        }
        if validation != Validation::Off {
            layer_names.push(VALIDATION_LAYER.as_ptr());
            if debug_utils {
                info = info.push_next(&mut messenger_info);
            }
        }
        if validation == Validation::Sync {
            extension_names.push(ext::validation_features::NAME.as_ptr());
            info = info.push_next(&mut features);
        }
        let info = info.enabled_layer_names(&layer_names).enabled_extension_names(&extension_names);
        // SAFETY: `info` and all that it points to live until the call returns; `messages` as long as the instance.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::NoDevice,
            result => Error::Call { call: "vkCreateInstance", result },
        })?;
        let mut instance = Instance { raw, debug_utils, entry, messenger: None, messages, owned: true };
        if validation != Validation::Off && debug_utils {
            let debug = ext::debug_utils::Instance::new(&instance.entry, &instance.raw);
            let info = self::messenger_info(&instance.messages);
            // SAFETY: the extension is enabled; the messages' address stays valid until the messenger is destroyed.
            let messenger = unsafe { debug.create_debug_utils_messenger(&info, None) }
                .map_err(call("vkCreateDebugUtilsMessengerEXT"))?;
            instance.messenger = Some((debug, messenger));
        }
        Ok(Arc::new(instance))
    }

    /// Borrows an instance that a host made and will destroy; `debug_utils` says whether it has `VK_EXT_debug_utils`.
    ///
    /// # Safety
    /// `raw` was made with `entry`, for Vulkan 1.2 or later, and outlives the result and everything made from it.
    pub(super) unsafe fn from_raw(entry: ash::Entry, raw: ash::Instance, debug_utils: bool) -> Arc<Instance> {
        Arc::new(Instance {
            raw,
            debug_utils,
            entry,
            messenger: None,
            messages: Box::new(Mutex::new(Vec::new())),
            owned: false,
        })
    }

    /// Every device, fit or not, in the loader's order.
    ///
    /// # Errors
    /// A failing driver. No device at all is an empty list.
    pub fn devices(&self) -> Result<Vec<DeviceReport>> {
        let physical = self.physical_devices()?;
        Ok(physical.iter().enumerate().map(|(index, p)| profile::report(&self.raw, index, *p, None)).collect())
    }

    /// Opens a device.
    ///
    /// # Errors
    /// No device, none that matches, or one that is unfit, with what it lacks.
    pub fn open(self: &Arc<Instance>, choice: &DeviceChoice) -> Result<Arc<Device>> {
        self.open_as(choice, |_| ())
    }

    /// [`Instance::open`], as if the device were another: what `disguise` takes from its report is not used. For tests of what becomes
    /// of the rest.
    ///
    /// # Errors
    /// As of [`Instance::open`].
    pub fn open_as(
        self: &Arc<Instance>,
        choice: &DeviceChoice,
        disguise: impl FnOnce(&mut DeviceReport),
    ) -> Result<Arc<Device>> {
        let reports = self.devices()?;
        if reports.is_empty() {
            return Err(Error::NoDevice);
        }
        let list = |line: &dyn Fn(&DeviceReport) -> String| reports.iter().map(line).collect::<Vec<_>>().join("\n");
        let known = || list(&|r| format!("  {}: {} ({})", r.index, r.name, r.driver));
        let chosen = match choice {
            DeviceChoice::Auto => {
                reports.iter().filter(|r| r.missing.is_empty()).min_by_key(|r| r.rank()).ok_or_else(|| {
                    Error::NoFitDevice {
                        listing: list(&|r| format!("  {} ({}) lacks {}", r.name, r.driver, r.missing.join(", "))),
                    }
                })?
            }
            DeviceChoice::Named(asked) => reports
                .iter()
                .filter(|r| r.matches(asked))
                .min_by_key(|r| (!r.missing.is_empty(), r.rank()))
                .ok_or_else(|| Error::UnknownDevice { asked: asked.clone(), known: known() })?,
        };
        if !chosen.missing.is_empty() {
            return Err(Error::Unfit { device: chosen.name.clone(), missing: chosen.missing.clone() });
        }
        let physical = self.physical_devices()?;
        let physical = physical.get(chosen.index).ok_or(Error::NoDevice)?;
        let mut report = chosen.clone();
        disguise(&mut report);
        Device::open(self, *physical, &report)
    }

    /// What the validation layer has said so far, warnings and errors, oldest first (at most a thousand).
    pub fn validation_messages(&self) -> Vec<String> {
        lock(&self.messages).clone()
    }

    fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: the instance is alive.
        match unsafe { self.raw.enumerate_physical_devices() } {
            // What the loader says when it finds no driver.
            Err(vk::Result::ERROR_INITIALIZATION_FAILED) => Ok(Vec::new()),
            other => other.map_err(|result| Error::Call { call: "vkEnumeratePhysicalDevices", result }),
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold the instance, so none is left; the messenger is this instance's.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            if self.owned {
                self.raw.destroy_instance(None);
            }
        }
    }
}

/// Locks a mutex, also after another thread has panicked with it: what lies in ours is never half changed.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn messenger_info(messages: &Mutex<Vec<String>>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::DebugUtilsMessageSeverityFlagsEXT as Severity;
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        // Not GENERAL: that is the loader talking about drivers that it could not load.
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
        .pfn_user_callback(Some(receive))
        .user_data(std::ptr::from_ref(messages).cast_mut().cast())
}

unsafe extern "system" fn receive(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the mutex given in `messenger_info`, alive as long as the instance; the layer passes valid data.
    unsafe {
        let messages = &*user.cast::<Mutex<Vec<String>>>();
        if let Some(text) = data.as_ref().and_then(|data| data.message_as_c_str()) {
            let mut messages = lock(messages);
            if messages.len() < MOST_MESSAGES {
                messages.push(format!("{severity:?}: {}", text.to_string_lossy()));
            }
        }
    }
    vk::FALSE
}
