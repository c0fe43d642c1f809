//! How much of an image's light does not follow albedo. Kernel: `glsl/film/gloss.comp`.
use super::{Demodulation, Noisy};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{SizePush, vec4};
use crate::shaders::gloss;
use crate::shaders::shared::gloss_cell::GLOSS_CELL;

/// The cells of one image.
pub(super) struct Gloss {
    /// `None` where it is not asked for.
    kernel: Option<Kernel<gloss::Bind<'static>>>,
    /// Mean albedo, and the share of light that does not follow it; one element where it is not asked for.
    pub(super) cells: Buffer<vec4>,
}

impl Gloss {
    /// For `noisy` and images that hold the same. Without direct light apart, pixels that show the sky in part would count, whose light is bright
    /// where albedo is low.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the cells do not fit.
    pub(super) fn new(gpu: &Gpu, noisy: &Noisy, demodulation: Demodulation, wanted: bool) -> Result<Self> {
        let wanted = wanted && demodulation == Demodulation::Light;
        let constants = gloss::Constants { noisy: noisy.holds.constants(), ..Default::default() };
        let cells = if wanted { cells_of(noisy.size) as usize } else { 1 };
        Ok(Self {
            kernel: wanted.then(|| Kernel::new(gpu, &constants)).transpose()?,
            cells: Buffer::new(gpu, "gloss", cells, Location::Device)?,
        })
    }

    /// Whether it is asked for.
    pub(super) fn is_wanted(&self) -> bool {
        self.kernel.is_some()
    }

    /// stats\[P\], light\[P\], guide\[P\] -> cells\[C\]
    pub(super) fn record(&self, rec: &mut Recorder, noisy: &Noisy) -> Result<()> {
        let Some(kernel) = &self.kernel else { return Ok(()) };
        let bind = gloss::Bind { noisy: noisy.bind(), cells: &self.cells };
        rec.dispatch_threads(kernel, bind, &SizePush { size: noisy.size, ..Default::default() }, cells_of(noisy.size))
    }
}

fn cells_of(size: [u32; 2]) -> u32 {
    size.map(|pixels| pixels.div_ceil(GLOSS_CELL as u32)).iter().product()
}
