//! Exclusive scan of the counts: where every pixel's paths start. Reduce, then scan, with no assumption about
//! forward progress or subgroups. Kernels: `glsl/apportion/{reduce,offsets}.comp`. Twin:
//! [`crate::twins::apportion::offsets`].
use super::counts::Counts;
use crate::error::Result;
use crate::gpu::PerBlock;
use crate::gpu::{Gpu, Recorder};
use crate::layout::ScanPush;
use crate::shaders::{offsets, reduce};

/// The kernels.
pub struct Scan {
    reduce: PerBlock<reduce::Bind<'static>>,
    offsets: PerBlock<offsets::Bind<'static>>,
}

impl Scan {
    /// Compiles them, as [`PerBlock::new`] does.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        Ok(Self { reduce: PerBlock::new(gpu, thread_items)?, offsets: PerBlock::new(gpu, thread_items)? })
    }

    /// count\[P\] -> offset\[P + 1\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, c: &Counts) -> Result<()> {
        let pixels = c.count.len() as u32;
        let push = &ScanPush { pixels, ..Default::default() };
        let (counts, blocks) = (&c.count, &c.blocks);
        self.reduce.record(rec, reduce::Bind { counts, blocks, last_block: c.last_block() }, push, pixels)?;
        let bind = offsets::Bind { counts, blocks, offset: &c.offset };
        self.offsets.record(rec, bind, push, pixels)
    }
}
