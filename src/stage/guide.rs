//! Primary hits at pixel centres. Kernel: `glsl/guide.comp`. Twin: [`crate::reference::guide`].
use super::PerThread;
use crate::error::Result;
use crate::frame::{DeviceScene, FilmTile};
use crate::gpu::Recorder;
use crate::gpu::layout::PathPush;
use crate::shaders::guide::Bind;

/// The specialised kernel.
pub type Guides = PerThread<Bind<'static>>;

/// camera -> guide\[tile\]
pub fn record(k: &Guides, rec: &mut Recorder, s: &DeviceScene, tile: &FilmTile, push: &PathPush) -> Result<()> {
    let push = PathPush { first_pixel: tile.first_pixel, pixels: tile.pixels, ..*push };
    k.record(rec, Bind { scene: s.bind(), guides: &tile.guide }, &push, tile.pixels)
}
