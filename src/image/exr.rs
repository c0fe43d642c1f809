//! OpenEXR files. Those of any program are read; those written have scan lines with lossless compression.
use super::claim::{self, Claim};
use super::film::{Channel, Film, Samples, split};
use super::frame::{self, Frame, held, shown, union};
use super::output::Stream;
use super::primaries::{from_exr, to_exr};
use super::sorted_head::SortedHead;
use crate::error::Checked;
use crate::memory;
use exr::block::lines::LineRefMut;
use exr::image::write::samples::{SamplesWriter, WritableSamples};
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatImage, FlatSamples, Image, Layer};
use exr::math::RoundingMode;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, IntegerBounds, LevelMode, SampleType, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::{Compression, LineOrder, ReadChannels, ReadLayers, WritableImage};
use std::io::{Cursor, ErrorKind};

const ENCODING: Encoding =
    Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
/// Prefix of the names of Tallow's attributes, because the standard reserves many names (`version`, `comments`...).
const PREFIX: &str = "tallow:";

type FlatPart = Layer<AnyChannels<FlatSamples>>;

pub(super) fn encode(film: &Film, out: &mut dyn Stream) -> std::io::Result<()> {
    let pixels = film.pixels();
    if let Some(Channel { name, samples, .. }) = film.channels.iter().find(|c| c.samples.len() != pixels) {
        let what = format!("channel {name} has {} samples for {pixels} pixels", samples.len());
        return Err(std::io::Error::new(ErrorKind::InvalidData, what));
    }
    fn channel(c: &Channel) -> AnyChannel<&Samples> {
        AnyChannel::new(text(&c.name), &c.samples)
    }
    let channels = AnyChannels::sort(film.channels.iter().map(channel).collect());
    let size = (film.width as usize, film.height as usize);
    let layer = Layer::new(size, LayerAttributes::default(), ENCODING, channels);
    let mut attributes = ImageAttributes::with_size(size);
    attributes.chromaticities = film.primaries.map(to_exr);
    let attribute = |(key, value): (&String, &String)| (text(&format!("{PREFIX}{key}")), text(value));
    attributes.other = film.metadata.iter().map(attribute).map(|(k, v)| (k, AttributeValue::Text(v))).collect();
    let image = Image::empty(attributes).with_layer(layer);
    image.write().to_buffered(SortedHead::new(out)).map_err(|e| match e {
        exr::error::Error::Io(e) => e,
        other => std::io::Error::new(ErrorKind::InvalidData, other.to_string()),
    })
}

/// Text in UTF-8, as OpenEXR's own library writes it; the crate's conversions allow only Latin-1.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

fn string(t: &Text) -> String {
    String::from_utf8_lossy(t.as_slice()).into_owned()
}

/// Planes are written without a copy, which would be most of the memory that a large render takes.
impl<'slf, 'a: 'slf> WritableSamples<'slf> for &'a Samples {
    type Writer = Lines<'a>;

    fn sample_type(&self) -> SampleType {
        match self {
            Samples::F32(_) => SampleType::F32,
            Samples::U32(_) => SampleType::U32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'slf self, header: &Header) -> Lines<'a> {
        Lines { samples: self, width: header.layer_size.width() }
    }
}

/// Gives the writer the lines of a plane.
pub struct Lines<'a> {
    samples: &'a Samples,
    width: usize,
}

impl SamplesWriter for Lines<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let first = line.location.position.y() * self.width + line.location.position.x();
        let range = first..first + line.location.sample_count;
        let written = match self.samples {
            Samples::F32(samples) => line.write_samples_from_slice(&samples[range]),
            Samples::U32(samples) => line.write_samples_from_slice(&samples[range]),
        };
        written.expect("a line has room for its samples");
    }
}

/// The memory that decoding takes, from the headers alone.
pub(super) fn claim(bytes: &[u8], frame: Frame) -> Checked<Claim> {
    let mut stream = Cursor::new(bytes);
    let meta = MetaData::read_from_buffered(&mut stream, true).map_err(plain)?;
    MetaData::validate(&meta.headers, false).map_err(plain)?;
    check_sampling(&meta)?;
    claim::of_exr(&meta, bytes.len().saturating_sub(stream.position() as usize), frame)
}

/// What the headers alone tell of the film of [`Frame::Display`]: its channels have no samples.
pub(super) fn head(bytes: &[u8]) -> Checked<Film> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(plain)?;
    let frame = frame::of(&meta, Frame::Display);
    let mut film = Film::new(frame.size.0 as u32, frame.size.1 as u32);
    let many = meta.headers.len() > 1;
    for header in &meta.headers {
        let part_name = header.own_attributes.layer_name.as_ref().filter(|_| many).map(string);
        for channel in &header.channels.list {
            let name = channel_name(part_name.as_deref(), &string(&channel.name));
            let window = held(frame::window(header), frame);
            film.channels.push(Channel { name, samples: Samples::F32(Vec::new()), window });
        }
        film.metadata.extend(texts(&header.own_attributes.other));
    }
    film.metadata.extend(texts(&meta.headers[0].shared_attributes.other));
    Ok(film)
}

/// The rectangles of [`Frame::Data`] and [`Frame::Display`], from the headers alone.
pub(super) fn frames(bytes: &[u8]) -> Checked<[IntegerBounds; 2]> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), true).map_err(plain)?;
    Ok([Frame::Data, Frame::Display].map(|frame| frame::of(&meta, frame)))
}

/// The film of [`Frame::Display`]. It must be called only after [`claim`] has accepted the headers.
pub(super) fn decode(bytes: &[u8]) -> Checked<Film> {
    let mut image = read(bytes)?;
    let window = image.attributes.display_window;
    film_from(&mut image, window, false)
}

/// The film of [`Frame::Data`], and the file without the samples that the film holds as they were stored: [`replace`] takes both. It must
/// be called only after [`claim`] has accepted the headers.
pub(super) fn decode_parts(bytes: &[u8]) -> Checked<(Film, FlatImage)> {
    let mut image = read(bytes)?;
    let window = stored(&image);
    Ok((film_from(&mut image, window, true)?, image))
}

/// New samples for some channels, which are identified by their names in the film of [`Frame::Data`].
pub(super) struct Replacement<'a> {
    pub(super) channels: &'a [(&'a str, &'a [f32])],
    /// The layer in which the old samples are kept, if they are.
    pub(super) keep_as: Option<&'a str>,
    /// Key and value of an entry of metadata to set; one without a value is removed.
    pub(super) entry: (&'a str, Option<&'a str>),
}

/// Encodes what [`decode_parts`] has made of a file with new samples. Everything else is kept except the compression, which becomes
/// lossless.
pub(super) fn replace(parts: &FlatImage, film: &Film, with: &Replacement) -> Checked<Vec<u8>> {
    let mut image = whole(parts, film);
    set_entry(&mut image, with.entry);
    let frame = stored(&image);
    let many = image.layer_data.len() > 1;
    for part in &mut image.layer_data {
        let data = window(part);
        let part_name = part.attributes.layer_name.as_ref().filter(|_| many).map(string);
        part.encoding = ENCODING;
        let mut kept = Vec::new();
        for channel in &mut part.channel_data.list {
            let name = channel_name(part_name.as_deref(), &string(&channel.name));
            if let Some((_, samples)) = with.channels.iter().find(|(wanted, _)| *wanted == name) {
                let fresh = FlatSamples::F32(shown(samples, frame, data)?);
                let old = std::mem::replace(&mut channel.sample_data, fresh);
                kept.extend(with.keep_as.map(|layer| AnyChannel { sample_data: old, ..named(channel, layer) }));
            }
        }
        if !kept.is_empty() {
            kept.extend(std::mem::take(&mut part.channel_data.list));
            part.channel_data = AnyChannels::sort(kept.into());
        }
    }
    let mut out = Cursor::new(Vec::new());
    image.write().to_buffered(SortedHead::new(&mut out)).map_err(|e| format!("cannot be encoded: {e}"))?;
    Ok(out.into_inner())
}

/// The file with the samples that its film holds.
fn whole(parts: &FlatImage, film: &Film) -> FlatImage {
    let mut image = parts.clone();
    let channels = image.layer_data.iter_mut().flat_map(|part| &mut part.channel_data.list);
    for (channel, held) in channels.zip(&film.channels).filter(|(channel, _)| channel.sample_data.len() == 0) {
        channel.sample_data = match &held.samples {
            Samples::F32(samples) => FlatSamples::F32(samples.clone()),
            Samples::U32(samples) => FlatSamples::U32(samples.clone()),
        };
    }
    image
}

/// Sets or removes an attribute for the whole file and removes it from the parts, to which the reader may have assigned it.
fn set_entry(image: &mut FlatImage, (key, value): (&str, Option<&str>)) {
    let name = text(&format!("{PREFIX}{key}"));
    for part in &mut image.layer_data {
        part.attributes.other.remove(&name);
    }
    image.attributes.other.remove(&name);
    image.attributes.other.extend(value.map(|value| (name, AttributeValue::Text(text(value)))));
}

/// Makes a channel without samples, with the same view and component in another layer.
fn named(channel: &AnyChannel<FlatSamples>, layer: &str) -> AnyChannel<FlatSamples> {
    let name = string(&channel.name);
    let (own_layer, component) = split(&name);
    let parts = [split(own_layer).0, layer, component];
    let name = parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join(".");
    AnyChannel::new(text(&name), FlatSamples::F32(Vec::new()))
}

fn window(part: &FlatPart) -> IntegerBounds {
    IntegerBounds::new(part.attributes.layer_position, part.size)
}

/// The smallest rectangle that holds the data windows of all parts.
fn stored(image: &FlatImage) -> IntegerBounds {
    let windows = image.layer_data.iter().map(window);
    windows.reduce(union).unwrap_or(image.attributes.display_window)
}

fn read(bytes: &[u8]) -> Checked<FlatImage> {
    let chunks = exr::block::read(Cursor::new(bytes), false).map_err(plain)?;
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        // A panic on one of the crate's threads could not be caught; see `contained`.
        .non_parallel()
        .from_chunks(chunks)
        .map_err(plain)
}

/// Translates the crate's errors, which address programmers, for users.
fn plain(e: exr::error::Error) -> String {
    use exr::error::Error;
    let kind = |what: &str| format!("{what}, which is not supported: save it as a flat EXR with ZIP compression");
    match e {
        Error::NotSupported(m) if m.contains("deep") => kind("holds several samples a pixel in depth (deep data)"),
        Error::NotSupported(m) if m.contains("compression") => kind("is compressed in a rare way"),
        Error::NotSupported(_) => kind("is an EXR file of a rare kind"),
        Error::Invalid(m) if m.contains("deep") => kind("holds several samples a pixel in depth (deep data)"),
        Error::Invalid(m) if m.starts_with("compressed ") => damaged("its compressed pixels are damaged"),
        Error::Invalid(m) if m.contains("missing bytes") => damaged("it ends too early"),
        Error::Invalid(m) => damaged(&format!("something is wrong with this: {m}")),
        Error::Io(_) | Error::Aborted => damaged("it ends too early"),
    }
}

fn damaged(what: &str) -> String {
    format!("cannot be decoded: {what}; is it complete?")
}

/// Refuses subsampled channels, on which the crate's reader would panic.
fn check_sampling(meta: &MetaData) -> Checked {
    let mut channels = meta.headers.iter().flat_map(|h| &h.channels.list);
    match channels.find(|c| c.sampling != Vec2(1, 1)) {
        Some(c) => Err(format!("channel {} is subsampled, which is not supported: save it at full size", c.name)),
        None => Ok(()),
    }
}

/// Puts all parts into one film. If there are several, the channel names begin with the name of the part. Samples that the film
/// cannot hold as they are stored remain in the image if it `keeps` them.
fn film_from(image: &mut FlatImage, frame: IntegerBounds, keeps: bool) -> Checked<Film> {
    let mut film = Film::new(frame.size.0 as u32, frame.size.1 as u32);
    if film.pixels() == 0 {
        return Err("has no pixels: its display window is empty".to_owned());
    }
    let many = image.layer_data.len() > 1;
    for part in &mut image.layer_data {
        let part_name = part.attributes.layer_name.as_ref().filter(|_| many).map(string);
        let data = window(part);
        for channel in &mut part.channel_data.list {
            let name = channel_name(part_name.as_deref(), &string(&channel.name));
            let samples = shown_samples(&mut channel.sample_data, data, frame)?;
            if !keeps {
                channel.sample_data = FlatSamples::F32(Vec::new());
            }
            film.channels.push(Channel { name, samples, window: held(data, frame) });
        }
        film.metadata.extend(texts(&part.attributes.other));
    }
    film.metadata.extend(texts(&image.attributes.other));
    film.primaries = image.attributes.chromaticities.map(from_exr);
    Ok(film)
}

fn texts<'a>(
    attributes: impl IntoIterator<Item = (&'a Text, &'a AttributeValue)>,
) -> impl Iterator<Item = (String, String)> {
    attributes.into_iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(value) => Some((string(name).trim_start_matches(PREFIX).to_owned(), string(value))),
        AttributeValue::I32(value) => Some((string(name), value.to_string())),
        _ => None,
    })
}

/// Puts the part's name before a channel's, unless the program that wrote the file has already done so.
fn channel_name(part: Option<&str>, channel: &str) -> String {
    match part {
        Some(part) if !part.is_empty() && !channel.starts_with(&format!("{part}.")) => format!("{part}.{channel}"),
        _ => channel.to_owned(),
    }
}

/// The samples are taken where they need no conversion.
fn shown_samples(samples: &mut FlatSamples, data: IntegerBounds, frame: IntegerBounds) -> Checked<Samples> {
    use std::mem::take;
    Ok(match samples {
        FlatSamples::F16(v) => {
            let mut floats = memory::reserved(v.len())?;
            floats.extend(v.iter().map(|h| h.to_f32()));
            Samples::F32(if data == frame { floats } else { shown(&floats, data, frame)? })
        }
        FlatSamples::F32(v) => Samples::F32(if data == frame { take(v) } else { shown(v, data, frame)? }),
        FlatSamples::U32(v) => Samples::U32(if data == frame { take(v) } else { shown(v, data, frame)? }),
    })
}
