//! Stands in for Vulkan's loader in front of a program that opens it: `REAL_LOADER` names the real one, submission
//! number `LOSE_AT`, counted from 1, loses the device, number `FAIL_AT` finds no memory, and with `NO_DEVICE` its drivers
//! have no device. With `NO_CACHE` no pipeline cache can be made; an instance that is destroyed before its device aborts
//! the program.
//! `tests/cli/device.rs` compiles it, with std alone.
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::mem::transmute;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};

type Find = unsafe extern "system" fn(*mut c_void, *const c_char) -> *const c_void;
type Submit = unsafe extern "system" fn(*mut c_void, u32, *const c_void, u64) -> c_int;

type Destroy = unsafe extern "system" fn(*mut c_void, *const c_void);

const ERROR_OUT_OF_HOST_MEMORY: c_int = -1;
const ERROR_DEVICE_LOST: c_int = -4;

static DEVICE: OnceLock<Find> = OnceLock::new();
static SUBMIT: OnceLock<Submit> = OnceLock::new();
static SUBMITTED: AtomicUsize = AtomicUsize::new(0);
static DESTROY_DEVICE: OnceLock<Destroy> = OnceLock::new();
static DESTROY_INSTANCE: OnceLock<Destroy> = OnceLock::new();
static OPEN: AtomicBool = AtomicBool::new(false);

unsafe extern "C" {
    fn dlopen(name: *const c_char, flags: c_int) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *const c_void;
}

fn real() -> Find {
    static REAL: OnceLock<Find> = OnceLock::new();
    *REAL.get_or_init(|| unsafe {
        let path = CString::new(std::env::var("REAL_LOADER").unwrap()).unwrap();
        let library = dlopen(path.as_ptr(), 2); // RTLD_NOW
        assert!(!library.is_null(), "{path:?}");
        transmute::<*const c_void, Find>(dlsym(library, c"vkGetInstanceProcAddr".as_ptr()))
    })
}

#[unsafe(no_mangle)]
unsafe extern "system" fn vkGetInstanceProcAddr(instance: *mut c_void, name: *const c_char) -> *const c_void {
    unsafe {
        let found = real()(instance, name);
        if found.is_null() {
            return found;
        }
        let name = CStr::from_ptr(name);
        if name == c"vkEnumeratePhysicalDevices" && std::env::var_os("NO_DEVICE").is_some() {
            return no_devices as *const c_void;
        }
        if name == c"vkDestroyInstance" {
            DESTROY_INSTANCE.get_or_init(|| transmute::<*const c_void, Destroy>(found));
            return destroy_instance as *const c_void;
        }
        if name != c"vkGetDeviceProcAddr" {
            return found;
        }
        DEVICE.get_or_init(|| transmute::<*const c_void, Find>(found));
        device as *const c_void
    }
}

unsafe extern "system" fn no_devices(_: *mut c_void, count: *mut u32, _: *mut c_void) -> c_int {
    unsafe { *count = 0 };
    0
}

unsafe extern "system" fn device(device: *mut c_void, name: *const c_char) -> *const c_void {
    unsafe {
        let found = DEVICE.get().unwrap()(device, name);
        let name = CStr::from_ptr(name);
        if name == c"vkDestroyDevice" {
            OPEN.store(true, SeqCst);
            DESTROY_DEVICE.get_or_init(|| transmute::<*const c_void, Destroy>(found));
            return destroy_device as *const c_void;
        }
        if name == c"vkCreatePipelineCache" && std::env::var_os("NO_CACHE").is_some() {
            return no_cache as *const c_void;
        }
        if found.is_null() || name != c"vkQueueSubmit2" {
            return found;
        }
        SUBMIT.get_or_init(|| transmute::<*const c_void, Submit>(found));
        submit as *const c_void
    }
}

unsafe extern "system" fn no_cache(_: *mut c_void, _: *const c_void, _: *const c_void, _: *mut u64) -> c_int {
    ERROR_OUT_OF_HOST_MEMORY
}

unsafe extern "system" fn destroy_device(device: *mut c_void, allocator: *const c_void) {
    OPEN.store(false, SeqCst);
    unsafe { DESTROY_DEVICE.get().unwrap()(device, allocator) }
}

unsafe extern "system" fn destroy_instance(instance: *mut c_void, allocator: *const c_void) {
    if OPEN.load(SeqCst) {
        std::process::abort();
    }
    unsafe { DESTROY_INSTANCE.get().unwrap()(instance, allocator) }
}

unsafe extern "system" fn submit(queue: *mut c_void, count: u32, what: *const c_void, fence: u64) -> c_int {
    let named = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<usize>().ok());
    match SUBMITTED.fetch_add(1, SeqCst) + 1 {
        number if named("LOSE_AT").is_some_and(|at| number >= at) => ERROR_DEVICE_LOST,
        number if named("FAIL_AT") == Some(number) => ERROR_OUT_OF_HOST_MEMORY,
        _ => unsafe { SUBMIT.get().unwrap()(queue, count, what, fence) },
    }
}
