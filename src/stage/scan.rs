//! Exclusive scan of the counts: where every pixel's paths start. Reduce, then scan, in three passes, with
//! no assumption about forward progress or subgroups. Kernels: `glsl/{reduce,blocks,offsets}.comp`. Twin:
//! [`crate::reference::apportion::offsets`].
use super::apportion::Counts;
use super::{blocks, one_workgroup};
use crate::error::Result;
use crate::gpu::layout::{Effects, ScanPush, uvec2};
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::shaders::{self, offsets, reduce};

/// The middle pass, which apportioning needs too.
pub(super) struct Blocks(Kernel<shaders::blocks::Bind<'static>>);

impl Blocks {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, &Effects::default(), &[])?))
    }

    /// Replaces the sums of all blocks by the sums before them.
    pub fn record(&self, rec: &mut Recorder, sums: &Buffer<uvec2>, pixels: u32) -> Result<()> {
        let push = ScanPush { pixels };
        rec.dispatch(&self.0, shaders::blocks::Bind { blocks: sums }, &push, one_workgroup())
    }
}

/// The kernels.
pub struct Scan {
    reduce: Kernel<reduce::Bind<'static>>,
    blocks: Blocks,
    offsets: Kernel<offsets::Bind<'static>>,
}

impl Scan {
    /// Compiles them.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let none = Effects::default();
        Ok(Self {
            reduce: Kernel::new(gpu, &none, &[])?,
            blocks: Blocks::new(gpu)?,
            offsets: Kernel::new(gpu, &none, &[])?,
        })
    }

    /// count\[P\] -> offset\[P + 1\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, c: &Counts) -> Result<()> {
        let pixels = c.count.len() as u32;
        let (push, all) = (&ScanPush { pixels }, blocks(pixels));
        rec.dispatch(&self.reduce, reduce::Bind { counts: &c.count, blocks: c.blocks() }, push, all)?;
        self.blocks.record(rec, c.blocks(), pixels)?;
        let bind = offsets::Bind { counts: &c.count, blocks: c.blocks(), offset: &c.offset };
        rec.dispatch(&self.offsets, bind, push, all)
    }
}
