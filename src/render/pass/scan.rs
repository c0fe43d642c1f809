//! Exclusive scan of the counts: where every pixel's paths start. Reduce, then scan, in three passes, with
//! no assumption about forward progress or subgroups. Kernels: `glsl/{reduce,blocks,offsets}.comp`. Twin:
//! [`crate::twins::apportion::offsets`].
use super::counts::Counts;
use crate::error::Result;
use crate::gpu::PerBlock;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::layout::{ScanPush, uvec2};
use crate::shaders::{self, offsets, reduce};

/// The middle pass, which apportioning needs too.
pub(super) struct Blocks(PerBlock<shaders::scan_block_sums::Bind<'static>>);

impl Blocks {
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        Ok(Self(PerBlock::new(gpu, thread_items)?))
    }

    /// Replaces the sums of all blocks by the sums before them.
    pub fn record(&self, rec: &mut Recorder, sums: &Buffer<uvec2>, pixels: u32) -> Result<()> {
        self.0.record_one(
            rec,
            shaders::scan_block_sums::Bind { blocks: sums },
            &ScanPush { pixels, ..Default::default() },
        )
    }
}

/// The kernels.
pub struct Scan {
    reduce: PerBlock<reduce::Bind<'static>>,
    blocks: Blocks,
    offsets: PerBlock<offsets::Bind<'static>>,
}

impl Scan {
    /// Compiles them, as [`PerBlock::new`] does.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        Ok(Self {
            reduce: PerBlock::new(gpu, thread_items)?,
            blocks: Blocks::new(gpu, thread_items)?,
            offsets: PerBlock::new(gpu, thread_items)?,
        })
    }

    /// count\[P\] -> offset\[P + 1\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, c: &Counts) -> Result<()> {
        let pixels = c.count.len() as u32;
        let push = &ScanPush { pixels, ..Default::default() };
        self.reduce.record(rec, reduce::Bind { counts: &c.count, blocks: c.blocks() }, push, pixels)?;
        self.blocks.record(rec, c.blocks(), pixels)?;
        let bind = offsets::Bind { counts: &c.count, blocks: c.blocks(), offset: &c.offset };
        self.offsets.record(rec, bind, push, pixels)
    }
}
