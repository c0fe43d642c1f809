//! Options of every command that runs on a device and writes pictures.
use super::finite;
use crate::error::Result;
use crate::gpu::{DeviceOptions, Gpu};
use crate::image::{WriteOptions, tone::ToneMap};

/// The options.
#[derive(clap::Args)]
pub struct Common {
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Exposure of PNG files in stops
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Tone curve of PNG files
    #[arg(long, value_enum, default_value_t)]
    pub tonemap: ToneMap,
    /// Run under the Vulkan validation layers and fail on any message
    #[arg(long)]
    pub validation: bool,
    /// Print one JSON object at the end
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl Common {
    /// Whether a table and warnings are wanted.
    pub fn talkative(&self) -> bool {
        !self.quiet && !self.json
    }

    /// Opens the device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn open(&self) -> Result<Gpu> {
        Gpu::open(&DeviceOptions { device: self.device.clone(), validation: self.validation })
    }

    /// How PNG files are made.
    pub fn write_options(&self) -> WriteOptions {
        WriteOptions { exposure: self.exposure as f32, tone_map: self.tonemap }
    }
}
