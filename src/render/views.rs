//! Results for the caller, where they lie.
use super::{Outputs, Renderer};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, PixelFormat, RawBuffer};
use crate::layout::{Guide, PixelLight, PixelStats};
use crate::render::buffers::FilmTile;
use bytemuck::Pod;
use std::mem::offset_of;

/// A result buffer for the caller: pixel `i` of the view (row-major, row 0 at the top) starts `buffer.offset + offset + i * stride` bytes
/// from the start of the Vulkan buffer.
#[derive(Clone, Copy, Debug)]
pub struct OutputView {
    /// The range of a Vulkan buffer that holds the records of all pixels, valid as long as what returned the view.
    pub buffer: RawBuffer,
    /// Bytes from the start of that range to the first pixel's first value.
    pub offset: u64,
    /// Bytes from pixel to pixel: a record holds more than one value, so that most are larger than their `format`.
    pub stride: u32,
    /// How the values of one pixel are laid out.
    pub format: PixelFormat,
    /// Pixels in this view.
    pub pixels: u32,
}

/// What a renderer leaves of every pixel; the EXR layers of the same names hold these values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layer {
    /// Mean of the samples: linear radiance (Rec. 709).
    Radiance,
    /// Sum of the squared deviations from the mean: m2 / (n - 1) is the variance of one of n samples, and an n-th of that the
    /// variance of the mean.
    M2,
    /// Samples behind the mean.
    Samples,
    /// Radiance that needs no filter: see [`PixelLight::direct`].
    Direct,
    /// Reflectance that all other light has been multiplied by; where light is not kept apart, that of the primary hit.
    Albedo,
    /// Shading normal of the primary hit in world space.
    Normal,
    /// The hit in world units.
    Position,
    /// Distance from the camera in world units; 0 on a miss.
    Depth,
    /// Index of the object, [`crate::layout::NONE`] on a miss.
    Object,
}

impl Renderer {
    /// Where a layer lies: one view for each of [`super::FilmBuffers::tiles`], in order. The buffers are the renderer's own, which the
    /// next frame overwrites; see [`RawBuffer`] for their usage and who owns them.
    ///
    /// # Errors
    /// [`Error::Usage`] when the renderer was made without the [`super::Outputs`] that keep it.
    pub fn views(&self, layer: Layer) -> Result<Vec<OutputView>> {
        let Outputs { split_light, guides, .. } = self.outputs;
        let (kept, output) = match layer {
            Layer::Radiance | Layer::M2 | Layer::Samples => (true, ""),
            Layer::Direct => (split_light, "split_light"),
            Layer::Albedo => (split_light || guides, "guides"),
            Layer::Normal | Layer::Position | Layer::Depth | Layer::Object => (guides, "guides"),
        };
        if !kept {
            return Err(Error::Usage(format!("the renderer keeps no {layer:?}: make it with Outputs::{output}")));
        }
        Ok(self.frame.film.tiles.iter().map(|tile| view(tile, layer)).collect())
    }
}

fn view(tile: &FilmTile, layer: Layer) -> OutputView {
    use PixelFormat::{R32G32B32Sfloat, R32Sfloat, R32Uint};
    let (stats, light, guide) = (&tile.stats, &tile.light, &tile.guide);
    match layer {
        Layer::Radiance => within(tile, stats, offset_of!(PixelStats, mean), R32G32B32Sfloat),
        Layer::M2 => within(tile, stats, offset_of!(PixelStats, m2), R32G32B32Sfloat),
        Layer::Samples => within(tile, stats, offset_of!(PixelStats, count), R32Uint),
        Layer::Direct => within(tile, light, offset_of!(PixelLight, direct), R32G32B32Sfloat),
        Layer::Albedo if tile.has_light() => within(tile, light, offset_of!(PixelLight, albedo), R32G32B32Sfloat),
        Layer::Albedo => within(tile, guide, offset_of!(Guide, albedo), R32G32B32Sfloat),
        Layer::Normal => within(tile, guide, offset_of!(Guide, normal), R32G32B32Sfloat),
        Layer::Position => within(tile, guide, offset_of!(Guide, position), R32G32B32Sfloat),
        Layer::Depth => within(tile, guide, offset_of!(Guide, depth), R32Sfloat),
        Layer::Object => within(tile, guide, offset_of!(Guide, object), R32Uint),
    }
}

fn within<T: Pod>(tile: &FilmTile, records: &Buffer<T>, offset: usize, format: PixelFormat) -> OutputView {
    let (stride, offset) = (size_of::<T>() as u32, offset as u64);
    OutputView { buffer: records.raw(), offset, stride, format, pixels: tile.pixels }
}
