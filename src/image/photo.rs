//! PNG, JPEG and Radiance HDR.
use super::film::{Film, Picture, Samples};
use super::tone;
use super::WriteOptions;
use image::codecs::{hdr::HdrEncoder, png::PngEncoder};
use image::{ColorType, DynamicImage, ExtendedColorType, ImageEncoder, ImageReader, Limits, Rgb};
use std::io::Cursor;

/// More than any screen or camera; keeps a damaged header from asking for all memory.
const MAX_EDGE: u32 = 65_536;
const MAX_BYTES: u64 = 4 << 30;

pub(super) fn encode_png(picture: &Picture, options: &WriteOptions) -> Result<Vec<u8>, String> {
    let code = |v: &f32| (tone::display(*v, options.exposure, options.tone_map) * 255.0).round() as u8;
    let bytes: Vec<u8> = picture.pixels.iter().flatten().map(code).collect();
    let mut out = Vec::new();
    PngEncoder::new(&mut out)
        .write_image(&bytes, picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(|e| format!("cannot be encoded: {e}"))?;
    Ok(out)
}

/// RGBE has no sign and no infinities: negative values and NaN become 0, huge ones the largest that it holds.
pub(super) fn encode_hdr(picture: &Picture) -> Result<Vec<u8>, String> {
    const LARGEST: f32 = 1.7e38;
    let pixels: Vec<_> = picture.pixels.iter().map(|p| Rgb(p.map(|v| v.max(0.0).min(LARGEST)))).collect();
    let mut out = Vec::new();
    HdrEncoder::new(&mut out)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(|e| format!("cannot be encoded: {e}"))?;
    Ok(out)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Film, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    if reader.format().is_none() {
        return Err("is no EXR, PNG, JPEG or HDR file".to_owned());
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| format!("cannot be decoded: {e}; is it complete?"))?;
    Ok(film_from(image))
}

/// Integers are taken for sRGB code values, floats for radiance. Alpha, always linear, is kept as the channel A.
fn film_from(image: DynamicImage) -> Film {
    let is_float = matches!(image.color(), ColorType::Rgb32F | ColorType::Rgba32F);
    let has_alpha = image.color().has_alpha();
    let rgba = image.into_rgba32f();
    let mut film = Film::new(rgba.width(), rgba.height());
    let linear = |v: f32| if is_float { v } else { tone::linear_from_srgb(v) };
    let colour: Vec<_> = rgba.pixels().map(|p| [p[0], p[1], p[2]].map(linear)).collect();
    film.add_vec3("", ["R", "G", "B"], &colour);
    if has_alpha {
        film.add("A", Samples::F32(rgba.pixels().map(|p| p[3]).collect()));
    }
    film
}
