//! Folds a batch of samples into the pixels' statistics. Kernel: `glsl/film/accumulate.comp`. Twin: [`crate::twins::accumulate`].
use super::pair;
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::FoldPush;
use crate::render::buffers::{FilmBuffers, FilmTile, part_if};
use crate::render::schedule::{Batch, PathRange};
use crate::shaders::accumulate::Bind;

/// The specialised kernel.
pub type Fold = Kernel<Bind<'static>>;

/// samples\[batch\] -> stats\[P\], light\[P\]
pub fn record(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, b: &Batch) -> Result<()> {
    let tile = f.tile_of(b);
    let first_pixel = b.first_pixel - tile.first_pixel;
    let window = first_pixel / tile.window * tile.window;
    let (tile_first, pixels, samples) = (tile.first_pixel, b.pixels, b.samples);
    let push = FoldPush { first_pixel, pixels, tile: tile_first, window, samples, ..FoldPush::default() };
    fold(k, rec, f, tile, &push)
}

/// samples\[batch\], offset\[P + 1\] -> stats\[P\], light\[P\]
pub fn record_listed(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, range: &PathRange) -> Result<()> {
    let PathRange { first, paths, round, rounds } = *range;
    f.tiles[0].windows().try_for_each(|w| {
        let (first_pixel, pixels, first_path) = (w.start, w.end - w.start, pair(first));
        let push = FoldPush {
            first_pixel,
            pixels,
            tile: 0,
            window: w.start,
            samples: 0,
            paths,
            first_path,
            round,
            rounds,
            ..Default::default()
        };
        fold(k, rec, f, &f.tiles[0], &push)
    })
}

/// Binds the window of the tile that begins at `push.window`.
fn fold(k: &Fold, rec: &mut Recorder, f: &FilmBuffers, tile: &FilmTile, push: &FoldPush) -> Result<()> {
    let end = tile.pixels.min(push.window + tile.window);
    let bound = push.window as usize..end as usize;
    let folded_stats = &tile.stats.part(bound.clone())?;
    let folded_light = &part_if(tile.has_light(), &tile.light, &bound)?;
    let (samples, offset) = (&f.samples, &f.counts.offset);
    let (stats, light, broken) = (&tile.stats, &tile.light, &f.broken);
    let bind = Bind { samples, stats, light, offset, folded_stats, folded_light, broken };
    rec.dispatch_threads(k, bind, push, push.pixels)
}
