//! What a device can do at most, measured with two kernels: one that copies and one that computes. Kernels:
//! `glsl/profile/ceiling_*.comp`.
use crate::error::Result;
use crate::gpu::{Buffer, FrameResources, Gpu, Kernel, Location, PassTime};
use crate::layout::vec4;
use crate::shaders::{ceiling_arithmetic, ceiling_copy};
use serde::{Deserialize, Serialize};

/// Runs of each kernel; the fastest counts.
const REPEATS: usize = 10;
/// Bytes that are copied: from what the caches near a processor hold to what none does.
const COPIED_BYTES: [u64; 5] = [1 << 20, 4 << 20, 16 << 20, 64 << 20, 256 << 20];
/// Bytes that are copied at a time at each size, so that small copies are tried more often than large ones.
const MOVED_BYTES: u64 = 64 << 20;
/// Nanoseconds that the kernel which computes runs at least.
const LEAST_NS: u64 = 2_000_000;
/// Threads that it has at first, and at most.
const THREADS: [u32; 2] = [1 << 11, 1 << 22];

/// The fastest that kernels were seen to copy and to compute.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ceilings {
    /// Copies of growing size.
    pub copies: Vec<CopySpeed>,
    /// Billions of operations per second in single precision; a multiplication and an addition are two.
    pub arithmetic_gop_s: f64,
}

/// The fastest copy of a size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CopySpeed {
    /// Bytes that it reads and writes, which both count.
    pub bytes: u64,
    /// Billions of bytes per second.
    pub gb_s: f64,
}

impl Ceilings {
    /// Measures both.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`], also for a queue family without timestamps.
    pub fn measure(gpu: &Gpu) -> Result<Self> {
        gpu.check_clock()?;
        Ok(Self { copies: copies(gpu)?, arithmetic_gop_s: arithmetic_gop_s(gpu)? })
    }

    /// Billions of bytes per second that a pass can move whose buffers have `working_set` bytes: those of the smallest copy that is
    /// as large, or of the largest.
    pub fn copy_gb_s(&self, working_set: u64) -> f64 {
        let fits = self.copies.iter().find(|copy| copy.bytes >= working_set);
        fits.or(self.copies.last()).map_or(f64::INFINITY, |copy| copy.gb_s)
    }
}

fn copies(gpu: &Gpu) -> Result<Vec<CopySpeed>> {
    let info = gpu.info();
    let most = (2 * info.max_storage_range).min(info.memory_heap / 8).max(COPIED_BYTES[0]);
    COPIED_BYTES.into_iter().filter(|&bytes| bytes <= most).map(|bytes| copy(gpu, bytes)).collect()
}

fn copy(gpu: &Gpu, bytes: u64) -> Result<CopySpeed> {
    let elements = (bytes / 2 / size_of::<vec4>() as u64) as usize;
    let calls = MOVED_BYTES.div_ceil(bytes);
    let source = Buffer::<vec4>::new(gpu, "ceiling source", elements, Location::Device)?;
    let target = Buffer::<vec4>::new(gpu, "ceiling target", elements, Location::Device)?;
    let kernel = Kernel::new(gpu, &gpu.tuning().thread().into())?;
    let mut frame = FrameResources::new(gpu)?;
    gpu.run(&mut frame, |rec| rec.fill(&source, 0))?; // memory that was never written may not exist yet
    let mut least = u64::MAX;
    for _ in 0..=REPEATS {
        let bind = || ceiling_copy::Bind { source: &source, target: &target };
        let threads = elements as u32;
        let times = gpu.run(&mut frame, |rec| {
            (0..calls).try_for_each(|_| rec.dispatch_threads(&kernel, bind(), &threads, threads))
        })?;
        least = times.iter().map(duration_ns).min().unwrap_or(u64::MAX).min(least);
    }
    Ok(CopySpeed { bytes, gb_s: bytes as f64 / least as f64 })
}

/// Billions of operations per second, for clocks that may change: it takes a few hundredths of a second.
///
/// # Errors
/// [`crate::error::Error::Device`], also for a queue family without timestamps.
pub fn arithmetic_gop_s(gpu: &Gpu) -> Result<f64> {
    gpu.check_clock()?;
    let kernel = Kernel::new(gpu, &gpu.tuning().thread().into())?;
    let result = Buffer::<vec4>::new(gpu, "ceiling result", THREADS[1] as usize, Location::Device)?;
    let mut frame = FrameResources::new(gpu)?;
    let mut run = |threads: u32| {
        let bind = ceiling_arithmetic::Bind { result: &result };
        let times = gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &threads, threads))?;
        Ok(times.first().map_or(u64::MAX, duration_ns))
    };
    run(THREADS[0])?; // some drivers compile on the first run
    let mut threads = THREADS[0];
    while run(threads)? < LEAST_NS && threads < THREADS[1] {
        threads *= 2;
    }
    let mut least = u64::MAX;
    for _ in 0..REPEATS {
        least = least.min(run(threads)?);
    }
    let each = f64::from(ceiling_arithmetic::TURNS) * f64::from(ceiling_arithmetic::OPERATIONS);
    Ok(f64::from(threads) * each / least as f64)
}

/// The clock may be too coarse to see it.
fn duration_ns(time: &PassTime) -> u64 {
    time.duration_ns().max(1)
}

/// What thread `i` of the kernel that computes stores: its CPU twin.
pub fn reference(i: u32) -> vec4 {
    let first = (i & 1023) as f32;
    let mut values = [first, first + 1.0, first + 2.0];
    for _ in 0..4 * ceiling_arithmetic::TURNS {
        values = values.map(|v| v * ceiling_arithmetic::FACTOR + ceiling_arithmetic::ADDEND);
    }
    [values[0] + values[1] + values[2]; 4]
}
