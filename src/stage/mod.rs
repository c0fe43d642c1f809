//! One file per kernel: what it reads and writes, and how it is recorded. Stages never call stages; `frame.rs` lists them.
use crate::error::{Error, Result};
use crate::gpu::layout::{Effects, TRAVERSAL_STACK};
use crate::gpu::{Bindings, Gpu, Kernel, Recorder};

pub mod apportion;
pub mod batch;
pub mod choose;
pub mod fold;
pub mod guide;
pub mod lookup;
pub mod path;
pub mod scan;

/// Tracing on lavapipe runs fastest at 32 (against 16 and 64).
pub const WORKGROUP_CPU: u32 = 32;

/// Runs of a list of paths that are begun at once, so that no thread of lavapipe has the dear ones alone: placed samples of
/// Cornell box, Sponza, bust and grass trace in 0.95 to 0.97 of the time.
const STRIPES_CPU: u32 = 16;

/// Two subgroups of the most common width.
pub const WORKGROUP_GPU: u32 = 64;

/// Workgroups along one axis that every Vulkan device can run.
const ROW: u32 = 65_535;

/// A kernel whose threads each do one item, and whose workgroup is chosen when it is made.
pub struct PerThread<B> {
    kernel: Kernel<B>,
    workgroup: u32,
}

impl<B: Bindings> PerThread<B> {
    /// Compiles the kernel for what `effects` call for.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it.
    pub fn new(gpu: &Gpu, effects: &Effects, workgroup: u32) -> Result<Self> {
        Self::with_stack(gpu, effects, workgroup, TRAVERSAL_STACK)
    }

    /// [`PerThread::new`] of a kernel that traces rays of a scene with this [`Scene::stack`](crate::scene::Scene::stack).
    ///
    /// # Errors
    /// As [`PerThread::new`], and [`Error::Usage`] for a stack of another size than scenes may have.
    pub fn with_stack(gpu: &Gpu, effects: &Effects, workgroup: u32, stack: u32) -> Result<Self> {
        if !(1..=TRAVERSAL_STACK).contains(&stack) {
            return Err(Error::Usage(format!("a stack of {stack} groups: choose 1 to {TRAVERSAL_STACK}")));
        }
        let stripes = if gpu.info().kind == "CPU" { STRIPES_CPU } else { 1 };
        // local_size_x_id, the same for `thread_index()`, the stack of `shared/traverse.glsl`, and `striped_index()`.
        let numbers = [(100, workgroup), (101, workgroup), (102, stack), (104, stripes)];
        Ok(Self { kernel: Kernel::new(gpu, effects, &numbers)?, workgroup })
    }

    /// Records it over `threads` items.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, bind: B, push: &B::Push, threads: u32) -> Result<()> {
        rec.dispatch(&self.kernel, bind, push, groups(threads, self.workgroup))
    }

    /// Milliseconds that the pipeline took to create.
    pub fn compile_ms(&self) -> f64 {
        self.kernel.compile_time().as_secs_f64() * 1e3
    }
}

/// Workgroups of `size` threads that cover `threads`, folded into rows; `thread_index()` unfolds them.
pub fn groups(threads: u32, size: u32) -> [u32; 3] {
    let groups = threads.div_ceil(size);
    [groups.min(ROW), groups.div_ceil(ROW), 1]
}

/// A kernel whose workgroups each own a block of pixels, a run of them each thread; or one that closes what those began.
pub struct PerBlock<B> {
    kernel: Kernel<B>,
    thread_items: u32,
}

impl<B: Bindings> PerBlock<B> {
    /// Compiles the kernel for blocks of threads with so many pixels: see [`thread_items`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it, [`Error::Usage`] for more than 1024 pixels or none.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        if !(1..=MOST_ITEMS).contains(&thread_items) {
            return Err(Error::Usage(format!("{thread_items} pixels of a thread: choose 1 to {MOST_ITEMS}")));
        }
        // THREAD_ITEMS of `shared/block.glsl`.
        Ok(Self { kernel: Kernel::new(gpu, &Effects::default(), &[(103, thread_items)])?, thread_items })
    }

    /// Records it over all blocks of a film.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, bind: B, push: &B::Push, pixels: u32) -> Result<()> {
        rec.dispatch(&self.kernel, bind, push, [block_count(pixels, self.thread_items), 1, 1])
    }

    /// Records one workgroup of it.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record_one(&self, rec: &mut Recorder, bind: B, push: &B::Push) -> Result<()> {
        rec.dispatch(&self.kernel, bind, push, [1; 3])
    }
}

/// Of a [`PerBlock`] kernel.
const BLOCK_THREADS: u32 = 64;

/// Pixels of a thread of a [`PerBlock`] kernel at most.
const MOST_ITEMS: u32 = 1024;

/// Blocks of a film.
pub fn block_count(pixels: u32, thread_items: u32) -> u32 {
    pixels.div_ceil(BLOCK_THREADS * thread_items)
}

/// Pixels that a thread of a [`PerBlock`] kernel walks over. Two cores are busy with few threads, and a long run spares
/// barriers; a GPU hides the time that its memory takes behind other threads, of which it wants tens of thousands.
pub fn thread_items(gpu: &Gpu, pixels: u32) -> u32 {
    const FEW: u32 = 16;
    const MANY: u32 = 64;
    let fits = block_count(pixels, FEW) <= ROW;
    if fits && gpu.info().kind != "CPU" { FEW } else { MANY }
}

/// A 64-bit number as buffers and push constants hold it, low word first.
fn pair(n: u64) -> [u32; 2] {
    [n as u32, (n >> 32) as u32]
}

#[cfg(test)]
mod tests {
    #[test]
    fn large_dispatches_fold_into_rows() {
        assert_eq!(super::groups(65, 64), [2, 1, 1]);
        assert_eq!(super::groups(65_535 * 32, 32), [65_535, 1, 1]);
        assert_eq!(super::groups(65_535 * 32 + 1, 32), [65_535, 2, 1]);
    }
}
