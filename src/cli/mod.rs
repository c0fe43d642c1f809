//! The command line. Each subcommand has a file of its own; this one parses, dispatches and prints.
pub mod checkpoint;
pub mod choices;
pub mod common;
pub mod compare;
pub mod cost;
mod crash;
pub mod devices;
mod elsewhere;
pub mod explain;
pub mod files;
pub mod filter;
pub mod interrupt;
pub mod merge;
pub mod overrides;
pub mod profile;
pub mod progress;
pub mod render;
pub mod sequence;

use crate::error::{Checked, Error, Result};
use crate::gpu::Gpu;
use clap::error::ErrorKind;
use clap::{Arg, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::io::Write;
use std::ops::RangeBounds;
use std::path::Path;
use std::process::ExitCode;

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    a limit given with --max-... or --min-... is exceeded, compare --statistical finds a difference, or a profile has changed
  2    usage: an option or a setting is wrong
  3    input: a file cannot be read or is damaged
  4    device or memory: no Vulkan, no usable device, it was lost, or memory is out
  5    output: a file cannot be written
  6    some points of a measurement, or frames of a sequence, failed, and the others are written; or nothing could be measured in its time
  7    too noisy to say: compare --statistical finds no difference, but could have missed one, or profiles are of other devices or clocks
  70   internal error: a bug, please report it
  130  interrupted (Ctrl-C)";

/// A path tracer for Vulkan.
#[derive(Parser)]
#[command(name = "tallow", version, about, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Render(Box<render::Args>),
    Sequence(Box<sequence::Args>),
    Filter(Box<filter::Args>),
    Compare(Box<compare::Args>),
    Cost(Box<cost::Args>),
    Merge(merge::Args),
    Explain(Box<explain::Args>),
    Profile(Box<profile::Args>),
    Devices(devices::Args),
}

/// How a command ended without an error. The value is the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Everything was done.
    Done = 0,
    /// A limit given by the user was exceeded, or what was to stay the same has changed.
    LimitExceeded = 1,
    /// Some points of a measurement, or frames of a sequence, failed; the others are there.
    PartlyFailed = 6,
    /// A test found nothing, and would have missed what it was to find; or profiles are of devices or clocks that differ.
    Undecided = 7,
    /// The command was stopped by Ctrl-C or another signal.
    Interrupted = 130,
}

/// Runs the command line and returns its exit code. An error is printed in one line on stderr.
pub fn main() -> ExitCode {
    crash::report_panics();
    let words: Vec<_> = std::env::args_os().collect();
    let result = match parse(&words) {
        Ok(cli) => {
            interrupt::install(&interruption(&cli.command));
            run(cli.command)
        }
        Err(e) => usage(&e, &words),
    };
    match result {
        Ok(exit) => ExitCode::from(exit as u8),
        Err(e) => {
            complain(&format!("error: {e}"));
            ExitCode::from(e.exit_code())
        }
    }
}

/// Parses the command line. A negative number is always the value of an option and never an option itself.
fn parse(words: &[OsString]) -> std::result::Result<Cli, clap::Error> {
    let numbers = |arg: Arg| match arg.get_long().is_some() && arg.get_action().takes_values() {
        true => arg.allow_negative_numbers(true),
        false => arg,
    };
    let command = Cli::command().mut_subcommands(|command| command.mut_args(numbers));
    Cli::from_arg_matches(&command.try_get_matches_from(words)?)
}

/// What an interruption says until the command has more to say.
fn interruption(command: &Command) -> String {
    match command {
        Command::Sequence(args) => sequence::interruption(args, "before the first frame"),
        _ => "interrupted: nothing was written".to_owned(),
    }
}

fn run(command: Command) -> Result<Exit> {
    match command {
        Command::Render(args) => render::run(&args),
        Command::Sequence(args) => sequence::run(&args),
        Command::Filter(args) => filter::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Cost(args) => cost::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Profile(args) => profile::run(&args),
        Command::Devices(args) => devices::run(&args),
    }
}

/// What the standard library says of numbers, and what is said here.
const PLAINER: [(&str, &str); 4] = [
    ("invalid digit found in string", "expected a whole number"),
    ("cannot parse integer from empty string", "expected a whole number"),
    ("number too large to fit in target type", "the number is too large"),
    ("number too small to fit in target type", "the number is too small"),
];

/// Prints clap's help or version, or turns its error message into one line with the problem and the tip.
fn usage(e: &clap::Error, words: &[OsString]) -> Result<Exit> {
    let text = e.render().to_string();
    if !e.use_stderr() {
        return print(&text).map(|()| Exit::Done);
    }
    if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return Err(Error::Usage(
            "name a command: render, sequence, filter, compare, cost, merge, explain, profile or devices (see tallow --help)"
                .to_owned(),
        ));
    }
    let one_line = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    let command = Cli::command();
    let subcommand = words.get(1).and_then(|word| command.find_subcommand(word));
    let tip = elsewhere::tip(e, words, &command, subcommand);
    // Of an option that needs another one only the usage says the name.
    let tells = |p: &String| match e.kind() {
        ErrorKind::MissingRequiredArgument => !p.starts_with("For more"),
        _ if p.starts_with("tip:") => tip.is_none() && !p.starts_with("tip: to pass") && !elsewhere::misleads(e),
        _ => !["Usage:", "For more"].iter().any(|words| p.starts_with(words)),
    };
    let parts = text.split("\n\n").map(one_line).filter(tells);
    let message = parts.chain(tip.iter().map(|tip| format!("tip: {tip}"))).collect::<Vec<_>>().join("; ");
    let message = PLAINER.iter().fold(message, |message, (of_rust, here)| message.replace(of_rust, here));
    let message = message.trim_start_matches("error: ");
    let subcommand = subcommand.map_or_else(String::new, |found| format!("{} ", found.get_name()));
    Err(Error::Usage(format!("{message} (see tallow {subcommand}--help)")))
}

/// Escapes control characters, because names in files may contain terminal commands or line breaks.
pub fn readable(text: &str) -> String {
    // These change the direction of the text that follows.
    let turns = |c| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let shown = |c: char| match c.is_control() || turns(c) {
        true => c.escape_default().to_string(),
        false => c.to_string(),
    };
    text.chars().map(shown).collect()
}

/// Writes one line to stderr. A closed stderr is ignored.
pub fn complain(message: &str) {
    let _ = writeln!(std::io::stderr(), "{}", readable(message));
}

/// Writes lines to stdout. A reader that stops early (`| head`) is no error, but a full disk is.
///
/// # Errors
/// [`Error::Output`].
pub fn print(text: &str) -> Result<()> {
    write_out(&text.split('\n').map(readable).collect::<Vec<_>>().join("\n"))
}

/// Prints a value as one line of JSON. Infinities, which JSON cannot express, become null.
///
/// # Errors
/// As [`print()`].
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string(value).map_err(|e| Error::output("standard output", e))?;
    // JSON allows some control characters unescaped that terminals would execute.
    let shown = |c: char| if c.is_control() { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() };
    write_out(&(text.chars().map(shown).collect::<String>() + "\n"))
}

fn write_out(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::output("standard output", format!("{e}"))),
        _ => Ok(()),
    }
}

/// Fails on any message of the validation layers; there are none without `--validation`.
fn fail_on_messages(gpu: &Gpu) -> Result<()> {
    match gpu.validation_messages().first() {
        Some(message) => Err(Error::Device(format!("validation: {message}"))),
        None => Ok(()),
    }
}

/// Checks that a picture in false colours can be written to `path`, which must end in .png.
fn check_png(option: &str, path: &Path) -> Result<()> {
    match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        true => crate::image::check_writable(path),
        false => Err(Error::Usage(format!("{option} {}: false colours go to a .png", path.display()))),
    }
}

/// Parses a finite number, for options where NaN would disable a check.
fn finite(text: &str) -> Checked<f64> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err("expected a finite number".to_owned()),
    }
}

/// Parses a finite number in `range`, which `expected` says in words.
fn within(
    range: impl RangeBounds<f64> + Clone + Send + Sync + 'static,
    expected: &'static str,
) -> impl Fn(&str) -> Checked<f64> + Clone {
    move |text| finite(text).ok().filter(|number| range.contains(number)).ok_or_else(|| format!("expected {expected}"))
}

/// A word that a POSIX shell takes as it is.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::{quoted, readable};

    #[test]
    fn a_shell_takes_quoted_words_as_they_are() {
        assert_eq!(["a/b.toml", "my scene", "it's"].map(quoted), ["a/b.toml", "'my scene'", r"'it'\''s'"]);
    }

    #[test]
    fn nothing_that_a_terminal_obeys_is_printed() {
        assert_eq!(readable("a\u{1b}]0;x\u{7}b\nc\u{9b}d\u{202e}e"), "a\\u{1b}]0;x\\u{7}b\\nc\\u{9b}d\\u{202e}e");
        assert_eq!(readable("wände \"für\" C:\\x '家'"), "wände \"für\" C:\\x '家'");
    }
}
