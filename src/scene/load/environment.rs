//! Images of light from infinitely far.
use crate::error::{Error, Result};
use crate::image::{self, Picture};
use std::path::Path;

/// Reads an image of linear radiance.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read or decoded, [`Error::Memory`].
pub fn load(path: &Path) -> Result<Picture> {
    decode(path, &image::input::read(path)?)
}

/// [`load`] from bytes; `path` is for messages.
fn decode(path: &Path, bytes: &[u8]) -> Result<Picture> {
    image::check_room(path, bytes)?;
    image::decode(bytes).and_then(|film| film.rec709(None)).map_err(|what| unusable(path, &what))
}

/// The error for a damaged image.
pub fn unusable(path: &Path, what: &str) -> Error {
    Error::input(path, format!("is no usable environment image ({what}): save it again as HDR or EXR"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_rec_709() {
        use crate::image::primaries::tests::{AP1, file};
        let red = |primaries| decode(Path::new("a.exr"), &file(primaries, [4.0, 0.0, 0.0])).unwrap().pixels[0][0];
        assert_eq!(red(None), 4.0);
        assert!((red(Some(AP1)) - 6.8202).abs() < 1e-3, "{}", red(Some(AP1)));
    }

    #[test]
    fn damage_is_one_line_with_a_remedy() {
        let error = decode(Path::new("a.hdr"), b"#?RADIANCE\nnonsense").unwrap_err().to_string();
        assert!(error.starts_with("a.hdr: is no usable environment image") && !error.contains('\n'), "{error}");
    }
}
