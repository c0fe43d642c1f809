//! What a test of two renders found, and of which images.
use crate::error::{Error, Result};
use crate::image::significance::{Estimate, Options, Outcome, overlay};
use crate::image::{self, FILTERED, Film, Picture, WriteOptions};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// One of the two images.
pub struct Side {
    /// Where it was read.
    pub path: PathBuf,
    /// Its metadata and the counts of samples, by which pixels are rendered again.
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

/// The channel that tells how many samples a pixel has.
pub const SAMPLES: &str = "samples";

impl Side {
    /// Reads it; `errors` is an image of its standard errors, for one that does not tell its noise.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn read(path: &Path, errors: Option<&Path>) -> Result<Self> {
        let mut film = image::read(path)?;
        let estimate = match errors {
            None => Estimate::of_film(&film).map_err(|what| Error::input(path, what)),
            Some(file) => {
                let errors = image::read(file)?.picture(None).map_err(|what| Error::input(file, what))?;
                Estimate::with_errors(&film, &errors).map_err(|what| Error::input(file, what))
            }
        }?;
        film.channels.retain(|channel| channel.name == SAMPLES);
        Ok(Self { path: path.to_owned(), film, estimate })
    }

    /// The means that were tested.
    pub fn picture(&self) -> Picture {
        let Estimate { width, height, mean, .. } = &self.estimate;
        Picture { width: *width, height: *height, pixels: mean.clone() }
    }

    /// The filter behind the samples, whose mean was tested in place of what it made of them.
    pub fn filter(&self) -> Option<&str> {
        self.film.metadata.get(FILTERED).map(String::as_str)
    }

    /// What the file says of where it was rendered.
    pub fn origin(&self) -> Value {
        const KEYS: [&str; 9] =
            ["software", "scene", "sceneFingerprint", "device", "driver", "cpu", "sampleRanges", "settings", FILTERED];
        let said = |key: &str| Some((key.to_owned(), Value::from(self.film.metadata.get(key)?.clone())));
        let mut origin: serde_json::Map<_, _> = KEYS.iter().filter_map(|key| said(key)).collect();
        origin.insert("file".to_owned(), json!(self.path.display().to_string()));
        Value::Object(origin)
    }
}

impl Report<'_> {
    /// Whether both means are equal bit for bit.
    pub fn equal(&self) -> bool {
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
}

/// Writes linear colours to a .png.
///
/// # Errors
/// [`Error::Output`].
pub fn write_png(path: &Path, picture: &Picture) -> Result<()> {
    image::write(path, &Film::from(picture), &WriteOptions::default())
}
