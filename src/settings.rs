//! Every choice a user makes about a render: default, unit and range in one place. The command line and the `[render]`
//! table of a scene file fill the same struct; [`Settings::validate`] is the only check.
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// How a pixel's samples are spread over its surroundings. Widths are in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum PixelFilter {
    /// Uniform over the pixel.
    #[default]
    Box,
    /// Triangle of radius 1.
    Tent,
    /// Gaussian of standard deviation 0.5, cut at radius 2.
    Gaussian,
}

/// Where the random numbers come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Sampler {
    /// Owen-scrambled Sobol points.
    #[default]
    Sobol,
    /// Independent numbers (PCG), the control.
    Independent,
}

/// The settings of a render.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Film width in pixels, 1 to 16384.
    pub width: u32,
    /// Film height in pixels, 1 to 16384.
    pub height: u32,
    /// Samples per pixel, 1 to 16777216.
    pub spp: u32,
    /// Path edges: 1 = emission only, 2 = direct light, 3 = one bounce of indirect light. 1 to 1024.
    pub max_depth: u32,
    /// Paths longer than this many edges survive with the probability of their throughput; 0 is off.
    pub roulette_depth: u32,
    /// Upper limit of an indirect sample's largest channel, W/(m^2 sr); 0 is off. Biases the image.
    pub clamp_indirect: f32,
    /// Chooses the random sequence.
    pub seed: u32,
    /// Pixel filter.
    pub filter: PixelFilter,
    /// Random numbers.
    pub sampler: Sampler,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            spp: 64,
            max_depth: 8,
            roulette_depth: 0,
            clamp_indirect: 0.0,
            seed: 0,
            filter: PixelFilter::Box,
            sampler: Sampler::Sobol,
        }
    }
}

impl Settings {
    /// The largest film edge in pixels.
    pub const MAX_EDGE: u32 = 16_384;
    /// The largest number of samples per pixel.
    pub const MAX_SPP: u32 = 1 << 24;
    /// The longest path in edges.
    pub const MAX_DEPTH: u32 = 1024;

    /// # Errors
    /// [`Error::Usage`] with the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        let range = |name: &str, value: u32, max: u32| match value {
            v if (1..=max).contains(&v) => Ok(()),
            v => Err(Error::Usage(format!("{name} is {v}: choose a value from 1 to {max}"))),
        };
        range("width", self.width, Self::MAX_EDGE)?;
        range("height", self.height, Self::MAX_EDGE)?;
        range("spp", self.spp, Self::MAX_SPP)?;
        range("max-depth", self.max_depth, Self::MAX_DEPTH)?;
        match self.clamp_indirect {
            c if c.is_finite() && c >= 0.0 => Ok(()),
            c => Err(Error::Usage(format!("clamp-indirect is {c}: choose 0 (off) or a positive number"))),
        }
    }

    /// Pixels of the film.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
