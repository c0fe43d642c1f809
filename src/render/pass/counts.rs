//! Samples of every pixel, and what finding their numbers takes.
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Location, block_count};
use crate::layout::{Apportionment, BlockSums, uvec2};
use crate::shaders::shared::last_block;

/// Values of a digit of a remainder.
pub const BINS: usize = 256;

/// The counts, and what finding them takes, the offsets of the scan included.
pub struct Counts {
    /// What a policy says of every pixel: how much it is worth samples.
    pub priority: Buffer<f32>,
    /// 12.20 fixed point; then, unless they are shares of the next samples, what a pixel lacks.
    pub weight: Buffer<u32>,
    /// Samples of every pixel.
    pub count: Buffer<u32>,
    /// First path of every pixel, and the number of all: 64 bits, low word first. Before the scan, the remainders.
    pub offset: Buffer<uvec2>,
    /// One: read it for what was not finite.
    pub state: Buffer<Apportionment>,
    pub(super) sums: Buffer<BlockSums>,
    pub(super) blocks: Buffer<uvec2>,
    pub(super) histogram: Buffer<u32>,
    /// Workgroups that a dispatch has ended.
    ended: Buffer<u32>,
}

impl Counts {
    /// Priority, weight, count and offset.
    pub const BYTES_PER_PIXEL: usize = 20;

    /// For a film of `pixels`, and kernels whose threads have so many each.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, pixels: u32, thread_items: u32) -> Result<Self> {
        let (n, of_blocks) = (pixels as usize, block_count(pixels, thread_items) as usize);
        let offset = Buffer::new(gpu, "offset", n + 1, Location::Device)?;
        offset.write(n, &[[0; 2]])?; // the number of all, which may be asked for before any is placed
        Ok(Self {
            priority: Buffer::new(gpu, "priority", n, Location::Device)?,
            weight: Buffer::new(gpu, "weight", n, Location::Device)?,
            count: Buffer::new(gpu, "count", n, Location::Device)?,
            offset,
            state: Buffer::from_slice(gpu, "apportionment", &[Apportionment::default()])?,
            sums: Buffer::new(gpu, "sums", of_blocks, Location::Device)?,
            blocks: Buffer::new(gpu, "blocks", of_blocks, Location::Device)?,
            histogram: Buffer::from_slice(gpu, "histogram", &[0; BINS])?,
            ended: Buffer::from_slice(gpu, "ended", &[0])?,
        })
    }

    pub(super) fn last_block(&self) -> last_block::Bind<'_> {
        last_block::Bind { ended: &self.ended }
    }
}
