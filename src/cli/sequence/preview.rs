//! `--preview`: the frames of a sequence as a small animated picture.
use crate::error::{Error, Result};
use crate::image::{self, Film, WriteOptions, output};
use ::image::codecs::gif::{GifEncoder, Repeat};
use ::image::{Delay, Frame, RgbaImage};
use std::path::Path;
use std::time::Duration;

/// Pixels of the longer edge at most.
const EDGE: u32 = 480;

/// Checks that a preview can be written there.
///
/// # Errors
/// [`Error::Usage`] for another kind of file, [`Error::Output`].
pub fn check(path: &Path) -> Result<()> {
    match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gif")) {
        true => output::check(path),
        false => Err(Error::Usage(format!("--preview {}: a preview goes to a .gif", path.display()))),
    }
}

/// Small pictures so far.
#[derive(Default)]
pub struct Preview(Vec<RgbaImage>);

impl Preview {
    /// Adds a frame as a PNG of it would look.
    ///
    /// # Errors
    /// A sentence about a film that is no picture.
    pub fn add(&mut self, film: &Film, options: &WriteOptions) -> std::result::Result<(), String> {
        let mut png = Vec::new();
        image::encode(Path::new("frame.png"), film, options, &mut std::io::Cursor::new(&mut png))
            .map_err(|e| e.to_string())?;
        let whole = ::image::load_from_memory(&png).map_err(|e| e.to_string())?;
        let small = if whole.width().max(whole.height()) > EDGE { whole.thumbnail(EDGE, EDGE) } else { whole };
        self.0.push(small.into_rgba8());
        Ok(())
    }

    /// Writes what there is, at so many frames per second; viewers show no more than 50.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn write(&self, path: &Path, fps: f64) -> Result<()> {
        let mut bytes = Vec::new();
        self.encode(&mut bytes, fps).map_err(|e| Error::output(path, e))?;
        output::write(path, &bytes)
    }

    fn encode(&self, bytes: &mut Vec<u8>, fps: f64) -> std::result::Result<(), ::image::ImageError> {
        let mut encoder = GifEncoder::new_with_speed(bytes, 10);
        encoder.set_repeat(Repeat::Infinite)?;
        let delay = Delay::from_saturating_duration(Duration::from_secs_f64((1.0 / fps).clamp(0.02, 600.0)));
        self.0.iter().try_for_each(|small| encoder.encode_frame(Frame::from_parts(small.clone(), 0, 0, delay)))
    }
}
