//! A noisy image taken apart, and the image that it should become.
use anyhow::anyhow;
use std::path::Path;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{self, FilterSettings, Row};
use tallow::denoise::twin::{self, Parts};
use tallow::gpu::Gpu;
use tallow::image::aov::{Aovs, Names};
use tallow::image::source::Source;
use tallow::image::{self, Film, Picture, WriteOptions, metrics};
use tallow::layout::vec4;

/// See above.
pub struct Case {
    /// What the filters get.
    pub parts: Parts,
    /// As rendered.
    pub noisy: Picture,
    /// As it should be.
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

    /// The whole image with what a filter returned.
    pub fn whole(&self, filtered: &[vec4]) -> Picture {
        Picture { pixels: self.parts.remodulate(filtered), ..self.noisy.clone() }
    }

    /// The same with the direct light and the albedo of the reference, so that nothing but the filtered light differs.
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

    /// Mean squared error in 8-bit sRGB code values, as the papers have it.
    pub fn mse(&self, picture: &Picture) -> f64 {
        255.0 * 255.0 * 10f64.powf(-0.1 * metrics::psnr(picture, &self.reference))
    }
}

fn parts(source: &Source, demodulation: Demodulation) -> anyhow::Result<Parts> {
    let aovs = Aovs::find(&source.film, &Names::new()).map_err(|what| anyhow!(what))?;
    Ok(twin::split(&aovs, demodulation))
}

fn picture(source: &Source) -> anyhow::Result<Picture> {
    source.film.picture(None).map_err(|what| anyhow!(what))
}

/// # Errors
/// When it cannot be written.
pub fn write(picture: &Picture, path: &Path) -> anyhow::Result<()> {
    let mut film = Film::new(picture.width, picture.height);
    film.add_vec3("", ["R", "G", "B"], &picture.pixels);
    Ok(image::write(path, &film, &WriteOptions::default())?)
}
