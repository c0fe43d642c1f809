//! What options and commands of other programs are called here: the known words that are most like theirs by the letters lead astray.
use super::quoted;
use crate::image;
use crate::scene::SceneFile;
use clap::Command;
use clap::error::{ContextKind, ContextValue, Error};
use std::path::Path;

/// Of a command line that clap refuses, what the word that it does not know stands for. `subcommand` is the one that was named.
pub fn tip(e: &Error, subcommand: Option<&Command>) -> Option<String> {
    let word = |kind| match e.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    match (word(ContextKind::InvalidSubcommand), word(ContextKind::InvalidArg), subcommand) {
        (Some(word), ..) => of_command(word),
        (_, Some(word), Some(subcommand)) => of_option(word, subcommand),
        _ => None,
    }
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

/// Only such as the command has.
fn of_option(word: &str, command: &Command) -> Option<String> {
    let has = |name: &str| command.get_arguments().any(|arg| arg.get_long() == Some(name));
    let here: &[&str] = match word {
        "--samples" | "--sample-count" | "--samples-per-pixel" => &["spp"],
        "--bounces" | "--max-bounces" | "--depth" | "--ray-depth" => &["max-depth"],
        "--size" | "--resolution" | "--res" | "--dimensions" => &["width", "height"],
        "--gpu" | "--adapter" => &["device"],
        "--threshold" | "--tolerance" | "--max-error" => &["max-mse", "max-relmse", "max-flip", "min-psnr", "min-ssim"],
        "--time-limit" | "--timeout" | "--budget" => &["time"],
        "--start" | "--end" | "--start-frame" | "--end-frame" => &["frames"],
        file if !file.starts_with('-') && writes(command, file) => {
            return Some(format!("what is written is named by -o {}", quoted(file)));
        }
        _ => return None,
    };
    let names = here.iter().map(|name| format!("--{name}")).collect::<Vec<_>>().join(", ");
    here.iter().all(|name| has(name)).then(|| format!("here that is {names}"))
}
