//! What a measurement ran on.
use super::document::{Machine, Software};
use crate::gpu::{DeviceInfo, Gpu};
use crate::machine::{cpu, cpu_mhz, device_mhz};

/// Describes a device and this host; no clock was seen yet.
pub fn describe(gpu: &Gpu) -> Machine {
    let info = gpu.info();
    Machine {
        device: info.name.clone(),
        kind: info.kind.to_string(),
        driver: info.driver(),
        ray_queries: gpu.traces_by_ray_query(),
        cpu: cpu(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        cpu_mhz: None,
        device_mhz: None,
    }
}

impl Machine {
    /// Extends the ranges of the clocks to those of now, while the device has just been busy.
    pub fn see_clocks(&mut self, info: &DeviceInfo) {
        let extend = |range: &mut Option<[u64; 2]>, now: Option<u64>| {
            let Some(now) = now else { return };
            let [least, most] = range.unwrap_or([now; 2]);
            *range = Some([least.min(now), most.max(now)]);
        };
        extend(&mut self.cpu_mhz, cpu_mhz());
        extend(&mut self.device_mhz, device_mhz(info));
    }
}

/// Describes this program.
pub fn software() -> Software {
    Software { version: env!("CARGO_PKG_VERSION").to_owned(), commit: option_env!("TALLOW_COMMIT").map(str::to_owned) }
}
