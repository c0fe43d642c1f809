//! What the metadata of a rendered file say of where its samples come from: by that it is resumed and merged.
use super::layers;
use crate::error::{Error, Result};
use crate::image::Film;
use crate::settings::Settings;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

const SETTINGS: &str = "settings";
const SAMPLES: &str = "sampleRanges";

/// Samples of one render. A pixel has no others, and may lack some at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SampleRange {
    /// Of their sequence.
    pub seed: u32,
    /// Index of the first.
    pub first: u32,
    /// Of the pixel that has most.
    pub count: u32,
}

impl SampleRange {
    /// Index after the last.
    pub fn end(&self) -> u64 {
        u64::from(self.first) + u64::from(self.count)
    }

    /// Whether a sample is in both.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.seed == other.seed && u64::from(self.first) < other.end() && u64::from(other.first) < self.end()
    }
}

/// Where a film's samples come from.
pub struct Origin {
    /// Of the render; of a merged file, those of the first that went into it.
    pub settings: Value,
    /// One for each render that went into it. Adjacent ones stay apart: pixels that lack samples at the end of the former
    /// have a gap there.
    pub samples: Vec<SampleRange>,
}

impl Origin {
    /// Reads it.
    ///
    /// # Errors
    /// What is missing or damaged.
    pub fn of(film: &Film) -> std::result::Result<Self, String> {
        Ok(Self { settings: parsed(film, SETTINGS)?, samples: parsed(film, SAMPLES)? })
    }
}

fn parsed<T: DeserializeOwned>(film: &Film, key: &str) -> std::result::Result<T, String> {
    let missing = || format!("has no metadata \"{key}\": it must be of this version of tallow render, or merge");
    let said = film.metadata.get(key).ok_or_else(missing)?;
    serde_json::from_str(said).map_err(|e| format!("{key}: {e}"))
}

fn json(what: &impl Serialize) -> Result<String> {
    serde_json::to_string(what).map_err(|e| Error::Usage(e.to_string()))
}

/// The metadata of a render's film.
///
/// # Errors
/// [`Error::Usage`] when the film has no layer of counts.
pub fn metadata(settings: &Settings, film: &Film) -> Result<[(&'static str, String); 2]> {
    let counts = layers::counts(film, "samples").map_err(Error::Usage)?;
    let count = counts.into_iter().max().unwrap_or(0);
    let range = SampleRange { seed: settings.seed, first: settings.first_sample, count };
    Ok([(SETTINGS, json(settings)?), (SAMPLES, json(&[range])?)])
}

/// Says that a film is of these samples.
///
/// # Errors
/// None: the result is that of every text made here.
pub fn set_samples(film: &mut Film, samples: &[SampleRange]) -> Result<()> {
    film.metadata.insert(SAMPLES.to_owned(), json(&samples)?);
    Ok(())
}
