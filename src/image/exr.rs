//! OpenEXR, scan lines, lossless: ours out, anybody's in.
use super::film::{Channel, Film, Samples};
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatImage, FlatSamples, Image, Layer};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{Compression, LineOrder, ReadChannels, ReadLayers, WritableImage};
use std::io::Cursor;

/// Flat areas in DWA blocks: one value in 64, deflated 1032 to 1.
const MAX_RATIO: u64 = 1 << 16;
/// Before the names of our attributes, as many names (`version`, `comments`...) are taken by the standard.
const PREFIX: &str = "tallow:";

pub(super) fn encode(film: &Film) -> Result<Vec<u8>, String> {
    let channel = |c: &Channel| AnyChannel::new(text(&c.name), flat_samples(&c.samples));
    let channels = AnyChannels::sort(film.channels.iter().map(channel).collect());
    let size = (film.width as usize, film.height as usize);
    let (compression, blocks, line_order) = (Compression::ZIP16, Blocks::ScanLines, LineOrder::Increasing);
    let encoding = Encoding { compression, blocks, line_order };
    let layer = Layer::new(size, LayerAttributes::default(), encoding, channels);
    let mut attributes = ImageAttributes::with_size(size);
    let attribute = |(key, value): (&String, &String)| (text(&format!("{PREFIX}{key}")), text(value));
    attributes.other = film.metadata.iter().map(attribute).map(|(k, v)| (k, AttributeValue::Text(v))).collect();
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
    check_size(&meta, bytes.len())?;
    check_sampling(&meta)?;
    let image: FlatImage = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        // A panic on one of its own threads would abort the process, see `contained`.
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    film_from(image)
}

fn check_size(meta: &MetaData, file_len: usize) -> Result<(), String> {
    let mut claimed = 0_u64;
    for header in &meta.headers {
        let window = header.shared_attributes.display_window.size;
        let samples = |size: Vec2<usize>| (size.0 as u64).saturating_mul(size.1 as u64);
        let plane = samples(header.layer_size).max(samples(window));
        claimed = claimed.saturating_add(plane.saturating_mul(header.channels.list.len() as u64));
    }
    super::check_claim(claimed, file_len, MAX_RATIO)
}

/// The crate's reader asserts this.
fn check_sampling(meta: &MetaData) -> Result<(), String> {
    let mut channels = meta.headers.iter().flat_map(|h| &h.channels.list);
    match channels.find(|c| c.sampling != Vec2(1, 1)) {
        Some(c) => Err(format!("channel {} is subsampled, which is not supported: save it at full size", c.name)),
        None => Ok(()),
    }
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
        AttributeValue::Text(value) => Some((string(name).trim_start_matches(PREFIX).to_owned(), string(value))),
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
