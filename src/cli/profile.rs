//! `tallow profile`: where a frame's time goes, how near its passes are to what the device can do, and what changed.
mod fresh;
mod text;

use super::choices::Choices;
use super::common::Common;
use super::files::{Files, Item, check_distinct};
use super::overrides::Overrides;
use super::{Exit, print, print_json};
use crate::denoise::filter::Method;
use crate::error::{Error, Result};
use crate::gpu::Tracing;
use crate::image::output;
use crate::profile::{Comparison, Profile, Verdict};
use fresh::Fresh;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Show where the time of a frame goes, and what changed since an earlier profile
///
/// A frame is all of a render at the scene's settings, with the filter behind it. Bytes and operations are counted from the kernels
/// and what they bind, and set beside the fastest copy and the fastest arithmetic that the device is seen to do; "+" marks what is
/// more than was counted. Options override the settings of the scene file; defaults are for what it does not set.
#[derive(clap::Args)]
#[command(
    mut_arg("validation", |arg| arg.help("Run under the Vulkan validation layers and fail on any message; times mean little \
                                          then")),
    mut_arg("json", |arg| arg.help("Print one JSON object: --compare reads it")),
    mut_arg("quiet", |arg| arg.help("Print nothing but errors and, with --compare, the verdict")),
)]
pub struct Args {
    /// Scene file (.toml, .gltf, .glb), model (.obj, .ply), or the .json of an earlier profile, to compare it without another run
    pub scene: PathBuf,
    /// Frames to time, and as many more without timestamps; 20 and more for a 95th percentile [default: 20]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    pub frames: Option<u16>,
    /// Compare with an earlier profile of the scene and the settings that --json printed: exit code 1 when something changed by
    /// more than its noise, 7 when that cannot be said
    #[arg(long, value_name = "FILE")]
    pub compare: Option<PathBuf>,
    /// Write the times of every frame to a .csv
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write a trace of CPU and GPU for Perfetto
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
    /// Filter every frame
    #[arg(long, value_name = "FILTER")]
    pub denoise: Option<Method>,
    /// Who finds what rays meet [default: auto]
    #[arg(long, value_enum)]
    pub tracing: Option<Tracing>,
    /// What of a glTF file is seen.
    #[command(flatten)]
    pub choices: Choices,
    /// The device, and what is printed.
    #[command(flatten)]
    pub common: Common,
    /// Replace the scene's own settings.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    profile: &'a Profile,
    /// What was repaired in the scene; empty for an earlier profile.
    warnings: &'a [String],
    /// Only with `--compare`.
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<&'a Comparison>,
}

/// Runs the subcommand.
///
/// # Errors
/// As a render of the scene, [`Error::Input`] for a profile that cannot be read, [`Error::Usage`] for one of something else,
/// [`Error::Output`].
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    let old = args.compare.as_deref().map(Profile::read).transpose()?;
    let Fresh { profile, trace, warnings } = if args.is_earlier() {
        Fresh { profile: Profile::read(&args.scene)?, trace: None, warnings: Vec::new() }
    } else {
        fresh::profile(args, old.as_ref())?
    };
    let comparison = old.map(|old| Comparison::new(&old, &profile)).transpose()?;
    let csv = args.csv.iter().map(|path| Item::bytes(path.clone(), text::csv(&profile).into_bytes()));
    let trace = args.trace.iter().zip(trace).map(|(path, trace)| Item::bytes(path.clone(), trace.into_bytes()));
    let items: Vec<_> = csv.chain(trace).collect();
    let mut files = Files::default();
    files.save(&items, true);
    report(args, &profile, &warnings, comparison.as_ref())?;
    files.pipe(&items, true);
    files.check()?;
    Ok(match comparison.map(|found| found.verdict) {
        Some(Verdict::Changed) => Exit::LimitExceeded,
        Some(Verdict::Inconclusive) => Exit::Undecided,
        Some(Verdict::Same) | None => Exit::Done,
    })
}

impl Args {
    /// Whether the "scene" is a profile that was made before.
    fn is_earlier(&self) -> bool {
        self.scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
    }

    /// What is written, by its option.
    fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let csv = self.csv.iter().map(|path| ("--csv", path.as_path()));
        csv.chain(self.trace.iter().map(|path| ("--trace", path.as_path())))
    }

    /// Whether an option is given that only frames which run now can follow.
    fn says_how_to_render(&self) -> bool {
        let Self { frames, denoise, common: Common { device, validation, .. }, tracing, choices, overrides, .. } = self;
        let options = [frames.is_some(), denoise.is_some(), device.is_some(), tracing.is_some(), *validation];
        options.contains(&true) || *choices != Choices::default() || *overrides != Overrides::default()
    }
}

/// What cannot be written or followed is told before frames are run.
fn check_outputs(args: &Args) -> Result<()> {
    if args.is_earlier() && args.trace.is_some() {
        return Err(Error::Usage("a trace is of frames that run now: give --trace with a scene".to_owned()));
    }
    if args.is_earlier() && args.says_how_to_render() {
        return Err(Error::Usage(format!(
            "{}: of an earlier profile no frames run: leave out --frames, --denoise, --device, --tracing, --validation, --camera, \
             --clip and settings such as --spp, or give the scene",
            args.scene.display()
        )));
    }
    let outputs: Vec<_> = args.outputs().collect();
    outputs.iter().try_for_each(|(_, path)| output::check(path))?;
    let compare = args.compare.iter().map(|path| ("--compare", path.as_path()));
    let inputs: Vec<_> = [("the scene", args.scene.as_path())].into_iter().chain(compare).collect();
    check_distinct(&outputs, &inputs)
}

fn report(args: &Args, profile: &Profile, warnings: &[String], comparison: Option<&Comparison>) -> Result<()> {
    if args.common.json {
        return print_json(&Report { profile, warnings, comparison });
    }
    let of_profile = if args.common.quiet { String::new() } else { text::of_profile(profile) };
    let of_comparison = comparison.map_or_else(String::new, |found| text::of_comparison(found, args.common.quiet));
    print(&(of_profile + &of_comparison))
}
