//! An engine that embeds the renderer: own instance, device and command buffers, made with plain ash.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use ash::vk;
use ash::vk::Handle;
use std::ffi::{CStr, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tallow::gpu::{RawDevice, Tracing, change_loader_lists};

/// What an engine has: everything here is made and destroyed with plain ash.
pub struct Engine {
    /// Keeps the loader open.
    _entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    pub device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    messenger: (ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    messages: Box<Mutex<Vec<String>>>,
    tracing: Tracing,
    /// The tests of one program run side by side, and hooks hear of the calls of one engine.
    alone: Option<MutexGuard<'static, ()>>,
}

static ENGINES: Mutex<()> = Mutex::new(());

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

unsafe extern "system" fn collect(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    messages: *mut c_void,
) -> vk::Bool32 {
    let (text, messages) = unsafe { ((*data).message_as_c_str(), &*messages.cast::<Mutex<Vec<String>>>()) };
    messages.lock().unwrap().push(text.unwrap_or_default().to_string_lossy().into_owned());
    vk::FALSE
}

unsafe fn instance(entry: &ash::Entry, version: u32) -> ash::Instance {
    let app = vk::ApplicationInfo::default().api_version(version);
    let mut extensions = vec![ash::ext::debug_utils::NAME.as_ptr(), ash::ext::validation_features::NAME.as_ptr()];
    let layers = [LAYER.as_ptr()];
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    // Newer layers are told here to look at what shaders access.
    static ON: vk::Bool32 = vk::TRUE;
    let heuristic = [vk::LayerSettingEXT { value_count: 1, p_values: (&raw const ON).cast(), ..Default::default() }
        .layer_name(LAYER)
        .setting_name(c"syncval_shader_accesses_heuristic")];
    let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&heuristic);
    let offered = unsafe { entry.enumerate_instance_extension_properties(Some(LAYER)) }.unwrap_or_default();
    let configurable = offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::ext::layer_settings::NAME));
    extensions.extend(configurable.then_some(ash::ext::layer_settings::NAME.as_ptr()));
    let mut info = vk::InstanceCreateInfo::default().application_info(&app).push_next(&mut features);
    if configurable {
        info = info.push_next(&mut settings);
    }
    info = info.enabled_extension_names(&extensions).enabled_layer_names(&layers);
    let _alone = change_loader_lists();
    unsafe { entry.create_instance(&info, None) }.expect("install vulkan-validationlayers and mesa-vulkan-drivers")
}

/// What a device that traces by ray queries is made with.
const RAY_EXTENSIONS: [&CStr; 3] =
    [ash::khr::ray_query::NAME, ash::khr::acceleration_structure::NAME, ash::khr::deferred_host_operations::NAME];

/// One that has what the renderer needs, but for an instance that is too old for that.
unsafe fn device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    tracing: Tracing,
    version: u32,
) -> ash::Device {
    if version < vk::API_VERSION_1_3 {
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
        return unsafe { instance.create_device(physical, &info, None) }.unwrap();
    }
    let rays = tracing == Tracing::RayQuery;
    let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
    let core = vk::PhysicalDeviceFeatures::default().shader_int64(true).robust_buffer_access(true);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true).host_query_reset(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).maintenance4(true);
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap();
    let calibrated = [ash::khr::calibrated_timestamps::NAME, ash::ext::calibrated_timestamps::NAME];
    let is_offered = |name: &CStr| offered.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
    let names = calibrated.into_iter().find(|name| is_offered(name)).into_iter();
    let extensions: Vec<_> = names.chain(RAY_EXTENSIONS.into_iter().filter(|_| rays)).map(CStr::as_ptr).collect();
    let mut structures = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
    let mut queries = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
    v12.buffer_device_address = rays.into();
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&core)
        .push_next(&mut v12)
        .push_next(&mut v13);
    if rays {
        info = info.push_next(&mut structures).push_next(&mut queries);
    }
    unsafe { instance.create_device(physical, &info, None) }.unwrap()
}

impl Engine {
    /// A device under core and synchronization validation.
    pub fn new() -> Self {
        Self::tracing(Tracing::Compute)
    }

    /// One that was made to trace rays so.
    pub fn tracing(tracing: Tracing) -> Self {
        Self::made(tracing, vk::API_VERSION_1_3)
    }

    /// One whose instance was made for this version of Vulkan.
    pub fn of_version(version: u32) -> Self {
        Self::made(Tracing::Compute, version)
    }

    fn made(tracing: Tracing, version: u32) -> Self {
        let turn = ENGINES.lock().unwrap_or_else(PoisonError::into_inner);
        unsafe {
            let entry = ash::Entry::load().expect("install libvulkan1");
            let instance = instance(&entry, version);
            let messages = Box::new(Mutex::new(Vec::new()));
            let utils = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(collect))
                .user_data((&raw const *messages).cast_mut().cast());
            let messenger = utils.create_debug_utils_messenger(&info, None).unwrap();
            // The one that the program takes, too.
            let name = super::own_gpu().info().name.clone();
            let of_name = |&d: &vk::PhysicalDevice| {
                instance.get_physical_device_properties(d).device_name_as_c_str().unwrap().to_str() == Ok(&name)
            };
            let physical = instance.enumerate_physical_devices().unwrap().into_iter().find(of_name).unwrap();
            let alone = change_loader_lists();
            let device = device(&instance, physical, tracing, version);
            drop(alone);
            let queue = device.get_device_queue(0, 0);
            let pool = device.create_command_pool(&vk::CommandPoolCreateInfo::default(), None).unwrap();
            let messenger = (utils, messenger);
            Self {
                _entry: entry,
                instance,
                physical,
                device,
                queue,
                pool,
                messenger,
                messages,
                tracing,
                alone: Some(turn),
            }
        }
    }

    /// What the engine hands over.
    pub fn raw(&self) -> RawDevice {
        RawDevice {
            get_instance_proc_addr: self._entry.static_fn().get_instance_proc_addr as *const c_void,
            instance: self.instance.handle().as_raw(),
            physical_device: self.physical.as_raw(),
            device: self.device.handle().as_raw(),
            queue: self.queue.as_raw(),
            queue_family: 0,
            robust_buffer_access: true,
            debug_utils: true,
            tracing: self.tracing,
            ..RawDevice::default()
        }
    }

    /// Begins a command buffer, hands it to `record`, submits it and waits.
    pub fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        unsafe {
            let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).unwrap();
            record(commands[0]);
            self.device.end_command_buffer(commands[0]).unwrap();
            let submit = [vk::SubmitInfo::default().command_buffers(&commands)];
            self.device.queue_submit(self.queue, &submit, vk::Fence::null()).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
        }
    }

    /// As [`Self::run`], without waiting: what is returned goes to [`Self::wait`].
    pub fn submit(&self, record: impl FnOnce(vk::CommandBuffer)) -> (vk::Fence, vk::CommandBuffer) {
        unsafe {
            let info = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).unwrap();
            record(commands[0]);
            self.device.end_command_buffer(commands[0]).unwrap();
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            let submit = [vk::SubmitInfo::default().command_buffers(&commands)];
            self.device.queue_submit(self.queue, &submit, fence).unwrap();
            (fence, commands[0])
        }
    }

    /// Waits until a submission is complete.
    pub fn wait(&self, (fence, commands): (vk::Fence, vk::CommandBuffer)) {
        unsafe {
            self.device.wait_for_fences(&[fence], true, u64::MAX).unwrap();
            self.device.destroy_fence(fence, None);
            self.device.free_command_buffers(self.pool, &[commands]);
        }
    }

    /// Leaves the device as it is for ever, with what was left on it.
    pub fn abandon(mut self) {
        self.alone = None;
        std::mem::forget(self);
    }

    /// What the layers have said so far.
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap().clone()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            let alone = change_loader_lists();
            self.device.destroy_device(None);
            drop(alone);
            // Whatever the layer above forgot is reported here.
            let left = self.messages();
            self.messenger.0.destroy_debug_utils_messenger(self.messenger.1, None);
            let alone = change_loader_lists();
            self.instance.destroy_instance(None);
            drop(alone);
            assert!(left.is_empty() || std::thread::panicking(), "{left:#?}");
        }
    }
}
