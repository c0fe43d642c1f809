//! Test cases for filters: a noisy image split into its parts, and its reference.
use anyhow::anyhow;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{self, FilterSettings, Row};
use tallow::denoise::twin::{self, Parts};
use tallow::gpu::Gpu;
use tallow::image::aov::{Aovs, Names};
use tallow::image::source::Source;
use tallow::image::{Picture, metrics};
use tallow::layout::vec4;

/// A noisy image and its reference.
pub struct Case {
    /// The parts of the noisy image, which the filters get.
    pub parts: Parts,
    /// The noisy image as rendered.
    pub noisy: Picture,
    /// The image that a perfect filter would return.
    pub reference: Picture,
    truth: Parts,
}

impl Case {
    /// # Errors
    /// When a file lacks its colour.
    pub fn new(noisy: &Source, reference: &Source, demodulation: Demodulation) -> anyhow::Result<Self> {
        Ok(Self {
            parts: parts(noisy, demodulation)?,
            noisy: picture(noisy)?,
            reference: picture(reference)?,
            truth: parts(reference, demodulation)?,
        })
    }

    /// Joins what a filter returned with the other parts of the noisy image.
    pub fn whole(&self, filtered: &[vec4]) -> Picture {
        Picture { pixels: self.parts.remodulate(filtered), ..self.noisy.clone() }
    }

    /// As [`Self::whole`] with direct light and albedo of the reference, so that only the filtered light differs from it.
    pub fn filtered_light(&self, filtered: &[vec4]) -> Picture {
        Picture { pixels: self.truth.remodulate(filtered), ..self.noisy.clone() }
    }

    /// The settings that a search starts from.
    pub fn start(&self) -> FilterSettings {
        FilterSettings::default().scaled_to(&self.parts.input)
    }

    /// # Errors
    /// Those of the device.
    pub fn run(&self, gpu: &Gpu, row: &Row, settings: &FilterSettings) -> anyhow::Result<Vec<vec4>> {
        Ok(filter::run(gpu, row, &self.parts.input, settings)?.0)
    }

    /// Mean squared error in 8-bit sRGB code values, as in the papers.
    pub fn mse(&self, picture: &Picture) -> f64 {
        255.0 * 255.0 * 10f64.powf(-0.1 * metrics::psnr(picture, &self.reference))
    }
}

/// Takes an image apart as a filter gets it.
///
/// # Errors
/// When the file lacks its colour.
pub fn parts(source: &Source, demodulation: Demodulation) -> anyhow::Result<Parts> {
    let aovs = Aovs::find(&source.film, &Names::new()).map_err(|what| anyhow!(what))?;
    Ok(twin::split(&aovs, demodulation, false /* as the papers divide by albedo */))
}

fn picture(source: &Source) -> anyhow::Result<Picture> {
    source.film.picture(None).map_err(|what| anyhow!(what))
}
