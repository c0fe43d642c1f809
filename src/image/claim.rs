//! The memory that decoding a file takes, computed from its headers. It is checked before anything is allocated, because a
//! header of a few bytes can claim any size.
use super::frame::{self, Frame};
use crate::error::Checked;
use exr::meta::MetaData;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;
use exr::prelude::Compression;

/// The size of a film and the memory that decoding it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// Width and height of the film.
    pub size: [u32; 2],
    /// Peak memory in bytes, without the bytes of the file itself.
    pub bytes: u64,
}

impl Claim {
    /// Number of pixels of the film.
    pub fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// Smallest number of bytes per chunk: its entry in the offset table, and its head with first line and length.
const BYTES_OF_CHUNK: u64 = 8 + 8;

/// Largest number of pixels and of samples in a film that the file need not store. Pixels that are not stored are 0, but
/// they take memory, and no data in the file confirm them. The limits allow an 8K frame in 8 channels or a 4K frame in 32
/// of which only a corner was rendered.
const EMPTY_PIXELS: u64 = 1 << 25;
const EMPTY_SAMPLES: u64 = 1 << 28;
/// A film above these limits may be this many times as large as what is stored.
const EMPTY_TIMES: u64 = 4;

/// Checks the headers of an EXR file, which are followed by `behind` bytes.
///
/// # Errors
/// A message about the size that is not possible.
pub(super) fn of_exr(meta: &MetaData, behind: usize, kind: Frame) -> Checked<Claim> {
    check_data(&meta.headers, behind as u64)?;
    let frame = frame::of(meta, kind);
    check_frame(&meta.headers, frame)?;
    let film = 4 * area(frame) * channels(&meta.headers);
    let stored: u64 = meta.headers.iter().map(bytes_of_pixels).fold(0, u64::saturating_add);
    let bytes = match kind {
        _ if meta.headers.iter().all(|h| is_kept(h, frame)) => stored.max(film),
        // Channels are converted one at a time.
        Frame::Display => stored.max(film) + 4 * area(frame),
        // What was converted stays as it was, to be written again.
        Frame::Data => stored.saturating_add(film),
    };
    Ok(Claim { size: [frame.size.0 as u32, frame.size.1 as u32], bytes })
}

/// Checks that the claimed pixels and chunks fit into the bytes that follow the headers.
fn check_data(headers: &[Header], behind: u64) -> Checked {
    let sum = |of: fn(&Header) -> u64| headers.iter().map(of).fold(0, u64::saturating_add);
    let least = sum(|h| bytes_of_pixels(h) / largest_ratio(h.compression))
        .saturating_add(sum(|h| (h.chunk_count as u64).saturating_mul(BYTES_OF_CHUNK)));
    if least > behind {
        let claimed = sum(bytes_of_pixels);
        return Err(format!("claims {claimed} bytes of pixels, more than its {behind} can hold; is it complete?"));
    }
    Ok(())
}

/// Largest number of bytes of pixels that one compressed byte can hold.
fn largest_ratio(compression: Compression) -> u64 {
    const DEFLATE: u64 = 1032;
    match compression {
        Compression::Uncompressed => 1,
        // 2 bytes stand for a run of 128.
        Compression::RLE => 64,
        Compression::ZIP1 | Compression::ZIP16 => DEFLATE,
        // A float's 3 bytes are deflated and become 4.
        Compression::PXR24 => DEFLATE * 4 / 3,
        // A run of 255 values of 2 bytes takes a Huffman code of at least 1 bit and a length of 8 bits.
        Compression::PIZ => 510 * 8 / 9 + 1,
        // 3 bytes stand for a square of 16 values of 2 bytes.
        Compression::B44 | Compression::B44A => 32 / 3 + 1,
        // A square of 64 floats takes 2 bytes in each of two deflated streams; runs of 128 in 2 bytes, deflated, are as small.
        Compression::DWAA(_) | Compression::DWAB(_) => 64 * DEFLATE,
        // The decoder does not support it and says so.
        Compression::HTJ2K32 | Compression::HTJ2K256 => u64::MAX,
    }
}

fn check_frame(headers: &[Header], frame: IntegerBounds) -> Checked {
    let stored: u64 = headers.iter().map(|h| area(frame::window(h))).sum();
    let samples: u64 = headers.iter().map(|h| area(frame::window(h)) * h.channels.list.len() as u64).sum();
    let (pixels, all) = (area(frame), area(frame).saturating_mul(channels(headers)));
    if pixels > EMPTY_PIXELS.max(EMPTY_TIMES * stored) || all > EMPTY_SAMPLES.max(EMPTY_TIMES * samples) {
        return Err(format!(
            "shows {} x {} pixels in {} channels but stores {stored} pixels of them: save it with a display window of the \
             size of its pictures",
            frame.size.0,
            frame.size.1,
            channels(headers)
        ));
    }
    Ok(())
}

/// Whether its samples become those of the film without conversion.
fn is_kept(header: &Header, frame: IntegerBounds) -> bool {
    frame::window(header) == frame && header.channels.list.iter().all(|c| c.sample_type != SampleType::F16)
}

fn area(bounds: IntegerBounds) -> u64 {
    (bounds.size.0 as u64).saturating_mul(bounds.size.1 as u64)
}

fn channels(headers: &[Header]) -> u64 {
    headers.iter().map(|h| h.channels.list.len() as u64).sum()
}

fn bytes_of_pixels(header: &Header) -> u64 {
    area(frame::window(header)).saturating_mul(header.channels.bytes_per_pixel as u64)
}
