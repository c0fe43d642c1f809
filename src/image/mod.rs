//! Images: the [`Film`] with its named channels, readers and writers of image files, and metrics that compare two images.
pub mod aov;
mod claim;
pub mod difference;
mod exr;
mod film;
mod frame;
pub mod input;
pub mod metrics;
pub mod output;
mod photo;
pub(crate) mod primaries;
pub mod significance;
mod sorted_head;
pub mod source;
pub mod tone;

use crate::error::{Checked, Error, Result};
use crate::memory;
pub use claim::Claim;
pub use film::{Channel, FILTERED, Film, NOISY, Picture, SOFTWARE, Samples, Window};
use frame::Frame;
use output::Stream;
pub(crate) use photo::{BAND, NO_IMAGE, bands, check_end, has_16_bits, is_unread, picture};
#[cfg(feature = "cli")]
pub(crate) use photo::{codes, encode_png};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use tone::ToneMap;

/// How radiance is converted for PNG files. EXR and HDR files hold radiance unchanged and ignore both fields.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriteOptions {
    /// Exposure in stops: radiance is multiplied by 2 to this power.
    pub exposure: f32,
    /// Curve that is applied after the exposure and before the sRGB transfer function.
    pub tone_map: ToneMap,
}

#[derive(Clone, Copy)]
enum Format {
    Exr,
    Png,
    Hdr,
}

fn format_of(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match extension.as_str() {
        "exr" => Ok(Format::Exr),
        "png" => Ok(Format::Png),
        "hdr" => Ok(Format::Hdr),
        _ => Err(Error::Usage(format!(
            "{}: an image file ends in .exr (all layers), .png or .hdr (colour only)",
            path.display()
        ))),
    }
}

/// Whether [`write()`] knows the ending of such a name.
#[cfg(feature = "cli")]
pub(crate) fn is_written(path: &Path) -> bool {
    format_of(path).is_ok()
}

/// Whether a file of this name can hold more layers than the colour.
pub fn has_layers(path: &Path) -> bool {
    matches!(format_of(path), Ok(Format::Exr))
}

/// Writes a film in the format of the file extension: `.exr` holds every channel and the metadata; `.png` (8-bit sRGB)
/// and `.hdr` (Radiance RGBE, with negative values as 0) hold only the colour.
///
/// The file appears complete or not at all (see [`output::write`]).
///
/// # Errors
/// [`Error::Usage`] for another extension, [`Error::Output`] when the film has no colour or the file cannot be written.
pub fn write(path: &Path, film: &Film, options: &WriteOptions) -> Result<()> {
    format_of(path)?;
    output::write_with(path, |stream| encode(path, film, options, stream))
}

/// Writes to `stream` what [`write()`] would write to a file of this name.
///
/// # Errors
/// [`std::io::ErrorKind::InvalidData`] when the film has no colour or the extension is unknown, and those of the stream.
pub fn encode(path: &Path, film: &Film, options: &WriteOptions, stream: &mut dyn Stream) -> std::io::Result<()> {
    let invalid = |what: String| std::io::Error::new(std::io::ErrorKind::InvalidData, what);
    let colour = || film.rec709(None).map_err(invalid);
    match format_of(path).map_err(|e| invalid(e.to_string()))? {
        Format::Exr => exr::encode(film, stream),
        Format::Png => stream.write_all(&photo::encode_png(&colour()?, options).map_err(invalid)?),
        Format::Hdr => stream.write_all(&photo::encode_hdr(&colour()?).map_err(invalid)?),
    }
}

/// Checks, before a long render, that the extension is known and that [`write()`] could write to the folder.
///
/// # Errors
/// As [`write()`].
pub fn check_writable(path: &Path) -> Result<()> {
    format_of(path)?;
    output::check(path)
}

/// Reads an EXR, PNG, JPEG, HDR, TGA or BMP file, recognised by its content, into linear values. Those of EXR and HDR are as they are stored,
/// whatever primaries a file names: [`Film::rec709`] converts them.
///
/// # Errors
/// [`Error::Input`] when the file cannot be read, is of another kind, or is damaged; [`Error::Memory`].
pub fn read(path: &Path) -> Result<Film> {
    decode_file(path, &input::read_image(path)?)
}

/// Reads the header of an image file: size, metadata and channels, which have no samples. Files that are no EXR have neither metadata
/// nor channels.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_head(path: &Path) -> Result<Film> {
    let bytes = input::read_image(path)?;
    let about = |what| Error::input(path, what);
    let Claim { size: [width, height], .. } = claim_of(&bytes, Frame::Display).map_err(about)?;
    match is_exr(&bytes) {
        true => contained(|| exr::head(&bytes)).map_err(about),
        false => Ok(Film::new(width, height)),
    }
}

/// As [`read`], for a file that is already in memory.
///
/// # Errors
/// One line that says what is wrong with the data, or that they need more memory than is free.
pub fn decode(bytes: &[u8]) -> Checked<Film> {
    memory::check(claim_of(bytes, Frame::Display)?.bytes)?;
    decode_claimed(bytes)
}

/// Size and memory of an image, by its header.
///
/// # Errors
/// One line that says what is wrong with it.
pub(crate) fn claim(bytes: &[u8]) -> Checked<Claim> {
    claim_of(bytes, Frame::Display)
}

/// Whether a file holds floats, as EXR and HDR do.
pub(crate) fn holds_floats(bytes: &[u8]) -> bool {
    is_exr(bytes) || photo::format(bytes) == Some(::image::ImageFormat::Hdr)
}

/// Checks that there is memory to decode an image. A damaged file passes and is reported by the decoder.
///
/// # Errors
/// [`Error::Memory`].
pub fn check_room(path: &Path, bytes: &[u8]) -> Result<()> {
    claim_of(bytes, Frame::Display).map_or(Ok(()), |claim| check_memory(path, claim.bytes))
}

fn decode_file(path: &Path, bytes: &[u8]) -> Result<Film> {
    let claim = claim_of(bytes, Frame::Display).map_err(|what| Error::input(path, what))?;
    check_memory(path, claim.bytes)?;
    decode_claimed(bytes).map_err(|what| Error::input(path, what))
}

/// Checks that `bytes` of host memory are free.
///
/// # Errors
/// [`Error::Memory`] about the file at `path`.
pub fn check_memory(path: &Path, bytes: u64) -> Result<()> {
    memory::check(bytes).map_err(|what| Error::Memory(format!("{}: {what}", path.display())))
}

fn claim_of(bytes: &[u8], frame: Frame) -> Checked<Claim> {
    contained(|| if is_exr(bytes) { exr::claim(bytes, frame) } else { photo::claim(bytes) })
}

/// Decodes a file. It must be called only after [`claim_of`] has accepted it.
fn decode_claimed(bytes: &[u8]) -> Checked<Film> {
    contained(|| if is_exr(bytes) { exr::decode(bytes) } else { photo::decode(bytes) })
}

/// Whether a file with this beginning may be an image.
fn is_image(head: &[u8]) -> bool {
    is_exr(head) || photo::format(head).is_some()
}

fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is inside a decoder. Its panics are caught and become errors, so a panic hook should stay silent.
pub fn is_decoding() -> bool {
    DECODING.get()
}

/// Calls a decoder and turns its panics into errors. Some decoders of other crates assert what a damaged file can violate
/// (exr 1.74: the level of a tile, sums in B44 blocks). They keep no state between calls, so unwinding leaves nothing
/// inconsistent. A program built with `panic = "abort"` ends at such an assertion.
///
/// # Errors
/// The decoder's error in one line, or that it panicked.
pub fn contained<T>(decode: impl FnOnce() -> Checked<T>) -> Checked<T> {
    DECODING.set(true);
    let result = catch_unwind(AssertUnwindSafe(decode));
    DECODING.set(false);
    let broken = |_| Err("cannot be decoded: its data contradict its header; is it complete?".to_owned());
    result.unwrap_or_else(broken).map_err(|what| what.replace('\n', " "))
}

#[cfg(test)]
mod tests {
    use super::{contained, is_decoding};

    #[test]
    fn a_panic_in_a_decoder_is_an_error() {
        let line = contained(|| -> Result<(), String> { panic!("planted: {}", is_decoding()) }).unwrap_err();
        assert!(line.contains("contradict") && !is_decoding());
    }
}
