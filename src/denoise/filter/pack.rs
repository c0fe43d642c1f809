//! Makes the two planes that most filters' taps read. Kernel: `glsl/filter/pack.comp`. Twin: [`Packed::reference`].
use super::pixel::{known_normal, known_position, known_radiance};
use super::{FilterInput, Planes};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{PackPush, uvec4, vec4};
use crate::shaders::pack::Bind;
use crate::shaders::shared::packed_pixels;
use glam::Vec3;

/// Of a pixel of both planes.
pub const BYTES: u64 = (size_of::<vec4>() + size_of::<uvec4>()) as u64;

/// The kernel and its planes.
pub struct Pack {
    kernel: Kernel<Bind<'static>>,
    /// Radiance and the samples behind it, all zero where nothing is known.
    pub colour: Buffer<vec4>,
    /// The bits of the position and of the packed normal: as floats, small ones might be fetched as 0.
    pub place: Buffer<uvec4>,
}

impl Pack {
    /// For images of (width, height).
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when they do not fit.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2]) -> Result<Self> {
        let pixels = width as usize * height as usize;
        Ok(Self {
            kernel: Kernel::new(gpu, &Default::default())?,
            colour: Buffer::new(gpu, "colour", pixels, Location::Device)?,
            place: Buffer::new(gpu, "place", pixels, Location::Device)?,
        })
    }

    /// What the filters bind.
    pub fn bind(&self) -> packed_pixels::Bind<'_> {
        packed_pixels::Bind { colour: &self.colour, place: &self.place }
    }

    /// radiance\[P\], guide\[P\] -> colour\[P\], place\[P\]
    pub fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let bind = Bind { radiance: &planes.radiance, guide: &planes.guide, colour: &self.colour, place: &self.place };
        rec.dispatch_threads(
            &self.kernel,
            bind,
            &PackPush { count: planes.pixels(), ..Default::default() },
            planes.pixels(),
        )
    }
}

/// A pixel as the taps see it.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Zero where nothing is known.
    pub colour: Vec3,
    /// Samples behind `colour`; 0 where nothing is known.
    pub count: f32,
    /// Unit, or zero.
    pub normal: Vec3,
    /// World units.
    pub position: Vec3,
}

impl Packed {
    /// Every pixel of an image.
    pub fn reference(input: &FilterInput) -> Vec<Self> {
        let pack = |(c, g): (&vec4, &crate::layout::Guide)| {
            let colour = known_radiance(*c);
            Self {
                colour: colour.unwrap_or_default(),
                count: colour.map_or(0.0, |_| c[3]),
                normal: known_normal(g.normal),
                position: known_position(g.position),
            }
        };
        input.radiance.iter().zip(&input.guide).map(pack).collect()
    }

    /// This pixel with the mean of weighted differences added, and in-painted if it was unknown; itself where nothing
    /// had weight.
    pub fn moved_by(self, sum: Vec3, total: f32) -> Self {
        let count = if self.count > 0.0 { self.count } else { 1.0 };
        if total > 0.0 { Self { colour: self.colour + sum / total, count, ..self } } else { self }
    }

    /// As a result.
    pub fn output(&self) -> vec4 {
        self.colour.extend(self.count).into()
    }
}
