//! `tallow merge`: renders of the same picture by different samples become one.
use super::origin::{self, Origin, SampleRange};
use super::{Exit, layers};
use crate::error::{Error, Result};
use crate::image::{self, Film, WriteOptions};
use crate::statistics::{BrokenSamples, Pixel, join};
use std::path::{Path, PathBuf};

/// Merge renders of disjoint sample ranges into one
///
/// The files must come from renders that differ in nothing but --first-sample and --spp, or in --seed. Means and
/// variances are joined by the rule of Chan, Golub and LeVeque (1979): within rounding, the result is that of one render.
#[derive(clap::Args)]
pub struct Args {
    /// EXR files that tallow rendered
    #[arg(required = true, num_args = 2..)]
    files: Vec<PathBuf>,
    /// EXR file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Settings in which merged renders may differ.
const FREE: [&str; 3] = ["spp", "first_sample", "seed"];

struct Part {
    film: Film,
    pixels: Vec<Pixel>,
    broken: Option<BrokenSamples>,
    /// Its settings are all but [`FREE`].
    origin: Origin,
}

impl Part {
    fn read(path: &Path) -> Result<Self> {
        let film = image::read(path)?;
        Self::of(film).map_err(|what| Error::input(path, what))
    }

    fn of(film: Film) -> std::result::Result<Self, String> {
        let mut origin = Origin::of(&film)?;
        if let Some(settings) = origin.settings.as_object_mut() {
            settings.retain(|key, _| !FREE.contains(&key.as_str()));
        }
        Ok(Self { pixels: layers::pixels(&film)?, broken: layers::broken_samples(&film)?, film, origin })
    }

    /// Why they cannot be merged.
    fn conflict(&self, other: &Self) -> Option<String> {
        if self.origin.settings != other.origin.settings {
            return Some("was rendered with other settings".into());
        }
        if self.origin.scene != other.origin.scene {
            return Some("shows another scene, or the same one changed".into());
        }
        let again = other.origin.samples.iter().find(|b| self.origin.samples.iter().any(|a| a.overlaps(b)))?;
        let SampleRange { seed, first, .. } = again;
        Some(format!("has samples {first} to {} of seed {seed} as well: they would count twice", again.end()))
    }
}

/// Runs the subcommand.
///
/// # Errors
/// [`Error::Input`] when a file cannot be read or does not belong to the others, [`Error::Output`].
pub fn run(args: &Args) -> Result<Exit> {
    image::check_writable(&args.output)?;
    let parts: Vec<Part> = args.files.iter().map(|path| Part::read(path)).collect::<Result<_>>()?;
    for (i, (part, path)) in parts.iter().zip(&args.files).enumerate() {
        if let Some(what) = parts[..i].iter().find_map(|earlier| earlier.conflict(part)) {
            return Err(Error::input(path, what));
        }
    }
    image::write(&args.output, &merged(parts)?, &WriteOptions::default())?;
    Ok(Exit::Done)
}

/// The first film, with everybody's samples.
fn merged(parts: Vec<Part>) -> Result<Film> {
    let mut parts = parts.into_iter();
    let Some(Part { mut film, mut pixels, mut broken, mut origin }) = parts.next() else {
        return Err(Error::Usage("name files to merge".into()));
    };
    for part in parts {
        pixels.iter_mut().zip(&part.pixels).for_each(|(a, b)| *a = join(a, b));
        origin.samples.extend(part.origin.samples);
        broken = BrokenSamples::join(broken, part.broken);
    }
    layers::replace_pixels(&mut film, &pixels);
    layers::set_broken_samples(&mut film, broken);
    film.channels.retain(|c| c.name != layers::PENDING && c.name != layers::PRIORITY);
    origin::set_samples(&mut film, &origin.samples)?;
    Ok(film)
}
