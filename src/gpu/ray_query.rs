//! Tracing of rays by the device itself: which devices can, and what is enabled on them for it.
use ash::{khr, vk};
use std::ffi::CStr;

/// Who finds what rays meet. The pictures are the same but for rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Tracing {
    /// Whichever is faster, as far as that was measured: so far compute on every device, since ray queries were timed on none that
    /// has hardware for them
    #[default]
    Auto,
    /// Tallow's own kernels, on any device
    Compute,
    /// The device, by its extension VK_KHR_ray_query
    RayQuery,
}

/// What tracing by ray queries takes. The first is the one that others are named after.
pub(super) const EXTENSIONS: [&CStr; 3] =
    [khr::ray_query::NAME, khr::acceleration_structure::NAME, khr::deferred_host_operations::NAME];

/// The feature structs of the extensions.
#[derive(Default)]
pub(super) struct RayFeatures {
    pub structures: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'static>,
    pub queries: vk::PhysicalDeviceRayQueryFeaturesKHR<'static>,
}

impl RayFeatures {
    /// Exactly what is needed.
    pub fn required() -> Self {
        let mut features = Self::default();
        features.structures.acceleration_structure = vk::TRUE;
        features.queries.ray_query = vk::TRUE;
        features
    }
}

/// Vulkan's records keep numbers of copies, and of the first triangles of their meshes, in 24 bits.
pub(super) const MOST_NUMBERS: u64 = 1 << 24;

/// The functions and limits of a device that traces by ray queries.
pub(super) struct RayQueries {
    pub structures: khr::acceleration_structure::Device,
    /// The scratch memory of a build begins at a multiple of it.
    pub scratch_alignment: u64,
    /// Copies in a scene at most.
    pub most_copies: u64,
    /// Triangles or boxes of a mesh at most.
    pub most_shapes: u64,
}

impl RayQueries {
    /// Of a device that was made with [`EXTENSIONS`].
    pub fn new(instance: &ash::Instance, physical: vk::PhysicalDevice, device: &ash::Device) -> Self {
        let mut limits = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
        let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut limits);
        // SAFETY: `physical` belongs to `instance` and has the extension.
        unsafe { instance.get_physical_device_properties2(physical, &mut all) };
        let scratch_alignment = u64::from(limits.min_acceleration_structure_scratch_offset_alignment.max(1));
        Self {
            structures: khr::acceleration_structure::Device::new(instance, device),
            scratch_alignment,
            most_copies: limits.max_instance_count.min(MOST_NUMBERS),
            most_shapes: limits.max_primitive_count,
        }
    }
}

/// Names of the extensions and features that a device of Vulkan 1.3 lacks.
pub(super) fn lacks(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Vec<&'static str> {
    // SAFETY: `physical` belongs to `instance`, here and below. A list that cannot be had is empty.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    let is_offered = |name: &&CStr| offered.iter().any(|found| found.extension_name_as_c_str() == Ok(*name));
    let names = EXTENSIONS.into_iter().filter(|name| !is_offered(name)).filter_map(|name| name.to_str().ok());
    let names: Vec<_> = names.collect();
    if !names.is_empty() {
        return names; // the structs of an extension that is not there may not be asked for
    }
    let (mut addresses, mut has) = (vk::PhysicalDeviceBufferDeviceAddressFeatures::default(), RayFeatures::default());
    let mut all = vk::PhysicalDeviceFeatures2::default()
        .push_next(&mut addresses)
        .push_next(&mut has.structures)
        .push_next(&mut has.queries);
    unsafe { instance.get_physical_device_features2(physical, &mut all) };
    let features = [
        ("bufferDeviceAddress", addresses.buffer_device_address),
        ("accelerationStructure", has.structures.acceleration_structure),
        ("rayQuery", has.queries.ray_query),
    ];
    features.into_iter().filter(|(_, on)| *on == vk::FALSE).map(|(name, _)| name).collect()
}
