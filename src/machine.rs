//! The machine that the program runs on.
use sysinfo::{CpuRefreshKind, System};

/// Name of the processor as its maker and the system give it, or "unknown".
pub fn cpu() -> String {
    let mut system = System::new();
    system.refresh_cpu_list(CpuRefreshKind::nothing());
    let brand = system.cpus().first().map(|cpu| cpu.brand().trim().to_owned());
    brand.filter(|brand| !brand.is_empty()).unwrap_or_else(|| "unknown".to_owned())
}
