//! OpenEXR, scan lines, lossless: ours out, anybody's in.
use super::film::{Channel, Film, Samples};
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatImage, FlatSamples, Image, Layer};
use exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::meta::MetaData;
use exr::prelude::{Compression, ReadChannels, ReadLayers, WritableImage};
use std::io::Cursor;

/// 4 GiB of 32-bit samples.
const MAX_SAMPLES: u64 = 1 << 30;
/// Deflate packs at most 1032 to 1 and PXR24 drops one byte in four; a header that asks for more than this times
/// the length of its file is damaged, and must not make us allocate what it asks for.
const MAX_RATIO: u64 = 4096;

pub(super) fn encode(film: &Film) -> Result<Vec<u8>, String> {
    let channel = |c: &Channel| AnyChannel::new(text(&c.name), flat_samples(&c.samples));
    let channels = AnyChannels::sort(film.channels.iter().map(channel).collect());
    let size = (film.width as usize, film.height as usize);
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let encoding = Encoding { blocks: exr::image::Blocks::ScanLines, ..encoding };
    let layer = Layer::new(size, LayerAttributes::default(), encoding, channels);
    let mut attributes = ImageAttributes::with_size(size);
    attributes.other = film.metadata.iter().map(|(k, v)| (text(k), AttributeValue::Text(text(v)))).collect();
    let mut out = Cursor::new(Vec::new());
    Image::empty(attributes)
        .with_layer(layer)
        .write()
        .to_buffered(&mut out)
        .map_err(|e| format!("cannot be encoded: {e}"))?;
    Ok(out.into_inner())
}

/// UTF-8 as it is, which is what OpenEXR's own library writes; the crate's conversions allow Latin-1 only.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

fn string(t: &Text) -> String {
    String::from_utf8_lossy(t.as_slice()).into_owned()
}

fn flat_samples(samples: &Samples) -> FlatSamples {
    match samples {
        Samples::F32(v) => FlatSamples::F32(v.clone()),
        Samples::U32(v) => FlatSamples::U32(v.clone()),
    }
}

pub(super) fn decode(bytes: &[u8]) -> Result<Film, String> {
    let damaged = |e: exr::error::Error| format!("cannot be decoded: {e}; is it complete?");
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    check_size(&meta, bytes.len() as u64)?;
    let image: FlatImage = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    film_from(image)
}

fn check_size(meta: &MetaData, file_len: u64) -> Result<(), String> {
    let area = |w: usize, h: usize| (w as u64).saturating_mul(h as u64);
    let samples = |size: exr::math::Vec2<usize>, channels: usize| area(size.0, size.1).saturating_mul(channels as u64);
    let (mut stored, mut shown) = (0_u64, 0_u64);
    for header in &meta.headers {
        let channels = header.channels.list.len();
        stored = stored.saturating_add(samples(header.layer_size, channels));
        shown = shown.saturating_add(samples(header.shared_attributes.display_window.size, channels));
    }
    if stored.max(shown) > MAX_SAMPLES || stored > file_len.saturating_mul(MAX_RATIO) {
        return Err(format!("claims {} samples, which a file of {file_len} bytes cannot hold", stored.max(shown)));
    }
    Ok(())
}

/// All parts in one film, channels of a second part and on under the name of their part.
fn film_from(image: FlatImage) -> Result<Film, String> {
    let window = image.attributes.display_window;
    let mut film = Film::new(window.size.0 as u32, window.size.1 as u32);
    if film.pixels() == 0 {
        return Err("has no pixels: its display window is empty".to_owned());
    }
    let many = image.layer_data.len() > 1;
    for part in image.layer_data {
        let part_name = part.attributes.layer_name.as_ref().filter(|_| many).map(string);
        for channel in part.channel_data.list {
            let name = channel_name(part_name.as_deref(), &string(&channel.name));
            if channel.sampling != exr::math::Vec2(1, 1) {
                return Err(format!("channel {name} is subsampled, which is not supported: save it at full size"));
            }
            let data = IntegerBounds::new(part.attributes.layer_position, part.size);
            film.channels.push(Channel { name, samples: shown_samples(channel.sample_data, data, window) });
        }
        film.metadata.extend(texts(&part.attributes.other));
    }
    film.metadata.extend(texts(&image.attributes.other));
    Ok(film)
}

fn texts<'a>(
    attributes: impl IntoIterator<Item = (&'a Text, &'a AttributeValue)>,
) -> impl Iterator<Item = (String, String)> {
    attributes.into_iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(value) => Some((string(name), string(value))),
        _ => None,
    })
}

/// Some programs repeat the part's name in its channels, some do not.
fn channel_name(part: Option<&str>, channel: &str) -> String {
    match part {
        Some(part) if !part.is_empty() && !channel.starts_with(&format!("{part}.")) => format!("{part}.{channel}"),
        _ => channel.to_owned(),
    }
}

fn shown_samples(samples: FlatSamples, data: IntegerBounds, window: IntegerBounds) -> Samples {
    match samples {
        FlatSamples::F16(v) => Samples::F32(shown(v.iter().map(|h| h.to_f32()).collect(), data, window)),
        FlatSamples::F32(v) => Samples::F32(shown(v, data, window)),
        FlatSamples::U32(v) => Samples::U32(shown(v, data, window)),
    }
}

/// The picture is the display window: pixels outside the data window are 0, data outside the display window is dropped.
fn shown<T: Copy + Default>(stored: Vec<T>, data: IntegerBounds, window: IntegerBounds) -> Vec<T> {
    if data == window {
        return stored;
    }
    let (width, height) = (window.size.0, window.size.1);
    let mut out = vec![T::default(); width * height];
    // Offsets of two 32-bit positions need 33 bits.
    let dx = i64::from(data.position.0) - i64::from(window.position.0);
    let dy = i64::from(data.position.1) - i64::from(window.position.1);
    let first = (-dx).clamp(0, data.size.0 as i64) as usize;
    let last = (width as i64 - dx).clamp(first as i64, data.size.0 as i64) as usize;
    for (row, values) in stored.chunks_exact(data.size.0.max(1)).enumerate() {
        let y = row as i64 + dy;
        if first < last && (0..height as i64).contains(&y) {
            let start = y as usize * width + (first as i64 + dx) as usize;
            out[start..start + last - first].copy_from_slice(&values[first..last]);
        }
    }
    out
}
