//! An image file that is changed in some channels and kept in all others.
use super::film::Film;
use super::output::Stream;
use super::{WriteOptions, exr, output};
use crate::error::{Error, Result};
use std::io::{Cursor, ErrorKind};
use std::path::{Path, PathBuf};

/// An image file in memory.
pub struct Source {
    path: PathBuf,
    /// As EXR, whatever the file was.
    bytes: Vec<u8>,
    /// Every pixel that is stored, shown or not, row 0 at the top.
    pub film: Film,
}

impl Source {
    /// Reads an EXR, PNG, JPEG or HDR file.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn read(path: &Path) -> Result<Self> {
        let about = |what: String| Error::input(path, what);
        let mut bytes = super::input::read(path)?;
        let film = super::decode_frame(&bytes, exr::Frame::Data).map_err(about)?;
        if !super::is_exr(&bytes) {
            let mut encoded = Cursor::new(Vec::new());
            exr::encode(&film, &mut encoded).map_err(|e| about(e.to_string()))?;
            bytes = encoded.into_inner();
        }
        Ok(Self { path: path.to_owned(), bytes, film })
    }

    /// The part of it that is shown.
    ///
    /// # Errors
    /// [`Error::Input`].
    pub fn shown(&self) -> Result<Film> {
        super::decode(&self.bytes).map_err(|what| Error::input(&self.path, what))
    }

    /// The file with other samples, one per pixel of `film`, in the channels of these names, and with an entry of metadata
    /// that says so.
    ///
    /// # Errors
    /// [`Error::Input`] when it holds what cannot be written again.
    pub fn replaced(&self, channels: &[(&str, &[f32])], entry: (&str, &str)) -> Result<Self> {
        let about = |what| Error::input(&self.path, what);
        let bytes = super::contained(|| exr::replace(&self.bytes, channels, entry)).map_err(about)?;
        let film = super::decode_frame(&bytes, exr::Frame::Data).map_err(about)?;
        Ok(Self { path: self.path.clone(), bytes, film })
    }

    /// Writes it: to `.exr` all of it, to others the colour that is shown.
    ///
    /// # Errors
    /// As [`super::write`].
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        super::format_of(path)?;
        output::write_with(path, |stream| self.encode(path, options, stream))
    }

    /// What [`Source::write`] writes to a file of this name.
    ///
    /// # Errors
    /// As [`super::encode`].
    pub fn encode(&self, path: &Path, options: &WriteOptions, stream: &mut dyn Stream) -> std::io::Result<()> {
        if super::has_layers(path) {
            return stream.write_all(&self.bytes);
        }
        let shown = self.shown().map_err(|e| std::io::Error::new(ErrorKind::InvalidData, e.to_string()))?;
        super::encode(path, &shown, options, stream)
    }
}
