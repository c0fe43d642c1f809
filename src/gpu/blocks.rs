//! Dispatches of kernels whose workgroups each process one block of consecutive pixels.
use super::{Bindings, Gpu, Kernel, MAX_GROUPS, Recorder};
use crate::error::{Error, Result};
use crate::shaders::shared::block;

/// A kernel whose workgroups each process one block of pixels and whose threads each process a run of pixels within it.
pub struct PerBlock<B> {
    kernel: Kernel<B>,
    thread_items: u32,
}

impl<B: Bindings<Constants: From<block::Constants>>> PerBlock<B> {
    /// Compiles the kernel for `thread_items` pixels per thread (see [`thread_items`]).
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it, [`Error::Usage`] for more than 1024 pixels or none.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        if !(1..=MOST_ITEMS).contains(&thread_items) {
            return Err(Error::Usage(format!("{thread_items} pixels of a thread: choose 1 to {MOST_ITEMS}")));
        }
        let constants = block::Constants { thread_items, interleaved: gpu.tuning().interleaves };
        Ok(Self { kernel: Kernel::new(gpu, &constants.into())?, thread_items })
    }

    /// Records one workgroup for every block of a film of `pixels` pixels.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, bind: B, push: &B::Push, pixels: u32) -> Result<()> {
        rec.dispatch(&self.kernel, bind, push, [block_count(pixels, self.thread_items), 1, 1])
    }
}

/// Largest number of pixels per thread of a [`PerBlock`] kernel.
const MOST_ITEMS: u32 = 1024;

/// Number of blocks that cover `pixels` pixels.
pub fn block_count(pixels: u32, thread_items: u32) -> u32 {
    pixels.div_ceil(block::BLOCK_THREADS * thread_items)
}

/// Number of pixels that each thread of a [`PerBlock`] kernel processes: the device's preferred number, or 64 where a film
/// would otherwise need more blocks than a dispatch can have.
pub fn thread_items(gpu: &Gpu, pixels: u32) -> u32 {
    const MOST: u32 = 64;
    let suited = gpu.tuning().thread_items;
    if block_count(pixels, suited) <= MAX_GROUPS { suited } else { MOST }
}
