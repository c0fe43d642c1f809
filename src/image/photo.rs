//! Reading of PNG, JPEG, Radiance HDR, TGA and BMP files, and writing of PNG and HDR.
use super::WriteOptions;
use super::claim::Claim;
use super::film::{Film, Picture, Samples};
use super::tone;
use crate::error::Checked;
use crate::math::srgb::linear_from_srgb;
use crate::memory;
use image::codecs::{
    hdr::{HdrDecoder, HdrEncoder},
    png::PngEncoder,
};
use image::{
    ColorType, DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageError, ImageFormat, ImageReader,
    Limits, Rgb,
};
use std::borrow::Cow;
use std::io::{Cursor, ErrorKind};

/// Largest number of pixels that one byte of a file can hold. PNG packs 8 pixels into a byte, and deflate packs 1032 bytes
/// into one. TGA packs 128 into two bytes, and BMP
/// with its runs, which may leave out all that is empty, is taken for as good. JPEG needs a bit for 64 pixels of one component, which can be subsampled by 4 in each direction; HDR holds a
/// line of 2^16 pixels in 12 bytes.
const PIXELS_PER_BYTE: u64 = 8 * 1032;
/// Largest number of bytes for colour profiles and texts.
const TEXTS: u64 = 1 << 26;

/// The codes of 8-bit sRGB: R, G, B of the first pixel, and so on.
pub fn codes(picture: &Picture, options: &WriteOptions) -> Vec<u8> {
    let code = |v: &f32| (tone::display(*v, options.exposure, options.tone_map) * 255.0).round() as u8;
    picture.pixels.iter().flatten().map(code).collect()
}

/// Encodes 8-bit sRGB.
///
/// # Errors
/// When the picture has no pixels.
pub fn encode_png(picture: &Picture, options: &WriteOptions) -> Checked<Vec<u8>> {
    let mut out = Vec::new();
    PngEncoder::new(&mut out)
        .write_image(&codes(picture, options), picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(|e| e.to_string())?;
    out.splice(PNG_HEADER..PNG_HEADER, SRGB);
    Ok(out)
}

/// Bytes of a PNG before the chunks that tell of its colours: the signature and the chunk IHDR.
const PNG_HEADER: usize = 8 + 25;
/// The chunk that says that values are sRGB, to be shown with perceptual intent: length, name, intent, checksum.
const SRGB: [u8; 13] = *b"\0\0\0\x01sRGB\0\xae\xce\x1c\xe9";

/// Encodes RGBE, which has no sign and no infinities: negative values and NaN become 0, values are limited to the largest that it
/// holds, and pixels below its smallest exponent become black (the encoder would let that wrap around). All others are rounded here,
/// since the encoder cuts off.
pub(super) fn encode_hdr(picture: &Picture) -> Checked<Vec<u8>> {
    // The encoder marks rows of this width by a byte that every reader takes for a pixel.
    if picture.width == 32768 {
        return Err("is 32768 pixels wide, which HDR files cannot be: write an .exr".to_owned());
    }
    const LARGEST: f32 = 255.0 * (1u128 << 119) as f32;
    const SMALLEST: f32 = f32::MIN_POSITIVE;
    let held = |p: &[f32; 3]| {
        let light = p.map(|v| if v > 0.0 { v.min(LARGEST) } else { 0.0 });
        Rgb(if light.iter().any(|&v| v >= SMALLEST) { nearest(light) } else { [0.0; 3] })
    };
    let pixels: Vec<_> = picture.pixels.iter().map(held).collect();
    let mut out = Vec::new();
    HdrEncoder::new(&mut out)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(|e| e.to_string())?;
    Ok(out)
}

/// The nearest colour whose channels are multiples, up to 255, of 1/256 of one power of two. The brightest is a normal number.
fn nearest(light: [f32; 3]) -> [f32; 3] {
    // A float's exponent alone is the largest power of two in it, 128 units.
    let unit = |v: f32| f32::from_bits(v.to_bits() & 0x7f80_0000) / 128.0;
    let brightest = light.into_iter().fold(0.0, f32::max);
    // What rounds to 256 units has twice the unit.
    let unit = unit((brightest / unit(brightest)).round() * unit(brightest));
    light.map(|v| (v / unit).round() * unit)
}

/// How the HDR files of Radiance begin, and those of other programs, which the decoder does not know.
const RADIANCE: &[u8] = b"#?RADIANCE\n";
const RGBE: &[u8] = b"#?RGBE\n";

/// The memory that decoding a file takes, from its header alone.
///
/// # Errors
/// A message about what is wrong with the header.
pub fn claim(bytes: &[u8]) -> Checked<Claim> {
    if format(bytes).is_none() {
        return Err(NO_IMAGE.to_owned());
    }
    let decoder = reader(bytes, TEXTS)?.into_decoder().map_err(plain)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels > PIXELS_PER_BYTE * bytes.len() as u64 {
        let length = bytes.len();
        return Err(format!("claims {pixels} pixels, more than a file of {length} bytes can hold; is it complete?"));
    }
    let color = decoder.color_type();
    let planes = if color.has_alpha() { 4 } else { 3 };
    Ok(Claim { size: [width, height], bytes: pixels * (u64::from(color.bytes_per_pixel()) + 4 * planes) })
}

pub(super) fn decode(bytes: &[u8]) -> Checked<Film> {
    film_from(&picture(bytes)?)
}

/// Decodes a PNG, JPEG, HDR, TGA or BMP file without converting its values, but for what the header of an HDR says that they were
/// multiplied by.
///
/// # Errors
/// A message about what is wrong with the data, or that they need more memory than is free.
pub fn picture(bytes: &[u8]) -> Checked<DynamicImage> {
    let claim = claim(bytes)?;
    check_end(bytes)?;
    memory::check(claim.bytes)?;
    let exposure = exposure(bytes)?;
    let mut picture = reader(bytes, TEXTS + claim.bytes)?.decode().map_err(plain)?;
    if let (DynamicImage::ImageRgb32F(picture), Some(exposure)) = (&mut picture, exposure) {
        picture.pixels_mut().flat_map(|p| p.0.iter_mut().zip(exposure)).for_each(|(v, exposure)| *v /= exposure);
    }
    Ok(picture)
}

/// What the radiance in an HDR file was multiplied by, all lines together; `None` for other files.
fn exposure(bytes: &[u8]) -> Checked<Option<[f32; 3]>> {
    if format(bytes) != Some(ImageFormat::Hdr) {
        return Ok(None);
    }
    let header = HdrDecoder::new(reader(bytes, TEXTS)?.into_inner()).map_err(plain)?.metadata();
    let (all, (r, g, b)) = (header.exposure.unwrap_or(1.0), header.color_correction.unwrap_or((1.0, 1.0, 1.0)));
    let exposure = [r, g, b].map(|own| own * all);
    match exposure.iter().find(|v| !(v.is_normal() && **v > 0.0)) {
        None => Ok(Some(exposure)),
        Some(wrong) => Err(format!(
            "was multiplied by {wrong}, by its lines EXPOSURE and COLORCORR: correct these to positive numbers, or remove them"
        )),
    }
}

/// What is told of a file that is no image, or of a kind that is not read.
pub const NO_IMAGE: &str = "is no EXR, PNG, JPEG, HDR, TGA or BMP file";

/// What the first bytes say that a picture is; `None` if it is not read.
pub fn format(bytes: &[u8]) -> Option<ImageFormat> {
    match bytes.starts_with(RGBE) {
        true => Some(ImageFormat::Hdr),
        false => match image::guess_format(bytes) {
            Ok(format) => Some(format).filter(|format| is_read(*format)),
            Err(_) => is_tga(bytes).then_some(ImageFormat::Tga),
        },
    }
}

/// Whether files of this format are read, those of EXR elsewhere.
fn is_read(format: ImageFormat) -> bool {
    use ImageFormat::{Bmp, Hdr, Jpeg, OpenExr, Png, Tga};
    matches!(format, Png | Jpeg | Hdr | OpenExr | Tga | Bmp)
}

/// Whether the first bytes are those of a picture of another format.
pub fn is_unread(bytes: &[u8]) -> bool {
    format(bytes).is_none() && image::guess_format(bytes).is_ok()
}

/// Number of bytes from which the format is told.
pub const HEAD: usize = 18;

/// Whether a file begins as TGA files do, which have no mark of their own: the kinds of colours and of packing that there are, a size, and
/// bits of a pixel.
fn is_tga(bytes: &[u8]) -> bool {
    let Some(&[_, palette, kind, _, _, _, _, entry, _, _, _, _, w0, w1, h0, h1, bits, _]) = bytes.first_chunk::<HEAD>()
    else {
        return false;
    };
    let by_palette = matches!(kind, 1 | 9);
    let known = (by_palette || matches!(kind, 2 | 3 | 10 | 11)) && palette <= 1 && (!by_palette || palette == 1);
    let entries = palette == 0 || matches!(entry, 15 | 16 | 24 | 32);
    let bits = if by_palette { matches!(bits, 8 | 16) } else { matches!(bits, 8 | 15 | 16 | 24 | 32) };
    known && entries && bits && [w0, w1] != [0; 2] && [h0, h1] != [0; 2]
}

/// Whether a file is a PNG of 16 bits a channel, which its first chunk says behind the size.
pub fn has_16_bits(bytes: &[u8]) -> bool {
    format(bytes) == Some(ImageFormat::Png) && bytes.get(24) == Some(&16)
}

fn reader(bytes: &[u8], memory: u64) -> Checked<ImageReader<Cursor<Cow<'_, [u8]>>>> {
    let bytes = match bytes.strip_prefix(RGBE) {
        Some(rest) => Cow::Owned([RADIANCE, rest].concat()),
        None => Cow::Borrowed(bytes),
    };
    let format = format(&bytes).ok_or(NO_IMAGE)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(memory);
    reader.limits(limits);
    Ok(reader)
}

/// Translates the crate's errors, which address programmers, for users.
fn plain(e: ImageError) -> String {
    let damaged = |what: &str| format!("cannot be decoded: {what}; is it complete?");
    match e {
        ImageError::IoError(e) if e.kind() != ErrorKind::UnexpectedEof => damaged("it cannot be read to its end"),
        ImageError::IoError(_) => damaged("it ends too early"),
        ImageError::Unsupported(_) => {
            "is of a rare kind, which is not supported: save it as a plain PNG, or as EXR if it holds floats".to_owned()
        }
        ImageError::Limits(_) => "holds more than 64 MiB of texts or profiles: save it without".to_owned(),
        ImageError::Decoding(_) | ImageError::Encoding(_) | ImageError::Parameter(_) => damaged("its data are damaged"),
    }
}

/// Checks that a JPEG is complete. The decoders of other formats do so themselves.
///
/// # Errors
/// A message that the end of the file is missing.
pub fn check_end(bytes: &[u8]) -> Checked {
    match format(bytes) == Some(ImageFormat::Jpeg) && jpeg_is_cut(bytes) {
        true => Err("is a JPEG without its end: get the complete file".to_owned()),
        false => Ok(()),
    }
}

/// Whether the end marker is missing; the decoder would fill the missing part with grey. Segments are skipped by their
/// lengths, so that thumbnails inside them and data that phones append to the picture are ignored.
fn jpeg_is_cut(bytes: &[u8]) -> bool {
    const END_OF_IMAGE: u8 = 0xd9;
    let mut rest = bytes;
    // In the data of a scan, each 0xff is followed by 0 or a restart marker. These, 1 and the start of the image have no
    // length.
    while let Some(at) = rest.iter().position(|&byte| byte == 0xff) {
        rest = &rest[at + 1..];
        match *rest {
            [END_OF_IMAGE, ..] => return false,
            [0 | 1 | 0xd0..=0xd8 | 0xff, ..] => {}
            [_, high, low, ..] => {
                let behind = 1 + usize::from(u16::from_be_bytes([high, low]));
                rest = rest.get(behind..).unwrap_or_default();
            }
            _ => return true,
        }
    }
    true
}

/// Number of rows that are converted at a time, because converting a whole picture would need its size in memory again.
pub const BAND: u32 = 64;

/// Splits the picture into bands of [`BAND`] rows; the last may have fewer.
pub fn bands(image: &DynamicImage) -> impl Iterator<Item = DynamicImage> {
    let (width, height) = (image.width(), image.height());
    (0..height).step_by(BAND as usize).map(move |y| image.crop_imm(0, y, width, BAND.min(height - y)))
}

/// Converts a picture into a film. Integers are sRGB code values and floats are radiance. Alpha is always linear and
/// becomes the channel A.
fn film_from(image: &DynamicImage) -> Checked<Film> {
    let is_float = matches!(image.color(), ColorType::Rgb32F | ColorType::Rgba32F);
    let names = if image.color().has_alpha() { &["R", "G", "B", "A"][..] } else { &["R", "G", "B"] };
    let mut film = Film::new(image.width(), image.height());
    let mut planes: Vec<Vec<f32>> = names.iter().map(|_| memory::reserved(film.pixels())).collect::<Result<_, _>>()?;
    let linear = |v: f32| if is_float { v } else { linear_from_srgb(v) };
    for band in bands(image) {
        for pixel in band.into_rgba32f().pixels() {
            let [r, g, b, a] = pixel.0;
            planes.iter_mut().zip([linear(r), linear(g), linear(b), a]).for_each(|(plane, v)| plane.push(v));
        }
    }
    names.iter().zip(planes).for_each(|(name, plane)| film.add(*name, Samples::F32(plane)));
    Ok(film)
}
