//! What a measurement ran on.
use super::document::{Machine, Software};
use crate::gpu::DeviceInfo;
use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// Describes a device and this host.
pub fn describe(info: &DeviceInfo) -> Machine {
    let system =
        System::new_with_specifics(RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing().with_frequency()));
    Machine {
        device: info.name.clone(),
        kind: info.kind.to_string(),
        driver: format!("{} {} {}", info.driver_name, info.driver_version, info.driver_info).trim().to_owned(),
        cpu: crate::machine::cpu(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        cpu_mhz: clock(&system).map(|mhz| [mhz; 2]),
    }
}

/// The clock of the first core in MHz; `None` where the system does not tell.
pub fn cpu_mhz() -> Option<u64> {
    clock(&System::new_with_specifics(RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing().with_frequency())))
}

/// Describes this program.
pub fn software() -> Software {
    Software { version: env!("CARGO_PKG_VERSION").to_owned(), commit: option_env!("TALLOW_COMMIT").map(str::to_owned) }
}

fn clock(system: &System) -> Option<u64> {
    system.cpus().first().map(sysinfo::Cpu::frequency).filter(|&mhz| mhz > 0)
}
