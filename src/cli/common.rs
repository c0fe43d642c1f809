//! Options shared by commands that run on a device or write pictures.
use super::{complain, finite, print, print_json, quoted};
use crate::error::{Checked, Result};
use crate::gpu::{self, DeviceOptions, Gpu, Tracing};
use crate::image::{WriteOptions, tone::ToneMap};
use crate::settings::entry::Entry;
use clap::{Arg, ArgAction};
use serde::Serialize;

/// Adds range, default and placeholder to the help of the options for the settings in `defaults`. An option whose help
/// already states its default keeps it.
pub fn with_ranges(defaults: Vec<Entry>) -> impl FnMut(Arg) -> Arg {
    move |arg| {
        let entry = defaults.iter().find(|e| arg.get_long() == Some(&*e.name));
        let (Some(entry), Some(help)) = (entry, arg.get_help()) else { return arg };
        let Entry { value, range, placeholder, .. } = entry;
        if entry.is_switch {
            return arg.action(ArgAction::SetTrue);
        }
        let range = if range.is_empty() { String::new() } else { format!(" [{range}]") };
        let own = help.to_string().contains("[default");
        let default = if own { String::new() } else { format!(" [default: {value}]") };
        let help = format!("{help}{range}{default}");
        let arg = arg.help(help);
        if placeholder.is_empty() { arg } else { arg.value_name(*placeholder) }
    }
}

/// Options for the device and for what is printed.
#[derive(Clone, clap::Args)]
pub struct Common {
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Run under the Vulkan validation layers and fail on any message
    #[arg(long)]
    pub validation: bool,
    /// Print one JSON object at the end. Without a result nothing goes to stdout: the exit code and stderr say why
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

impl Common {
    /// Whether to print a table and warnings.
    pub fn talkative(&self) -> bool {
        !self.quiet && !self.json
    }

    /// Takes warnings, and prints each unless only the result is wanted.
    pub fn warnings(&self) -> Warnings {
        Warnings::new(self.talkative())
    }

    /// Prints what a command found: `found` as JSON or `text`, or nothing.
    ///
    /// # Errors
    /// As [`print()`].
    pub fn report(&self, found: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
        match (self.json, self.quiet) {
            (true, _) => print_json(found),
            (false, true) => Ok(()),
            (false, false) => print(&text()),
        }
    }

    /// The option that selects the device, for a printed command that is to run there too; empty where none is given.
    pub fn device_words(&self) -> String {
        self.device.as_ref().map_or(String::new(), |device| format!(" --device {}", quoted(device)))
    }

    /// Opens the device that the options select, to trace rays as `tracing` says. What is compiled is kept for the next run.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn open(&self, tracing: Tracing) -> Result<Gpu> {
        let (device, validation, cache) = (self.device.clone(), self.validation, gpu::cache_folder());
        Gpu::open(&DeviceOptions { device, validation, cache, tracing, ..DeviceOptions::default() })
    }
}

/// What a command has warned of so far: lines on stderr, and a list in its JSON.
pub struct Warnings {
    is_printed: bool,
    place: String,
    all: Vec<String>,
}

impl Warnings {
    /// None so far; whether each is printed, too.
    pub fn new(is_printed: bool) -> Self {
        Self { is_printed, place: String::new(), all: Vec::new() }
    }

    /// From here on all of them are of this place, which stands before each: a frame of a sequence.
    pub fn are_of(&mut self, place: String) {
        self.place = place + ": ";
    }

    /// Warns of what is odd.
    pub fn add(&mut self, warnings: impl IntoIterator<Item = String>) {
        warnings.into_iter().for_each(|warning| self.take(&warning, self.is_printed));
    }

    /// Warns of what is wrong with the result, or would lose it: that is printed with `--quiet` and `--json`, too.
    pub fn insist(&mut self, warnings: impl IntoIterator<Item = String>) {
        warnings.into_iter().for_each(|warning| self.take(&warning, true));
    }

    fn take(&mut self, warning: &str, is_printed: bool) {
        let warning = format!("{}{warning}", self.place);
        if is_printed {
            complain(&format!("warning: {warning}"));
        }
        self.all.push(warning);
    }

    /// Warns of options that were given and change nothing, because `name`, the policy or filter that was chosen, does not read them.
    pub fn add_unread(&mut self, given: Vec<String>, name: &str, reads: impl Fn(&str) -> bool) {
        let unread = given.into_iter().filter(|option| !reads(option));
        self.add(unread.map(|option| format!("--{option} changes nothing: {name} does not read it")));
    }

    /// All of them, in the order in which they came.
    pub fn all(&self) -> &[String] {
        &self.all
    }
}

/// How .png files show radiance.
#[derive(Clone, clap::Args)]
pub struct PngOptions {
    /// Exposure of PNG files in stops
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = finite)]
    pub exposure: f64,
    /// Tone curve of PNG files
    #[arg(long, value_enum, default_value_t)]
    pub tonemap: ToneMap,
}

impl PngOptions {
    /// How radiance is converted.
    pub fn write_options(&self) -> WriteOptions {
        WriteOptions { exposure: self.exposure as f32, tone_map: self.tonemap }
    }
}

/// Parses frames per second, a number or a fraction.
///
/// # Errors
/// A sentence with what is expected.
pub fn frames_per_second(text: &str) -> Checked<f64> {
    let fps = match text.split_once('/') {
        Some((frames, seconds)) => finite(frames)? / finite(seconds)?,
        None => finite(text)?,
    };
    match fps > 0.0 && fps <= 1e6 {
        true => Ok(fps),
        false => Err("choose a number above 0, at most 1000000".to_owned()),
    }
}
