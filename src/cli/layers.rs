//! What a renderer's buffers hold, as the channels of an image file.
use crate::error::Result;
use crate::gpu::Buffer;
use crate::gpu::layout::{Guide, PixelLight, PixelStats};
use crate::image::{Film, Samples};
use crate::renderer::{FilmTile, Renderer};
use bytemuck::Pod;

const RGB: [&str; 3] = ["R", "G", "B"];
const XYZ: [&str; 3] = ["X", "Y", "Z"];

/// Reads the buffers back into a film with the layers that the renderer was asked for.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn film(renderer: &Renderer) -> Result<Film> {
    let settings = renderer.settings();
    let mut film = Film::new(settings.width, settings.height);
    let tiles = &renderer.film().tiles;
    add_stats(&mut film, &gather(tiles, |tile| &tile.stats)?);
    if renderer.outputs().split_light {
        add_light(&mut film, &gather(tiles, |tile| &tile.light)?);
    }
    if renderer.outputs().guides {
        add_guide(&mut film, &gather(tiles, |tile| &tile.guide)?);
    }
    Ok(film)
}

/// One array out of all tiles.
fn gather<T: Pod>(tiles: &[FilmTile], buffer: impl Fn(&FilmTile) -> &Buffer<T>) -> Result<Vec<T>> {
    let parts: Vec<Vec<T>> = tiles.iter().map(|tile| buffer(tile).read()).collect::<Result<_>>()?;
    Ok(parts.concat())
}

fn add_stats(film: &mut Film, stats: &[PixelStats]) {
    film.add_vec3("", RGB, &stats.iter().map(|s| s.mean).collect::<Vec<_>>());
    film.add_vec3("variance", RGB, &stats.iter().map(variance_of_mean).collect::<Vec<_>>());
    film.add("samples", Samples::U32(stats.iter().map(|s| s.count).collect()));
}

/// Squared standard error of a pixel: m2 / (n (n - 1)); 0 for fewer than two samples, which tell nothing.
fn variance_of_mean(s: &PixelStats) -> [f32; 3] {
    let n = s.count as f32;
    s.m2.map(|m2| if s.count > 1 { m2 / (n * (n - 1.0)) } else { 0.0 })
}

fn add_light(film: &mut Film, light: &[PixelLight]) {
    film.add_vec3("direct", RGB, &light.iter().map(|l| l.direct).collect::<Vec<_>>());
    film.add_vec3("indirect", RGB, &light.iter().map(|l| l.indirect).collect::<Vec<_>>());
}

fn add_guide(film: &mut Film, guide: &[Guide]) {
    film.add_vec3("albedo", RGB, &guide.iter().map(|g| g.albedo).collect::<Vec<_>>());
    film.add_vec3("N", XYZ, &guide.iter().map(|g| g.normal).collect::<Vec<_>>());
    film.add_vec3("P", XYZ, &guide.iter().map(|g| g.position).collect::<Vec<_>>());
    film.add("Z", Samples::F32(guide.iter().map(|g| g.depth).collect()));
    film.add("id", Samples::U32(guide.iter().map(|g| g.object).collect()));
}
