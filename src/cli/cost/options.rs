//! Options of `tallow cost`.
use crate::allocate::Policy;
use crate::cli::common::with_ranges;
use crate::cli::finite;
use crate::cli::overrides::Overrides;
use crate::cost::grid::Axes;
use crate::denoise::filter::Method;
use crate::error::{Error, Result};
use crate::render::settings::{Film, Settings};
use clap::Parser;
use std::path::PathBuf;

/// Measure how much time buys how much accuracy, by which method
///
/// Renders a scene by every combination of allocation, filter and samples, in random order, and compares time and error. Writes
/// cost.json (with all raw runs), cost.csv and cost.html. Time is the device's own, without the first run of each kernel. Errors
/// are measured against a reference, which is rendered and kept for the next time unless one is given. Stopped by Ctrl-C or by the
/// budget, the same command goes on where it was.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml, .gltf, .glb) or model (.obj, .ply)
    #[arg(required_unless_present = "filter_only")]
    pub scene: Option<PathBuf>,
    /// Folder for the results; it is made if missing
    #[arg(short, long, value_name = "FOLDER", default_value = "cost")]
    pub output: PathBuf,
    /// Allocation policies
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "uniform,both")]
    pub allocate: Vec<&'static Policy>,
    /// Filters, as for tallow render --denoise; none is the plain render
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "none,atrous,auto")]
    pub denoise: Vec<Method>,
    /// Samples per pixel
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1,2,4,8,16")]
    pub spp: Vec<u32>,
    /// Rounds of policies that learn; 0 is their own choice
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0")]
    pub rounds: Vec<u32>,
    /// Options of tallow render for all points and the reference, such as "--max-depth 4"; with --filter-only of tallow filter
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true, default_value = "")]
    pub with: String,
    /// Measure everything also with these options, such as "--min-spp 4"; may be given several times
    #[arg(long = "variant", value_name = "OPTIONS", allow_hyphen_values = true)]
    pub variants: Vec<String>,
    /// Runs of each point, each with another seed
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub repeats: u32,
    /// Limit of the whole measurement in minutes; 0 is none
    #[arg(long, value_name = "MINUTES", default_value = "10", value_parser = minutes)]
    pub budget_minutes: f64,
    /// Image to measure errors against, of the scene and the size [default: rendered]
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Most samples per pixel of a reference that is rendered
    #[arg(long, value_name = "N", default_value = "4096", value_parser = clap::value_parser!(u32).range(64..=1 << 24))]
    pub reference_spp: u32,
    /// Chooses the random order of the runs
    #[arg(long, value_name = "N", default_value = "0")]
    pub order_seed: u64,
    /// Measure filters on this image instead of a scene; needs --reference
    #[arg(long, value_name = "IMAGE", requires = "reference", conflicts_with = "scene")]
    pub filter_only: Option<PathBuf>,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Run under the Vulkan validation layers and fail on any message
    #[arg(long)]
    pub validation: bool,
    /// Print the document as one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Size of the film.
    #[command(flatten)]
    pub film: FilmOptions,
}

/// Settings of the film, with their ranges in the help.
#[derive(clap::Args)]
#[command(next_help_heading = "Film", mut_args(with_ranges(Settings::default().entries())))]
pub struct FilmOptions {
    /// Settings of the film.
    #[command(flatten)]
    film: Film,
}

impl FilmOptions {
    /// Replaces the settings that were given.
    pub fn apply(&self, settings: &mut Settings) {
        self.film.apply(settings);
    }
}

impl Args {
    /// The lists of the grid; samples in ascending order.
    pub fn axes(&self) -> Axes {
        let mut spp = self.spp.clone();
        spp.sort_unstable();
        Axes { allocate: self.allocate.clone(), filters: self.denoise.clone(), spp, rounds: self.rounds.clone() }
    }
}

/// Parses options of `tallow render` in one text.
///
/// # Errors
/// [`Error::Usage`].
pub fn overrides(text: &str) -> Result<Overrides> {
    #[derive(Parser)]
    #[command(no_binary_name = true, disable_help_flag = true)]
    struct Words {
        #[command(flatten)]
        overrides: Overrides,
    }
    let parsed = Words::try_parse_from(text.split_whitespace());
    Ok(parsed.map_err(|e| refused(text, "render", &e))?.overrides)
}

/// Options in a text that a command does not take.
pub fn refused(text: &str, command: &str, e: &clap::Error) -> Error {
    let line = e.to_string();
    let line = line.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    Error::Usage(format!("\"{}\": {line} (see tallow {command} --help)", text.trim()))
}

fn minutes(text: &str) -> std::result::Result<f64, String> {
    let value = finite(text)?;
    // A million minutes are two years.
    if (0.0..=1e6).contains(&value) { Ok(value) } else { Err("expected a number of minutes, or 0 for no limit".into()) }
}
