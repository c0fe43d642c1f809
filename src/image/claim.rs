//! What a file's headers ask for, weighed before anything is allocated: a header of a few bytes may claim any size.
use super::frame::{self, Frame};
use exr::meta::MetaData;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;
use exr::prelude::Compression;

/// What decoding a file takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// Width and height of the film.
    pub size: [u32; 2],
    /// Memory at the worst moment, that of the file's bytes apart.
    pub bytes: u64,
}

impl Claim {
    /// Pixels of the film.
    pub fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// An entry in the table of offsets, and the smallest head of a chunk: its first line and its length.
const BYTES_OF_CHUNK: u64 = 8 + 8;

/// Pixels and samples of a film that no part of the file holds: they are 0, take memory all the same, and nothing in the file
/// vouches for them. An 8K frame of which a corner was rendered, in 8 channels, or a 4K frame in 32.
const EMPTY_PIXELS: u64 = 1 << 25;
const EMPTY_SAMPLES: u64 = 1 << 28;
/// A film of more than that may be so many times as large as what is stored.
const EMPTY_TIMES: u64 = 4;

/// Checks the headers of an EXR file of which `behind` bytes follow them.
///
/// # Errors
/// Which of its sizes cannot be.
pub(super) fn of_exr(meta: &MetaData, behind: usize, frame: Frame) -> Result<Claim, String> {
    check_data(&meta.headers, behind as u64)?;
    let frame = frame::of(meta, frame);
    check_frame(&meta.headers, frame)?;
    let film = 4 * area(frame) * channels(&meta.headers);
    let stored: u64 = meta.headers.iter().map(bytes_of_pixels).fold(0, u64::saturating_add);
    // Channels are converted one after the other.
    let plane = if meta.headers.iter().all(|h| is_kept(h, frame)) { 0 } else { 4 * area(frame) };
    Ok(Claim { size: [frame.size.0 as u32, frame.size.1 as u32], bytes: stored.max(film) + plane })
}

/// The pixels and the chunks must fit what follows the headers.
fn check_data(headers: &[Header], behind: u64) -> Result<(), String> {
    let sum = |of: fn(&Header) -> u64| headers.iter().map(of).fold(0, u64::saturating_add);
    let least = sum(|h| bytes_of_pixels(h) / largest_ratio(h.compression))
        .saturating_add(sum(|h| (h.chunk_count as u64).saturating_mul(BYTES_OF_CHUNK)));
    if least > behind {
        let claimed = sum(bytes_of_pixels);
        return Err(format!("claims {claimed} bytes of pixels, more than its {behind} can hold; is it complete?"));
    }
    Ok(())
}

/// Bytes of pixels that a byte can stand for.
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
        // Not supported: the decoder says so.
        Compression::HTJ2K32 | Compression::HTJ2K256 => u64::MAX,
    }
}

fn check_frame(headers: &[Header], frame: IntegerBounds) -> Result<(), String> {
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

/// Whether its samples become the film's as they are.
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
