//! The Vulkan layer. It holds all of the crate's `unsafe` code and all of its Vulkan calls; everything above it is safe
//! Rust that names buffers and kernels. The one other foreign library is here for the same reason: [`Oidn`].
//!
//! The layer promises its callers:
//! - A handle that a call uses is alive: a frame keeps the buffers and pipelines recorded into it until the work is complete, and
//!   every object holds a counted reference to the device ([`Gpu`]).
//! - Barriers are derived from the accesses that a kernel declares in its GLSL; no caller writes one.
//! - Device memory holds plain data (`Pod`), for which every bit pattern is a valid value.
//! - While work submitted here runs, the host does not touch device memory that the work may use, and nothing that it uses is freed.
//! - A kernel that gets invalid data computes an invalid result, but it accesses nothing outside its buffers (robust
//!   buffer access) and its own arrays ([`Bindings`]).
//!
//! In return, a caller that hands over raw handles must keep the contracts of [`Gpu::from_raw`] and
//! [`Recorder::external`].
#![allow(unsafe_code)]
mod acceleration;
mod access;
mod blocks;
mod buffer;
mod builds;
mod cache;
mod calibrated;
mod commands;
mod descriptors;
mod device;
mod external;
mod frame;
mod info;
mod instance;
mod kernel;
mod oidn;
mod pipelines;
mod ray_query;
mod recorder;
mod shape;
mod staging;
mod timing;
mod tuned;
mod tuning;
mod turns;
mod upload;

pub use acceleration::Acceleration;
pub(crate) use acceleration::{Aabb, Mesh, Placement, Shapes};
pub use access::Access;
pub use blocks::{PerBlock, block_count, thread_items};
use buffer::Untyped;
pub use buffer::{Bound, Buffer, Location, PART, PixelFormat, RawBuffer};
pub use cache::cache_folder;
pub use device::{DeviceOptions, Gpu};
pub use external::RawDevice;
pub use frame::FrameResources;
pub use info::{DeviceInfo, DeviceKind, Feature, REQUIRED_FEATURES, survey};
pub use instance::change_loader_lists;
pub use kernel::{Bindings, Kernel, MAX_GROUPS, RayQueryCode, Slot, SlotKind, Specialise};
pub use oidn::{OIDN_VARIABLE, Oidn, OidnInput, Texels};
pub use ray_query::Tracing;
pub use recorder::Recorder;
pub use shape::{BoundRange, KernelCode, Pass, PassObserver, PassShape};
pub use timing::{Calibration, PassTime, host_ns, total_ms};
pub(crate) use timing::{by_pass, milliseconds};
pub use tuning::Tuning;

use crate::error::{Error, Result};
use crate::memory::or_out_of_addresses;
use ash::vk;

/// Adds to a Vulkan error what was being done when it occurred.
trait At<T> {
    fn at(self, what: &str) -> Result<T>;
}

impl<T> At<T> for std::result::Result<T, vk::Result> {
    fn at(self, what: &str) -> Result<T> {
        self.map_err(|code| explain(what, code))
    }
}

fn explain(what: &str, code: vk::Result) -> Error {
    if code == vk::Result::ERROR_DEVICE_LOST {
        return Error::DeviceLost(format!(
            "{what}: the device was lost (a driver reset, often because one pass ran too long): run again, with a \
             smaller film if it happens again"
        ));
    }
    if code == vk::Result::TIMEOUT {
        return Error::DeviceLost(format!(
            "{what}: the device stopped answering: no pass began or ended within the time that it is waited for: run \
             again with a smaller film, and update its driver if it happens again"
        ));
    }
    let out_of_memory = format!("{what}: out of memory: {LESS_MEMORY}");
    match code {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::OutOfDeviceMemory(out_of_memory),
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::Memory(out_of_memory),
        vk::Result::ERROR_INITIALIZATION_FAILED => {
            let or = or_out_of_addresses();
            Error::Device(format!("{what}: the driver failed to start: check that it matches the running system{or}"))
        }
        other => Error::Device(format!("{what}: Vulkan returned {other:?}")),
    }
}

/// What to do where memory is not enough.
const LESS_MEMORY: &str = "choose a smaller film or scene, or a device with more memory";
