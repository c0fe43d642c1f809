//! Options of `tallow cost`.
use crate::allocate::{AllocateOverrides as Allocate, Policy};
use crate::cli::choices::Choices;
use crate::cli::common::{Common, frames_per_second, with_ranges};
use crate::cli::filter::options as filter;
use crate::cli::overrides::Overrides;
use crate::cli::within;
use crate::cost::grid::Axes;
use crate::denoise::filter::{FilterSettings, Method};
use crate::error::{Error, Result};
use crate::gpu::Tracing;
use crate::render::settings::{Film, Settings};
use crate::render::{Reproject, ReprojectOverrides, Reprojection};
use clap::{Arg, Args as _, Parser};
use std::path::PathBuf;

/// Measure how much time buys how much accuracy, by which method
///
/// Renders a scene by every combination of allocation, filter and samples, in random order, and compares time and error. Writes
/// cost.json (with all raw runs), cost.csv and cost.html. Time is the device's own, without the first run of each kernel. Errors
/// are measured against a reference, which is rendered and kept for the next time unless one is given. Stopped by Ctrl-C or by the
/// budget, the same command goes on where it was.
///
/// Of a scene that moves the image of one frame is judged (--frame), alone and as the end of a sequence whose frames begin with
/// samples of the last (--reproject): time and samples are that frame's.
#[derive(clap::Args)]
#[command(mut_args(as_of_scene))]
pub struct Args {
    /// Scene file (.toml, .gltf, .glb) or model (.obj, .ply)
    #[arg(required_unless_present = "filter_only")]
    pub scene: Option<PathBuf>,
    /// Folder for the results; it is made if missing
    #[arg(short, long, value_name = "FOLDER", default_value = "cost")]
    pub output: PathBuf,
    /// Allocation policies
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        conflicts_with = "filter_only",
        default_value = "uniform,both",
        default_value_if("ablate", "true", "both")
    )]
    pub allocate: Vec<&'static Policy>,
    /// Filters, as for tallow render --denoise; none is the plain render
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "none,atrous,auto",
        default_value_if("ablate", "true", "auto")
    )]
    pub denoise: Vec<Method>,
    /// Samples per pixel
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        conflicts_with = "filter_only",
        default_value = "1,2,4,8,16",
        default_value_if("ablate", "true", "4")
    )]
    pub spp: Vec<u32>,
    /// Rounds of policies that learn; 0 is their own choice
    #[arg(long, value_name = "LIST", value_delimiter = ',', conflicts_with = "filter_only", default_value = "0")]
    pub rounds: Vec<u32>,
    /// Where the scene moves: whether frames begin with samples of the last [default: off,forward where the camera has no lens]
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', conflicts_with = "filter_only")]
    pub reproject: Vec<Reprojection>,
    /// Where the scene moves: the frame whose image is judged. Only its time is told; with --reproject forward up to eight frames are
    /// rendered before it [default: 8]
    #[arg(long, value_name = "N", conflicts_with = "filter_only", value_parser = clap::value_parser!(u32).range(1..))]
    pub frame: Option<u32>,
    /// Where the scene moves: frames per second, such as 24 or 30000/1001
    #[arg(long, conflicts_with = "filter_only", default_value = "24", value_parser = frames_per_second)]
    pub fps: f64,
    /// Options of tallow render or tallow sequence and settings of tallow filter for all points, and of the render for the reference
    /// too, such as "--max-depth 4"; with --filter-only of tallow filter alone
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true, default_value = "")]
    pub with: String,
    /// Measure everything also with these options, such as "--min-spp 4" or "--radius 12"; may be given several times
    #[arg(long = "variant", value_name = "OPTIONS", allow_hyphen_values = true)]
    pub variants: Vec<String>,
    /// Measure everything also with each other value of every knob that it has: what it takes in time, and gives in error [grid:
    /// both + auto, 4 spp, if no lists are given]
    #[arg(long, conflicts_with = "filter_only")]
    pub ablate: bool,
    /// Points of other renderers to put beside: a .csv with the columns method, filter, spp, seed, ms (wall time) and image (a file)
    #[arg(long, value_name = "FILE", conflicts_with = "filter_only")]
    pub points: Option<PathBuf>,
    /// Runs of each point, each with another seed
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub repeats: u32,
    /// Limit of reference and runs in minutes; 0 is none. Missing pictures of a measurement that is taken up again are made after it
    // A million minutes are two years.
    #[arg(long, value_name = "MINUTES", default_value = "10",
        value_parser = within(0.0..=1e6, "a number of minutes, or 0 for no limit"))]
    pub budget_minutes: f64,
    /// Image to measure errors against, of the scene and the size [default: rendered]
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Most samples per pixel of a reference that is rendered; a measurement that goes on keeps the reference that it began with
    #[arg(long, value_name = "N", conflicts_with = "filter_only", default_value = "4096", value_parser = clap::value_parser!(u32).range(64..=1 << 24))]
    pub reference_spp: u32,
    /// Chooses the random order of the runs
    #[arg(long, value_name = "N", default_value = "0")]
    pub order_seed: u64,
    /// Measure filters on this image instead of a scene; needs --reference
    #[arg(long, value_name = "IMAGE", requires = "reference", conflicts_with = "scene")]
    pub filter_only: Option<PathBuf>,
    /// Who finds what rays meet
    #[arg(long, value_enum, default_value_t, conflicts_with = "filter_only")]
    pub tracing: Tracing,
    /// What of a glTF file is seen.
    #[command(flatten)]
    pub choices: Choices,
    /// The device, and what is printed.
    #[command(flatten)]
    pub common: Common,
    /// Size of the film.
    #[command(flatten)]
    pub film: FilmOptions,
}

/// An image that is given leaves nothing to choose of a scene.
fn as_of_scene(arg: Arg) -> Arg {
    if ["camera", "clip"].contains(&arg.get_id().as_str()) { arg.conflicts_with("filter_only") } else { arg }
}

/// Settings of the film, with their ranges in the help.
#[derive(clap::Args)]
#[command(next_help_heading = "Film", mut_args(as_of_film()))]
pub struct FilmOptions {
    /// Settings of the film.
    #[command(flatten)]
    film: Film,
}

/// Ranges of the film's settings, which an image that is given leaves nothing to say. This reaches the options of the grid too, whose
/// lists have names of settings.
fn as_of_film() -> impl FnMut(Arg) -> Arg {
    let film = Film::augment_args(clap::Command::new("film"));
    let is_of_film = move |name: Option<&str>| film.get_arguments().any(|arg| arg.get_long() == name);
    let entries = Settings::default().entries().into_iter().filter(|entry| is_of_film(Some(&*entry.name)));
    let mut ranged = with_ranges(entries.collect());
    move |arg| {
        let arg = ranged(arg);
        if is_of_film(arg.get_long()) { arg.conflicts_with("filter_only") } else { arg }
    }
}

impl FilmOptions {
    /// Replaces the settings that were given.
    pub fn apply(&self, settings: &mut Settings) {
        self.film.apply(settings);
    }
}

impl Args {
    /// The lists of the grid; samples in ascending order.
    pub fn axes(&self, carries: Vec<Option<Reproject>>) -> Axes {
        let mut spp = self.spp.clone();
        spp.sort_unstable();
        let (allocate, filters, rounds) = (self.allocate.clone(), self.denoise.clone(), self.rounds.clone());
        Axes { allocate, filters, spp, rounds, carries }
    }
}

/// Options of `tallow render` and `tallow sequence` and settings of `tallow filter`, parsed from one text.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
pub struct Words {
    #[command(flatten)]
    render: Overrides,
    #[command(flatten)]
    filter: filter::Overrides,
    #[command(flatten)]
    carry: ReprojectOverrides,
}

impl Words {
    /// Parses `text`, in which nothing may stand that the lists of the grid say.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn parse(text: &str) -> Result<Self> {
        let words = Self::try_parse_from(text.split_whitespace()).map_err(|e| refused(text, "render", &e))?;
        let Allocate { policy, rounds, .. } = &words.render.allocate;
        let lists = [
            ("spp", words.render.render.spp.is_some()),
            ("allocate", policy.is_some()),
            ("rounds", rounds.is_some()),
            ("reproject", words.carry.reproject.is_some()),
        ];
        match lists.iter().find(|(_, given)| *given) {
            Some((name, _)) => Err(Error::Usage(format!("\"{}\": give --{name} itself, as a list", text.trim()))),
            None => Ok(words),
        }
    }

    /// Refuses what must be the same for all points: the size, and the seeds that they share.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn checked_as_variant(self, text: &str) -> Result<Self> {
        let Overrides { film, render, sequence, .. } = &self.render;
        let shared = [
            ("width", film.width.is_some()),
            ("height", film.height.is_some()),
            ("seed", render.seed.is_some()),
            ("first-sample", sequence.first_sample.is_some()),
        ];
        match shared.iter().find(|(_, given)| *given) {
            Some((name, _)) => Err(Error::Usage(format!(
                "\"{}\": --{name} is the same for all points; give it in --with",
                text.trim()
            ))),
            None => Ok(self),
        }
    }

    /// Replaces the settings that were given.
    pub fn apply(&self, settings: &mut Settings, filters: &mut FilterSettings, carries: &mut Reproject) {
        self.render.apply(settings);
        *filters = self.filter.settings(*filters);
        self.carry.apply(carries);
    }
}

/// Options in a text that a command does not take.
pub fn refused(text: &str, command: &str, e: &clap::Error) -> Error {
    let line = e.to_string();
    let line = line.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    Error::Usage(format!("\"{}\": {line} (see tallow {command} --help)", text.trim()))
}
