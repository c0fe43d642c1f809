//! Folds a batch of samples into the pixels' statistics. Kernel: `glsl/fold.comp`. Twin: [`crate::reference::fold`].
use super::PerThread;
use crate::error::Result;
use crate::frame::{Batch, FilmBuffers};
use crate::gpu::Recorder;
use crate::gpu::layout::FoldPush;
use crate::shaders::fold::Bind;

/// The specialised kernel.
pub type Fold = PerThread<Bind<'static>>;

/// samples\[batch\] -> stats\[P\], light\[P\]
pub fn record(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, b: &Batch) -> Result<()> {
    let restart = u32::from(b.first_sample == 0);
    let tile = f.tile_of(b);
    let first_pixel = b.first_pixel - tile.first_pixel;
    let push = FoldPush { first_pixel, pixels: b.pixels, samples: b.samples, restart };
    let bind = Bind { samples: &f.samples, stats: &tile.stats, light: &tile.light };
    k.record(rec, bind, &push, b.pixels)
}
