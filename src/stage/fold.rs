//! Folds a batch of samples into the pixels' statistics. Kernel: `glsl/fold.comp`. Twin: [`crate::reference::fold`].
use super::{PerThread, pair};
use crate::error::Result;
use crate::frame::{FilmBuffers, FilmTile};
use crate::gpu::Recorder;
use crate::gpu::layout::FoldPush;
use crate::schedule::{Batch, PathRange};
use crate::shaders::fold::Bind;

/// The specialised kernel.
pub type Fold = PerThread<Bind<'static>>;

/// samples\[batch\] -> stats\[P\], light\[P\]
pub fn record(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, b: &Batch) -> Result<()> {
    let tile = f.tile_of(b);
    let first_pixel = b.first_pixel - tile.first_pixel;
    let push = FoldPush { first_pixel, pixels: b.pixels, samples: b.samples, ..FoldPush::default() };
    k.record(rec, bind(f, tile), &push, b.pixels)
}

fn bind<'a>(f: &'a FilmBuffers, tile: &'a FilmTile) -> Bind<'a> {
    Bind { samples: &f.samples, stats: &tile.stats, light: &tile.light, offset: &f.counts.offset }
}

/// samples\[batch\], offset\[P + 1\] -> stats\[P\], light\[P\]
pub fn record_listed(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, range: &PathRange) -> Result<()> {
    let tile = &f.tiles[0];
    let PathRange { first, paths, round, rounds } = *range;
    let push = FoldPush { pixels: tile.pixels, paths, first_path: pair(first), round, rounds, ..FoldPush::default() };
    k.record(rec, bind(f, tile), &push, tile.pixels)
}
