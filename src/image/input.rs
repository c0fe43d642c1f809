//! Opening files to read.
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Opens a file. A folder is refused, and so is a pipe: one that nobody writes to would never end.
///
/// # Errors
/// [`Error::Input`] with what to do about it.
pub fn open(path: &Path) -> Result<File> {
    let about = |e| Error::input(path, remedy(&e));
    match std::fs::metadata(path).map_err(about)? {
        kind if kind.is_file() => File::open(path).map_err(about),
        kind if kind.is_dir() => Err(Error::input(path, "is a folder: name a file in it")),
        _ => Err(Error::input(path, "is a pipe or a device: save what it holds as a file first")),
    }
}

/// Reads the whole of a file.
///
/// # Errors
/// As [`open`]; [`Error::Device`] when there is not enough memory.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    read_rest(path, open(path)?, Vec::new())
}

/// Bytes that tell the kind of an image.
const HEAD: u64 = 16;

/// [`read`] for images: a file that begins as none is not read on.
///
/// # Errors
/// As [`read`], and for a file of another kind.
pub fn read_image(path: &Path) -> Result<Vec<u8>> {
    let mut file = open(path)?;
    let mut head = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut head).map_err(|e| Error::input(path, remedy(&e)))?;
    match super::is_image(&head) {
        true => read_rest(path, file, head),
        false => Err(Error::input(path, "is no EXR, PNG, JPEG or HDR file")),
    }
}

fn read_rest(path: &Path, mut file: File, mut bytes: Vec<u8>) -> Result<Vec<u8>> {
    let length = file.metadata().map_or(0, |m| m.len());
    super::check_memory(path, length)?;
    file.read_to_end(&mut bytes).map_err(|e| Error::input(path, remedy(&e)))?;
    Ok(bytes)
}

fn remedy(e: &std::io::Error) -> String {
    let what = match e.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => "check its name and folder",
        ErrorKind::PermissionDenied => "give yourself permission to read it",
        ErrorKind::OutOfMemory => "it is too large for this machine",
        _ => "take another copy of it",
    };
    format!("cannot be read: {e}; {what}")
}
