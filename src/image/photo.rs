//! PNG, JPEG and Radiance HDR.
use super::WriteOptions;
use super::film::{Film, Picture, Samples};
use super::tone;
use image::codecs::{hdr::HdrEncoder, png::PngEncoder};
use image::{
    ColorType, DynamicImage, ExtendedColorType, ImageEncoder, ImageError, ImageFormat, ImageReader, Limits, Rgb,
};
use std::io::Cursor;

/// Deflate, in PNG, packs at most 1032 to 1; each pixel counts as four samples.
const MAX_RATIO: u64 = 4 * 1032;
/// Bytes that colour profiles and texts beside the pixels may take.
const TEXTS: u64 = 1 << 26;

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
    let pixels: Vec<_> =
        picture.pixels.iter().map(|p| Rgb(p.map(|v| if v > 0.0 { v.min(LARGEST) } else { 0.0 }))).collect();
    let mut out = Vec::new();
    HdrEncoder::new(&mut out)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(|e| format!("cannot be encoded: {e}"))?;
    Ok(out)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Film, String> {
    let reader = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string());
    let damaged = |e: ImageError| format!("cannot be decoded: {e}; is it complete?");
    let Some(format) = reader()?.format() else {
        return Err("is no EXR, PNG, JPEG or HDR file".to_owned());
    };
    if format == ImageFormat::Jpeg && jpeg_is_cut(bytes) {
        return Err("is a JPEG without its end: get the complete file".to_owned());
    }
    let (width, height) = reader()?.into_dimensions().map_err(damaged)?;
    // Four: alpha, or what a decoder adds for it.
    let samples = 4 * u64::from(width) * u64::from(height);
    super::check_claim(samples, bytes.len(), MAX_RATIO)?;
    let mut reader = reader()?;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(TEXTS + 8 * samples);
    reader.limits(limits);
    reader.decode().map(film_from).map_err(damaged)
}

/// The decoder fills what is missing with grey. A complete file has an end marker behind its last start of scan; the
/// thumbnail that a camera embeds before it does not count.
fn jpeg_is_cut(bytes: &[u8]) -> bool {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|w| w == marker);
    const START_OF_SCAN: [u8; 2] = [0xff, 0xda];
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    last(END_OF_IMAGE) < last(START_OF_SCAN)
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
