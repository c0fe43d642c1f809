//! What the metadata of a rendered file say of where its samples come from: by that it is resumed and merged.
use super::layers;
use crate::error::{Error, Result};
use crate::image::Film;
use crate::scene::Scene;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

const SETTINGS: &str = "settings";
const SCENE: &str = "sceneFingerprint";
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
    /// [`Scene::fingerprint`].
    pub scene: String,
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
        let settings = parsed(film, SETTINGS)?;
        Ok(Self { settings, scene: said(film, SCENE)?.to_owned(), samples: parsed(film, SAMPLES)? })
    }

    /// # Errors
    /// When the film is of another scene.
    pub fn shows(&self, scene: &Scene) -> std::result::Result<(), String> {
        if self.scene == scene.fingerprint.to_string() {
            return Ok(());
        }
        Err("shows another scene, or this one before it was changed".into())
    }
}

fn said<'a>(film: &'a Film, key: &str) -> std::result::Result<&'a str, String> {
    let missing = || format!("has no metadata \"{key}\": it must be of tallow render or merge, of this version");
    film.metadata.get(key).map(String::as_str).ok_or_else(missing)
}

fn parsed<T: DeserializeOwned>(film: &Film, key: &str) -> std::result::Result<T, String> {
    serde_json::from_str(said(film, key)?).map_err(|e| format!("{key}: {e}"))
}

fn json(what: &impl Serialize) -> Result<String> {
    serde_json::to_string(what).map_err(|e| Error::Usage(e.to_string()))
}

/// The metadata of a render's film.
///
/// # Errors
/// [`Error::Usage`] when the film has no layer of counts.
pub fn metadata(scene: &Scene, film: &Film) -> Result<[(&'static str, String); 3]> {
    let settings = &scene.settings;
    let counts = layers::counts(film, "samples").map_err(Error::Usage)?;
    let count = counts.into_iter().max().unwrap_or(0);
    let range = SampleRange { seed: settings.seed, first: settings.first_sample, count };
    Ok([(SETTINGS, json(settings)?), (SCENE, scene.fingerprint.to_string()), (SAMPLES, json(&[range])?)])
}

/// Says that a film is of these samples.
///
/// # Errors
/// [`Error::Usage`] when JSON cannot say it (a bug).
pub fn set_samples(film: &mut Film, samples: &[SampleRange]) -> Result<()> {
    film.metadata.insert(SAMPLES.to_owned(), json(&samples)?);
    Ok(())
}
