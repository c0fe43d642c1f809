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
        .map_err(|e| e.to_string())?;
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
        .map_err(|e| e.to_string())?;
    Ok(out)
}

pub(super) fn decode(bytes: &[u8]) -> Result<Film, String> {
    let reader = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string());
    let damaged = |e: ImageError| format!("cannot be decoded: {e}; is it complete?");
    if reader()?.format().is_none() {
        return Err("is no EXR, PNG, JPEG or HDR file".to_owned());
    }
    check_end(bytes)?;
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

/// # Errors
/// For a JPEG that is not complete; other decoders notice by themselves.
pub fn check_end(bytes: &[u8]) -> Result<(), String> {
    match image::guess_format(bytes).is_ok_and(|f| f == ImageFormat::Jpeg) && jpeg_is_cut(bytes) {
        true => Err("is a JPEG without its end: get the complete file".to_owned()),
        false => Ok(()),
    }
}

/// Whether the end marker is missing: the decoder fills what is not there with grey. Segments are passed over by their
/// lengths, so that thumbnails within them and what phones append behind the picture do not count.
fn jpeg_is_cut(bytes: &[u8]) -> bool {
    const END_OF_IMAGE: u8 = 0xd9;
    let mut rest = bytes;
    // In the data of a scan a 0 or a restart follows each 0xff; those, 1 and the start of the image have no length.
    let is_segment = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 1 | 0xd0..=0xd8 | 0xff);
    while let Some(at) = rest.windows(2).position(is_segment) {
        if rest[at + 1] == END_OF_IMAGE {
            return false;
        }
        let Some(&[high, low]) = rest[at + 2..].first_chunk() else { return true };
        let behind = at + 2 + usize::from(u16::from_be_bytes([high, low]));
        rest = rest.get(behind..).unwrap_or_default();
    }
    true
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
