//! The machine that the program runs on: its processor, and the clocks of processor and device.
use crate::error::Result;
use crate::gpu::{Buffer, DeviceInfo, DeviceKind, FrameResources, Gpu, Kernel, Location};
use crate::layout::vec4;
use crate::shaders::ceiling_arithmetic;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// Name of the processor as its maker and the system give it, or "unknown".
pub fn cpu() -> String {
    let mut system = System::new();
    system.refresh_cpu_list(CpuRefreshKind::nothing());
    let brand = system.cpus().first().map(|cpu| cpu.brand().trim().to_owned());
    brand.filter(|brand| !brand.is_empty()).unwrap_or_else(|| "unknown".to_owned())
}

/// Clock of the processor's fastest core in MHz; `None` where the system does not tell.
pub fn cpu_mhz() -> Option<u64> {
    let frequency = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing().with_frequency());
    let system = System::new_with_specifics(frequency);
    system.cpus().iter().map(sysinfo::Cpu::frequency).max().filter(|&mhz| mhz > 0)
}

/// Clock of a device in MHz, of the processor if that is the device; `None` where the system does not tell. To be asked while the
/// device is busy or has just been, because idle ones slow down.
pub fn device_mhz(info: &DeviceInfo) -> Option<u64> {
    match info.kind {
        DeviceKind::Cpu => cpu_mhz(),
        _ => drm_mhz(Path::new("/sys/class/drm"), [info.vendor_id, info.device_id]).or_else(|| nvidia_mhz(&info.name)),
    }
}

/// How long a GPU works before it is timed. An H200 that had idled for a second was at 345 of 1980 MHz, and back after .1 to .6 s of work.
const WAKING: Duration = Duration::from_millis(800);
/// Threads of that work: a millisecond of a large GPU, a tenth of a second of a small one.
const WAKING_THREADS: u32 = 1 << 17;

/// Keeps a GPU busy until it has raised its clock, which it lowers while the host alone is at work. Without this, what takes a few
/// milliseconds seems to take five times as long. To be called right before what is timed; a CPU needs none of it.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn wake(gpu: &Gpu) -> Result<()> {
    if gpu.info().kind == DeviceKind::Cpu {
        return Ok(());
    }
    let kernel = Kernel::new(gpu, &gpu.tuning().thread().into())?;
    let result = Buffer::<vec4>::new(gpu, "work that wakes", WAKING_THREADS as usize, Location::Device)?;
    let (mut frame, begun) = (FrameResources::new(gpu)?, Instant::now());
    while begun.elapsed() < WAKING {
        let bind = ceiling_arithmetic::Bind { result: &result };
        gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &WAKING_THREADS, WAKING_THREADS))?;
    }
    Ok(())
}

/// From what Linux tells of the graphics card with these PCI numbers: i915 and Xe in files of their own, amdgpu among its sensors.
fn drm_mhz(cards: &Path, ids: [u32; 2]) -> Option<u64> {
    let number = |path: &Path| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok().filter(|&n| n > 0);
    let id =
        |path: &Path| u32::from_str_radix(std::fs::read_to_string(path).ok()?.trim().trim_start_matches("0x"), 16).ok();
    let of_card = |card: &Path| {
        let device = card.join("device");
        if ["vendor", "device"].map(|name| id(&device.join(name))) != ids.map(Some) {
            return None;
        }
        let own = ["gt_act_freq_mhz", "device/tile0/gt0/freq0/act_freq"].map(|name| number(&card.join(name)));
        let sensors = std::fs::read_dir(device.join("hwmon")).into_iter().flatten().flatten();
        let hertz = sensors.filter_map(|sensor| number(&sensor.path().join("freq1_input"))).max();
        own.into_iter().flatten().next().or(hertz.map(|hertz| hertz / 1_000_000))
    };
    std::fs::read_dir(cards).ok()?.flatten().filter_map(|card| of_card(&card.path())).max()
}

/// From what NVIDIA's driver brings with it.
fn nvidia_mhz(name: &str) -> Option<u64> {
    let words = ["--query-gpu=name,clocks.current.sm", "--format=csv,noheader,nounits"];
    let output = Command::new("nvidia-smi").args(words).output().ok()?;
    fastest_named(&String::from_utf8_lossy(&output.stdout), name)
}

/// Of lines such as "NVIDIA H100, 1980".
fn fastest_named(lines: &str, name: &str) -> Option<u64> {
    let named = lines.lines().filter_map(|line| line.rsplit_once(',')).filter(|(card, _)| card.trim() == name);
    named.filter_map(|(_, mhz)| mhz.trim().parse().ok()).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_those_of_the_card_with_the_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let card = |card: &str, vendor: &str, device: &str| {
            write(&format!("{card}/device/vendor"), vendor);
            write(&format!("{card}/device/device"), device);
        };
        card("card0", "0x8086\n", "0x4680\n");
        write("card0/gt_act_freq_mhz", "1450\n");
        card("card1", "0x1002\n", "0x744c\n");
        write("card1/device/hwmon/hwmon3/freq1_input", "2304000000\n");
        card("card2", "0x1002\n", "0x1234\n");
        let mhz = |ids| drm_mhz(folder.path(), ids);
        assert_eq!((mhz([0x8086, 0x4680]), mhz([0x1002, 0x744c])), (Some(1450), Some(2304)));
        assert_eq!((mhz([0x1002, 0x1234]), mhz([1, 2])), (None, None));
        assert_eq!(drm_mhz(&folder.path().join("missing"), [0x8086, 0x4680]), None);
        let lines = "NVIDIA H100, 1755\nNVIDIA H100, 1980\nNVIDIA T4, [N/A]\n";
        assert_eq!((fastest_named(lines, "NVIDIA H100"), fastest_named(lines, "NVIDIA T4")), (Some(1980), None));
    }
}
