//! An image file in memory of which some channels are replaced and all others are kept.
use super::film::Film;
use super::frame::Frame;
use super::output::Stream;
use super::{Claim, WriteOptions, exr, output};
use crate::error::{Error, Result};
use std::io::{Cursor, ErrorKind};
use std::path::{Path, PathBuf};

/// An image file in memory of which only the header was decoded.
pub struct Unread {
    path: PathBuf,
    bytes: Vec<u8>,
    /// Size and memory for decoding every stored pixel.
    pub claim: Claim,
}

impl Unread {
    /// Reads an EXR, PNG, JPEG or HDR file.
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
        let Self { path, mut bytes, .. } = self;
        let film = super::decode_file(&path, &bytes, Frame::Data)?;
        if !super::is_exr(&bytes) {
            let mut encoded = Cursor::new(Vec::new());
            exr::encode(&film, &mut encoded).map_err(|e| Error::input(&path, e))?;
            bytes = encoded.into_inner();
        }
        Ok(Source { path, bytes, film })
    }
}

/// An image file in memory.
pub struct Source {
    path: PathBuf,
    /// The content as EXR, whatever the format of the file.
    bytes: Vec<u8>,
    /// Every stored pixel, shown or not, with row 0 at the top.
    pub film: Film,
}

impl Source {
    /// Reads an EXR, PNG, JPEG or HDR file.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn read(path: &Path) -> Result<Self> {
        Unread::open(path)?.decode()
    }

    /// Decodes the part that is shown, the display window.
    ///
    /// # Errors
    /// [`Error::Input`] when the data are damaged, [`Error::Memory`] when there is not enough memory.
    pub fn shown(&self) -> Result<Film> {
        super::decode_file(&self.path, &self.bytes, Frame::Display)
    }

    /// Replaces the samples of the named channels, one per pixel of `film`, and adds an entry of metadata. The old samples are
    /// kept in the layer `keep_as`, if one is named.
    ///
    /// # Errors
    /// [`Error::Input`] when the file holds something that cannot be written again.
    pub fn replaced(&self, channels: &[(&str, &[f32])], keep_as: Option<&str>, entry: (&str, &str)) -> Result<Self> {
        let with = exr::Replacement { channels, keep_as, entry };
        let bytes = super::contained(|| exr::replace(&self.bytes, &with));
        let bytes = bytes.map_err(|what| Error::input(&self.path, what))?;
        let film = super::decode_file(&self.path, &bytes, Frame::Data)?;
        Ok(Self { path: self.path.clone(), bytes, film })
    }

    /// Writes everything to an `.exr` file, and only the colour that is shown to other formats.
    ///
    /// # Errors
    /// As [`super::write`].
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        super::format_of(path)?;
        output::write_with(path, |stream| self.encode(path, None, options, stream))
    }

    /// Writes to `stream` what [`Source::write`] would write to a file of this name, or instead of the colour another layer.
    ///
    /// # Errors
    /// As [`super::encode`].
    pub fn encode(
        &self,
        path: &Path,
        layer: Option<&str>,
        options: &WriteOptions,
        stream: &mut dyn Stream,
    ) -> std::io::Result<()> {
        if super::has_layers(path) {
            return stream.write_all(&self.bytes);
        }
        let invalid = |what: String| std::io::Error::new(ErrorKind::InvalidData, what);
        let shown = self.shown().map_err(|e| invalid(e.to_string()))?;
        let colour = shown.rec709(layer).map_err(invalid)?;
        super::encode(path, &Film::from(&colour), options, stream)
    }
}
