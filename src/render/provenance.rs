//! What the metadata of a rendered file say of where its samples come from: by that it is resumed and merged.
use super::{Renderer, film};
use crate::error::{Checked, Error, Result};
use crate::image::Film;
use crate::render::settings::Settings;
use crate::scene::Scene;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

const SETTINGS: &str = "settings";
const SCENE: &str = "sceneFingerprint";
const SAMPLES: &str = "sampleRanges";
/// Metadata that tells of the frames before one that begins with their samples.
pub const HISTORY: &str = "history";

/// Samples of one render. A pixel has no others, and may lack some at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct SampleRange {
    /// Of their sequence.
    pub seed: u32,
    /// Index of the first.
    pub first: u32,
    /// Of the pixel that has most.
    pub count: u32,
}

impl SampleRange {
    /// Index of the last. Ranges in a [`Provenance`] have one.
    pub(crate) fn last(&self) -> u32 {
        self.first + (self.count - 1)
    }

    /// Whether the other goes on where this one ends.
    pub(crate) fn ends_before(&self, other: &Self) -> bool {
        self.seed == other.seed && other.first.checked_sub(1) == Some(self.last())
    }

    /// Whether a sample is in both.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.seed == other.seed && self.first <= other.last() && other.first <= self.last()
    }
}

/// Where a film's samples come from.
pub(crate) struct Provenance {
    /// Of the render; of a merged file, those of the first that went into it.
    pub settings: Value,
    /// [`Scene::fingerprint`].
    pub scene: String,
    /// One for each render that went into it, unless it closed up with another. They are not empty, do not overlap, and have
    /// [`Settings::MAX_SPP`] samples at most.
    pub samples: Vec<SampleRange>,
}

impl Provenance {
    /// Reads and checks it.
    ///
    /// # Errors
    /// What is missing or damaged.
    pub(crate) fn of(film: &Film) -> Checked<Self> {
        if film.metadata.contains_key(HISTORY) {
            return Err("has samples of earlier frames: it can be neither resumed nor merged".to_owned());
        }
        let (settings, samples) = (parsed(film, SETTINGS)?, parsed::<Vec<SampleRange>>(film, SAMPLES)?);
        check_ranges(&samples)?;
        Ok(Self { settings, scene: said(film, SCENE)?.to_owned(), samples })
    }

    /// Samples of all ranges.
    pub(crate) fn samples_per_pixel(&self) -> u32 {
        self.samples.iter().map(|range| range.count).sum()
    }

    /// # Errors
    /// When the film is of another scene.
    pub(crate) fn shows(&self, scene: &Scene, settings: &Settings) -> Checked {
        let shown = scene.fingerprint(settings.size()).map_err(|e| e.to_string())?;
        if self.scene == shown.to_string() {
            return Ok(());
        }
        Err("shows another scene, or this one before it was changed".into())
    }
}

fn check_ranges(samples: &[SampleRange]) -> Checked {
    let wrong = |what: &str| Err(format!("{SAMPLES} {what}: take the file as tallow wrote it"));
    if samples.is_empty() {
        return Err("holds no samples yet: render anew".to_owned());
    }
    if samples.iter().any(|r| r.count == 0 || r.first.checked_add(r.count).is_none()) {
        return wrong("are empty, or end beyond 32 bits");
    }
    if samples.iter().map(|r| u64::from(r.count)).sum::<u64>() > Settings::MAX_SPP.into() {
        return wrong("have more samples than a pixel can count");
    }
    let mut sorted = samples.to_vec();
    sorted.sort();
    if sorted.windows(2).any(|pair| pair[0].overlaps(&pair[1])) {
        return wrong("overlap");
    }
    Ok(())
}

fn said<'a>(film: &'a Film, key: &str) -> Checked<&'a str> {
    let missing = || format!("has no metadata \"{key}\": it must be of tallow render or merge, of this version");
    film.metadata.get(key).map(String::as_str).ok_or_else(missing)
}

fn parsed<T: DeserializeOwned>(film: &Film, key: &str) -> Checked<T> {
    serde_json::from_str(said(film, key)?).map_err(|e| format!("{key}: {e}"))
}

/// Settings as a file tells them, by way of its text: a number's shortest decimal is not its value in double precision.
///
/// # Errors
/// [`Error::Usage`] when JSON cannot say them (a bug).
pub(crate) fn values(settings: &Settings) -> Result<serde_json::Value> {
    serde_json::from_str(&json(settings)?).map_err(|e| Error::Usage(e.to_string()))
}

fn json(what: &impl Serialize) -> Result<String> {
    serde_json::to_string(what).map_err(|e| Error::Usage(e.to_string()))
}

/// The metadata of a frame that begins with samples of earlier ones. It names no ranges of samples: such a film can be neither
/// resumed nor merged. `history` is what tells the frames before from others.
///
/// # Errors
/// Those of [`Scene::fingerprint`].
pub fn of_frame(scene: &Scene, settings: &Settings, history: &str) -> Result<BTreeMap<String, String>> {
    let shown = scene.fingerprint(settings.size())?;
    let entries = [(SETTINGS, json(settings)?), (SCENE, shown.to_string()), (HISTORY, history.to_owned())];
    Ok(entries.map(|(key, value)| (key.to_owned(), value)).into())
}

/// The metadata of a render's film; none when the renderer's camera was moved, since no scene has those samples, and none where a
/// history is kept: see [`of_frame`].
///
/// # Errors
/// [`Error::Usage`] when the film has no layer of counts.
pub(crate) fn metadata(renderer: &Renderer, film: &Film) -> Result<BTreeMap<String, String>> {
    let Some(scene) = renderer.fingerprint().filter(|_| renderer.history().is_none()) else {
        return Ok(BTreeMap::new());
    };
    let settings = renderer.settings();
    let counts = film::counts(film, "samples").map_err(Error::Usage)?;
    let count = counts.iter().copied().max().unwrap_or(0);
    let range = SampleRange { seed: settings.seed, first: settings.first_sample, count };
    let ranges = if count > 0 { vec![range] } else { Vec::new() };
    let entries = [(SETTINGS, json(settings)?), (SCENE, scene.to_string()), (SAMPLES, json(&ranges)?)];
    Ok(entries.map(|(key, value)| (key.to_owned(), value)).into())
}

/// Says that a film is of these samples.
///
/// # Errors
/// [`Error::Usage`] when JSON cannot say it (a bug).
pub(crate) fn set_samples(film: &mut Film, samples: &[SampleRange]) -> Result<()> {
    film.metadata.insert(SAMPLES.to_owned(), json(&samples)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_that_cannot_be_are_refused() {
        let check = |ranges: &[(u32, u32, u32)]| {
            let range = |&(seed, first, count): &(u32, u32, u32)| SampleRange { seed, first, count };
            check_ranges(&ranges.iter().map(range).collect::<Vec<_>>())
        };
        assert_eq!(check(&[(0, 0, 4), (0, 4, 1), (1, 0, 4)]), Ok(()));
        assert_eq!(check(&[(7, u32::MAX - 1, 1)]), Ok(()));
        for (ranges, part) in [
            (&[][..], "no samples yet: render anew"),
            (&[(0, 0, 0)], "empty"),
            (&[(0, u32::MAX, 1)], "32 bits"),
            (&[(0, 0, 4), (1, 0, 4), (0, 3, 1)], "overlap"),
            (&[(0, 0, 9), (0, 3, 1), (0, 5, 1)], "overlap"),
            (&[(0, 0, Settings::MAX_SPP), (1, 0, 1)], "can count"),
            (&[(0, 0, 1 << 31), (1, 0, 1 << 31)], "can count"),
        ] {
            let line = check(ranges).unwrap_err();
            assert!(line.contains(part), "{ranges:?}: {line}");
        }
    }
}
