//! `tallow compare --statistical`: tests whether two renders have the same expectation.
use super::{check_sizes, evidence, junit, page, words};
use crate::cli::files::check_distinct;
use crate::cli::{Exit, check_png, complain, finite, print, print_json, readable};
use crate::error::{Error, Result};
use crate::image::significance::{self, Estimate, Options, Outcome, Scale, Verdict, overlay};
use crate::image::{self, Film, Picture, WriteOptions, output};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of the test.
#[derive(clap::Args)]
#[command(next_help_heading = "Test of two renders")]
pub struct Args {
    /// Test whether A and B have the same expectation, given the noise that their layers m2, samples or variance tell of:
    /// by pixels, blocks, objects and as a whole
    #[arg(long, conflicts_with_all = ["layer", "diff", "Limits"])]
    pub statistical: bool,
    /// How often images that are the same may be called different
    #[arg(long, value_name = "RATE", value_parser = rate, default_value_t = Options::default().false_alarms, requires = "statistical")]
    false_alarms: f64,
    /// Relative difference, beyond the accepted one, that must be visible, or else the images are too noisy to say
    #[arg(long, value_name = "SHARE", value_parser = above_0, default_value_t = Options::default().resolve, requires = "statistical")]
    resolve: f64,
    /// Where it must be visible: pixel, 4x4, 16x16, 64x64, 256x256, 1024x1024, object or image
    #[arg(long, value_name = "SCALE", default_value_t = Options::default().at, requires = "statistical")]
    at: Scale,
    /// Relative difference that does not matter
    #[arg(long, value_name = "SHARE", value_parser = from_0, default_value_t = Options::default().accept, requires = "statistical")]
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
    /// again to this folder
    #[arg(long, value_name = "FOLDER", requires = "statistical")]
    evidence: Option<PathBuf>,
}

/// One of the two images.
pub struct Side {
    /// Where it was read.
    pub path: PathBuf,
    /// All of it.
    pub film: Film,
    /// What it says of its expectation.
    pub estimate: Estimate,
}

/// All that was found.
pub struct Report<'a> {
    /// The images A and B.
    pub sides: &'a [Side; 2],
    /// What was asked.
    pub options: Options,
    /// What was found.
    pub outcome: Outcome,
}

/// Runs the test.
///
/// # Errors
/// When a file cannot be read or written, does not tell its noise, or sizes differ.
pub fn run(a: &Path, b: &Path, json: bool, args: &Args) -> Result<Exit> {
    check_outputs(a, b, args)?;
    let sides = [side(a, None)?, side(b, args.errors.as_deref())?];
    let [a_colour, b_colour] = sides.each_ref().map(Side::picture);
    check_sizes((a, &a_colour), (b, &b_colour))?;
    image::check_memory(a, a_colour.pixels.len() as u64 * BYTES_PER_PIXEL)?;
    let options = Options { false_alarms: args.false_alarms, accept: args.accept, resolve: args.resolve, at: args.at };
    let [a_estimate, b_estimate] = sides.each_ref().map(|side| &side.estimate);
    let outcome = significance::test(a_estimate, b_estimate, &options).map_err(|what| Error::input(a, what))?;
    let report = Report { sides: &sides, options, outcome };
    let full = args.map.as_ref().map(|path| report.write_map(path)).transpose()?;
    args.junit.as_ref().map_or(Ok(()), |path| output::write(path, junit::text(&report)?.as_bytes()))?;
    args.html.as_ref().map_or(Ok(()), |path| output::write(path, page::html(&report).as_bytes()))?;
    let failed = !matches!(report.outcome.verdict, Verdict::Same { .. });
    let folder = args.evidence.as_ref().filter(|_| failed);
    folder.map_or(Ok(()), |folder| evidence::write(folder, &report))?;
    match json {
        true => print_json(&report.json(args, full))?,
        false => print(&report.text(args, full))?,
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
    let mut inputs = vec![("A", a), ("B", b)];
    inputs.extend(args.errors.as_deref().map(|errors| ("--errors", errors)));
    check_distinct(&outputs, &inputs)?;
    args.evidence.as_ref().map_or(Ok(()), |folder| evidence::check(folder))
}

fn side(path: &Path, errors: Option<&Path>) -> Result<Side> {
    let film = image::read(path)?;
    let estimate = match errors {
        None => Estimate::of_film(&film).map_err(|what| Error::input(path, what)),
        Some(file) => {
            let errors = image::read(file)?.picture(None).map_err(|what| Error::input(file, what))?;
            Estimate::with_errors(&film, &errors).map_err(|what| Error::input(file, what))
        }
    }?;
    Ok(Side { path: path.to_owned(), film, estimate })
}

impl Side {
    /// The means that were tested.
    pub fn picture(&self) -> Picture {
        let Estimate { width, height, mean, .. } = &self.estimate;
        Picture { width: *width, height: *height, pixels: mean.clone() }
    }

    /// What the file says of where it was rendered.
    pub fn origin(&self) -> Value {
        const KEYS: [&str; 8] =
            ["software", "scene", "sceneFingerprint", "device", "driver", "cpu", "sampleRanges", "settings"];
        let said = |key: &str| Some((key.to_owned(), Value::from(self.film.metadata.get(key)?.clone())));
        let mut origin: serde_json::Map<_, _> = KEYS.iter().filter_map(|key| said(key)).collect();
        origin.insert("file".to_owned(), json!(self.path));
        Value::Object(origin)
    }
}

impl Report<'_> {
    /// Whether both images are equal bit for bit.
    fn equal(&self) -> bool {
        self.sides[0].estimate.mean == self.sides[1].estimate.mean
    }

    /// Writes the map and returns the relative difference of full colours.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write_map(&self, path: &Path) -> Result<f32> {
        let overlay = overlay(&self.outcome, &self.sides[1].picture());
        write_png(path, &overlay.picture)?;
        Ok(overlay.full)
    }

    /// All figures.
    pub fn figures(&self) -> Value {
        json!({
            "equal": self.equal(),
            "a": self.sides[0].origin(),
            "b": self.sides[1].origin(),
            "options": self.options,
            "outcome": self.outcome,
        })
    }

    fn json(&self, args: &Args, full: Option<f32>) -> Value {
        let mut figures = self.figures();
        figures["map"] = json!(args.map.as_ref().zip(full).map(|(path, full)| json!({ "file": path, "full": full })));
        figures["evidence"] = json!(args.evidence);
        figures
    }

    fn text(&self, args: &Args, full: Option<f32>) -> String {
        let mut text = String::new();
        if let Verdict::Same { .. } = self.outcome.verdict {
            text += &format!("{}\n", words::verdict(self));
        }
        if self.equal() {
            text += "the images are equal bit for bit\n";
        }
        if self.outcome.left_out > 0 {
            text += &format!("{} pixels with fewer than two samples were left out\n", self.outcome.left_out);
        }
        text += &words::tables(&self.outcome);
        if let Some((path, full)) = args.map.as_ref().zip(full) {
            let (path, full) = (readable(&path.display().to_string()), words::percent(full.into()));
            text += &format!(
                "{path}: orange where A is brighter than B, blue where it is darker; full colour from {full} on\n"
            );
        }
        text
    }
}

/// Writes linear colours to a .png.
///
/// # Errors
/// [`Error::Output`].
pub fn write_png(path: &Path, picture: &Picture) -> Result<()> {
    let mut film = Film::new(picture.width, picture.height);
    film.add_vec3("", ["R", "G", "B"], &picture.pixels);
    image::write(path, &film, &WriteOptions::default())
}

fn rate(text: &str) -> std::result::Result<f64, String> {
    finite(text)
        .ok()
        .filter(|rate| *rate > 0.0 && *rate <= 0.3)
        .ok_or_else(|| "expected a number above 0, up to 0.3".to_owned())
}

fn above_0(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|share| *share > 0.0).ok_or_else(|| "expected a number above 0".to_owned())
}

fn from_0(text: &str) -> std::result::Result<f64, String> {
    finite(text).ok().filter(|share| *share >= 0.0).ok_or_else(|| "expected a number of 0 or more".to_owned())
}
