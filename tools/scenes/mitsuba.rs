//! Differences between what Mitsuba computes and what its descriptions say, with the values that give the same picture in
//! Tallow.
use super::emit::Place;
use anyhow::Context;
use image::codecs::png::PngEncoder;
use std::fs::File;
use std::path::PathBuf;
use tallow::image::{Film, Picture, WriteOptions};
use tallow::math::fresnel::fresnel_dielectric;
use tallow::scene::coat_table;
use tallow::twins::coat::{coat_row_at, row_inside};

/// Field of view in degrees. The XML of the tests leaves it to the default, a 50 mm lens on 36 mm x 24 mm film; the
/// descriptions say 30, with which the references do not match. For a square film with the diagonal of 36 mm x 24 mm it is
/// 2 atan(hypot(36, 24) / (100 sqrt 2)).
pub const FOV: f64 = 34.02205717235932;

/// Writes a grey image for a mask beside the scene file. Mitsuba masks with the decoded luminance of an image and ignores
/// its alpha, whereas Tallow uses alpha and linear values.
pub fn grey_mask(place: &Place, filename: &str) -> anyhow::Result<PathBuf> {
    let source = place.folder.join(filename);
    let bytes = std::fs::read(&source).with_context(|| format!("cannot read {}", source.display()))?;
    let image = image::load_from_memory(&bytes).with_context(|| format!("cannot decode {}", source.display()))?;
    let mut grey = image.to_luma8();
    for pixel in grey.pixels_mut() {
        let s = f32::from(pixel.0[0]) / 255.0;
        let linear = if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) };
        pixel.0[0] = (linear * 255.0).round() as u8;
    }
    let path = beside(place, filename, "png")?;
    let file = File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    grey.write_with_encoder(PngEncoder::new(file)).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Writes an environment image beside the scene file with the rows where Tallow expects them. Mitsuba puts the centres of
/// the first and the last row on the poles, Tallow half a row away from them. The new image has more rows, so that
/// interpolation between them reproduces the old rows.
pub fn environment(place: &Place, filename: &str) -> anyhow::Result<PathBuf> {
    const FINER: usize = 4;
    let Picture { width, height, pixels } =
        tallow::image::read(&place.folder.join(filename))?.rec709(None).map_err(anyhow::Error::msg)?;
    let (columns, last) = (width as usize, height as usize - 1);
    let pixel = |i: usize| {
        let at = (i / columns) as f32 + 0.5;
        let at = at / FINER as f32;
        let above = (at as usize).min(last - 1);
        let row = |y: usize| glam::Vec3::from(pixels[y * columns + i % columns]);
        row(above).lerp(row(above + 1), at - above as f32).to_array()
    };
    let rows = FINER * last;
    let mut film = Film::new(width, rows as u32);
    film.add_vec3("", ["R", "G", "B"], &(0..rows * columns).map(pixel).collect::<Vec<_>>());
    let path = beside(place, filename, "exr")?;
    tallow::image::write(&path, &film, &WriteOptions::default())?;
    Ok(path)
}

/// Factor for the colour under a rough coat of index `eta`. Mitsuba approximates the integral of what the coat reflects
/// inwards by the mean over 64 cosines including both ends: 63/64 of it plus 1/64 of the reflectance along the normal.
pub fn under_rough_coat(eta: f64, alpha: f64, ggx: bool) -> f64 {
    let table: Vec<u32> = coat_table(eta as f32, ggx).into_iter().map(f32::to_bits).collect();
    let exact = f64::from(row_inside(&coat_row_at(&table, alpha as f32)));
    let normal = f64::from(fresnel_dielectric(1.0, eta as f32).x);
    (1.0 - exact) / (1.0 - (63.0 * exact + normal) / 64.0)
}

/// Path for a picture that is made for the scene.
fn beside(place: &Place, filename: &str, extension: &str) -> anyhow::Result<PathBuf> {
    let stem = PathBuf::from(filename).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(place.out.canonicalize()?.join(format!("{}-{stem}.{extension}", place.name)))
}
