//! What a renderer's buffers hold, as the channels of an image file, and back.
use crate::error::{Checked, Result};
use crate::gpu::{Buffer, FrameResources};
use crate::image::{FILTERED, Film, NOISY, Samples};
use crate::layout::{Guide, PixelLight, PixelStats, vec3};
use crate::render::buffers::FilmTile;
use crate::render::settings::Settings;
use crate::render::{FilmBuffers, Outputs, Renderer};
use crate::statistics::{BrokenSamples, Pixel, variance_of_mean};
use crate::{memory, threads};
use rayon::prelude::*;
use std::ops::Range;

const RGB: [&str; 3] = ["R", "G", "B"];
const XYZ: [&str; 3] = ["X", "Y", "Z"];

/// What the policy said last: only in files of renders that place samples.
pub(crate) const PRIORITY: &str = "priority";

/// Samples that a pixel still lacks of what it was to have: only in files of renders that were interrupted.
pub(crate) const PENDING: &str = "pending";

/// Metadata: whether the layer of direct light holds none of lamps and sky, which is noisy. Filters ask for it.
pub(crate) const SHARP_DIRECT: &str = "sharpDirect";
/// Metadata: [`Settings::indirect_stride`]. Filters ask for it.
pub(crate) const INDIRECT_STRIDE: &str = "indirectStride";
/// Key of metadata: what the layer `albedo` holds, [`OF_SAMPLES`]. Earlier versions wrote another albedo and did not say so.
pub(crate) const ALBEDO: &str = "albedo";
/// Value of it: the mean of all samples of a pixel.
pub(crate) const OF_SAMPLES: &str = "mean of samples";

/// Sum of squared deviations of the luminance of indirect light times albedo.
pub(crate) const INDIRECT_M2: &str = "indirect.m2";

/// How far the lens blurs what a pixel shows, from 0, sharp, to 1: only in files of cameras with a lens.
pub(crate) const BLUR: &str = "denoising blur";

/// What rounding took off the means of direct light and albedo, and what the samples of a pixel have seen or not, as
/// [`crate::layout::PixelLight::remainder`]: only in files where that is not 0.
pub(crate) const LIGHT_REMAINDER: &str = "light.remainder";
/// What rounding took off the means of pixels with thousands of samples: only in files that have such pixels; and [`LIGHT_REMAINDER`].
const REMAINDERS: [&str; 2] = ["remainder", LIGHT_REMAINDER];

/// Metadata of samples that are wrong.
const BROKEN: &str = "brokenSamples";

/// Of a film with everything.
const CHANNELS: usize = 38;

/// What a pixel takes in a film with everything.
pub(crate) fn bytes_per_pixel(placed: bool) -> u64 {
    (size_of::<f32>() * (CHANNELS + if placed { 2 } else { 0 })) as u64 // priority, pending
}

/// Bytes of host memory that a render with these settings takes at most when its film is read back, the scene not counted: the film,
/// and its buffers, or, where the device has memory of its own, copies of them. Where the two share memory that the host does not cache,
/// as on some integrated graphics cards, it takes both the buffers and copies of them, which is not counted.
pub fn host_bytes(settings: &Settings) -> u64 {
    let placed = !settings.allocate.is_even();
    settings.pixels() as u64 * (FilmBuffers::bytes_per_pixel(placed) + bytes_per_pixel(placed))
}

/// Reads the buffers back into a film with the layers that the renderer was asked for. [`super::Job::film`] adds where
/// they come from, so that the file can be resumed and merged.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn read_back(renderer: &Renderer) -> Result<Film> {
    let of_device = renderer.film();
    if of_device.tiles[0].stats.is_read_in_place() {
        return read(renderer, &of_device.tiles, &of_device.counts.priority);
    }
    let (tiles, priority) = copied(renderer)?;
    read(renderer, &tiles, &priority)
}

/// Copies for the host of what a film is read from. One submission makes them all, since each waits for work of other threads that was
/// submitted before.
fn copied(renderer: &Renderer) -> Result<(Vec<FilmTile>, Buffer<f32>)> {
    let of_device = renderer.film();
    let (mut tiles, mut priority) = (Vec::new(), of_device.counts.priority.clone());
    renderer.gpu.run(&mut FrameResources::new(&renderer.gpu)?, |rec| {
        tiles = of_device.tiles.iter().map(|tile| tile.copied(rec)).collect::<Result<_>>()?;
        if !renderer.settings().allocate.is_even() {
            priority = rec.copied(&priority)?;
        }
        Ok(())
    })?;
    Ok((tiles, priority))
}

fn read(renderer: &Renderer, tiles: &[FilmTile], priority: &Buffer<f32>) -> Result<Film> {
    let (settings, outputs) = (renderer.settings(), renderer.outputs());
    let mut film = Film::new(settings.width, settings.height);
    // A batch at a time, so that its records are in the cache when they become channels.
    for tile in tiles {
        let pixels = tile.stats.len();
        for first in (0..pixels).step_by(BATCH) {
            film.append(&Records::read(tile, first..pixels.min(first + BATCH), outputs)?.films());
        }
    }
    drop_remainders_of_none(&mut film);
    if !settings.allocate.is_even() {
        film.add(PRIORITY, Samples::F32(priority.read()?));
    }
    Ok(film)
}

/// Pixels whose records are read at once.
const BATCH: usize = 1 << 17;
/// Pixels of which one thread makes channels at once: they fit its cache.
const RUN: usize = 1 << 12;

/// What buffers hold of a batch of pixels; empty is what is not kept.
struct Records {
    stats: Vec<PixelStats>,
    light: Vec<PixelLight>,
    guide: Vec<Guide>,
    seen: Vec<Guide>,
    blur: Vec<f32>,
}

impl Records {
    fn read(tile: &FilmTile, pixels: Range<usize>, outputs: Outputs) -> Result<Self> {
        let guide = |kept: bool, buffer: &Buffer<Guide>| {
            if kept { buffer.read_range(pixels.clone()) } else { Ok(Vec::new()) }
        };
        Ok(Self {
            guide: guide(outputs.guides, &tile.guide)?,
            seen: guide(tile.has_seen(), &tile.seen)?,
            blur: if tile.has_blur() { tile.blur.read_range(pixels.clone())? } else { Vec::new() },
            light: if outputs.split_light { tile.light.read_range(pixels.clone())? } else { Vec::new() },
            stats: tile.stats.read_range(pixels)?,
        })
    }

    /// As films of [`RUN`] pixels each.
    fn films(&self) -> Vec<Film> {
        let runs = self.stats.len().div_ceil(RUN);
        threads::within_kept(|| (0..runs).into_par_iter().map(|run| self.film(run * RUN)).collect())
    }

    fn film(&self, first: usize) -> Film {
        fn run<T>(records: &[T], first: usize) -> &[T] {
            records.get(first..).map_or(&[], |rest| &rest[..rest.len().min(RUN)])
        }
        let (stats, guide, seen) = (run(&self.stats, first), run(&self.guide, first), run(&self.seen, first));
        let mut light = run(&self.light, first).to_vec();
        let unsampled = stats.iter().zip(guide).zip(&mut light).filter(|((stats, _), _)| stats.count == 0);
        unsampled.for_each(|((_, guide), light)| light.albedo = guide.albedo);
        let mut film = Film::new(stats.len() as u32, 1);
        add_pixels(&mut film, stats, &light);
        if !guide.is_empty() {
            add_guide(&mut film, guide);
        }
        if !seen.is_empty() {
            add_seen(&mut film, seen);
        }
        if !self.blur.is_empty() {
            film.add(BLUR, Samples::F32(run(&self.blur, first).to_vec()));
        }
        film
    }
}

/// Adds what the samples say. `light` is empty where direct and indirect light are not kept apart.
fn add_pixels(film: &mut Film, stats: &[PixelStats], light: &[PixelLight]) {
    let vec3s = |of: fn(&PixelStats) -> vec3| stats.iter().map(of).collect::<Vec<_>>();
    film.add_vec3("", RGB, &vec3s(|s| s.mean));
    film.add_vec3("variance", RGB, &vec3s(variance_of_mean));
    film.add_vec3("m2", RGB, &vec3s(|s| s.m2));
    film.add("samples", Samples::U32(stats.iter().map(|s| s.count).collect()));
    if !light.is_empty() {
        let indirect = stats.iter().zip(light).map(|(&stats, &light)| Pixel { stats, light }.indirect());
        film.add_vec3("direct", RGB, &light.iter().map(|l| l.direct).collect::<Vec<_>>());
        film.add_vec3("indirect", RGB, &indirect.collect::<Vec<_>>());
        film.add_vec3("albedo", RGB, &light.iter().map(|l| l.albedo).collect::<Vec<_>>());
        film.add(INDIRECT_M2, Samples::F32(light.iter().map(|l| l.indirect_m2).collect()));
    }
    let remainders = [stats.iter().map(|s| s.remainder).collect(), light.iter().map(|l| l.remainder).collect()];
    for (name, remainders) in REMAINDERS.into_iter().zip::<[Vec<u32>; 2]>(remainders) {
        if remainders.len() == stats.len() {
            film.add(name, Samples::U32(remainders));
        }
    }
}

/// Only pixels with thousands of samples, of glass, of a key light that no sample chose, and of the sky or a lamp beside a key light have
/// remainders.
fn drop_remainders_of_none(film: &mut Film) {
    let is_zero = |samples: &Samples| matches!(samples, Samples::U32(words) if words.iter().all(|&word| word == 0));
    film.channels.retain(|c| !(REMAINDERS.contains(&c.name.as_str()) && is_zero(&c.samples)));
}

/// What the samples say, out of a film that [`read_back`] made.
///
/// # Errors
/// Which layer is missing, or that memory is.
pub(crate) fn pixels(film: &Film) -> Checked<Vec<Pixel>> {
    let mean = match (rgb(film, NOISY), film.metadata.get(FILTERED)) {
        (Ok(mean), _) => mean,
        (Err(_), None) => rgb(film, "")?,
        (Err(_), Some(filter)) => {
            return Err(format!(
                "was filtered ({filter}), and the mean of its samples is gone: take the file before that"
            ));
        }
    };
    let (m2, count) = (rgb(film, "m2")?, counts(film, "samples")?);
    let light = light(film)?;
    let [remainder, light_remainder] = REMAINDERS.map(|name| film.words(name));
    let word = |words: Option<&[u32]>, i: usize| words.map_or(0, |words| words[i]);
    let at = |plane: [&[f32]; 3], i: usize| plane.map(|values| values[i]);
    let pixel = |i: usize| Pixel {
        stats: PixelStats {
            mean: at(mean, i),
            count: count[i],
            m2: at(m2, i),
            remainder: word(remainder, i),
            ..Default::default()
        },
        // Without a sample, the layer holds the albedo at the pixel's centre.
        light: light.filter(|_| count[i] > 0).map_or_else(PixelLight::default, |(direct, albedo, indirect_m2)| {
            PixelLight {
                direct: at(direct, i),
                indirect_m2: indirect_m2[i],
                albedo: at(albedo, i),
                remainder: word(light_remainder, i),
                ..Default::default()
            }
        }),
    };
    let mut pixels = memory::reserved(film.pixels())?;
    pixels.extend((0..film.pixels()).map(pixel));
    Ok(pixels)
}

/// Whether a film keeps direct and indirect light apart.
///
/// # Errors
/// When it has a part of what that takes.
pub(crate) fn splits_light(film: &Film) -> Checked<bool> {
    let names = ["direct", "indirect"].map(|layer| RGB.map(|c| format!("{layer}.{c}"))).concat();
    match names.iter().filter(|name| film.channel(name).is_some()).count() {
        0 => Ok(false),
        n if n == names.len() => Ok(true),
        _ => Err("has direct or indirect light in part: take the file as tallow wrote it".to_owned()),
    }
}

/// The channels of a layer.
fn rgb<'a>(film: &'a Film, layer: &str) -> Checked<[&'a [f32]; 3]> {
    let plane = |component: &str| {
        let name = if layer.is_empty() { component.to_owned() } else { format!("{layer}.{component}") };
        floats(film, &name)
    };
    Ok([plane("R")?, plane("G")?, plane("B")?])
}

/// Direct light, the albedo of all other light and its M2, where they are kept apart.
type Light<'a> = ([&'a [f32]; 3], [&'a [f32]; 3], &'a [f32]);

fn light(film: &Film) -> Checked<Option<Light<'_>>> {
    if !splits_light(film)? {
        return Ok(None);
    }
    let Some(m2) = film.floats(INDIRECT_M2) else {
        return Err(format!(
            "has no layer \"{INDIRECT_M2}\", the noise of indirect light, as files of earlier versions: it can be filtered, but \
             to add samples render it anew"
        ));
    };
    Ok(Some((rgb(film, "direct")?, rgb(film, "albedo")?, m2)))
}

/// What the file says of samples that were no number or ended early.
///
/// # Errors
/// When it is damaged.
pub(crate) fn broken_samples(film: &Film) -> Checked<Option<BrokenSamples>> {
    let said = film.metadata.get(BROKEN);
    said.map(|text| serde_json::from_str(text).map_err(|e| format!("{BROKEN}: {e}"))).transpose()
}

/// Makes the file say it.
pub(crate) fn set_broken_samples(film: &mut Film, broken: Option<BrokenSamples>) {
    film.metadata.remove(BROKEN);
    if let Some(broken) = broken {
        let text = serde_json::to_string(&broken).expect("integers alone");
        film.metadata.insert(BROKEN.to_owned(), text);
    }
}

/// Replaces what the samples say; the other layers stay, but for a filtered colour.
pub(crate) fn replace_pixels(film: &mut Film, pixels: &[Pixel]) {
    let split = film.channel("direct.R").is_some();
    let mut fresh = Film::new(film.width, film.height);
    let unsampled = |i: usize| rgb(film, "albedo").map_or([0.0; 3], |albedo| albedo.map(|plane| plane[i]));
    let light = |(i, p): (usize, &Pixel)| match p.stats.count {
        0 => PixelLight { albedo: unsampled(i), ..p.light },
        _ => p.light,
    };
    let light: Vec<_> = pixels.iter().enumerate().filter(|_| split).map(light).collect();
    add_pixels(&mut fresh, &pixels.iter().map(|p| p.stats).collect::<Vec<_>>(), &light);
    film.channels.retain(|c| fresh.channel(&c.name).is_none() && !c.name.starts_with(NOISY));
    drop_remainders_of_none(&mut fresh);
    film.metadata.remove(FILTERED);
    film.channels.extend(fresh.channels);
}

/// Makes `colour`, a plane a channel, the picture of a film, by a filter of this name. What it showed, the mean of its samples,
/// stays as the layer [`NOISY`].
pub fn replace_colour(film: &mut Film, colour: [Vec<f32>; 3], filter: &str) {
    film.metadata.insert(FILTERED.to_owned(), filter.to_owned());
    for channel in film.channels.iter_mut().filter(|c| RGB.contains(&c.name.as_str())) {
        channel.name = format!("{NOISY}.{}", channel.name);
    }
    RGB.into_iter().zip(colour).for_each(|(name, plane)| film.add(name, Samples::F32(plane)));
}

/// A channel of floats.
///
/// # Errors
/// When there is no such channel.
pub(crate) fn floats<'a>(film: &'a Film, name: &str) -> Checked<&'a [f32]> {
    film.floats(name).ok_or_else(|| lacks("channel of floats", name))
}

/// A layer of counts.
///
/// # Errors
/// When there is no such layer of integers.
pub(crate) fn counts<'a>(film: &'a Film, name: &str) -> Checked<&'a [u32]> {
    film.words(name).ok_or_else(|| lacks("layer of counts", name))
}

fn lacks(what: &str, name: &str) -> String {
    format!("has no {what} \"{name}\": it must be an EXR file that tallow rendered")
}

fn add_guide(film: &mut Film, guide: &[Guide]) {
    // What the samples say of it is better.
    if film.channel("albedo.R").is_none() {
        film.add_vec3("albedo", RGB, &guide.iter().map(|g| g.albedo).collect::<Vec<_>>());
    }
    film.add_vec3("N", XYZ, &guide.iter().map(|g| g.normal).collect::<Vec<_>>());
    film.add_vec3("P", XYZ, &guide.iter().map(|g| g.position).collect::<Vec<_>>());
    film.add("Z", Samples::F32(guide.iter().map(|g| g.depth).collect()));
    film.add("id", Samples::U32(guide.iter().map(|g| g.object).collect()));
}

/// What is seen in smooth surfaces or through a lens, by the names of Blender's layers for filters.
fn add_seen(film: &mut Film, seen: &[Guide]) {
    film.add_vec3("denoising normal", XYZ, &seen.iter().map(|g| g.normal).collect::<Vec<_>>());
    film.add_vec3("denoising position", XYZ, &seen.iter().map(|g| g.position).collect::<Vec<_>>());
    film.add("denoising depth", Samples::F32(seen.iter().map(|g| g.depth).collect()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_takes_its_records_and_its_channels() {
        // Statistics, light, a guide, another of what is seen, and the lens's blur; 38 channels. Placed: 24 bytes more, and 2 channels.
        let records = (size_of::<PixelStats>() + size_of::<PixelLight>() + 2 * size_of::<Guide>() + 4) as u64;
        let mut settings = Settings { width: 3, height: 2, ..Settings::default() };
        assert_eq!(host_bytes(&settings), 6 * (records + 4 * 38));
        settings.allocate.policy = &crate::allocate::both::ROW;
        assert_eq!(host_bytes(&settings), 6 * (records + 24 + 4 * 40));
    }

    #[test]
    fn a_filtered_colour_leaves_the_noisy_one_beside_it() {
        let mut film = Film::new(1, 1);
        add_pixels(&mut film, &[PixelStats { mean: [1.0, 2.0, 3.0], ..PixelStats::default() }], &[]);
        replace_colour(&mut film, [4.0, 5.0, 6.0].map(|v| vec![v]), "atrous");
        assert_eq!(rgb(&film, "").unwrap(), [[4.0], [5.0], [6.0]]);
        assert_eq!(rgb(&film, NOISY).unwrap(), [[1.0], [2.0], [3.0]]);
    }

    #[test]
    fn a_film_with_everything_has_so_many_channels() {
        let mut film = Film::new(1, 1);
        add_pixels(&mut film, &[PixelStats::default()], &[PixelLight::default()]);
        add_guide(&mut film, &[Guide::default()]);
        add_seen(&mut film, &[Guide::default()]);
        film.add(BLUR, Samples::F32(vec![0.0]));
        assert_eq!(film.channels.len(), CHANNELS);
    }
}
