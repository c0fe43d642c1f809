//! What the machine can still hold: systems promise more, and end the process when it is touched.
use sysinfo::{MemoryRefreshKind, System};

/// Refuses what needs more bytes than are free, those of the process's control group included.
///
/// # Errors
/// How much is needed and how much is free.
pub fn check(needed: u64) -> Result<(), String> {
    let mut system = System::new();
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let group = system.cgroup_limits().map_or(u64::MAX, |limits| limits.free_memory);
    // Systems that do not tell say 0.
    let free = Some(system.available_memory()).filter(|&bytes| bytes > 0).unwrap_or(u64::MAX).min(group);
    if needed > free {
        return Err(format!("needs {} of memory, {} are free", gibibytes(needed), gibibytes(free)));
    }
    Ok(())
}

fn gibibytes(bytes: u64) -> String {
    format!("{:.1} GiB", bytes as f64 / (1 << 30) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused_and_what_every_machine_has_is_not() {
        assert_eq!(check(1 << 20), Ok(()));
        let line = check(3 << 60).unwrap_err();
        assert!(line.starts_with("needs 3221225472.0 GiB of memory, ") && line.ends_with(" GiB are free"), "{line}");
    }
}
