//! The samples in a file of `tallow render` or `merge`, checked against what its metadata claim: whoever adds samples to them
//! trusts them from here on.
use super::film;
use super::provenance::Provenance;
use crate::error::Checked;
use crate::image::Film;
use crate::render::schedule;
use crate::render::settings::{Placing, Settings};
use crate::statistics::{BrokenSamples, Pixel};
use serde::Deserialize;

/// What the header of a file says of what was rendered.
pub(crate) struct Head {
    /// Where the samples come from.
    pub provenance: Provenance,
    /// As those of [`Rendered`].
    pub settings: Settings,
    /// Whether direct and indirect light are kept apart.
    pub splits_light: bool,
}

impl Head {
    /// Reads the metadata and the names of the channels; the samples may be missing.
    ///
    /// # Errors
    /// What is missing or damaged.
    pub(crate) fn of(film: &Film) -> Checked<Self> {
        let provenance = Provenance::of(film)?;
        let settings = Settings::deserialize(&provenance.settings).map_err(|e| format!("settings: {e}"))?;
        settings.validate().map_err(|e| format!("settings: {e}"))?;
        check_size(film, &settings)?;
        Ok(Self { provenance, settings, splits_light: film::splits_light(film)? })
    }
}

/// What was rendered so far.
pub(crate) struct Rendered {
    /// Where the samples come from.
    pub provenance: Provenance,
    /// Of the render; of a merged file, those of its first part.
    pub settings: Settings,
    /// Row-major. Every value is finite, M2 is not negative, and no pixel has more samples than the ranges.
    pub pixels: Vec<Pixel>,
    /// Samples that were no number or ended early.
    pub broken: Option<BrokenSamples>,
    /// Samples that each pixel still lacks: of a file that was interrupted.
    pub pending: Option<Vec<u32>>,
}

impl Rendered {
    /// Reads a film and checks it.
    ///
    /// # Errors
    /// What is missing, damaged, or not as the metadata say.
    pub(crate) fn of(film: &Film) -> Checked<Self> {
        let Head { provenance, settings, .. } = Head::of(film)?;
        let pixels = film::pixels(film)?;
        check_pixels(&pixels, settings.width, provenance.samples_per_pixel())?;
        let pending = film.channel(film::PENDING).map(|_| film::counts(film, film::PENDING)).transpose()?;
        if let Some(pending) = pending {
            check_pending(pending, &pixels, &settings)?;
        }
        let pending = pending.map(<[u32]>::to_vec);
        let broken = film::broken_samples(film)?;
        Ok(Self { provenance, settings, pixels, broken, pending })
    }

    /// Whether samples are spread evenly, and every pixel has all that the ranges tell of.
    pub(crate) fn is_full(&self) -> bool {
        let all = self.provenance.samples_per_pixel();
        self.settings.allocate.is_even() && self.pixels.iter().all(|p| p.stats.count == all)
    }

    /// The last priorities, where the policy keeps some.
    ///
    /// # Errors
    /// When they are missing.
    pub(crate) fn priority(&self, film: &Film) -> Checked<Vec<f32>> {
        if self.settings.allocate.is_even() {
            return Ok(Vec::new());
        }
        film::floats(film, film::PRIORITY).map(<[f32]>::to_vec)
    }
}

fn check_size(film: &Film, settings: &Settings) -> Checked {
    let is_cut = film.channels.iter().any(|c| c.window.is_some());
    if film.size() != settings.size() || is_cut {
        let [width, height] = settings.size();
        let size = format!("{}x{}{}", film.width, film.height, if is_cut { ", in part" } else { "" });
        return Err(format!("is {size}, but was rendered as {width}x{height}: take the file as tallow wrote it"));
    }
    Ok(())
}

fn check_pixels(pixels: &[Pixel], width: u32, most: u32) -> Checked {
    for (i, pixel) in pixels.iter().enumerate() {
        let count = pixel.stats.count;
        if count > most {
            let (x, y) = (i as u32 % width, i as u32 / width);
            return Err(format!("pixel ({x}, {y}) has {count} samples, but the file tells of {most} at most"));
        }
    }
    check_values(pixels, width)
}

/// Checks that all values are such as samples have.
///
/// # Errors
/// A sentence that names the first pixel.
pub(super) fn check_values(pixels: &[Pixel], width: u32) -> Checked {
    let found = pixels.iter().enumerate().find_map(|(i, pixel)| Some((i as u32, broken(pixel)?)));
    found.map_or(Ok(()), |(i, (layer, value))| {
        let (x, y) = (i % width, i / width);
        Err(format!("pixel ({x}, {y}) has {value} in the layer {layer}: no samples can be added to that"))
    })
}

/// A value that no samples have, and its layer.
fn broken(pixel: &Pixel) -> Option<(&'static str, f32)> {
    let Pixel { stats, light } = pixel;
    let layers = [
        ("R, G, B", stats.mean),
        ("m2", stats.m2),
        ("direct", light.direct),
        ("albedo", light.albedo),
        (film::INDIRECT_M2, [light.indirect_m2; 3]),
    ];
    layers.into_iter().find_map(|(name, values)| {
        let is_broken = |v: &f32| !v.is_finite() || (name.ends_with("m2") && *v < 0.0);
        values.into_iter().find(is_broken).map(|value| (name, value))
    })
}

/// What pixels lack is part of what the settings give them.
fn check_pending(pending: &[u32], pixels: &[Pixel], settings: &Settings) -> Checked {
    let with_pending = |(&lacks, pixel): (&u32, &Pixel)| u64::from(lacks) + u64::from(pixel.stats.count);
    let most = u64::from(most_of_pixel(settings));
    let sums = || pending.iter().zip(pixels).map(with_pending);
    if let Some(too_many) = sums().find(|&sum| sum > most) {
        return Err(format!("a pixel has or lacks {too_many} samples, but its settings allow {most}"));
    }
    let (all, budget) = (sums().sum::<u64>(), budget(settings));
    if all > budget {
        return Err(format!("its pixels have or lack {all} samples, but its settings allow {budget}"));
    }
    Ok(())
}

fn most_of_pixel(settings: &Settings) -> u32 {
    let is_even = settings.allocate.is_even() || settings.allocate.policy.placing == Placing::Chosen;
    if is_even { settings.spp } else { schedule::limit(settings) }
}

/// Samples of all pixels at most: those of a noise threshold are bound by the pixels' limit alone.
fn budget(settings: &Settings) -> u64 {
    let per_pixel = if settings.allocate.has_threshold() { most_of_pixel(settings) } else { settings.spp };
    u64::from(per_pixel) * settings.pixels() as u64
}
