//! The Vulkan loader and instance, with the validation layers if they are requested.
use super::At;
use crate::error::{Error, Result};
use crate::memory;
use ash::{ext, khr, vk};
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Messages of the validation layers, shared with the callback and with code that outlives the device.
pub(super) type Messages = Arc<Mutex<Vec<String>>>;

/// The loader walks its lists of instances and devices when it is asked for the functions of a device and when an object is named,
/// without protection against changes of these lists by other threads (issue 2018 of Vulkan-Loader).
static LOADER_LISTS: RwLock<()> = RwLock::new(());

/// Returns a lock to hold while an instance or a device is created or destroyed, so that no other thread has the loader find one. An
/// engine needs it that does so on one thread while another calls this crate, which names its objects: always on devices that the crate
/// opened, with [`RawDevice::debug_utils`](super::RawDevice::debug_utils) on the engine's own. The thread that holds it calls nothing else
/// of this crate.
pub fn change_loader_lists() -> RwLockWriteGuard<'static, ()> {
    LOADER_LISTS.write().unwrap_or_else(PoisonError::into_inner)
}

/// Returns a lock to hold while the loader finds a device.
pub(super) fn walk_loader_lists() -> RwLockReadGuard<'static, ()> {
    LOADER_LISTS.read().unwrap_or_else(PoisonError::into_inner)
}

/// An instance. It is destroyed on drop only if it was made here.
pub(super) struct Instance {
    /// Keeps the loader's library open.
    pub _entry: ash::Entry,
    pub raw: ash::Instance,
    pub owned: bool,
    /// Whether VK_EXT_debug_utils is enabled.
    pub debug_utils: bool,
    pub messages: Messages,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

impl Instance {
    /// # Errors
    /// No loader, no Vulkan 1.3, `validation` without the layers installed, or too small an address space.
    pub fn new(validation: bool) -> Result<Self> {
        memory::check_driver()?;
        let entry = load()?;
        let debug_utils = offers(&entry, None, ext::debug_utils::NAME)?;
        if validation && !(debug_utils && has_validation(&entry)?) {
            return Err(Error::Device(
                "the Vulkan validation layers are missing: install the package vulkan-validationlayers, or run \
                 without validation"
                    .into(),
            ));
        }
        let raw = create(&entry, debug_utils, validation)?;
        let mut instance =
            Self { _entry: entry, raw, owned: true, debug_utils, messages: Messages::default(), messenger: None };
        if validation {
            instance.listen()?;
        }
        Ok(instance)
    }

    /// Wraps an instance that the caller made and will destroy.
    pub fn borrowed(entry: ash::Entry, raw: ash::Instance) -> Self {
        let messages = Messages::default();
        Self { _entry: entry, raw, owned: false, debug_utils: false, messages, messenger: None }
    }

    /// Collects warnings and errors of the validation layers.
    fn listen(&mut self) -> Result<()> {
        use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
        let loader = ext::debug_utils::Instance::new(&self._entry, &self.raw);
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(Severity::WARNING | Severity::ERROR)
            .message_type(Type::VALIDATION)
            .pfn_user_callback(Some(collect))
            .user_data(Arc::as_ptr(&self.messages).cast_mut().cast());
        // SAFETY: the callback's data is kept by `self.messages`, which is dropped after the messenger.
        let messenger = unsafe { loader.create_debug_utils_messenger(&info, None) }.at("validation messages")?;
        self.messenger = Some((loader, messenger));
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some((loader, messenger)) = &self.messenger {
            // SAFETY: made by `listen` on this instance, destroyed once.
            unsafe { loader.destroy_debug_utils_messenger(*messenger, None) };
        }
        if self.owned {
            let _alone = change_loader_lists();
            // SAFETY: the device, the only other child, is destroyed before its instance is dropped.
            unsafe { self.raw.destroy_instance(None) };
        }
    }
}

/// SAFETY: called by the layers with valid data and the `Messages` that `listen` gave them.
unsafe extern "system" fn collect(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    let (data, messages) = unsafe { (&*data, &*messages.cast::<Mutex<Vec<String>>>()) };
    let text = unsafe { data.message_as_c_str() }.unwrap_or(c"(no text)").to_string_lossy().into_owned();
    messages.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}

fn load() -> Result<ash::Entry> {
    // SAFETY: loads the system's Vulkan loader, whose initialisers are trusted.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| {
        Error::Device(format!(
            "no Vulkan loader ({e}): install the packages libvulkan1 and, for a software device, mesa-vulkan-drivers"
        ))
    })?;
    // SAFETY: no preconditions.
    let version = unsafe { entry.try_enumerate_instance_version() }.at("Vulkan version")?;
    if version.is_none_or(|v| v < vk::API_VERSION_1_3) {
        return Err(Error::Device("the Vulkan loader is older than 1.3: update the package libvulkan1".into()));
    }
    Ok(entry)
}

/// Whether the loader and the drivers, or the given layer, support an instance extension.
fn offers(entry: &ash::Entry, layer: Option<&CStr>, extension: &CStr) -> Result<bool> {
    // SAFETY: no preconditions.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(layer) }.at("instance extensions")?;
    Ok(extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(extension)))
}

fn has_validation(entry: &ash::Entry) -> Result<bool> {
    // SAFETY: no preconditions.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.at("instance layers")?;
    Ok(layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)))
}

fn switched_on(name: &CStr) -> vk::LayerSettingEXT<'_> {
    static ON: vk::Bool32 = vk::TRUE;
    // The fields are set directly because `values` would count bytes.
    vk::LayerSettingEXT { value_count: 1, p_values: (&raw const ON).cast(), ..Default::default() }
        .layer_name(VALIDATION_LAYER)
        .setting_name(name)
        .ty(vk::LayerSettingTypeEXT::BOOL32)
}

fn create(entry: &ash::Entry, debug_utils: bool, validation: bool) -> Result<ash::Instance> {
    let app = vk::ApplicationInfo::default().application_name(c"tallow").api_version(vk::API_VERSION_1_3);
    let mut extensions = Vec::new();
    let mut layers = Vec::new();
    extensions.extend(debug_utils.then_some(ext::debug_utils::NAME.as_ptr()));
    // Drivers that are Vulkan over another interface, as on macOS, are listed where a program asks for them.
    let portability = offers(entry, None, khr::portability_enumeration::NAME)?;
    extensions.extend(portability.then_some(khr::portability_enumeration::NAME.as_ptr()));
    let configurable = validation && offers(entry, Some(VALIDATION_LAYER), ext::layer_settings::NAME)?;
    if validation {
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(if configurable { ext::layer_settings::NAME } else { ext::validation_features::NAME }.as_ptr());
    }
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    // Since July 2024 (pull request 8279) the layers ignore accesses by shaders unless this is switched on.
    let switches = [c"validate_sync", c"syncval_shader_accesses_heuristic"].map(switched_on);
    let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&switches);
    let flags = vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
    let mut info = vk::InstanceCreateInfo::default()
        .flags(if portability { flags } else { vk::InstanceCreateFlags::empty() })
        .application_info(&app)
        .enabled_extension_names(&extensions)
        .enabled_layer_names(&layers);
    if validation {
        info = if configurable { info.push_next(&mut settings) } else { info.push_next(&mut features) };
    }
    let _alone = change_loader_lists();
    // SAFETY: `info` and all it points to live through the call.
    unsafe { entry.create_instance(&info, None) }.map_err(|code| match code {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => Error::Device(
            "no Vulkan driver is installed: install the driver of the graphics card, or the package \
             mesa-vulkan-drivers for a software device"
                .into(),
        ),
        code => super::explain("Vulkan instance", code),
    })
}
