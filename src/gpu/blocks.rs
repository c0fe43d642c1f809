//! Dispatches over blocks of pixels.
use super::{Bindings, Gpu, Kernel, Recorder};
use crate::error::{Error, Result};
use crate::shaders::shared::block;

/// A kernel whose workgroups each own a block of pixels, a run of them each thread; or one that closes what those began.
pub struct PerBlock<B> {
    kernel: Kernel<B>,
    thread_items: u32,
}

impl<B: Bindings<Constants: From<block::Constants>>> PerBlock<B> {
    /// Compiles the kernel for blocks of threads with so many pixels: see [`thread_items`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it, [`Error::Usage`] for more than 1024 pixels or none.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        if !(1..=MOST_ITEMS).contains(&thread_items) {
            return Err(Error::Usage(format!("{thread_items} pixels of a thread: choose 1 to {MOST_ITEMS}")));
        }
        Ok(Self { kernel: Kernel::new(gpu, &block::Constants { thread_items }.into())?, thread_items })
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

/// Workgroups along one axis that every Vulkan device can run.
const MAX_GROUPS: u32 = 65_535;

/// Pixels of a thread of a [`PerBlock`] kernel at most.
const MOST_ITEMS: u32 = 1024;

/// Blocks of a film.
pub fn block_count(pixels: u32, thread_items: u32) -> u32 {
    pixels.div_ceil(block::BLOCK_THREADS * thread_items)
}

/// Pixels that a thread of a [`PerBlock`] kernel walks over: as many as suit the device, or more where a film would need too
/// many blocks.
pub fn thread_items(gpu: &Gpu, pixels: u32) -> u32 {
    const MOST: u32 = 64;
    let suited = gpu.tuning().thread_items;
    if block_count(pixels, suited) <= MAX_GROUPS { suited } else { MOST }
}
