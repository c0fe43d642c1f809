//! `tallow render`: a scene becomes image files.
use super::progress::Progress;
use super::{Exit, finite, interrupt};
use crate::error::{Error, Result};
use crate::image::{self, WriteOptions, tone::ToneMap};
use crate::report::table::PassRow;
use crate::settings::{PixelFilter, Sampler, Settings};
use serde::Serialize;
use std::path::PathBuf;

/// Which effects are compiled into the kernels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum EffectChoice {
    /// What the scene calls for.
    #[default]
    Auto,
    /// Everything, to see what that costs.
    All,
}

/// Render a scene to image files
///
/// Options override the settings of the scene file.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml) or model (.obj)
    pub scene: PathBuf,
    /// Image to write: .exr (all layers), .png or .hdr; may be given several times [default: the scene's name + .exr]
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Effects to compile in
    #[arg(long, value_enum, default_value_t)]
    pub effects: EffectChoice,
    /// Exposure of PNG files in stops
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Tone curve of PNG files
    #[arg(long, value_enum, default_value_t)]
    pub tonemap: ToneMap,
    /// Write a trace of CPU and GPU for Perfetto
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Count rays and visited nodes
    #[arg(long)]
    pub counters: bool,
    /// Run under the Vulkan validation layers and fail on any message
    #[arg(long)]
    pub validation: bool,
    /// Print one JSON object at the end
    #[arg(long)]
    pub json: bool,
    /// No progress bar and no table
    #[arg(short, long)]
    pub quiet: bool,
    /// Replace the scene's own settings.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// Settings given on the command line.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Settings")]
pub struct Overrides {
    /// Film width in pixels
    #[arg(long, value_name = "N")]
    pub width: Option<u32>,
    /// Film height in pixels
    #[arg(long, value_name = "N")]
    pub height: Option<u32>,
    /// Samples per pixel
    #[arg(long, value_name = "N")]
    pub spp: Option<u32>,
    /// Path edges: 2 is direct light, 3 one bounce of indirect light
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Edges after which Russian roulette starts; 0 is off
    #[arg(long, value_name = "N")]
    pub roulette_depth: Option<u32>,
    /// Largest value of an indirect sample; 0 is off, others bias the image
    #[arg(long, value_name = "N")]
    pub clamp_indirect: Option<f32>,
    /// Chooses the random sequence
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Pixel filter
    #[arg(long, value_enum)]
    pub filter: Option<PixelFilter>,
    /// Random numbers
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
}

impl Overrides {
    /// Replaces those settings that were given.
    pub fn apply(&self, settings: &mut Settings) {
        let Settings { width, height, spp, max_depth, roulette_depth, clamp_indirect, seed, filter, sampler } =
            settings;
        set(width, self.width);
        set(height, self.height);
        set(spp, self.spp);
        set(max_depth, self.max_depth);
        set(roulette_depth, self.roulette_depth);
        set(clamp_indirect, self.clamp_indirect);
        set(seed, self.seed);
        set(filter, self.filter);
        set(sampler, self.sampler);
    }
}

fn set<T>(setting: &mut T, given: Option<T>) {
    if let Some(value) = given {
        *setting = value;
    }
}

impl Args {
    /// Files to write.
    pub fn output_files(&self) -> Vec<PathBuf> {
        if !self.outputs.is_empty() {
            return self.outputs.clone();
        }
        let mut name = self.scene.file_stem().unwrap_or_default().to_owned();
        name.push(".exr");
        vec![name.into()]
    }

    /// How PNG files are made.
    pub fn write_options(&self) -> WriteOptions {
        WriteOptions { exposure: self.exposure as f32, tone_map: self.tonemap }
    }
}

/// What `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples taken, over all pixels.
    pub samples: u64,
    /// Rays traced; none without `--counters`.
    pub rays: Option<u64>,
    /// Wall time of the render without loading and writing.
    pub seconds: f64,
    /// Name of the device.
    pub device: String,
    /// GPU time by pass.
    pub passes: Vec<PassRow>,
    /// What was repaired in the scene.
    pub warnings: Vec<String>,
}

/// Runs the subcommand.
///
/// # Errors
/// Of every kind; nothing is written then.
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    let stop = interrupt::flag();
    let mut settings = Settings::default();
    args.overrides.apply(&mut settings);
    settings.validate()?;
    let total = settings.pixels() as u64 * u64::from(settings.spp);
    let progress = Progress::new(total, args.quiet || args.json);
    progress.finish();
    if stop.load(std::sync::atomic::Ordering::SeqCst) {
        return Ok(Exit::Interrupted);
    }
    Err(Error::Device(format!("{}: this build has no renderer", args.scene.display())))
}

/// A render may take hours; what cannot be written is told before.
fn check_outputs(args: &Args) -> Result<()> {
    args.output_files().iter().try_for_each(|path| image::check_writable(path))?;
    args.profile.iter().try_for_each(|path| image::output::check(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::path::Path;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn parse(words: &[&str]) -> Args {
        Command::parse_from([&["render"], words].concat()).args
    }

    #[test]
    fn every_setting_given_replaces_that_of_the_scene_and_no_other() {
        let mut settings = Settings { spp: 7, ..Settings::default() };
        parse(&["a.toml"]).overrides.apply(&mut settings);
        assert_eq!(settings, Settings { spp: 7, ..Settings::default() });
        let words = "a.toml --width 1 --height 2 --spp 3 --max-depth 4 --roulette-depth 5 --clamp-indirect 6 --seed 8 \
            --filter tent --sampler independent";
        parse(&words.split_whitespace().collect::<Vec<_>>()).overrides.apply(&mut settings);
        let expected = Settings {
            width: 1,
            height: 2,
            spp: 3,
            max_depth: 4,
            roulette_depth: 5,
            clamp_indirect: 6.0,
            seed: 8,
            filter: PixelFilter::Tent,
            sampler: Sampler::Independent,
        };
        assert_eq!(settings, expected);
    }

    #[test]
    fn the_output_defaults_to_the_scene_s_name_in_the_current_folder() {
        assert_eq!(parse(&["scenes/box/room.toml"]).output_files(), [Path::new("room.exr")]);
        assert_eq!(parse(&["room.toml", "-o", "a.png", "-o", "b.exr"]).output_files().len(), 2);
        assert_eq!(parse(&["room.v2.obj"]).output_files(), [Path::new("room.v2.exr")]);
        assert_eq!(parse(&["room.toml", "--exposure", "-1.5"]).write_options().exposure, -1.5);
    }
}
