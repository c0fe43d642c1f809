//! The GPU layer on a device that somebody else made: own instance, own device, own command buffer, same bits.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
mod support;
use ash::vk;
use ash::vk::Handle;
use std::ffi::c_void;
use std::sync::Mutex;
use support::kernels::next;
use tallow::gpu::layout::Effects;
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, RawDevice, Recorder};

/// What an engine has: everything here is made and destroyed with plain ash.
struct Engine {
    /// Keeps the loader open.
    _entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    messenger: (ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    messages: Box<Mutex<Vec<String>>>,
}

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

unsafe fn instance(entry: &ash::Entry) -> ash::Instance {
    let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
    let extensions = [ash::ext::debug_utils::NAME.as_ptr(), ash::ext::validation_features::NAME.as_ptr()];
    let layers = [c"VK_LAYER_KHRONOS_validation".as_ptr()];
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let info = vk::InstanceCreateInfo::default()
        .application_info(&app)
        .enabled_extension_names(&extensions)
        .enabled_layer_names(&layers)
        .push_next(&mut features);
    unsafe { entry.create_instance(&info, None) }.expect("install vulkan-validationlayers and mesa-vulkan-drivers")
}

unsafe fn device(instance: &ash::Instance, physical: vk::PhysicalDevice) -> ash::Device {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
    let core = vk::PhysicalDeviceFeatures::default().shader_int64(true);
    let mut v12 = vk::PhysicalDeviceVulkan12Features::default().scalar_block_layout(true).host_query_reset(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default().synchronization2(true).maintenance4(true);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&core)
        .push_next(&mut v12)
        .push_next(&mut v13);
    unsafe { instance.create_device(physical, &info, None) }.unwrap()
}

impl Engine {
    fn new() -> Self {
        unsafe {
            let entry = ash::Entry::load().expect("install libvulkan1");
            let instance = instance(&entry);
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
            let physical = instance.enumerate_physical_devices().unwrap()[0];
            let device = device(&instance, physical);
            let queue = device.get_device_queue(0, 0);
            let pool = device.create_command_pool(&vk::CommandPoolCreateInfo::default(), None).unwrap();
            Self { _entry: entry, instance, physical, device, queue, pool, messenger: (utils, messenger), messages }
        }
    }

    fn raw(&self) -> RawDevice {
        RawDevice {
            get_instance_proc_addr: self._entry.static_fn().get_instance_proc_addr as *const c_void,
            instance: self.instance.handle().as_raw(),
            physical_device: self.physical.as_raw(),
            device: self.device.handle().as_raw(),
            queue: self.queue.as_raw(),
            queue_family: 0,
        }
    }

    /// Begins a command buffer, hands it to `record`, submits it and waits.
    fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
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

    fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap().clone()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            // Whatever the layer above forgot is reported here.
            let left = self.messages();
            self.messenger.0.destroy_debug_utils_messenger(self.messenger.1, None);
            self.instance.destroy_instance(None);
            assert!(left.is_empty() || std::thread::panicking(), "{left:#?}");
        }
    }
}

/// Two dependent passes; returns the buffers in use, the result last.
fn record(rec: &mut Recorder<'_>, kernel: &next::Kernel, buffers: &[Buffer<u32>; 3]) {
    let [a, b, c] = buffers;
    let (count, groups) = (a.len() as u32, [(a.len() as u32).div_ceil(64), 1, 1]);
    rec.dispatch(kernel, next::Bind { from: a, to: b }, &count, groups).unwrap();
    rec.dispatch(kernel, next::Bind { from: b, to: c }, &count, groups).unwrap();
}

fn buffers(gpu: &Gpu, input: &[u32]) -> [Buffer<u32>; 3] {
    let make = |name| Buffer::new(gpu, name, input.len(), Location::Device).unwrap();
    [Buffer::from_slice(gpu, "a", input).unwrap(), make("b"), make("c")]
}

/// The result on a device that the layer opened itself.
fn own_device(input: &[u32]) -> Vec<u32> {
    let gpu = support::gpu();
    let kernel = next::Kernel::new(&gpu, &Effects::ALL, &[]).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, input), FrameResources::new(&gpu).unwrap());
    gpu.run(&mut frame, |rec| {
        record(rec, &kernel, &buffers);
        Ok(())
    })
    .unwrap();
    support::assert_silent(&gpu);
    buffers[2].read().unwrap()
}

#[test]
fn an_engines_command_buffer_gives_the_same_bits() {
    let engine = Engine::new();
    let input = support::words(10_007, 1);
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let kernel = next::Kernel::new(&gpu, &Effects::ALL, &[]).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, &vec![0; input.len()]), FrameResources::new(&gpu).unwrap());
    // The engine writes the input itself, just before, without a barrier of its own, and copies the result just after.
    let upload = Buffer::from_slice(&gpu, "upload", &input).unwrap();
    let download = Buffer::<u32>::new(&gpu, "download", input.len(), Location::Readback).unwrap();
    for _ in 0..2 {
        engine.run(|commands| unsafe {
            engine_copy(&engine.device, commands, &upload, &buffers[0]);
            let mut rec = Recorder::external(&gpu, &mut frame, commands.as_raw()).unwrap();
            record(&mut rec, &kernel, &buffers);
            drop(rec);
            engine_copy(&engine.device, commands, &buffers[2], &download);
        });
        assert_eq!(frame.times().unwrap().len(), 2);
    }
    let own = own_device(&input);
    assert!(buffers[2].read().unwrap() == own, "the bits are those of the layer's own device");
    assert!(download.read().unwrap() == own, "and the engine's copy sees them");
    assert!(own != input, "the comparison can fail");
    assert_eq!(engine.messages(), Vec::<String>::new());
    drop((gpu, kernel, buffers, frame, upload, download));
}

unsafe fn engine_copy(device: &ash::Device, commands: vk::CommandBuffer, from: &Buffer<u32>, to: &Buffer<u32>) {
    let (from, to) = (from.raw(), to.raw());
    let region = vk::BufferCopy { src_offset: from.offset, dst_offset: to.offset, size: from.size };
    let buffers = (vk::Buffer::from_raw(from.handle), vk::Buffer::from_raw(to.handle));
    unsafe { device.cmd_copy_buffer(commands, buffers.0, buffers.1, &[region]) };
}

#[test]
fn times_before_the_work_is_done_are_an_error() {
    let engine = Engine::new();
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let kernel = next::Kernel::new(&gpu, &Effects::ALL, &[]).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, &[1]), FrameResources::new(&gpu).unwrap());
    engine.run(|commands| {
        let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()) }.unwrap();
        record(&mut rec, &kernel, &buffers);
        drop(rec);
        assert!(frame.times().unwrap_err().to_string().contains("before its work was complete"));
    });
    assert_eq!(frame.times().unwrap().len(), 2);
    assert_eq!(engine.messages(), Vec::<String>::new());
}

#[test]
fn bad_handles_are_errors() {
    let engine = Engine::new();
    for bad in [
        RawDevice { device: 0, ..engine.raw() },
        RawDevice { get_instance_proc_addr: std::ptr::null(), ..engine.raw() },
        RawDevice { queue_family: 99, ..engine.raw() },
    ] {
        let message = unsafe { Gpu::from_raw(bad) }.err().unwrap().to_string();
        assert!(message.contains("null") || message.contains("99"), "{message}");
    }
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    assert!(unsafe { Recorder::external(&gpu, &mut frame, 0) }.is_err());
}
