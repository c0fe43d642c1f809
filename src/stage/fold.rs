//! Folds a batch of samples into the pixels' statistics. Kernel: `glsl/fold.comp`. Twin: [`crate::reference::fold`].
use super::groups;
use crate::error::Result;
use crate::frame::{Batch, FilmBuffers};
use crate::gpu::layout::{Effects, FoldPush};
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::shaders::fold::Bind;

/// The specialised kernel.
pub struct Fold(Kernel<Bind<'static>>);

impl Fold {
    /// Compiles the kernel.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it.
    pub fn new(gpu: &Gpu, effects: &Effects) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, effects, &[])?))
    }

    /// samples\[batch\] -> stats\[P\], light\[P\]
    pub fn record(&self, rec: &mut Recorder, f: &FilmBuffers, b: &Batch) -> Result<()> {
        let restart = u32::from(b.first_sample == 0);
        let tile = f.tile_of(b);
        let first_pixel = b.first_pixel - tile.first_pixel;
        let push = FoldPush { first_pixel, pixels: b.pixels, samples: b.samples, restart };
        let bind = Bind { samples: &f.samples, stats: &tile.stats, light: &tile.light };
        rec.dispatch(&self.0, bind, &push, groups(b.pixels, 64))
    }

    /// Milliseconds that the pipeline took to create.
    pub fn compile_ms(&self) -> f64 {
        self.0.compile_time().as_secs_f64() * 1e3
    }
}
