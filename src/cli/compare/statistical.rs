//! `tallow compare --statistical`: tests whether two renders have the same expectation.
use super::report::{Report, Side};
use super::{check_sizes, evidence, junit, page, words};
use crate::cli::files::check_distinct;
use crate::cli::{Exit, check_png, complain, print, print_json, readable, within};
use crate::error::{Error, Result};
use crate::image::significance::{self, Options, Scale, Verdict};
use crate::image::{self, output};
use clap::Arg;
use serde_json::{Value, json};
use std::ops::Bound::{Excluded, Included};
use std::path::{Path, PathBuf};

/// Options of the metrics.
const OF_METRICS: [&str; 7] = ["layer", "diff", "max_mse", "max_relmse", "max_flip", "min_psnr", "min_ssim"];
/// Options of the test, which require `--statistical`.
const OF_TEST: [&str; 9] = ["false_alarms", "resolve", "at", "accept", "errors", "map", "html", "junit", "evidence"];

/// Keeps options of the test from those of the metrics: beside one of these, which `--statistical` cannot be used with, nobody would be
/// told that it is missing.
pub fn apart(arg: Arg) -> Arg {
    if OF_TEST.contains(&arg.get_id().as_str()) { arg.conflicts_with_all(OF_METRICS) } else { arg }
}

/// Options of the test.
#[derive(clap::Args)]
#[command(next_help_heading = "Test of two renders")]
pub struct Args {
    /// Test whether A and B have the same expectation, given the noise that their layers m2, samples or variance tell of:
    /// by pixels, blocks, objects and as a whole
    #[arg(long, conflicts_with_all = OF_METRICS)]
    pub statistical: bool,
    /// How often images that are the same may be called different
    #[arg(long, value_name = "RATE", default_value_t = Options::default().false_alarms, requires = "statistical",
        value_parser = within((Excluded(0.0), Included(0.3)), "a number above 0, up to 0.3"))]
    false_alarms: f64,
    /// Relative difference, beyond the accepted one, that must be visible, or else the images are too noisy to say
    #[arg(long, value_name = "SHARE", default_value_t = Options::default().resolve, requires = "statistical",
        value_parser = within(Options::LEAST.., "a number of at least 1e-12"))]
    resolve: f64,
    /// Where it must be visible: pixel, 4x4, 16x16, 64x64, 256x256, 1024x1024, object or image
    #[arg(long, value_name = "SCALE", default_value_t = Options::default().at, requires = "statistical")]
    at: Scale,
    /// Relative difference that does not matter
    #[arg(long, value_name = "SHARE", default_value_t = Options::default().accept, requires = "statistical",
        value_parser = within(0.0.., "a number of 0 or more"))]
    accept: f64,
    /// Image of B's standard errors, for a reference that has no variance of its own
    #[arg(long, value_name = "FILE", requires = "statistical")]
    errors: Option<PathBuf>,
    /// Write where the images differ to a .png: orange where A is brighter, blue where it is darker
    #[arg(long, value_name = "FILE", requires = "statistical")]
    map: Option<PathBuf>,
    /// Write the verdict, the images, the map and all figures as one web page
    #[arg(long, value_name = "FILE", requires = "statistical")]
    html: Option<PathBuf>,
    /// Write the verdict as JUnit XML, a test case for each scale
    #[arg(long, value_name = "FILE", requires = "statistical")]
    junit: Option<PathBuf>,
    /// Unless the images are the same, write them, the map, the page, all figures and commands that render the worst pixels
    /// again to this folder; what an earlier comparison left there, as its report.json lists, goes once they are
    #[arg(long, value_name = "FOLDER", requires = "statistical")]
    evidence: Option<PathBuf>,
}

/// Runs the test.
///
/// # Errors
/// When a file cannot be read or written, does not tell its noise, or sizes differ.
pub fn run(a: &Path, b: &Path, json: bool, args: &Args) -> Result<Exit> {
    check_outputs(a, b, args)?;
    let sides = [Side::read(a, None)?, Side::read(b, args.errors.as_deref())?];
    let [of_a, of_b] = sides.each_ref().map(|side| side.film.foreign_primaries());
    if of_a != of_b {
        let what =
            "has other primaries than the first image, and variances cannot be converted: render both in the same";
        return Err(Error::input(b, what));
    }
    let [a_size, b_size] = sides.each_ref().map(|side| side.film.size());
    check_sizes((a, a_size), (b, b_size))?;
    image::check_memory(a, sides[0].film.pixels() as u64 * BYTES_PER_PIXEL)?;
    let options = Options { false_alarms: args.false_alarms, accept: args.accept, resolve: args.resolve, at: args.at };
    let [a_estimate, b_estimate] = sides.each_ref().map(|side| &side.estimate);
    let outcome = significance::test(a_estimate, b_estimate, &options).map_err(|what| Error::input(a, what))?;
    let report = Report { sides: &sides, options, outcome };
    let full = args.map.as_ref().map(|path| report.write_map(path)).transpose()?;
    if let Some(path) = &args.junit {
        output::write(path, junit::text(&report)?.as_bytes())?;
    }
    if let Some(path) = &args.html {
        output::write(path, page::html(&report).as_bytes())?;
    }
    let failed = failed(&report);
    match &args.evidence {
        Some(folder) if failed => evidence::write(folder, &report)?,
        Some(folder) => evidence::clear(folder, [a, b])?,
        None => {}
    }
    if json {
        print_json(&summary(&report, args, full))?;
    } else {
        print(&text(&report, args, full))?;
    }
    if failed {
        complain(&words::verdict(&report));
    }
    Ok(match report.outcome.verdict {
        Verdict::Same { .. } => Exit::Done,
        Verdict::Different => Exit::LimitExceeded,
        Verdict::TooNoisy { .. } => Exit::Undecided,
    })
}

/// Whether the images are not known to be the same, so that evidence is written.
fn failed(report: &Report) -> bool {
    !matches!(report.outcome.verdict, Verdict::Same { .. })
}

/// Bytes per pixel that a test takes in addition to the images: p-values, errors and a map for every scale.
const BYTES_PER_PIXEL: u64 = 120;

fn check_outputs(a: &Path, b: &Path, args: &Args) -> Result<()> {
    let mut outputs: Vec<(&str, &Path)> = Vec::new();
    if let Some(map) = &args.map {
        check_png("--map", map)?;
        outputs.push(("--map", map));
    }
    for (option, path) in [("--junit", &args.junit), ("--html", &args.html)] {
        if let Some(path) = path {
            output::check(path)?;
            outputs.push((option, path));
        }
    }
    let evidence = args.evidence.as_ref().map_or_else(Vec::new, |folder| evidence::touched(folder, [a, b]));
    for path in &evidence {
        outputs.push(("--evidence", path));
    }
    let mut inputs = vec![("A", a), ("B", b)];
    inputs.extend(args.errors.as_deref().map(|errors| ("--errors", errors)));
    check_distinct(&outputs, &inputs)?;
    if let Some(folder) = &args.evidence {
        evidence::check(folder, [a, b])?;
    }
    Ok(())
}

fn summary(report: &Report, args: &Args, full: Option<f32>) -> Value {
    let mut figures = report.figures();
    let text = |path: &Path| path.display().to_string();
    let map = args.map.as_ref().zip(full).map(|(path, full)| json!({ "file": text(path), "full": full }));
    figures["map"] = json!(map);
    figures["evidence"] = json!(args.evidence.as_deref().filter(|_| failed(report)).map(text));
    figures
}

fn text(report: &Report, args: &Args, full: Option<f32>) -> String {
    let mut text = String::new();
    if let Verdict::Same { .. } = report.outcome.verdict {
        text += &format!("{}\n", words::verdict(report));
    }
    let filtered = words::filtered(report);
    text.extend(filtered.iter().map(|sentence| format!("{}\n", readable(sentence))));
    if report.equal() {
        let what = if filtered.is_empty() { "images" } else { "means of the samples" };
        text += &format!("the {what} are equal bit for bit\n");
    }
    if report.outcome.left_out > 0 {
        text += &format!("{} pixels with fewer than two samples were left out\n", report.outcome.left_out);
    }
    text += &words::tables(&report.outcome);
    if let Some((path, full)) = args.map.as_ref().zip(full) {
        let (path, full) = (readable(&path.display().to_string()), words::percent(full.into()));
        text += &format!(
            "{path}: orange where A is brighter than B, blue where it is darker; full colour from {full} on\n"
        );
    }
    text
}
