//! What options and commands of other programs are called here: the known words that are most like theirs by the letters lead astray.
use super::quoted;
use crate::image;
use crate::scene::SceneFile;
use clap::Command;
use clap::error::{ContextKind, ContextValue, Error};
use std::ffi::OsString;
use std::path::Path;

/// Of a command line that clap refuses, what the one of its `words` that it does not know stands for. `all` has all commands, of which
/// `subcommand` is the one that was named.
pub fn tip(e: &Error, words: &[OsString], all: &Command, subcommand: Option<&Command>) -> Option<String> {
    let word = |kind| match e.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    match (word(ContextKind::InvalidSubcommand), word(ContextKind::InvalidArg), subcommand) {
        (Some(word), ..) => of_command(word),
        (_, Some("--list-devices"), _) => Some("here that is tallow devices".to_owned()),
        (_, Some(word), Some(subcommand)) => of_file(word, words).or_else(|| of_option(word, subcommand)),
        (_, Some(word), None) => of_no_command(word, all),
        _ => None,
    }
}

/// Whether the option that clap takes for the most like one that is not known is no typing mistake: of "--verbose" it is "--denoise" or
/// "--version", while nothing here prints more than it does.
pub fn misleads(e: &Error) -> bool {
    let (Some(ContextValue::String(word)), Some(ContextValue::String(near))) =
        (e.get(ContextKind::InvalidArg), e.get(ContextKind::SuggestedArg))
    else {
        return false;
    };
    let [word, near] = [word, near].map(|option| option.trim_start_matches('-'));
    word == "verbose" || strsim::jaro_winkler(word, near) < LEAST_LIKENESS
}

/// Options that are less alike, from 0 to 1, are not taken for one another: "verbose" and "denoise" have .71, "max-samples" and "max-spp" .88.
const LEAST_LIKENESS: f64 = 0.8;

/// Of a file whose name begins as an option does, of which clap tells the first letter alone.
fn of_file(option: &str, words: &[OsString]) -> Option<String> {
    let is_file = |name: &str| image::is_written(Path::new(name)) || SceneFile::is_named(Path::new(name));
    let is_it = |name: &&str| option.starts_with('-') && name.starts_with(option) && is_file(name);
    let name = words.iter().filter_map(|word| word.to_str()).find(is_it)?;
    Some(format!("a file of such a name is {}", quoted(&format!("./{name}"))))
}

fn of_command(word: &str) -> Option<String> {
    let here = match word {
        "denoise" => "filter",
        "convert" | "tonemap" => "filter --filter none",
        "diff" | "flip" => "compare",
        "animate" => "sequence",
        "bench" | "benchmark" => "profile (tallow cost for filters and policies)",
        "info" => "devices, or tallow explain for a scene",
        "version" => "--version",
        file if is_scene(Path::new(file)) => return Some(format!("to render it, tallow render {}", quoted(file))),
        _ => return None,
    };
    Some(format!("here that is tallow {here}"))
}

/// A file that `tallow render` would read.
fn is_scene(path: &Path) -> bool {
    path.is_file() && SceneFile::is_named(path)
}

/// Whether the command writes images of such a name.
fn writes(command: &Command, name: &str) -> bool {
    image::is_written(Path::new(name))
        && match command.get_name() {
            "render" | "filter" => true,
            "sequence" => name.contains('#'),
            _ => false,
        }
}

/// What an option of another program is called here; nothing for what none is known to have.
fn called(word: &str) -> &'static [&'static str] {
    match word {
        "--samples" | "--sample-count" | "--samples-per-pixel" => &["spp"],
        "--bounces" | "--max-bounces" | "--depth" | "--ray-depth" => &["max-depth"],
        "--size" | "--resolution" | "--res" | "--dimensions" => &["width", "height"],
        "--gpu" | "--adapter" => &["device"],
        "--threshold" | "--tolerance" | "--max-error" => &["max-mse", "max-relmse", "max-flip", "min-psnr", "min-ssim"],
        "--time-limit" | "--timelimit" | "--max-time" | "--timeout" | "--budget" => &["time"],
        "--out" | "--outfile" | "--output-file" | "--image" => &["output"],
        "--silent" => &["quiet"],
        "--start" | "--end" | "--start-frame" | "--end-frame" | "--frame" => &["frames"],
        _ => &[],
    }
}

fn has(command: &Command, name: &str) -> bool {
    command.get_arguments().any(|arg| arg.get_long() == Some(name))
}

fn listed(names: &[&str]) -> String {
    names.iter().map(|name| format!("--{name}")).collect::<Vec<_>>().join(", ")
}

/// Only such as the command has.
fn of_option(word: &str, command: &Command) -> Option<String> {
    if !word.starts_with('-') && writes(command, word) {
        return Some(format!("what is written is named by -o {}", quoted(word)));
    }
    let own = [word.trim_start_matches('-')];
    let here = match word {
        "--frames" | "--fps" | "--turntable" => &own,
        _ => called(word),
    };
    if command.get_name() == "render" && ["frames", "fps", "turntable"].iter().any(|name| here == [*name]) {
        return Some(format!("here that is tallow sequence {}", listed(here)));
    }
    (!here.is_empty() && here.iter().all(|name| has(command, name))).then(|| format!("here that is {}", listed(here)))
}

/// Of an option that stands before any command, the first command that has it.
fn of_no_command(word: &str, all: &Command) -> Option<String> {
    let own = [word.strip_prefix("--").unwrap_or_default()];
    let names = Some(called(word)).filter(|here| !here.is_empty()).unwrap_or(&own);
    let short = word.strip_prefix('-').and_then(|rest| rest.chars().next());
    let is_short = |command: &Command| command.get_arguments().any(|arg| short.is_some() && arg.get_short() == short);
    let by_name = all.get_subcommands().find(|command| names.iter().all(|name| has(command, name)));
    let (command, option) = match by_name {
        Some(command) => (command, listed(names)),
        None => (all.get_subcommands().find(|command| is_short(command))?, word.to_owned()),
    };
    Some(format!("a command comes first: tallow {} has {option}", command.get_name()))
}
