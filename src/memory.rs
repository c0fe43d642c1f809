//! Checks of free host memory before large allocations. Operating systems grant more memory than there is and kill the
//! process when it uses it, so the amount is checked first.
use crate::error::{Checked, Error, Result};
use std::fmt::Display;
use sysinfo::{MemoryRefreshKind, System};

/// Less than this is there, or nothing is: asking the system takes a hundred microseconds.
const SMALL: u64 = 1 << 20;

/// Addresses that lavapipe takes on two cores from its start to its first kernel, 700 MiB with heaps for threads, of
/// which it can do without some; with less than this it ends the process.
const DRIVER: u64 = 512 << 20;
/// Those of them that it may take once its device is open.
const OPEN_DRIVER: u64 = 256 << 20;

/// Checks that `needed` bytes are free on the machine, in the process's control group and in its address space.
///
/// # Errors
/// A message with the needed and the free amount.
pub fn check(needed: u64) -> Checked {
    if needed < SMALL {
        return Ok(());
    }
    let mut system = System::new();
    system.refresh_memory_specifics(MemoryRefreshKind::nothing().with_ram());
    // What is free of a group's memory leaves out files that the system keeps there, and gives up for processes.
    let group = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory.saturating_sub(limits.rss));
    // 0 means that the system does not tell.
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0).unwrap_or(u64::MAX);
    let (free, addresses) = (machine.min(group), free_addresses().unwrap_or(u64::MAX));
    if needed <= free.min(addresses) {
        return Ok(());
    }
    let limit = if addresses < free { " within the limit of the address space (ulimit -v)" } else { "" };
    Err(format!("needs {} of memory, {} are free{limit}", readable(needed), readable(free.min(addresses))))
}

/// As [`check`] once a device is open. Drivers that run out of addresses end the process, so that what one still takes
/// is left to it.
///
/// # Errors
/// As [`check`].
pub fn check_beside_driver(needed: u64) -> Checked {
    check(needed.saturating_add(free_addresses().map_or(0, |_| OPEN_DRIVER)))
}

/// Checks, under a limit of the address space, that a driver on the CPU can start.
///
/// # Errors
/// [`Error::Memory`].
pub fn check_driver() -> Result<()> {
    match free_addresses() {
        Some(free) if free < DRIVER => Err(Error::Memory(format!(
            "opening a device needs {} of addresses, {} are free: raise the limit of the address space (ulimit -v)",
            readable(DRIVER),
            readable(free)
        ))),
        _ => Ok(()),
    }
}

/// What else may be wrong where a driver does not start: nothing without a limit of the address space.
pub fn or_out_of_addresses() -> &'static str {
    if free_addresses().is_some() { "; or memory is out: raise the limit of the address space (ulimit -v)" } else { "" }
}

/// As [`check`], with an error about `what`, such as a file.
///
/// # Errors
/// [`Error::Memory`].
pub fn need(what: impl Display, bytes: u64) -> Result<()> {
    check(bytes).map_err(|lack| Error::Memory(format!("{what}: {lack}; free some, or make the scene smaller")))
}

/// Makes a vector with capacity for exactly `len` values.
///
/// # Errors
/// [`Error::Memory`].
pub fn vector<T>(what: impl Display, len: usize) -> Result<Vec<T>> {
    reserved(len).map_err(|lack| Error::Memory(format!("{what}: {lack}")))
}

/// As [`vector`], with a bare message as the error.
///
/// # Errors
/// A message with the amount of memory that the system refused.
pub fn reserved<T>(len: usize) -> Checked<Vec<T>> {
    let mut vector = Vec::new();
    reserve_exact(&mut vector, len)?;
    Ok(vector)
}

/// Reserves capacity for exactly `more` values in addition to those in `vector`.
///
/// # Errors
/// [`Error::Memory`].
pub fn reserve<T>(what: impl Display, vector: &mut Vec<T>, more: usize) -> Result<()> {
    reserve_exact(vector, more).map_err(|lack| Error::Memory(format!("{what}: {lack}")))
}

fn reserve_exact<T>(vector: &mut Vec<T>, more: usize) -> Checked {
    let bytes = (more as u64).saturating_mul(size_of::<T>() as u64);
    let refused = |_| format!("needs {} of memory, which the system does not give", readable(bytes));
    vector.try_reserve_exact(more).map_err(refused)
}

/// Bytes left under a limit of the address space (`ulimit -v`). `None` without a limit and on systems other than Linux.
fn free_addresses() -> Option<u64> {
    let read = |file: &str| std::fs::read_to_string(format!("/proc/self/{file}")).ok();
    let limit = number_after(&read("limits")?, "Max address space")?;
    let used = number_after(&read("status")?, "VmSize:")? * 1024;
    Some(limit.saturating_sub(used))
}

/// Returns the number after `key` at the beginning of a line; `None` for "unlimited".
fn number_after(text: &str, key: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
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
    fn what_no_machine_has_is_refused_and_what_every_machine_has_is_not() {
        assert_eq!(check(1 << 20), Ok(()));
        let line = check(3 << 60).unwrap_err();
        assert!(line.starts_with("needs 3221225472.0 GiB of memory, ") && line.ends_with("iB are free"), "{line}");
        let error = need("a.obj", 3 << 60).unwrap_err();
        assert!(error.exit_code() == 4 && error.to_string().starts_with("a.obj: needs 3221225472.0 GiB"), "{error}");
        assert_eq!(vector::<u8>("bytes", usize::MAX).unwrap_err().exit_code(), 4);
        assert_eq!(vector::<u8>("bytes", 3).unwrap().capacity(), 3);
        assert!(reserved::<u64>(1 << 58).unwrap_err().starts_with("needs 2147483648.0 GiB"));
    }

    #[test]
    fn limits_are_numbers_or_none() {
        let text =
            "Max cpu time  unlimited\nMax address space         4096000000           unlimited            bytes\n";
        assert_eq!(number_after(text, "Max address space"), Some(4_096_000_000));
        assert_eq!(number_after(&text.replace("4096000000", "unlimited"), "Max address space"), None);
        assert_eq!(number_after("VmPeak:\t 9 kB\nVmSize:\t    7052 kB\n", "VmSize:"), Some(7052));
    }
}
