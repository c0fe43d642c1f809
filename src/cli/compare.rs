//! `tallow compare`: measures how far an image is from its reference, or tests whether both have one expectation.
mod evidence;
mod junit;
mod page;
mod replay;
mod report;
mod statistical;
mod words;

use super::common::Warnings;
use super::files::check_distinct;
use super::{Exit, check_png, complain, finite, print, print_json, readable, within};
use crate::error::{Error, Result};
use crate::image::difference::heat_map;
use crate::image::metrics::{self, Metrics};
use crate::image::{self, Picture};
use crate::report::table;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Compare an image with its reference: MSE, relMSE, PSNR, SSIM and FLIP
///
/// MSE and relMSE, the mean of (a - b)^2 / (b^2 + 0.01), are taken on linear values; PSNR (peak 1), SSIM and FLIP on
/// the sRGB-encoded images cut to [0, 1]. With --statistical, two renders are tested instead for a difference that their noise
/// does not explain; exit code 0 says that they are the same, 1 that they differ, 7 that they are too noisy to say.
#[derive(clap::Args)]
#[command(mut_args(statistical::apart))]
pub struct Args {
    /// Image to judge (EXR, PNG, JPEG, HDR, TGA or BMP)
    a: PathBuf,
    /// Its reference
    b: PathBuf,
    /// Layer to compare, such as albedo, N or Z, as it is stored [default: the colour, as Rec. 709]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Write |A - B| in false colours to a .png
    #[arg(long, value_name = "FILE")]
    diff: Option<PathBuf>,
    /// Print one JSON object. Of equal images PSNR is infinite, which JSON cannot hold: "psnr" is null, and so is
    /// "ssim" of images under 11x11 pixels
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
    #[command(flatten)]
    test: statistical::Args,
}

/// Limits of the metrics. One that is exceeded gives a line on stderr and exit code 1.
#[derive(clap::Args)]
#[command(next_help_heading = "Limits (exit code 1 when exceeded)")]
struct Limits {
    /// Largest mean squared error
    #[arg(long, value_name = "N", value_parser = within(0.0.., "a number of 0 or more"))]
    max_mse: Option<f64>,
    /// Largest relative mean squared error
    #[arg(long, value_name = "N", value_parser = within(0.0.., "a number of 0 or more"))]
    max_relmse: Option<f64>,
    /// Largest mean FLIP error, 0 to 1
    #[arg(long, value_name = "N", value_parser = within(0.0..=1.0, "a number from 0 to 1"))]
    max_flip: Option<f64>,
    /// Smallest peak signal-to-noise ratio in dB
    #[arg(long, value_name = "DB", value_parser = finite)]
    min_psnr: Option<f64>,
    /// Smallest structural similarity, -1 to 1
    #[arg(long, value_name = "N", value_parser = within(-1.0..=1.0, "a number from -1 to 1"))]
    min_ssim: Option<f64>,
}

/// Bytes per pixel that the metrics take in addition to the two pictures; 118 were measured at 1024 x 1024.
const BYTES_PER_PIXEL: u64 = 125;

/// Share of the pixels in which the metrics of what is shown may miss a difference before that is told.
const UNSEEN: f64 = 0.5;

fn words_of_unseen(share: f64) -> String {
    format!(
        "{:.0} % of the pixels differ beyond 0 and 1, where PSNR, SSIM and FLIP see nothing: go by MSE and relMSE",
        100.0 * share
    )
}

/// Runs the subcommand.
///
/// # Errors
/// When a file cannot be read or written, has no such layer, holds NaN or infinities, or sizes differ.
pub fn run(args: &Args) -> Result<Exit> {
    if args.test.statistical {
        return statistical::run(&args.a, &args.b, args.json, &args.test);
    }
    if let Some(diff) = &args.diff {
        check_png("--diff", diff)?;
        check_distinct(&[("--diff", diff)], &[("A", &args.a), ("B", &args.b)])?;
    }
    let load = |path| load(path, args.layer.as_deref(), "name a layer with --layer");
    let (a, b) = (load(&args.a)?, load(&args.b)?);
    check_sizes((&args.a, a.size()), (&args.b, b.size()))?;
    image::check_memory(&args.a, a.pixels.len() as u64 * BYTES_PER_PIXEL)?;
    let unseen = metrics::unseen(&a, &b);
    let mut warnings = Warnings::new(true);
    if unseen > UNSEEN {
        args.limits.check_seen(unseen)?;
        warnings.insist([words_of_unseen(unseen)]);
    }
    let metrics = metrics::compare(&a, &b);
    let exceeded = args.limits.exceeded(&metrics)?;
    let scale = args.diff.as_ref().map(|path| write_diff(path, &a, &b)).transpose()?;
    report(args, &metrics, scale, &exceeded, warnings.all())?;
    for line in &exceeded {
        complain(line);
    }
    Ok(if exceeded.is_empty() { Exit::Done } else { Exit::LimitExceeded })
}

/// Reads a layer of an image, as Rec. 709 if it is the colour, and checks that every pixel is finite, as metrics need
/// it. `remedy` is for files without a colour.
///
/// # Errors
/// [`Error::Input`].
pub fn load(path: &Path, layer: Option<&str>, remedy: &str) -> Result<Picture> {
    let film = image::read(path)?;
    image::check_memory(path, (film.pixels() * size_of::<[f32; 3]>()) as u64)?;
    let picture = match layer {
        Some(_) => film.picture(layer),
        None => film.rec709(None).map_err(|what| format!("{what}; {remedy}")),
    };
    let picture = picture.map_err(|what| Error::input(path, what))?;
    drop(film);
    picture.finite().map_err(|what| Error::input(path, what))
}

/// Checks that the pictures of two files have the same size.
///
/// # Errors
/// [`Error::Input`] about the first file.
pub fn check_sizes((a_path, a): (&Path, [u32; 2]), (b_path, b): (&Path, [u32; 2])) -> Result<()> {
    if a == b {
        return Ok(());
    }
    let size = |[width, height]: [u32; 2]| format!("{width}x{height}");
    let what = format!("is {}, but {} is {}: compare images of one size", size(a), b_path.display(), size(b));
    Err(Error::input(a_path, what))
}

/// Names of the metrics.
pub const NAMES: [&str; 5] = ["MSE", "relMSE", "PSNR", "SSIM", "FLIP"];

/// Formats the metrics, in the order of [`NAMES`].
pub fn values(m: &Metrics) -> [String; 5] {
    [
        format!("{:.6e}", m.mse),
        format!("{:.6e}", m.relmse),
        format!("{:.3} dB", m.psnr),
        m.ssim.map_or("- (under 11x11 pixels)".to_owned(), |s| format!("{s:.6}")),
        format!("{:.6}", m.flip),
    ]
}

impl Limits {
    /// Limits of what is shown say nothing where it shows next to nothing.
    fn check_seen(&self, unseen: f64) -> Result<()> {
        let of_shown = [("max-flip", self.max_flip), ("min-psnr", self.min_psnr), ("min-ssim", self.min_ssim)];
        match of_shown.iter().find(|(_, limit)| limit.is_some()) {
            Some((option, _)) => {
                Err(Error::Usage(format!("--{option}: {}, as by --max-mse and --max-relmse", words_of_unseen(unseen))))
            }
            None => Ok(()),
        }
    }

    fn exceeded(&self, m: &Metrics) -> Result<Vec<String>> {
        if self.min_ssim.is_some() && m.ssim.is_none() {
            return Err(Error::Usage("--min-ssim needs images of at least 11x11 pixels".to_owned()));
        }
        let upper =
            [("mse", m.mse, self.max_mse), ("relmse", m.relmse, self.max_relmse), ("flip", m.flip, self.max_flip)];
        let lower = [("psnr", m.psnr, self.min_psnr), ("ssim", m.ssim.unwrap_or(1.0), self.min_ssim)];
        let above = upper.into_iter().filter_map(|(name, value, limit)| {
            limit
                .filter(|&l| value > l)
                .map(|l| format!("limit exceeded: {name} {value:.4e} is above --max-{name} {l}"))
        });
        let below = lower.into_iter().filter_map(|(name, value, limit)| {
            limit.filter(|&l| value < l).map(|l| format!("limit exceeded: {name} {value:.4} is below --min-{name} {l}"))
        });
        Ok(above.chain(below).collect())
    }
}

/// Writes the heat map and returns the value at the top of its colour scale.
fn write_diff(path: &Path, a: &Picture, b: &Picture) -> Result<f32> {
    let (map, top) = heat_map(a, b);
    report::write_png(path, &map)?;
    Ok(top)
}

fn report(args: &Args, m: &Metrics, scale: Option<f32>, exceeded: &[String], warnings: &[String]) -> Result<()> {
    if args.json {
        let text = |path: &Path| path.display().to_string();
        let diff = args.diff.as_ref().zip(scale).map(|(path, top)| json!({ "file": text(path), "scale": [0.0, top] }));
        let (a, b, layer) = (text(&args.a), text(&args.b), &args.layer);
        return print_json(
            &json!({ "a": a, "b": b, "layer": layer, "metrics": m, "diff": diff, "exceeded": exceeded, "warnings": warnings }),
        );
    }
    let rows: Vec<_> = NAMES.iter().zip(values(m)).map(|(name, value)| vec![(*name).to_owned(), value]).collect();
    print(&table::text(&["metric", "value"], &rows))?;
    match args.diff.as_ref().zip(scale) {
        Some((path, top)) => print(&format!(
            "{}: |A - B|, mean of the channels; black is 0, the palest colour {top:.6} and above\n",
            readable(&path.display().to_string())
        )),
        None => Ok(()),
    }
}
