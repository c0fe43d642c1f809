//! Wraps Vulkan's entry points: the wrappers count objects that are created and destroyed, and fail on request.
#![allow(unsafe_code, reason = "stands between the renderer and the driver")]
use ash::vk;
use std::collections::HashMap;
use std::ffi::{CStr, c_char, c_void};
use std::mem::transmute;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering::SeqCst};
use std::sync::{LazyLock, Mutex};
use tallow::gpu::RawDevice;

/// While set, the device is lost to whatever is submitted, and to whoever asks for times, which are given all the same.
pub static LOSE: AtomicBool = AtomicBool::new(false);

/// The most bytes that the device gives at once.
pub static MOST_BYTES: AtomicU64 = AtomicU64::new(u64::MAX);

/// While it is not 0, what every wait for a fence returns, without waiting.
pub static WAIT: AtomicI32 = AtomicI32::new(0);

/// While set, no memory that the host maps is cached, as on some integrated graphics cards: reading a buffer takes a copy.
pub static UNCACHED: AtomicBool = AtomicBool::new(false);

/// While set, no device reads its own clock by the extension for that, only the host's.
pub static NO_DEVICE_CLOCK: AtomicBool = AtomicBool::new(false);

/// A hook that is set until this is dropped, also by a test that fails.
pub struct Set(&'static AtomicBool);

/// Sets a hook until what is returned is dropped.
pub fn set(hook: &'static AtomicBool) -> Set {
    hook.store(true, SeqCst);
    Set(hook)
}

impl Drop for Set {
    fn drop(&mut self) {
        self.0.store(false, SeqCst);
    }
}

/// Called before every wait for a fence.
pub static BEFORE_WAIT: Mutex<Option<Box<dyn Fn() + Send>>> = Mutex::new(None);

/// What an entry point returns.
trait Outcome: Sized {
    fn failure(code: vk::Result) -> Option<Self>;
}

impl Outcome for vk::Result {
    fn failure(code: vk::Result) -> Option<Self> {
        Some(code)
    }
}

impl Outcome for () {
    fn failure(_: vk::Result) -> Option<Self> {
        None
    }
}

/// Why `name` fails now with the arguments that these point to, if it does.
unsafe fn failure(name: &str, arguments: &[*const c_void]) -> Option<vk::Result> {
    if name == "vkAllocateMemory" {
        let info = unsafe { &**arguments[1].cast::<*const vk::MemoryAllocateInfo>() };
        let fails = info.allocation_size > MOST_BYTES.load(SeqCst);
        return fails.then_some(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY);
    }
    if name == "vkWaitForFences" {
        if let Some(f) = &*BEFORE_WAIT.lock().unwrap() {
            f();
        }
        let code = WAIT.load(SeqCst);
        return (code != 0).then(|| vk::Result::from_raw(code));
    }
    let fails = name.starts_with("vkQueueSubmit") || name == "vkGetQueryPoolResults";
    (LOSE.load(SeqCst) && fails).then_some(vk::Result::ERROR_DEVICE_LOST)
}

/// A function of the loader or the driver; another one for every engine, since both may be unloaded between two.
struct Real<F>(Mutex<Option<F>>);

impl<F: Copy> Real<F> {
    fn set(&self, f: F) {
        *self.0.lock().unwrap() = Some(f);
    }

    fn get(&self) -> F {
        self.0.lock().unwrap().expect("set before it is handed out")
    }
}

static INSTANCE_LOADER: Real<vk::PFN_vkGetInstanceProcAddr> = Real(Mutex::new(None));
static DEVICE_LOADER: Real<vk::PFN_vkGetDeviceProcAddr> = Real(Mutex::new(None));
static CALLS: LazyLock<Mutex<HashMap<&'static str, usize>>> = LazyLock::new(Mutex::default);

/// The engine's handles, with our entry points. Engines take turns, and so do these.
pub fn between(raw: RawDevice) -> RawDevice {
    take_calls(); // of the test before
    // SAFETY: the engine's own pointer.
    INSTANCE_LOADER
        .set(unsafe { transmute::<*const c_void, vk::PFN_vkGetInstanceProcAddr>(raw.get_instance_proc_addr) });
    RawDevice { get_instance_proc_addr: get_instance_proc_addr as *const c_void, ..raw }
}

/// How often each entry point was called since the last time that somebody asked.
pub fn take_calls() -> HashMap<&'static str, usize> {
    std::mem::take(&mut CALLS.lock().unwrap())
}

unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    unsafe {
        let found = INSTANCE_LOADER.get()(instance, name);
        let ours = match CStr::from_ptr(name).to_bytes() {
            b"vkGetDeviceProcAddr" => {
                DEVICE_LOADER.set(transmute::<vk::PFN_vkVoidFunction, vk::PFN_vkGetDeviceProcAddr>(found));
                get_device_proc_addr as *const c_void
            }
            b"vkGetPhysicalDeviceMemoryProperties" => {
                MEMORY.set(transmute::<vk::PFN_vkVoidFunction, vk::PFN_vkGetPhysicalDeviceMemoryProperties>(found));
                memory_properties as *const c_void
            }
            b"vkGetPhysicalDeviceCalibrateableTimeDomainsKHR" | b"vkGetPhysicalDeviceCalibrateableTimeDomainsEXT"
                if found.is_some() && NO_DEVICE_CLOCK.load(SeqCst) =>
            {
                time_domains as *const c_void
            }
            _ => return found,
        };
        Some(transmute::<*const c_void, unsafe extern "system" fn()>(ours))
    }
}

unsafe extern "system" fn time_domains(
    _: vk::PhysicalDevice,
    count: *mut u32,
    domains: *mut vk::TimeDomainKHR,
) -> vk::Result {
    unsafe {
        *count = 1;
        if !domains.is_null() {
            *domains = vk::TimeDomainKHR::CLOCK_MONOTONIC;
        }
    }
    vk::Result::SUCCESS
}

static MEMORY: Real<vk::PFN_vkGetPhysicalDeviceMemoryProperties> = Real(Mutex::new(None));

unsafe extern "system" fn memory_properties(
    physical: vk::PhysicalDevice,
    found: *mut vk::PhysicalDeviceMemoryProperties,
) {
    unsafe {
        MEMORY.get()(physical, found);
        if UNCACHED.load(SeqCst) {
            (*found).memory_types.iter_mut().for_each(|of| of.property_flags &= !vk::MemoryPropertyFlags::HOST_CACHED);
        }
    }
}

/// For each entry point, one of its type that counts and passes on.
macro_rules! between {
    ($($name:ident: $pfn:ident($($arg:ident: $type:ty),+) -> $outcome:ty;)+) => {
        unsafe extern "system" fn get_device_proc_addr(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
            unsafe {
                let found = DEVICE_LOADER.get()(device, name);
                $(
                    if CStr::from_ptr(name).to_str() == Ok(stringify!($name)) {
                        static REAL: Real<vk::$pfn> = Real(Mutex::new(None));
                        unsafe extern "system" fn ours($($arg: $type),+) -> $outcome {
                            *CALLS.lock().unwrap().entry(stringify!($name)).or_default() += 1;
                            let arguments = [$((&raw const $arg).cast()),+];
                            let failure = unsafe { failure(stringify!($name), &arguments) };
                            let failed = failure.and_then(<$outcome>::failure);
                            if let Some(outcome) = failed
                                && stringify!($name) != "vkGetQueryPoolResults"
                            {
                                return outcome;
                            }
                            let done = unsafe { REAL.get()($($arg),+) };
                            failed.unwrap_or(done)
                        }
                        REAL.set(transmute::<vk::PFN_vkVoidFunction, vk::$pfn>(found));
                        return Some(transmute::<*const c_void, unsafe extern "system" fn()>(ours as *const c_void));
                    }
                )+
                found
            }
        }
    };
}

type Alloc<'a> = *const vk::AllocationCallbacks<'a>;

between! {
    vkCreateBuffer: PFN_vkCreateBuffer(d: vk::Device, i: *const vk::BufferCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Buffer) -> vk::Result;
    vkCreateBufferView: PFN_vkCreateBufferView(d: vk::Device, i: *const vk::BufferViewCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::BufferView) -> vk::Result;
    vkAllocateMemory: PFN_vkAllocateMemory(d: vk::Device, i: *const vk::MemoryAllocateInfo<'_>, a: Alloc<'_>, o: *mut vk::DeviceMemory) -> vk::Result;
    vkMapMemory: PFN_vkMapMemory(d: vk::Device, m: vk::DeviceMemory, at: vk::DeviceSize, n: vk::DeviceSize, f: vk::MemoryMapFlags, o: *mut *mut c_void) -> vk::Result;
    vkCreateShaderModule: PFN_vkCreateShaderModule(d: vk::Device, i: *const vk::ShaderModuleCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::ShaderModule) -> vk::Result;
    vkCreateComputePipelines: PFN_vkCreateComputePipelines(d: vk::Device, c: vk::PipelineCache, n: u32, i: *const vk::ComputePipelineCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Pipeline) -> vk::Result;
    vkCreatePipelineLayout: PFN_vkCreatePipelineLayout(d: vk::Device, i: *const vk::PipelineLayoutCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::PipelineLayout) -> vk::Result;
    vkCreateDescriptorSetLayout: PFN_vkCreateDescriptorSetLayout(d: vk::Device, i: *const vk::DescriptorSetLayoutCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::DescriptorSetLayout) -> vk::Result;
    vkCreateDescriptorPool: PFN_vkCreateDescriptorPool(d: vk::Device, i: *const vk::DescriptorPoolCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::DescriptorPool) -> vk::Result;
    vkCreateQueryPool: PFN_vkCreateQueryPool(d: vk::Device, i: *const vk::QueryPoolCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::QueryPool) -> vk::Result;
    vkCreateCommandPool: PFN_vkCreateCommandPool(d: vk::Device, i: *const vk::CommandPoolCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::CommandPool) -> vk::Result;
    vkAllocateCommandBuffers: PFN_vkAllocateCommandBuffers(d: vk::Device, i: *const vk::CommandBufferAllocateInfo<'_>, o: *mut vk::CommandBuffer) -> vk::Result;
    vkCreateFence: PFN_vkCreateFence(d: vk::Device, i: *const vk::FenceCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Fence) -> vk::Result;
    vkCreateSemaphore: PFN_vkCreateSemaphore(d: vk::Device, i: *const vk::SemaphoreCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Semaphore) -> vk::Result;
    vkCreateEvent: PFN_vkCreateEvent(d: vk::Device, i: *const vk::EventCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Event) -> vk::Result;
    vkCreateImage: PFN_vkCreateImage(d: vk::Device, i: *const vk::ImageCreateInfo<'_>, a: Alloc<'_>, o: *mut vk::Image) -> vk::Result;
    vkQueueSubmit2: PFN_vkQueueSubmit2(q: vk::Queue, n: u32, i: *const vk::SubmitInfo2<'_>, f: vk::Fence) -> vk::Result;
    vkWaitForFences: PFN_vkWaitForFences(d: vk::Device, n: u32, f: *const vk::Fence, all: vk::Bool32, limit: u64) -> vk::Result;
    vkQueueWaitIdle: PFN_vkQueueWaitIdle(q: vk::Queue) -> vk::Result;
    vkDestroyBuffer: PFN_vkDestroyBuffer(d: vk::Device, b: vk::Buffer, a: Alloc<'_>) -> ();
    vkFreeMemory: PFN_vkFreeMemory(d: vk::Device, m: vk::DeviceMemory, a: Alloc<'_>) -> ();
    vkDestroyPipeline: PFN_vkDestroyPipeline(d: vk::Device, p: vk::Pipeline, a: Alloc<'_>) -> ();
    vkDestroyCommandPool: PFN_vkDestroyCommandPool(d: vk::Device, p: vk::CommandPool, a: Alloc<'_>) -> ();
    vkDestroyDescriptorPool: PFN_vkDestroyDescriptorPool(d: vk::Device, p: vk::DescriptorPool, a: Alloc<'_>) -> ();
    vkDestroyQueryPool: PFN_vkDestroyQueryPool(d: vk::Device, p: vk::QueryPool, a: Alloc<'_>) -> ();
    vkGetQueryPoolResults: PFN_vkGetQueryPoolResults(d: vk::Device, p: vk::QueryPool, first: u32, n: u32, size: usize, to: *mut c_void, stride: vk::DeviceSize, f: vk::QueryResultFlags) -> vk::Result;
    vkResetCommandPool: PFN_vkResetCommandPool(d: vk::Device, p: vk::CommandPool, f: vk::CommandPoolResetFlags) -> vk::Result;
}
