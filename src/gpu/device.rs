//! Opening a device, submitting work to it, and the state that the rest of the layer shares.
use super::At;
use super::cache::PipelineCache;
use super::calibrated::{self, CalibratedClock, CalibratedExtension};
use super::info::{self, Candidate, DeviceInfo, DeviceKind, Features};
use super::instance::{Instance, Messages, change_loader_lists, walk_loader_lists};
use super::pipelines::Pipelines;
use super::ray_query::{self, RayFeatures, RayQueries, Tracing};
use super::tuning::Tuning;
use crate::error::{Error, Result};
use ash::vk::Handle;
use ash::{ext, khr, vk};
use gpu_allocator::AllocationSizes;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use std::ffi::{CStr, CString};
use std::mem::ManuallyDrop;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Default time to wait for a GPU while no pass begins or ends. Passes are sized to take a fraction of a second, so even
/// a device a thousand times slower stays within this limit.
const WAIT_LIMIT: Duration = Duration::from_secs(600);

/// Which device to open, and how to use it.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// Index in [`super::survey`], as a number below 100 is, or a part of the device's name in any case. `None` prefers discrete over
    /// integrated over virtual GPUs over CPUs, among those that lack nothing.
    pub device: Option<String>,
    /// Run under the validation layers with synchronization validation; see [`Gpu::validation_messages`].
    pub validation: bool,
    /// Folder in which compiled pipelines are kept between runs, such as [`super::cache_folder`]. It is made if missing.
    /// Drivers trust this data, so only files that nobody but the user can write are read. `None` keeps nothing.
    pub cache: Option<PathBuf>,
    /// How long to wait while no pass of a submission begins or ends before the device is given up as lost. `None` waits
    /// 10 minutes on GPUs and without limit on CPUs, whose drivers end endless loops by themselves and whose passes can take
    /// hours.
    pub wait_limit: Option<Duration>,
    /// Who finds what rays meet.
    pub tracing: Tracing,
    /// Sizes into which work is divided. `None` takes [`Tuning::CPU`] or [`Tuning::GPU`] by the kind of the device.
    pub tuning: Option<Tuning>,
}

/// An open device. Clones share it. It closes when the last clone, buffer, kernel and frame made with it is dropped.
#[derive(Clone)]
pub struct Gpu(pub(super) Arc<Inner>);

/// The shared state of a device. [`Drop::drop`] destroys the Vulkan objects, the instance last.
pub(super) struct Inner {
    pub device: ash::Device,
    pub physical: vk::PhysicalDevice,
    pub queue_family: u32,
    pub limits: vk::PhysicalDeviceLimits,
    pub cache: PipelineCache,
    pub pipelines: Pipelines,
    pub debug: Option<ext::debug_utils::Device>,
    pub info: DeviceInfo,
    pub tuning: Tuning,
    pub calibrated: Option<CalibratedClock>,
    /// `None` where rays are traced by compute kernels alone.
    pub ray_queries: Option<RayQueries>,
    queue: Mutex<vk::Queue>,
    /// Limit of [`Self::wait`] in nanoseconds.
    wait_limit: u64,
    /// Whether the device was lost: nothing more is asked of it.
    lost: AtomicBool,
    /// Whether work was left running that may never end. Nothing is freed any more then, because that work may use it.
    abandoned: AtomicBool,
    /// `None` only during construction and destruction.
    allocator: Mutex<Option<Allocator>>,
    instance: ManuallyDrop<Instance>,
}

/// The parts of an open device, before they are put together.
pub(super) struct Opened {
    pub instance: Instance,
    pub candidate: Candidate,
    pub queue_family: u32,
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub debug: Option<ext::debug_utils::Device>,
    pub calibrated: Option<CalibratedClock>,
    pub ray_queries: Option<RayQueries>,
    pub tuning: Tuning,
}

impl Gpu {
    /// Opens a device of this machine.
    ///
    /// # Errors
    /// [`Error::Device`] naming the remedy: no loader, no driver, no device of that name, a required feature is
    /// missing, ray queries or the validation layers are asked for and not there. [`Error::Usage`] for a tuning that cannot be.
    pub fn open(options: &DeviceOptions) -> Result<Self> {
        let instance = Instance::new(options.validation)?;
        let candidate = choose(info::candidates(&instance.raw)?, options)?;
        let queue_family = usable(&candidate)?;
        let by_ray_query = is_by_ray_query(options.tracing, &candidate.info)?;
        let tuning = options.tuning.unwrap_or(Tuning::of(candidate.info.kind, by_ray_query)).on(candidate.info.kind)?;
        let calibrated = calibrated::offered(&instance, candidate.physical, |_| true)?;
        let alone = change_loader_lists();
        let device = create_device(&instance.raw, candidate.physical, queue_family, calibrated, by_ray_query)?;
        let debug = instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &device));
        let calibrated = calibrated.map(|extension| CalibratedClock::new(extension, &instance.raw, &device));
        let ray_queries = by_ray_query.then(|| RayQueries::new(&instance.raw, candidate.physical, &device));
        drop(alone);
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        let opened =
            Opened { instance, candidate, queue_family, device, queue, debug, calibrated, ray_queries, tuning };
        Self::assemble(opened, options.cache.clone(), options.wait_limit)
    }

    /// Puts the parts together. On failure an owned device is destroyed.
    pub(super) fn assemble(opened: Opened, cache: Option<PathBuf>, wait_limit: Option<Duration>) -> Result<Self> {
        let Opened { instance, candidate, queue_family, device, queue, debug, calibrated, ray_queries, tuning } =
            opened;
        let limit =
            wait_limit.unwrap_or(if candidate.info.kind == DeviceKind::Cpu { Duration::MAX } else { WAIT_LIMIT });
        // From here on, Drop cleans up if a line below fails.
        let mut inner = Inner {
            physical: candidate.physical,
            queue_family,
            limits: candidate.limits,
            cache: PipelineCache::default(),
            pipelines: Pipelines::default(),
            debug,
            info: candidate.info.clone(),
            tuning,
            calibrated,
            ray_queries,
            queue: Mutex::new(queue),
            wait_limit: limit.as_nanos().try_into().unwrap_or(u64::MAX),
            lost: AtomicBool::new(false),
            abandoned: AtomicBool::new(false),
            allocator: Mutex::new(None),
            device,
            instance: ManuallyDrop::new(instance),
        };
        inner.cache = PipelineCache::new(&inner.device, &candidate, cache)?;
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: inner.instance.raw.clone(),
            device: inner.device.clone(),
            physical_device: inner.physical,
            debug_settings: Default::default(),
            buffer_device_address: inner.ray_queries.is_some(),
            allocation_sizes: block_sizes(),
        });
        *inner.lock_allocator() = Some(allocator.map_err(|e| Error::Device(format!("memory allocator: {e}")))?);
        Ok(Self(Arc::new(inner)))
    }

    /// The properties and limits of the device.
    pub fn info(&self) -> &DeviceInfo {
        &self.0.info
    }

    /// Checks that the queue's family tells times.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn check_clock(&self) -> Result<()> {
        match self.0.info.timestamp_bits {
            0 => Err(Error::Device(format!(
                "{} has no timestamps: choose another device or queue family",
                self.0.info.name
            ))),
            _ => Ok(()),
        }
    }

    /// Bytes of device memory held by all buffers that exist on the device.
    pub fn allocated_bytes(&self) -> u64 {
        self.0.lock_allocator().as_ref().map_or(0, |a| a.generate_report().total_allocated_bytes)
    }

    /// Whether rays are traced by ray queries: see [`DeviceOptions::tracing`].
    pub fn traces_by_ray_query(&self) -> bool {
        self.0.ray_queries.is_some()
    }

    /// # Errors
    /// [`Error::Device`] on a device that traces otherwise.
    pub(super) fn ray_queries(&self) -> Result<&RayQueries> {
        let none = || Error::Device("this device was not opened to trace by ray queries".into());
        self.0.ray_queries.as_ref().ok_or_else(none)
    }

    /// # Errors
    /// [`Error::Usage`] when `what` was made on another device, where its handles are not valid.
    pub(crate) fn owns(&self, what: &str, maker: &Gpu) -> Result<()> {
        match Arc::ptr_eq(&self.0, &maker.0) {
            true => Ok(()),
            false => Err(Error::Usage(format!("{what} was made on another device: make it on the one that runs it"))),
        }
    }

    /// Messages of the validation layers so far, oldest first; empty without [`DeviceOptions::validation`].
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.instance.messages.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// A shared handle to the messages. It outlives the device, so it also receives those about objects that were not
    /// destroyed.
    #[doc(hidden)]
    pub fn validation_log(&self) -> Messages {
        self.0.instance.messages.clone()
    }
}

impl Inner {
    /// Locks the allocator, which exists as long as the device is open.
    pub fn lock_allocator(&self) -> MutexGuard<'_, Option<Allocator>> {
        self.allocator.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Submits one command buffer and waits for `fence`, as long as the value of `progress`, which begins at 0, changes within
    /// the time limit.
    ///
    /// # Errors
    /// Those of Vulkan, `TIMEOUT` included. Nothing of the submission runs then, unless the device was abandoned.
    pub fn submit_and_wait(
        &self,
        commands: vk::CommandBuffer,
        fence: vk::Fence,
        progress: impl Fn() -> usize,
    ) -> std::result::Result<(), vk::Result> {
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
        // SAFETY: the buffer is complete, the fence unsignalled, and the lock keeps the queue to this thread.
        let submitted = unsafe {
            let reset = self.device.reset_fences(&[fence]);
            reset.and_then(|()| self.device.queue_submit2(*self.lock_queue(), &submit, fence))
        };
        let done = submitted.and_then(|()| self.wait(fence, progress).inspect_err(|failure| self.settle(*failure)));
        done.inspect_err(|failure| self.note_loss(*failure))
    }

    fn wait(&self, fence: vk::Fence, progress: impl Fn() -> usize) -> std::result::Result<(), vk::Result> {
        let mut before = 0;
        loop {
            // SAFETY: a live fence, submitted just before.
            match unsafe { self.device.wait_for_fences(&[fence], true, self.wait_limit) } {
                Err(vk::Result::TIMEOUT) => match progress() {
                    now if now == before => return Err(vk::Result::TIMEOUT),
                    now => before = now,
                },
                done => return done,
            }
        }
    }

    /// Ensures after a failed wait that nothing which running work may use is freed. A lost device runs nothing any more; one
    /// that hangs cannot be waited for, so it is marked as abandoned.
    fn settle(&self, failure: vk::Result) {
        let stopped = match failure {
            vk::Result::ERROR_DEVICE_LOST => true,
            vk::Result::TIMEOUT => false,
            // SAFETY: the lock keeps the queue to this thread. Only this queue is waited for, as an engine may use others.
            _ => matches!(
                unsafe { self.device.queue_wait_idle(*self.lock_queue()) },
                Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST)
            ),
        };
        self.abandoned.fetch_or(!stopped, Ordering::SeqCst);
    }

    fn lock_queue(&self) -> MutexGuard<'_, vk::Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers a failure that says that the device is lost, or that it is given up as lost.
    pub fn note_loss(&self, failure: vk::Result) {
        self.lost.fetch_or(matches!(failure, vk::Result::ERROR_DEVICE_LOST | vk::Result::TIMEOUT), Ordering::SeqCst);
    }

    /// # Errors
    /// [`Error::DeviceLost`] once a loss was noted, or work was given up that may still run and use what new work would.
    pub fn answers(&self) -> Result<()> {
        match self.lost.load(Ordering::SeqCst) || self.is_abandoned() {
            false => Ok(()),
            true => Err(Error::DeviceLost("the device was lost, or stopped answering, before: open another".into())),
        }
    }

    fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::SeqCst)
    }

    /// Calls `destroy`, unless abandoned work may still use what it destroys.
    pub fn free(&self, destroy: impl FnOnce(&ash::Device)) {
        if !self.is_abandoned() {
            destroy(&self.device);
        }
    }

    /// Names an object for validation messages and capture tools.
    pub fn name(&self, object: impl Handle, name: &str) {
        let (Some(debug), Ok(name)) = (&self.debug, CString::new(name)) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        let _unchanged = walk_loader_lists();
        // SAFETY: a live object of this device. A name that cannot be set is no loss.
        let _ = unsafe { debug.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        if self.is_abandoned() {
            // Its work may still be running, so the allocator, the loader and the driver are leaked.
            std::mem::forget(self.lock_allocator().take());
            return;
        }
        // SAFETY: nothing made on the device is left (all of it keeps this), and none of it is in use: whoever
        // submits through the layer waits, and `Recorder::external` makes its caller promise so. The instance is dropped
        // once, here.
        unsafe {
            self.pipelines.destroy(&self.device);
            self.cache.store_and_destroy(&self.device);
            *self.lock_allocator() = None;
            if self.instance.owned {
                let _alone = change_loader_lists();
                self.device.destroy_device(None);
            }
            ManuallyDrop::drop(&mut self.instance);
        }
    }
}

/// Sizes of the blocks of memory that buffers share. The first are small, so that a small film takes little of a small memory; each is
/// twice as large as the one before, so that there are few of them all the same.
fn block_sizes() -> AllocationSizes {
    const MIB: u64 = 1 << 20;
    let first = AllocationSizes::new(4 * MIB, 4 * MIB);
    first.with_max_device_memblock_size(256 * MIB).with_max_host_memblock_size(64 * MIB)
}

/// Chooses a device by index, or the best one, of those that a name is part of if there is one. `candidates` must not be empty.
fn choose(mut candidates: Vec<Candidate>, options: &DeviceOptions) -> Result<Candidate> {
    let wanted = options.device.as_deref();
    let lacks = |info: &DeviceInfo| match (info.missing.is_empty(), options.tracing) {
        (false, _) => 2,
        (true, Tracing::RayQuery) if !info.ray_query_lacks.is_empty() => 1,
        (true, _) => 0,
    };
    let rank = |i: &usize| (lacks(&candidates[*i].info), candidates[*i].info.kind);
    let best = || (0..candidates.len()).min_by_key(rank);
    let named = |wanted| find(&candidates, wanted).into_iter().min_by_key(rank);
    let index = wanted.map_or_else(best, named).ok_or_else(|| {
        let list = candidates.iter().enumerate().map(|(i, c)| format!("{i}: {}", c.info.name)).collect::<Vec<_>>();
        let (wanted, list) = (wanted.unwrap_or_default(), list.join("; "));
        Error::Device(format!("no device is called \"{wanted}\": choose one of {list}"))
    })?;
    Ok(candidates.swap_remove(index))
}

/// Numbers below this are indices and no parts of names: a "1" is in the version of many a driver that a name ends in.
const INDICES: usize = 100;

/// Those that are meant.
fn find(candidates: &[Candidate], wanted: &str) -> Vec<usize> {
    if let Some(index) = wanted.parse().ok().filter(|&index: &usize| index < INDICES) {
        return Some(index).filter(|&index| index < candidates.len()).into_iter().collect();
    }
    let wanted = wanted.to_lowercase();
    if wanted.trim().is_empty() {
        return Vec::new(); // it would be a part of every name
    }
    let is_meant = |i: &usize| candidates[*i].info.name.to_lowercase().contains(&wanted);
    (0..candidates.len()).filter(is_meant).collect()
}

/// Returns the queue family if the device has all required features.
pub(super) fn usable(candidate: &Candidate) -> Result<u32> {
    let DeviceInfo { name, missing, driver_name, driver_version, .. } = &candidate.info;
    if !missing.is_empty() {
        return Err(Error::Device(format!(
            "{name} (driver {driver_name} {driver_version}) lacks {}: update its driver, or choose another device \
             (`tallow devices` lists them)",
            missing.join(", ")
        )));
    }
    candidate.queue_family.ok_or_else(|| Error::Device(format!("{name} has no compute queue: choose another device")))
}

/// Whether rays are traced by ray queries then.
///
/// # Errors
/// [`Error::Device`] with what the device lacks for it.
pub(super) fn is_by_ray_query(tracing: Tracing, info: &DeviceInfo) -> Result<bool> {
    let DeviceInfo { name, driver_name, driver_version, ray_query_lacks, .. } = info;
    match tracing {
        Tracing::Auto | Tracing::Compute => Ok(false),
        Tracing::RayQuery if ray_query_lacks.is_empty() => Ok(true),
        Tracing::RayQuery => Err(Error::Device(format!(
            "{name} (driver {driver_name} {driver_version}) cannot trace by ray queries, since it lacks {}: choose the \
             tracing \"compute\", or a device or a driver that has it (`tallow devices` tells)",
            ray_query_lacks.join(", ")
        ))),
    }
}

fn create_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    queue_family: u32,
    calibrated: Option<CalibratedExtension>,
    by_ray_query: bool,
) -> Result<ash::Device> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
    let more = if by_ray_query { &ray_query::EXTENSIONS[..] } else { &[] };
    let names = calibrated.iter().map(|extension| extension.name()).chain(more.iter().copied());
    let mut extensions: Vec<_> = names.map(CStr::as_ptr).collect();
    // A device that has this extension is opened with it, or not at all.
    let partial = khr::portability_subset::NAME;
    // SAFETY: `physical` is of this instance.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.at("device extensions")?;
    extensions.extend(offered.iter().any(|e| e.extension_name_as_c_str() == Ok(partial)).then_some(partial.as_ptr()));
    let (mut features, mut of_rays) = (Features::required(), RayFeatures::required());
    features.v12.buffer_device_address = by_ray_query.into();
    // Every device supports it.
    features.core.robust_buffer_access = vk::TRUE;
    let mut info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&features.core)
        .push_next(&mut features.v12)
        .push_next(&mut features.v13);
    if by_ray_query {
        info = info.push_next(&mut of_rays.structures).push_next(&mut of_rays.queries);
    }
    // SAFETY: `physical` was found to have the features and extensions; `info` lives through the call.
    unsafe { instance.create_device(physical, &info, None) }.at("opening the device")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(
        name: &str,
        kind: DeviceKind,
        missing: &[&'static str],
        ray_query_lacks: &[&'static str],
    ) -> Candidate {
        let text = String::new;
        let info = DeviceInfo {
            name: name.into(),
            kind,
            vendor_id: 0,
            device_id: 0,
            unified: false,
            driver_name: text(),
            driver_info: text(),
            driver_version: text(),
            api_version: text(),
            max_storage_range: 0,
            max_texel_elements: 0,
            max_buffer_size: 0,
            max_allocation: 0,
            memory_heap: 0,
            subgroup_size: 0,
            subgroup_size_fixed: false,
            subgroup_shuffle: false,
            timestamp_bits: 0,
            timestamp_period: 0.0,
            robust_buffer_access: false,
            missing: missing.to_vec(),
            ray_query_lacks: ray_query_lacks.to_vec(),
        };
        let (physical, limits, cache_uuid) = Default::default();
        Candidate { physical, info, limits, cache_uuid, queue_family: Some(0) }
    }

    #[test]
    fn the_best_of_the_devices_that_are_meant_and_lack_nothing_is_chosen() {
        let all = || {
            vec![
                candidate("Card 1 (old driver)", DeviceKind::DiscreteGpu, &["maintenance4"], &["VK_KHR_ray_query"]),
                candidate("Card 1 (new driver)", DeviceKind::DiscreteGpu, &[], &["VK_KHR_ray_query"]),
                candidate("Chip", DeviceKind::IntegratedGpu, &[], &[]),
                candidate("llvmpipe", DeviceKind::Cpu, &[], &["VK_KHR_ray_query"]),
            ]
        };
        for (device, tracing, expected) in [
            (None, Tracing::Auto, "Card 1 (new driver)"),
            (None, Tracing::RayQuery, "Chip"),
            (Some("card 1"), Tracing::Auto, "Card 1 (new driver)"),
            (Some("card 1"), Tracing::RayQuery, "Card 1 (new driver)"),
            (Some("0"), Tracing::Auto, "Card 1 (old driver)"),
            (Some("pipe"), Tracing::RayQuery, "llvmpipe"),
        ] {
            let options = DeviceOptions { device: device.map(Into::into), tracing, ..Default::default() };
            assert_eq!(choose(all(), &options).unwrap().info.name, expected, "{device:?}, {tracing:?}");
        }
        for unknown in ["4", "chips", " "] {
            let options = DeviceOptions { device: Some(unknown.into()), ..Default::default() };
            let said = choose(all(), &options).err().unwrap().to_string();
            assert!(said.contains("no device is called") && said.contains("2: Chip"), "{said}");
        }
    }
}
