//! The extension that reads the device's clock from the host: VK_KHR_calibrated_timestamps, or the older
//! VK_EXT_calibrated_timestamps, whose functions are the same under other names.
use super::At;
use super::instance::Instance;
use crate::error::Result;
use ash::{ext, khr, vk};
use std::ffi::CStr;

/// One of the two extensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CalibratedExtension {
    Khr,
    Ext,
}

impl CalibratedExtension {
    /// The older one first: validation layers before 1.3.268 warn of the other on every device.
    const BY_PREFERENCE: [Self; 2] = [Self::Ext, Self::Khr];

    /// As a device lists it.
    pub fn name(self) -> &'static CStr {
        match self {
            Self::Khr => khr::calibrated_timestamps::NAME,
            Self::Ext => ext::calibrated_timestamps::NAME,
        }
    }

    /// Its function that tells which clocks a device can read.
    fn query(self) -> &'static CStr {
        match self {
            Self::Khr => c"vkGetPhysicalDeviceCalibrateableTimeDomainsKHR",
            Self::Ext => c"vkGetPhysicalDeviceCalibrateableTimeDomainsEXT",
        }
    }

    /// Its function that reads clocks, which is there only if the extension is enabled.
    pub fn function(self) -> &'static CStr {
        match self {
            Self::Khr => c"vkGetCalibratedTimestampsKHR",
            Self::Ext => c"vkGetCalibratedTimestampsEXT",
        }
    }
}

/// The preferred one of those by which `physical` can read its own clock, and that `may_be` is true of.
///
/// # Errors
/// [`crate::error::Error::Device`] when memory is out.
pub(super) fn offered(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    may_be: impl Fn(&CalibratedExtension) -> bool,
) -> Result<Option<CalibratedExtension>> {
    // SAFETY: `physical` belongs to `instance`.
    let listed = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.at("device extensions")?;
    let is_usable = |extension: &CalibratedExtension| {
        let is_listed = listed.iter().any(|found| found.extension_name_as_c_str() == Ok(extension.name()));
        // A loader that is older than the extension may not find the functions of its driver.
        // SAFETY: a live instance.
        let query =
            unsafe { instance._entry.get_instance_proc_addr(instance.raw.handle(), extension.query().as_ptr()) };
        is_listed && query.is_some() && may_be(extension)
    };
    for extension in CalibratedExtension::BY_PREFERENCE.into_iter().filter(is_usable) {
        // SAFETY: the device lists the extension, and the loader has its functions.
        let domains = unsafe { time_domains(extension, instance, physical) }.at("time domains")?;
        if domains.contains(&vk::TimeDomainKHR::DEVICE) {
            return Ok(Some(extension));
        }
    }
    Ok(None)
}

/// # Safety
/// `physical` belongs to `instance` and lists the extension.
unsafe fn time_domains(
    extension: CalibratedExtension,
    instance: &Instance,
    physical: vk::PhysicalDevice,
) -> std::result::Result<Vec<vk::TimeDomainKHR>, vk::Result> {
    let (entry, raw) = (&instance._entry, &instance.raw);
    unsafe {
        match extension {
            CalibratedExtension::Khr => khr::calibrated_timestamps::Instance::new(entry, raw)
                .get_physical_device_calibrateable_time_domains(physical),
            CalibratedExtension::Ext => ext::calibrated_timestamps::Instance::new(entry, raw)
                .get_physical_device_calibrateable_time_domains(physical),
        }
    }
}

/// The loaded functions of the extension that a device has enabled.
pub(super) enum CalibratedClock {
    Khr(khr::calibrated_timestamps::Device),
    Ext(ext::calibrated_timestamps::Device),
}

impl CalibratedClock {
    /// `device` was made with `extension` enabled.
    pub fn new(extension: CalibratedExtension, instance: &ash::Instance, device: &ash::Device) -> Self {
        match extension {
            CalibratedExtension::Khr => Self::Khr(khr::calibrated_timestamps::Device::new(instance, device)),
            CalibratedExtension::Ext => Self::Ext(ext::calibrated_timestamps::Device::new(instance, device)),
        }
    }

    /// The device's clock in ticks, and the nanoseconds by which it may be off.
    ///
    /// # Safety
    /// The device is alive.
    ///
    /// # Errors
    /// Those of Vulkan.
    pub unsafe fn now(&self) -> std::result::Result<(u64, u64), vk::Result> {
        let domain = [vk::CalibratedTimestampInfoKHR::default().time_domain(vk::TimeDomainKHR::DEVICE)];
        let (ticks, deviation) = unsafe {
            match self {
                Self::Khr(clock) => clock.get_calibrated_timestamps(&domain),
                Self::Ext(clock) => clock.get_calibrated_timestamps(&domain),
            }
        }?;
        Ok((ticks[0], deviation))
    }
}
