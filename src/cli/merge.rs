//! `tallow merge`: combines renders of the same picture with different samples into one.
use super::common::Warnings;
use super::files::key;
use super::{Exit, complain, quoted};
use crate::error::{Error, Result};
use crate::image::{self, WriteOptions};
use crate::render::{self, Gap, Merged};
use std::path::PathBuf;

/// Merge renders of disjoint sample ranges into one
///
/// The files must come from renders that differ in nothing but --first-sample and --spp, or in --seed. Means and
/// variances are joined by the rule of Chan, Golub and LeVeque (1979): within rounding, the result is that of one render,
/// and it has the same bits in whatever order the files are named. Where samples were spread evenly and their ranges close
/// up, --resume goes on behind the last. The output may be one of the files: it is replaced once the merged render is whole.
#[derive(clap::Args)]
pub struct Args {
    /// EXR files that tallow rendered
    #[arg(required = true, num_args = 2..)]
    files: Vec<PathBuf>,
    /// EXR file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the subcommand.
///
/// # Errors
/// As [`render::merge()`], [`Error::Usage`] for a file that cannot hold all layers, and [`Error::Output`].
pub fn run(args: &Args) -> Result<Exit> {
    image::check_writable(&args.output)?;
    if !image::has_layers(&args.output) {
        let name = args.output.display();
        return Err(Error::Usage(format!("{name}: a merged render keeps all of its layers: choose a name with .exr")));
    }
    let Merged { film, gaps, filtered, programs } = render::merge(&args.files)?;
    let replaced = args.files.iter().find(|part| key(part) == key(&args.output));
    image::write(&args.output, &film, &WriteOptions::default())?;
    if let Some(part) = replaced {
        // Its samples are all in the merged render, so that nothing is lost, but the same command would not find the part again.
        complain(&format!("note: {} was one of the parts: it holds all of them now", part.display()));
    }
    let missing = |Gap { seed, first, last }| format!("samples {first} to {last} of seed {seed} are missing");
    Warnings::new(true).insist(gaps.into_iter().map(missing));
    if programs.len() > 1 && film.channel("direct.R").is_some() {
        let programs = Vec::from_iter(programs).join(" and ");
        complain(&format!("note: the parts are of {programs}: their layers direct and albedo may hold other light"));
    }
    if let Some((part, filter)) = filtered.first() {
        let (part, output) = (part.display(), quoted(&args.output.display().to_string()));
        complain(&format!(
            "note: {part} was filtered ({filter}), and the merged picture is not: tallow filter {output} --filter {filter} -o {output}"
        ));
    }
    Ok(Exit::Done)
}
