//! What a device can do at most, measured with two kernels: one that copies and one that computes. Kernels:
//! `glsl/profile/ceiling_*.comp`.
use crate::error::Result;
use crate::gpu::{Buffer, FrameResources, Gpu, Kernel, Location, PassTime};
use crate::layout::vec4;
use crate::shaders::{ceiling_arithmetic, ceiling_copy};
use serde::{Deserialize, Serialize};

/// Runs of each kernel; the fastest counts.
const REPEATS: usize = 10;
/// Bytes of each of the two buffers, where the device lets kernels bind so much: more than its caches hold.
const COPIED_BYTES: u64 = 256 << 20;
/// Nanoseconds that the kernel which computes runs at least.
const LEAST_NS: u64 = 5_000_000;
/// Threads that it has at first, and at most.
const THREADS: [u32; 2] = [1 << 11, 1 << 22];

/// The fastest that kernels were seen to copy and to compute.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ceilings {
    /// Billions of bytes per second; what is read and what is written both count.
    pub copy_gb_s: f64,
    /// Billions of operations per second in single precision; a multiplication and an addition are two.
    pub arithmetic_gop_s: f64,
}

impl Ceilings {
    /// Measures both.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn measure(gpu: &Gpu) -> Result<Self> {
        Ok(Self { copy_gb_s: copy_gb_s(gpu)?, arithmetic_gop_s: arithmetic_gop_s(gpu)? })
    }
}

fn copy_gb_s(gpu: &Gpu) -> Result<f64> {
    let info = gpu.info();
    let bytes = COPIED_BYTES.min(info.max_storage_range).min(info.memory_heap / 16);
    let elements = (bytes / size_of::<vec4>() as u64).max(1) as usize;
    let source = Buffer::<vec4>::new(gpu, "ceiling source", elements, Location::Device)?;
    let target = Buffer::<vec4>::new(gpu, "ceiling target", elements, Location::Device)?;
    let kernel = Kernel::new(gpu, &gpu.tuning().thread().into())?;
    let mut frame = FrameResources::new(gpu)?;
    gpu.run(&mut frame, |rec| rec.fill(&source, 0))?; // memory that was never written may not exist yet
    let mut least = u64::MAX;
    for _ in 0..=REPEATS {
        let bind = ceiling_copy::Bind { source: &source, target: &target };
        let threads = elements as u32;
        let times = gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &threads, threads))?;
        least = least.min(duration_ns(&times));
    }
    Ok(2.0 * (elements * size_of::<vec4>()) as f64 / least as f64)
}

/// Billions of operations per second, for clocks that may change: it takes a few hundredths of a second.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn arithmetic_gop_s(gpu: &Gpu) -> Result<f64> {
    let kernel = Kernel::new(gpu, &gpu.tuning().thread().into())?;
    let result = Buffer::<vec4>::new(gpu, "ceiling result", THREADS[1] as usize, Location::Device)?;
    let mut frame = FrameResources::new(gpu)?;
    let mut run = |threads: u32| {
        let bind = ceiling_arithmetic::Bind { result: &result };
        let times = gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &threads, threads))?;
        Ok(duration_ns(&times))
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
fn duration_ns(times: &[PassTime]) -> u64 {
    times.iter().map(PassTime::duration_ns).sum::<u64>().max(1)
}

/// What thread `i` of the kernel that computes stores: its CPU twin.
pub fn reference(i: u32) -> vec4 {
    let first = (i & 1023) as f32;
    let mut values = [first, first + 1.0, first + 2.0, first + 3.0];
    for _ in 0..4 * ceiling_arithmetic::TURNS {
        values = values.map(|v| v * ceiling_arithmetic::FACTOR + ceiling_arithmetic::ADDEND);
    }
    [values[0] + values[1] + values[2] + values[3]; 4]
}
