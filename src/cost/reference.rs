//! The image that errors are measured against: given by the user, or rendered until its own noise is small beside the errors.
use super::document::{NoiseKind, ReferenceInfo, ReferenceSource};
use super::judge::Noise;
use crate::error::{Error, Result};
use crate::image::aov::{Aovs, Names};
use crate::image::metrics;
use crate::image::{self, FILTERED, Film, Picture};
use crate::render::provenance::{self, Provenance};
use crate::render::settings::Settings;
use crate::scene::Scene;
use std::path::Path;

/// A reference, and what is known of its noise.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The image.
    pub picture: Picture,
    /// Its measured noise; 0 where it was not measured.
    pub noise: Noise,
    /// Where it comes from.
    pub info: ReferenceInfo,
}

/// Reads a reference of the user's and checks that it can be one for a film of `size`. With a scene, a file that Tallow rendered
/// must show it; it is told of one of the `seeds` of runs that it has too.
///
/// # Errors
/// [`Error::Input`] and [`Error::Memory`].
pub fn read(path: &Path, size: [u32; 2], shows: Option<(&Scene, &Settings, &[u32])>) -> Result<Reference> {
    let film = image::read(path)?;
    let wrong = |what: String| Error::input(path, what);
    if film.size() != size {
        let what = format!(
            "is {}x{}, but {}x{} is measured: take a reference of that size",
            film.width, film.height, size[0], size[1]
        );
        return Err(wrong(what));
    }
    let picture = film.rec709(None).and_then(Picture::finite).map_err(wrong)?;
    let provenance = Provenance::of(&film).ok();
    let mut notes = Vec::new();
    if let (Some(provenance), Some((scene, settings, seeds))) = (&provenance, shows) {
        provenance.shows(scene, settings).map_err(|what| wrong(format!("{what}: it is no reference for that")))?;
        notes.extend(differences(&provenance.settings, settings));
        let shared = provenance.samples.iter().map(|range| range.seed).find(|seed| seeds.contains(seed));
        notes.extend(shared.map(|seed| {
            format!("the reference has samples of seed {seed}, as a run has: errors of that run are too small; render it with another --seed")
        }));
    }
    let filter = film.metadata.get(FILTERED);
    notes.extend(filter.map(|filter| {
        format!("the reference was filtered ({filter}): errors are from what that made of it, and what its own is worth is not known")
    }));
    if image::input::holds_integers(path) {
        let what =
            "the reference has no floats, as an image to look at: what is brighter than 1 was cut, and counts as error";
        notes.push(what.to_owned());
    }
    let bound = bound(&film, &picture).filter(|_| filter.is_none());
    Ok(Reference {
        noise: Noise::default(),
        info: ReferenceInfo {
            source: ReferenceSource::Given,
            path: Some(path.display().to_string()),
            spp: provenance.map(|provenance| provenance.samples_per_pixel()),
            noise: if bound.is_some() { NoiseKind::Bound } else { NoiseKind::Unknown },
            mse: bound.map(|noise| noise.mse),
            relmse: bound.map(|noise| noise.relmse),
            notes,
        },
        picture,
    })
}

/// Upper bound of a file's noise, from its layer of variances, which is not known in other primaries than the file's.
fn bound(film: &Film, picture: &Picture) -> Option<Noise> {
    if film.foreign_primaries().is_some() {
        return None;
    }
    let aovs = Aovs::find(film, &Names::new()).ok()?;
    let variance = (0..film.pixels()).map(|i| aovs.variance(i)).collect::<Option<Vec<_>>>()?;
    let noise = variance.iter().flatten().all(|v| v.is_finite()).then(|| noise_of(picture, &variance))?;
    (noise.mse > 0.0).then_some(noise)
}

/// Expected errors of a picture with these squared standard errors.
pub fn noise_of(picture: &Picture, variance: &[[f32; 3]]) -> Noise {
    let sum: f64 = variance.iter().flatten().map(|&v| f64::from(v)).sum();
    Noise { mse: sum / (3 * variance.len()) as f64, relmse: metrics::relative_noise(picture, variance) }
}

/// Settings that change the expected image and that a file was rendered with other values of.
fn differences(of_file: &serde_json::Value, settings: &Settings) -> Vec<String> {
    let ours = provenance::values(settings).unwrap_or_default();
    let differs = |key: &&str| of_file.get(*key).is_some_and(|value| ours.get(*key) != Some(value));
    let note = |key: &str| {
        let (theirs, ours) = (&of_file[key], &ours[key]);
        format!("the reference was rendered with {} {theirs} instead of {ours}", key.replace('_', "-"))
    };
    ["filter", "max_depth", "clamp_indirect", "indirect_stride"].into_iter().filter(differs).map(note).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a filter or eight bits have taken from it is told, and no noise is claimed of what was filtered.
    #[test]
    fn references_that_are_worth_less_than_they_look_are_told_of() {
        let folder = tempfile::tempdir().unwrap();
        let mut film = Film::new(2, 1);
        film.add_vec3("", ["R", "G", "B"], &[[0.5; 3]; 2]);
        film.add_vec3("variance", ["R", "G", "B"], &[[0.01; 3]; 2]);
        let told = |name: &str, film: &Film| {
            let path = folder.path().join(name);
            image::write(&path, film, &Default::default()).unwrap();
            let ReferenceInfo { noise, notes, .. } = read(&path, [2, 1], None).unwrap().info;
            (noise == NoiseKind::Bound, notes)
        };
        assert_eq!([told("a.exr", &film), told("a.hdr", &film)], [(true, vec![]), (false, vec![])]);
        std::fs::copy(folder.path().join("a.exr"), folder.path().join("b.dat")).unwrap();
        assert_eq!(read(&folder.path().join("b.dat"), [2, 1], None).unwrap().info.notes, [""; 0]);
        let (_, notes) = told("a.png", &film);
        assert!(notes.len() == 1 && notes[0].contains("has no floats"), "{notes:?}");
        film.metadata.insert(FILTERED.to_owned(), "auto".to_owned());
        let (bound, notes) = told("a.exr", &film);
        assert!(!bound && notes.len() == 1 && notes[0].contains("was filtered (auto)"), "{notes:?}");
    }

    #[test]
    fn a_file_of_the_same_settings_differs_in_none() {
        let settings = Settings { clamp_indirect: 0.1, max_depth: 5, ..Settings::default() };
        let of_file = serde_json::from_str(&serde_json::to_string(&settings).unwrap()).unwrap();
        assert_eq!(differences(&of_file, &settings), Vec::<String>::new());
        let deeper = Settings { max_depth: 6, ..settings };
        assert_eq!(differences(&of_file, &deeper), ["the reference was rendered with max-depth 5 instead of 6"]);
    }
}
