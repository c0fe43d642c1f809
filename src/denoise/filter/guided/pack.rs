//! What both forms of `guided` read of an image. Kernel: `glsl/guided/guided_pack.comp`.
use crate::denoise::filter::Planes;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{GuidedPackPush, vec4};
use crate::shaders::guided_pack;

/// Columns of a plane that lie beside each other, and rows of a strip, as in `glsl/shared/tiled_index.glsl`.
pub const BESIDE: u32 = 8;

/// What the kernels read of an image.
pub struct Packed {
    kernel: Kernel<guided_pack::Bind<'static>>,
    /// Radiance and the samples behind it, all zero where nothing is known.
    pub colour: Buffer<vec4>,
    /// The guide.
    pub channels: Buffer<vec4>,
    depth_scale: f32,
}

impl Packed {
    /// For images of (width, height), whose guide has 1, 3 or 4 `channels` and depths in units of `extent`.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when they do not fit.
    pub fn new(gpu: &Gpu, channels: u32, extent: f32, [width, height]: [u32; 2]) -> Result<Self> {
        let pixels = width.next_multiple_of(BESIDE) as usize * height as usize;
        Ok(Self {
            kernel: Kernel::new(gpu, &guided_pack::Constants { channels })?,
            colour: Buffer::new(gpu, "colour", pixels, Location::Device)?,
            channels: Buffer::new(gpu, "channels", pixels, Location::Device)?,
            depth_scale: 1.0 / extent,
        })
    }

    /// radiance\[P\], guide\[P\] -> colour\[P\], channels\[P\]
    pub fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let (radiance, guide) = (&planes.radiance, &planes.guide);
        let bind = guided_pack::Bind { radiance, guide, colour: &self.colour, channels: &self.channels };
        let push = GuidedPackPush { size: planes.size, depth_scale: self.depth_scale, ..Default::default() };
        rec.dispatch(&self.kernel, bind, &push, self.kernel.groups(planes.size))
    }
}
