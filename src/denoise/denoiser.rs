//! Filtered frames: what a renderer leaves in its buffers goes through a filter in the same command buffer.
use super::demodulated::Demodulated;
use super::demodulation::Demodulation;
use super::noisy::Noisy;
use crate::denoise::filter::firefly::Fireflies;
use crate::denoise::filter::{self, Filter, FilterSettings, Row};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, PixelFormat, Recorder};
use crate::layout::vec4;
use crate::render::{OutputView, Renderer};

/// A filter over the films of one renderer, whose buffers it keeps: a new renderer takes a new denoiser, since this one would go on showing
/// the old one's film. Everything is created in [`Denoiser::new`], nothing later.
pub struct Denoiser {
    noisy: Noisy,
    parts: Demodulated,
    filter: Box<dyn Filter>,
}

impl Denoiser {
    /// Compiles a row of [`FILTERS`](crate::denoise::filter::FILTERS) for the films of `renderer`, which was made with
    /// [`Outputs::guides`](crate::render::Outputs::guides), and for [`Demodulation::Light`] with
    /// [`Outputs::split_light`](crate::render::Outputs::split_light). Distances in the settings
    /// are in units of `extent`: [`FilterSettings::for_scene`] takes the diagonal of the scene's bounds; where little of a large scene is
    /// seen, give that of what is. `sigma_rt` is in units of `intensity`: give the radiance of what is white in your frames.
    /// [`Filtered`](super::Filtered) finds both by itself, but waits for the device.
    ///
    /// Of few samples, let `fireflies` be [`Fireflies::Usual`], as the command line does for all rows but `none`: one pixel that a single bright
    /// path has brought may have more error than all others together.
    ///
    /// Where the renderer's policy may leave pixels without a sample, these take direct light from the others, which the filter
    /// runs for once more.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range, for a renderer without what the filter needs or of another device, and for one with an
    /// `indirect_stride` without [`Demodulation::Light`]; [`Error::Device`] when the film is too large for the
    /// device's bindings.
    pub fn new(
        gpu: &Gpu,
        renderer: &Renderer,
        row: &Row,
        settings: &FilterSettings,
        demodulation: Demodulation,
        fireflies: Fireflies,
    ) -> Result<Self> {
        settings.validate()?;
        gpu.owns("the renderer", &renderer.gpu)?;
        let noisy = Noisy::of_film(renderer)?;
        let apart = demodulation == Demodulation::Light;
        if apart && !noisy.holds().light {
            let lack = "direct light apart: make the renderer with Outputs::split_light";
            return Err(Error::Usage(format!("a frame cannot be filtered without {lack}")));
        }
        if !apart && noisy.holds().indirect_stride > 1 {
            let what =
                "what is filtered is light that not every pixel has (indirect_stride): choose Demodulation::Light";
            return Err(Error::Usage(what.to_owned()));
        }
        filter::check_size(gpu, noisy.size)?;
        let allocate = &renderer.settings().allocate;
        let in_paint = apart && !allocate.is_even() && allocate.min_spp == 0;
        if in_paint && noisy.holds().indirect_stride > 1 {
            let what = "a frame with an indirect_stride needs samples in every pixel: set min_spp to 1 or more";
            return Err(Error::Usage(what.to_owned()));
        }
        let parts = Demodulated::new(gpu, &noisy, demodulation, row.weighs_noise, in_paint, fireflies)?;
        Ok(Self { filter: row.compile(gpu, settings, parts.planes.size)?, parts, noisy })
    }

    /// stats\[P\], light\[P\], guide\[P\] -> picture\[P\]: to be recorded behind the renderer's steps. The renderer's own
    /// radiance stays as it is.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn record(&self, rec: &mut Recorder) -> Result<()> {
        self.parts.record(rec, &self.noisy, &*self.filter, Some(&*self.filter))
    }

    /// Filtered linear radiance (Rec. 709), 4 floats a pixel, the last of them 1. It lies in a buffer of the denoiser's own, which
    /// the next frame overwrites: see [`RawBuffer`](crate::gpu::RawBuffer).
    pub fn radiance(&self) -> OutputView {
        OutputView {
            buffer: self.parts.picture.raw(),
            offset: 0,
            stride: size_of::<vec4>() as u32,
            format: PixelFormat::R32G32B32A32Sfloat,
            pixels: self.parts.whole().pixels(),
        }
    }

    /// The scales of the light and the surfaces that were filtered last, for the settings of another denoiser of such frames.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn scales(&self) -> Result<filter::Scales> {
        filter::Scales::of_planes(&self.parts.planes)
    }

    /// The same as [`Self::radiance`], for reading back.
    pub fn picture(&self) -> &Buffer<vec4> {
        &self.parts.picture
    }
}
