//! Use of a device that an engine made. It is handed over as raw handles, so the engine can use other Vulkan bindings or
//! another version of them.
use super::Gpu;
use super::calibrated::{self, CalibratedClock};
use super::device::{Opened, is_by_ray_query, usable};
use super::info;
use super::instance::{Instance, walk_loader_lists};
use super::ray_query::{RayQueries, Tracing};
use super::tuning::Tuning;
use crate::error::{Error, Result};
use ash::vk::Handle;
use ash::{ext, vk};
use std::ffi::{CStr, c_void};
use std::path::PathBuf;
use std::time::Duration;

/// The caller's handles, as the numbers of Vulkan's C interface (pointers for dispatchable handles), and how to use the
/// device. By default the handles are null, which [`Gpu::from_raw`] refuses: give all five, and `..RawDevice::default()` for what need
/// not be told.
#[derive(Clone, Debug, Default)]
pub struct RawDevice {
    /// `vkGetInstanceProcAddr` of the loader that made the rest.
    pub get_instance_proc_addr: *const c_void,
    /// `VkInstance`, made for Vulkan 1.3 or later.
    pub instance: u64,
    /// The `VkPhysicalDevice` that `device` was made from.
    pub physical_device: u64,
    /// `VkDevice`, made with all of [`super::REQUIRED_FEATURES`] enabled.
    pub device: u64,
    /// `VkQueue` of `queue_family`, used for uploads and by [`Gpu::run`].
    pub queue: u64,
    /// Index of a family with compute.
    pub queue_family: u32,
    /// Whether the device was made with `robustBufferAccess` enabled, which every device has; see [`Gpu::from_raw`].
    pub robust_buffer_access: bool,
    /// Whether the instance was made with VK_EXT_debug_utils enabled: passes carry labels then, and objects names.
    pub debug_utils: bool,
    /// Folder for compiled pipelines; see [`super::DeviceOptions::cache`].
    pub cache: Option<PathBuf>,
    /// How long to wait for a device that stands still; see [`super::DeviceOptions::wait_limit`].
    pub wait_limit: Option<Duration>,
    /// Who finds what rays meet. For [`Tracing::RayQuery`] the device was made with VK_KHR_ray_query, VK_KHR_acceleration_structure and
    /// VK_KHR_deferred_host_operations, and with the features `rayQuery`, `accelerationStructure` and `bufferDeviceAddress`. Vulkan does
    /// not tell all of that of a device: [`Gpu::from_raw`] refuses one that it sees to lack the second or the third extension.
    pub tracing: Tracing,
    /// Sizes into which work is divided; see [`super::DeviceOptions::tuning`].
    pub tuning: Option<Tuning>,
}

impl Gpu {
    /// Uses a device made elsewhere and destroys only what it makes itself. [`Gpu::calibrate`] works if the device has
    /// VK_KHR_calibrated_timestamps or VK_EXT_calibrated_timestamps enabled, and reads its own clock by it
    /// (`VK_TIME_DOMAIN_DEVICE`).
    ///
    /// # Safety
    /// - The handles are valid, belong together, and outlive everything made from the returned `Gpu`.
    /// - The instance was made with an `apiVersion` of 1.3 or newer; an older one is an error where the driver tells.
    /// - The device was made with every one of [`super::REQUIRED_FEATURES`] enabled, and with what [`RawDevice::tracing`] takes.
    /// - Whoever creates or destroys an instance or a device on another thread while this runs, or, with [`RawDevice::debug_utils`], as
    ///   long as the returned `Gpu` is used, holds [`super::change_loader_lists`].
    /// - Nobody else uses the queue while anything of this crate may. Only recording never does: `record`, `update`, `steps`, `steps_on`,
    ///   `views` and what begins with `set_` of a [`Renderer`](crate::render::Renderer), `record` and `radiance` of a
    ///   [`Denoiser`](crate::denoise::Denoiser) and of filters, [`super::FrameResources::new`] and [`super::Buffer::new`]. All else that
    ///   takes this `Gpu`, or what was made of it, may submit to the queue and wait for it: what makes renderers, denoisers, filters,
    ///   [`Planes`](crate::denoise::filter::Planes) and filled buffers, what reads or writes buffers, [`Gpu::run`], and all of
    ///   [`profile`](crate::profile). With a queue of its own, where the family has several, there is nothing to lock; frames may
    ///   still be submitted to any queue of the family.
    /// - Without `robust_buffer_access`, kernels read only what a [`Renderer`](crate::render::Renderer), a
    ///   [`Denoiser`](crate::denoise::Denoiser) and [`filter::run`](crate::denoise::filter::run) give them, which is checked:
    ///   none of their [`super::Buffer`]s is written by others, no pass, policy or filter is recorded apart from them,
    ///   the steps are those of [`Renderer::steps`](crate::render::Renderer::steps) in their order, and
    ///   [`Renderer::update`](crate::render::Renderer::update) gets a scene as [`Scene::apply`](crate::scene::Scene::apply)
    ///   has left it, with the change that it returned, or else [`Change::everything`](crate::scene::Change::everything).
    ///   Otherwise kernels might read and write outside their buffers.
    ///
    /// # Errors
    /// [`Error::Usage`] when a handle is null, the family does not exist or cannot compute, and for a tuning that cannot be.
    /// [`Error::Device`] when the device cannot do what is required.
    pub unsafe fn from_raw(raw: RawDevice) -> Result<Self> {
        check_handles(&raw)?;
        // SAFETY: a valid `vkGetInstanceProcAddr` by contract; function pointers have the size of data pointers on
        // every platform that has Vulkan.
        let get_instance_proc_addr =
            unsafe { std::mem::transmute::<*const c_void, vk::PFN_vkGetInstanceProcAddr>(raw.get_instance_proc_addr) };
        let table = ash::StaticFn { get_instance_proc_addr };
        // SAFETY: valid handles that belong together, by contract.
        let instance = unsafe {
            let loaded = ash::Instance::load(&table, vk::Instance::from_raw(raw.instance));
            Instance::borrowed(ash::Entry::from_static_fn(table), loaded)
        };
        let unchanged = walk_loader_lists();
        let device = unsafe { ash::Device::load(instance.raw.fp_v1_0(), vk::Device::from_raw(raw.device)) };
        let physical = vk::PhysicalDevice::from_raw(raw.physical_device);
        if !enabled(&instance.raw, &device, &[c"vkCmdPipelineBarrier2"]) {
            let what = "the instance was made for an older Vulkan: set apiVersion to 1.3 or newer";
            return Err(Error::Device(what.to_owned()));
        }
        check_family(&instance.raw, physical, raw.queue_family)?;
        let mut candidate = info::describe(&instance.raw, physical, Some(raw.queue_family));
        candidate.info.robust_buffer_access = raw.robust_buffer_access;
        usable(&candidate)?;
        let labels = [c"vkCmdBeginDebugUtilsLabelEXT", c"vkCmdEndDebugUtilsLabelEXT", c"vkSetDebugUtilsObjectNameEXT"];
        let has = |names: &[&CStr]| enabled(&instance.raw, &device, names);
        let debug = (raw.debug_utils && has(&labels)).then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let calibrated = calibrated::offered(&instance, physical, |extension| has(&[extension.function()]))?;
        let calibrated = calibrated.map(|extension| CalibratedClock::new(extension, &instance.raw, &device));
        let by_ray_query = is_by_ray_query(raw.tracing, &candidate.info)?;
        if by_ray_query && !has(&[c"vkCreateAccelerationStructureKHR", c"vkCreateDeferredOperationKHR"]) {
            let what = "the device cannot trace by ray queries: make it with VK_KHR_ray_query, VK_KHR_acceleration_structure and \
                        VK_KHR_deferred_host_operations, and with rayQuery, accelerationStructure and bufferDeviceAddress";
            return Err(Error::Device(what.to_owned()));
        }
        let ray_queries = by_ray_query.then(|| RayQueries::new(&instance.raw, physical, &device));
        let tuning = raw.tuning.unwrap_or(Tuning::of(candidate.info.kind, by_ray_query)).on(candidate.info.kind)?;
        drop(unchanged);
        let queue = vk::Queue::from_raw(raw.queue);
        let queue_family = raw.queue_family;
        let opened =
            Opened { instance, candidate, queue_family, device, queue, debug, calibrated, ray_queries, tuning };
        Self::assemble(opened, raw.cache, raw.wait_limit)
    }
}

fn check_handles(raw: &RawDevice) -> Result<()> {
    let handles = [
        ("get_instance_proc_addr", raw.get_instance_proc_addr as u64),
        ("instance", raw.instance),
        ("physical_device", raw.physical_device),
        ("device", raw.device),
        ("queue", raw.queue),
    ];
    match handles.iter().find(|(_, handle)| *handle == 0) {
        Some((field, _)) => {
            Err(Error::Usage(format!("a null handle was handed over: give RawDevice::{field} that of your engine")))
        }
        None => Ok(()),
    }
}

fn check_family(instance: &ash::Instance, physical: vk::PhysicalDevice, family: u32) -> Result<()> {
    // SAFETY: valid handles by the contract of `from_raw`.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    match families.get(family as usize) {
        Some(f) if f.queue_flags.contains(vk::QueueFlags::COMPUTE) => Ok(()),
        Some(_) => Err(Error::Usage(format!("queue family {family} has no compute: hand over one that has"))),
        None => Err(Error::Usage(format!("queue family {family} does not exist: there are {}", families.len()))),
    }
}

/// Whether the functions of an extension of the device or of a version are there; they are returned only if the extension is enabled,
/// or the instance made for the version.
fn enabled(instance: &ash::Instance, device: &ash::Device, names: &[&CStr]) -> bool {
    // SAFETY: valid handles by the contract of `from_raw`.
    names.iter().all(|name| unsafe { instance.get_device_proc_addr(device.handle(), name.as_ptr()) }.is_some())
}
