//! What a renderer's buffers hold, as the channels of an image file, and back.
use crate::error::Result;
use crate::gpu::layout::{Guide, PixelLight, PixelStats, vec3};
use crate::image::{Film, NOISY, Samples};
use crate::memory;
use crate::renderer::Renderer;
use crate::statistics::{Pixel, variance_of_mean};

const RGB: [&str; 3] = ["R", "G", "B"];
const XYZ: [&str; 3] = ["X", "Y", "Z"];

/// What the policy said last: only in files of renders that place samples.
pub const PRIORITY: &str = "priority";

/// Samples that a pixel still lacks of what it was to have: only in files of renders that were interrupted.
pub const PENDING: &str = "pending";

/// Metadata of what `tallow filter` wrote: the filter.
pub const FILTERED: &str = "filtered";

/// Of a film with everything.
const CHANNELS: usize = 27;

/// What a pixel takes in a film with everything.
pub fn bytes_per_pixel(placed: bool) -> u64 {
    (size_of::<f32>() * (CHANNELS + if placed { 2 } else { 0 })) as u64 // priority, pending
}

/// Reads the buffers back into a film with the layers that the renderer was asked for, a window at a time: whole buffers
/// beside the film would be as large again.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn film(renderer: &Renderer) -> Result<Film> {
    let (settings, outputs) = (renderer.settings(), renderer.outputs());
    let mut film = Film::new(settings.width, settings.height);
    for tile in &renderer.film().tiles {
        for range in tile.windows() {
            let window = range.start as usize..range.end as usize;
            let mut part = Film::new(window.len() as u32, 1);
            let light = if outputs.split_light { tile.light.read_range(window.clone())? } else { Vec::new() };
            add_pixels(&mut part, &tile.stats.read_range(window.clone())?, &light);
            if outputs.guides {
                add_guide(&mut part, &tile.guide.read_range(window)?);
            }
            film.append(part);
        }
    }
    if settings.allocate.policy != "uniform" {
        film.add(PRIORITY, Samples::F32(renderer.film().priority.read()?));
    }
    Ok(film)
}

/// Adds what the samples say. `light` is empty where direct and indirect light are not kept apart.
fn add_pixels(film: &mut Film, stats: &[PixelStats], light: &[PixelLight]) {
    let vec3s = |of: fn(&PixelStats) -> vec3| stats.iter().map(of).collect::<Vec<_>>();
    film.add_vec3("", RGB, &vec3s(|s| s.mean));
    film.add_vec3("variance", RGB, &vec3s(variance_of_mean));
    film.add_vec3("m2", RGB, &vec3s(|s| s.m2));
    film.add("samples", Samples::U32(stats.iter().map(|s| s.count).collect()));
    if !light.is_empty() {
        film.add_vec3("direct", RGB, &light.iter().map(|l| l.direct).collect::<Vec<_>>());
        film.add_vec3("indirect", RGB, &light.iter().map(|l| l.indirect).collect::<Vec<_>>());
    }
}

/// What the samples say, out of a film that [`film()`] made.
///
/// # Errors
/// Which layer is missing, or that memory is.
pub fn pixels(film: &Film) -> std::result::Result<Vec<Pixel>, String> {
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
    let light = if splits_light(film)? { Some((rgb(film, "direct")?, rgb(film, "indirect")?)) } else { None };
    let at = |plane: [&[f32]; 3], i: usize| plane.map(|values| values[i]);
    let pixel = |i: usize| Pixel {
        stats: PixelStats { mean: at(mean, i), count: count[i], m2: at(m2, i), rays: 0 },
        light: light.map_or_else(PixelLight::default, |(direct, indirect)| PixelLight {
            direct: at(direct, i),
            indirect: at(indirect, i),
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
pub fn splits_light(film: &Film) -> std::result::Result<bool, String> {
    let names = ["direct", "indirect"].map(|layer| RGB.map(|c| format!("{layer}.{c}"))).concat();
    match names.iter().filter(|name| film.channel(name).is_some()).count() {
        0 => Ok(false),
        n if n == names.len() => Ok(true),
        _ => Err("has direct or indirect light in part: take the file as tallow wrote it".to_owned()),
    }
}

/// The channels of a layer.
fn rgb<'a>(film: &'a Film, layer: &str) -> std::result::Result<[&'a [f32]; 3], String> {
    let plane = |component: &str| {
        let name = if layer.is_empty() { component.to_owned() } else { format!("{layer}.{component}") };
        match film.channel(&name) {
            Some(Samples::F32(values)) => Ok(values.as_slice()),
            _ => Err(format!("has no channel of floats \"{name}\": it must be an EXR file that tallow rendered")),
        }
    };
    Ok([plane("R")?, plane("G")?, plane("B")?])
}

/// Puts a filtered colour in the place of the samples' mean, which stays as a layer.
pub fn denoise(film: &mut Film, colour: &[vec3]) {
    for channel in film.channels.iter_mut().filter(|c| RGB.contains(&c.name.as_str())) {
        channel.name = format!("{NOISY}.{}", channel.name);
    }
    film.add_vec3("", RGB, colour);
}

/// Replaces what the samples say; the other layers stay, but for a filtered colour.
pub fn replace_pixels(film: &mut Film, pixels: &[Pixel]) {
    let split = film.channel("direct.R").is_some();
    let mut fresh = Film::new(film.width, film.height);
    let light: Vec<_> = pixels.iter().filter(|_| split).map(|p| p.light).collect();
    add_pixels(&mut fresh, &pixels.iter().map(|p| p.stats).collect::<Vec<_>>(), &light);
    film.channels.retain(|c| fresh.channel(&c.name).is_none() && !c.name.starts_with(NOISY));
    film.metadata.remove(FILTERED);
    film.channels.extend(fresh.channels);
}

/// A layer of counts.
///
/// # Errors
/// When there is no such layer of integers.
pub fn counts(film: &Film, name: &str) -> std::result::Result<Vec<u32>, String> {
    match film.channel(name) {
        Some(Samples::U32(counts)) => Ok(counts.clone()),
        _ => Err(format!("has no layer of counts \"{name}\": it must be an EXR file that tallow rendered")),
    }
}

fn add_guide(film: &mut Film, guide: &[Guide]) {
    film.add_vec3("albedo", RGB, &guide.iter().map(|g| g.albedo).collect::<Vec<_>>());
    film.add_vec3("N", XYZ, &guide.iter().map(|g| g.normal).collect::<Vec<_>>());
    film.add_vec3("P", XYZ, &guide.iter().map(|g| g.position).collect::<Vec<_>>());
    film.add("Z", Samples::F32(guide.iter().map(|g| g.depth).collect()));
    film.add("id", Samples::U32(guide.iter().map(|g| g.object).collect()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_with_everything_has_so_many_channels() {
        let mut film = Film::new(1, 1);
        add_pixels(&mut film, &[PixelStats::default()], &[PixelLight::default()]);
        add_guide(&mut film, &[Guide::default()]);
        assert_eq!(film.channels.len(), CHANNELS);
    }
}
