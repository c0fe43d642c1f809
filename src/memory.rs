//! What the machine can still hold: systems promise more, and end the process when it is touched.
use sysinfo::{MemoryRefreshKind, System};

/// Refuses what needs more bytes than are free, to the machine, to the process's control group and to the process itself.
///
/// # Errors
/// How much is needed and how much is free.
pub fn check(needed: u64) -> Result<(), String> {
    let mut system = System::new();
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    let group = system.cgroup_limits().map_or(u64::MAX, |limits| limits.free_memory);
    // Systems that do not tell say 0.
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0).unwrap_or(u64::MAX);
    let free = machine.min(group).min(free_addresses().unwrap_or(u64::MAX));
    if needed > free {
        return Err(format!("needs {} of memory, {} are free", readable(needed), readable(free)));
    }
    Ok(())
}

/// What the limit of the process (`ulimit -v`) leaves, where the system has one and tells it as Linux does.
fn free_addresses() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let row = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = row.split_whitespace().next()?.parse().ok()?; // or "unlimited"
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let row = status.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
    let used: u64 = row.split_whitespace().next()?.parse().ok()?; // in kB
    Some(limit.saturating_sub(used << 10))
}

/// An empty vector with room for `len` items.
///
/// # Errors
/// How much memory the system did not give.
pub fn reserved<T>(len: usize) -> Result<Vec<T>, String> {
    let mut items = Vec::new();
    let bytes = (len as u64).saturating_mul(size_of::<T>() as u64);
    let refused = |_| format!("needs {} of memory, which the system does not give", readable(bytes));
    items.try_reserve_exact(len).map_err(refused)?;
    Ok(items)
}

fn readable(bytes: u64) -> String {
    match bytes < 1 << 30 {
        true => format!("{:.1} MiB", bytes as f64 / (1 << 20) as f64),
        false => format!("{:.1} GiB", bytes as f64 / (1 << 30) as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_that_no_machine_has_is_an_error() {
        assert_eq!(reserved::<u64>(3).map(|v| v.capacity()), Ok(3));
        assert!(reserved::<u64>(1 << 58).unwrap_err().starts_with("needs 2147483648.0 GiB"));
    }

    #[test]
    fn what_no_machine_has_is_refused_and_what_every_machine_has_is_not() {
        assert_eq!(check(1 << 20), Ok(()));
        let line = check(3 << 60).unwrap_err();
        assert!(line.starts_with("needs 3221225472.0 GiB of memory, ") && line.ends_with("iB are free"), "{line}");
    }
}
