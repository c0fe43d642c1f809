//! An image file in memory of which some channels are replaced and all others are kept.
use super::film::{Channel, Film, Picture};
use super::frame::{self, Frame};
use super::{Claim, exr};
use crate::error::{Checked, Error, Result};
use ::exr::image::FlatImage;
use ::exr::meta::attribute::IntegerBounds;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// An image file in memory of which only the header was decoded.
pub struct Unread {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Size and memory for decoding every stored pixel.
    pub claim: Claim,
}

impl Unread {
    /// Reads an image file of any kind that [`super::read`] does.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = super::input::read_image(path)?;
        let claim = super::claim_of(&bytes, Frame::Data).map_err(|what| Error::input(path, what))?;
        Ok(Self { path: path.to_owned(), bytes, claim })
    }

    /// Decodes the pixels.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn decode(self) -> Result<Source> {
        let Self { path, bytes, claim } = self;
        super::check_memory(&path, claim.bytes)?;
        let decoded = match super::is_exr(&bytes) {
            true => super::contained(|| exr::decode_parts(&bytes)).map(|(film, parts)| (film, Some(parts))),
            false => super::decode_claimed(&bytes).map(|film| (film, None)),
        };
        let (film, parts) = decoded.map_err(|what| Error::input(&path, what))?;
        Ok(Source { path, bytes, parts, film })
    }
}

/// An image file in memory.
pub struct Source {
    path: PathBuf,
    bytes: Vec<u8>,
    /// What an EXR file holds besides the film.
    parts: Option<FlatImage>,
    /// Every stored pixel, shown or not, with row 0 at the top.
    pub film: Film,
}

/// New samples of channels, which are named as in [`Source::film`]: one sample for each of its pixels.
pub type Replaced<'a> = [(&'a str, &'a [f32])];

impl Source {
    /// Reads an image file of any kind that [`super::read`] does.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn read(path: &Path) -> Result<Self> {
        Unread::open(path)?.decode()
    }

    /// Width and height of the part that is shown, the display window.
    ///
    /// # Errors
    /// [`Error::Input`] when it is far larger than what is stored.
    pub fn shown_size(&self) -> Result<[u32; 2]> {
        Ok(self.shown_claim()?.size)
    }

    /// The colour that is shown, or another layer, as Rec. 709: what [`super::read`] and [`Film::rec709`] make of the file that
    /// [`Source::encoded`] returns.
    ///
    /// # Errors
    /// [`Error::Input`] when there is no such layer, [`Error::Memory`].
    pub fn shown(&self, layer: Option<&str>, replaced: &Replaced) -> Result<Picture> {
        let claim = self.shown_claim()?;
        super::check_memory(&self.path, claim.bytes)?;
        let input = |what| Error::input(&self.path, what);
        let channels = self.film.find(layer).ok_or_else(|| input(self.film.no_such_layer(layer)))?;
        let frames = self.frames().map_err(input)?;
        let [r, g, b] = channels.map(|channel| shown_samples(channel, replaced, frames).map_err(input));
        Ok(self.film.as_rec709(Picture::of_planes(claim.size, &[r?, g?, b?])))
    }

    /// Encodes an EXR file of everything, with new samples and another entry of metadata, or without that entry. The old samples are
    /// kept in the layer `keep_as`, if one is named.
    ///
    /// # Errors
    /// [`Error::Input`] when the file holds something that cannot be written again.
    pub fn encoded(&self, channels: &Replaced, keep_as: Option<&str>, entry: (&str, Option<&str>)) -> Result<Vec<u8>> {
        let with = exr::Replacement { channels, keep_as, entry };
        let encoded = match &self.parts {
            Some(parts) => super::contained(|| exr::replace(parts, &self.film, &with)),
            None => self.as_exr().and_then(|(film, parts)| exr::replace(&parts, &film, &with)),
        };
        encoded.map_err(|what| Error::input(&self.path, what))
    }

    fn as_exr(&self) -> Checked<(Film, FlatImage)> {
        let mut encoded = Cursor::new(Vec::new());
        exr::encode(&self.film, &mut encoded).map_err(|e| e.to_string())?;
        exr::decode_parts(encoded.get_ref())
    }

    fn shown_claim(&self) -> Result<Claim> {
        super::claim_of(&self.bytes, Frame::Display).map_err(|what| Error::input(&self.path, what))
    }

    /// The rectangles that are stored and shown.
    fn frames(&self) -> Checked<[IntegerBounds; 2]> {
        let Film { width, height, .. } = self.film;
        match super::is_exr(&self.bytes) {
            true => exr::frames(&self.bytes),
            false => Ok([IntegerBounds::new((0, 0), (width as usize, height as usize)); 2]),
        }
    }
}

/// The samples of a channel, or the new ones, in the rectangle that is shown; 0 where the file stores none.
fn shown_samples(channel: &Channel, replaced: &Replaced, [stored, shown]: [IntegerBounds; 2]) -> Checked<Vec<f32>> {
    let fresh = replaced.iter().find(|(name, _)| *name == channel.name);
    let samples = fresh.map_or_else(|| channel.samples.to_f32(), |(_, samples)| (*samples).into());
    match channel.window {
        None => frame::shown(&samples, stored, shown),
        Some(window) => {
            let held = frame::part(window, stored);
            frame::shown(&frame::shown(&samples, stored, held)?, held, shown)
        }
    }
}
