//! The properties of devices, and the features that Tallow requires of them.
use super::At;
use super::instance::Instance;
use super::ray_query;
use crate::error::{Error, Result};
use ash::vk;
use serde::Serialize;

/// One line of [`REQUIRED_FEATURES`].
#[derive(Clone, Copy)]
pub struct Feature {
    /// As the Vulkan specification spells it.
    pub name: &'static str,
    /// Returns its field among all features, which serves both to query and to enable it.
    field: fn(&mut Features) -> &mut vk::Bool32,
}

/// All features that Tallow requires of a device. A device handed over to [`super::Gpu::from_raw`] must have them enabled, each in its
/// struct:
///
/// ```
/// let names: Vec<_> = tallow::gpu::REQUIRED_FEATURES.iter().map(|feature| feature.name).collect();
/// let listed = [
///     "Vulkan 1.3",        // VkApplicationInfo::apiVersion, and that of the device
///     "synchronization2",  // VkPhysicalDeviceVulkan13Features
///     "maintenance4",      // VkPhysicalDeviceVulkan13Features
///     "scalarBlockLayout", // VkPhysicalDeviceVulkan12Features
///     "shaderInt64",       // VkPhysicalDeviceFeatures
///     "hostQueryReset",    // VkPhysicalDeviceVulkan12Features
/// ];
/// assert_eq!(names, listed);
/// ```
pub const REQUIRED_FEATURES: &[Feature] = &[
    Feature { name: "Vulkan 1.3", field: |f| &mut f.vulkan_1_3 },
    Feature { name: "synchronization2", field: |f| &mut f.v13.synchronization2 },
    Feature { name: "maintenance4", field: |f| &mut f.v13.maintenance4 },
    Feature { name: "scalarBlockLayout", field: |f| &mut f.v12.scalar_block_layout },
    Feature { name: "shaderInt64", field: |f| &mut f.core.shader_int64 },
    Feature { name: "hostQueryReset", field: |f| &mut f.v12.host_query_reset },
];

/// The feature structs that [`REQUIRED_FEATURES`] looks into.
#[derive(Default)]
pub(super) struct Features {
    vulkan_1_3: vk::Bool32,
    pub core: vk::PhysicalDeviceFeatures,
    pub v12: vk::PhysicalDeviceVulkan12Features<'static>,
    pub v13: vk::PhysicalDeviceVulkan13Features<'static>,
}

impl Features {
    /// Exactly the required features.
    pub fn required() -> Self {
        let mut features = Self::default();
        REQUIRED_FEATURES.iter().for_each(|feature| *(feature.field)(&mut features) = vk::TRUE);
        features
    }

    fn supported(instance: &ash::Instance, device: vk::PhysicalDevice, api_version: u32) -> Self {
        let mut features = Self::default();
        // Asking an older device for the structs of 1.3 is not allowed; it lacks everything.
        if api_version >= vk::API_VERSION_1_3 {
            let mut all =
                vk::PhysicalDeviceFeatures2::default().push_next(&mut features.v12).push_next(&mut features.v13);
            // SAFETY: `device` belongs to `instance`.
            unsafe { instance.get_physical_device_features2(device, &mut all) };
            features.core = all.features;
            features.vulkan_1_3 = vk::TRUE;
        }
        // The chain pointed to local variables.
        features.v12.p_next = std::ptr::null_mut();
        features.v13.p_next = std::ptr::null_mut();
        features
    }

    fn missing(&mut self) -> Vec<&'static str> {
        REQUIRED_FEATURES.iter().filter(|feature| *(feature.field)(self) == vk::FALSE).map(|f| f.name).collect()
    }
}

/// The kinds of devices, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum DeviceKind {
    /// A graphics card with memory of its own.
    #[serde(rename = "discrete GPU")]
    DiscreteGpu,
    /// A GPU that shares the processor's memory.
    #[serde(rename = "integrated GPU")]
    IntegratedGpu,
    /// A share of a GPU, given to a virtual machine.
    #[serde(rename = "virtual GPU")]
    VirtualGpu,
    /// Software, such as Mesa's lavapipe.
    #[serde(rename = "CPU")]
    Cpu,
    /// A kind that the driver does not tell, or another one.
    #[serde(rename = "other")]
    Other,
}

impl DeviceKind {
    fn of(device: vk::PhysicalDeviceType) -> Self {
        match device {
            vk::PhysicalDeviceType::DISCRETE_GPU => Self::DiscreteGpu,
            vk::PhysicalDeviceType::INTEGRATED_GPU => Self::IntegratedGpu,
            vk::PhysicalDeviceType::VIRTUAL_GPU => Self::VirtualGpu,
            vk::PhysicalDeviceType::CPU => Self::Cpu,
            _ => Self::Other,
        }
    }
}

impl std::fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Self::DiscreteGpu => "discrete GPU",
            Self::IntegratedGpu => "integrated GPU",
            Self::VirtualGpu => "virtual GPU",
            Self::Cpu => "CPU",
            Self::Other => "other",
        })
    }
}

/// The description of a device. `tallow devices` prints most of it.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceInfo {
    /// Name of the device, as the driver gives it.
    pub name: String,
    /// Kind of device.
    pub kind: DeviceKind,
    /// PCI number of its maker.
    pub vendor_id: u32,
    /// PCI number of the device among those of its maker.
    pub device_id: u32,
    /// Whether host and device share one memory, so that the host writes buffers in place.
    pub unified: bool,
    /// Short name of the driver.
    pub driver_name: String,
    /// The driver's description of its build.
    pub driver_info: String,
    /// Version of the driver, decoded by the vendor's scheme.
    pub driver_version: String,
    /// Highest Vulkan version that it supports, such as "1.3.224".
    pub api_version: String,
    /// Largest storage buffer binding in bytes.
    pub max_storage_range: u64,
    /// Largest texel buffer view in texels.
    pub max_texel_elements: u64,
    /// Largest buffer in bytes.
    pub max_buffer_size: u64,
    /// Largest memory allocation in bytes.
    pub max_allocation: u64,
    /// Size of the largest device-local heap in bytes.
    pub memory_heap: u64,
    /// Number of invocations in a subgroup.
    pub subgroup_size: u32,
    /// Whether all subgroups of compute kernels have that size.
    pub subgroup_size_fixed: bool,
    /// Whether the invocations of a subgroup can read each other's values in compute kernels.
    pub subgroup_shuffle: bool,
    /// Number of valid bits in a timestamp; 0 if passes cannot be timed.
    pub timestamp_bits: u32,
    /// Nanoseconds per tick of the timestamp counter.
    pub timestamp_period: f32,
    /// Whether accesses outside a buffer's bounds are prevented from reaching other memory (`robustBufferAccess`). It is
    /// always enabled on devices opened here; for a device handed over, its owner tells.
    pub robust_buffer_access: bool,
    /// Names of required features that the device lacks.
    pub missing: Vec<&'static str>,
    /// Names of what it lacks to trace by ray queries, extensions and features: see [`super::Tracing`].
    pub ray_query_lacks: Vec<&'static str>,
}

/// A device with its description and all that is needed to open it.
pub(super) struct Candidate {
    pub physical: vk::PhysicalDevice,
    pub info: DeviceInfo,
    pub limits: vk::PhysicalDeviceLimits,
    pub cache_uuid: [u8; vk::UUID_SIZE],
    /// First queue family with compute and timestamps, or else the first with compute.
    pub queue_family: Option<u32>,
}

/// Describes every device of this machine, in the loader's order. `DeviceOptions::device` accepts the index.
///
/// # Errors
/// No loader, no driver or no device.
pub fn survey() -> Result<Vec<DeviceInfo>> {
    let instance = Instance::new(false)?;
    Ok(candidates(&instance.raw)?.into_iter().map(|candidate| candidate.info).collect())
}

pub(super) fn candidates(instance: &ash::Instance) -> Result<Vec<Candidate>> {
    // SAFETY: a live instance.
    let devices = unsafe { instance.enumerate_physical_devices() }.at("list of devices")?;
    if devices.is_empty() {
        return Err(Error::Device(
            "no Vulkan device: install the driver of the graphics card, or the package mesa-vulkan-drivers for a \
             software device"
                .into(),
        ));
    }
    Ok(devices.into_iter().map(|physical| describe(instance, physical, None)).collect())
}

impl DeviceInfo {
    /// The driver's name, version and build.
    pub fn driver(&self) -> String {
        let Self { driver_name, driver_version, driver_info, .. } = self;
        format!("{driver_name} {driver_version} {driver_info}").trim().to_owned()
    }
}

/// Describes a device as seen from `queue_family`, or from the best family for compute.
pub(super) fn describe(instance: &ash::Instance, physical: vk::PhysicalDevice, queue_family: Option<u32>) -> Candidate {
    // SAFETY: `physical` belongs to `instance`, here and below.
    let basic = unsafe { instance.get_physical_device_properties(physical) };
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let memory = unsafe { instance.get_physical_device_memory_properties(physical) };
    let queue_family = queue_family.or_else(|| best_family(&families));
    let (v11, v12, v13) = newer_properties(instance, physical, basic.api_version);
    let text = |bytes: Option<&std::ffi::CStr>| bytes.unwrap_or_default().to_string_lossy().into_owned();
    let info = DeviceInfo {
        name: text(basic.device_name_as_c_str().ok()),
        kind: DeviceKind::of(basic.device_type),
        vendor_id: basic.vendor_id,
        device_id: basic.device_id,
        unified: matches!(basic.device_type, vk::PhysicalDeviceType::CPU | vk::PhysicalDeviceType::INTEGRATED_GPU),
        driver_name: text(v12.driver_name_as_c_str().ok()),
        driver_info: text(v12.driver_info_as_c_str().ok()),
        driver_version: driver_version(basic.vendor_id, basic.driver_version),
        api_version: version(basic.api_version),
        max_storage_range: basic.limits.max_storage_buffer_range.into(),
        max_texel_elements: basic.limits.max_texel_buffer_elements.into(),
        max_buffer_size: v13.max_buffer_size,
        max_allocation: v11.max_memory_allocation_size,
        memory_heap: largest_heap(&memory),
        subgroup_size: v11.subgroup_size,
        subgroup_size_fixed: v13.min_subgroup_size == v13.max_subgroup_size,
        subgroup_shuffle: v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
            && v11.subgroup_supported_operations.contains(vk::SubgroupFeatureFlags::SHUFFLE),
        timestamp_bits: queue_family
            .and_then(|f| families.get(f as usize))
            .map_or(0, |family| family.timestamp_valid_bits),
        timestamp_period: basic.limits.timestamp_period,
        robust_buffer_access: true,
        missing: Features::supported(instance, physical, basic.api_version).missing(),
        ray_query_lacks: match basic.api_version >= vk::API_VERSION_1_3 {
            true => ray_query::lacks(instance, physical),
            false => vec!["Vulkan 1.3"],
        },
    };
    let (cache_uuid, limits) = (basic.pipeline_cache_uuid, basic.limits);
    Candidate { physical, info, limits, cache_uuid, queue_family }
}

/// Properties added by Vulkan 1.1 to 1.3. They are zero for a device below 1.3, which cannot be used and must not be
/// queried for them.
fn newer_properties(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    api_version: u32,
) -> (
    vk::PhysicalDeviceVulkan11Properties<'static>,
    vk::PhysicalDeviceVulkan12Properties<'static>,
    vk::PhysicalDeviceVulkan13Properties<'static>,
) {
    let (mut v11, mut v12, mut v13) = Default::default();
    if api_version >= vk::API_VERSION_1_3 {
        let mut all =
            vk::PhysicalDeviceProperties2::default().push_next(&mut v11).push_next(&mut v12).push_next(&mut v13);
        // SAFETY: `physical` belongs to `instance` and knows these structs.
        unsafe { instance.get_physical_device_properties2(physical, &mut all) };
    }
    (v11, v12, v13)
}

fn best_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let computes = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let timed = families.iter().position(|f| computes(f) && f.timestamp_valid_bits > 0);
    timed.or_else(|| families.iter().position(computes)).map(|index| index as u32)
}

fn largest_heap(memory: &vk::PhysicalDeviceMemoryProperties) -> u64 {
    let local = memory.memory_heaps_as_slice().iter().filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    local.map(|heap| heap.size).max().unwrap_or(0)
}

fn version(v: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(v), vk::api_version_minor(v), vk::api_version_patch(v))
}

/// Decodes a driver version. NVIDIA packs 10, 8, 8 and 6 bits; other vendors pack it like the API version.
fn driver_version(vendor: u32, v: u32) -> String {
    const NVIDIA: u32 = 0x10de;
    match vendor {
        NVIDIA => format!("{}.{:02}.{:02}", v >> 22, v >> 14 & 0xff, v >> 6 & 0xff),
        _ => version(v),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_guide_names_all_that_is_required() {
        let guide = include_str!("../guide/embedding.md");
        assert!(super::REQUIRED_FEATURES.iter().all(|feature| guide.contains(feature.name)));
    }
}
