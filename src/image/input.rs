//! Opening and reading files, with checks of their kind and of free memory.
use super::photo::{HEAD, NO_IMAGE};
use crate::error::{Error, Result};
use crate::memory;
use image::ImageFormat;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek};
use std::path::Path;

/// Opens a regular file. A pipe is refused because one without a writer would never end.
///
/// # Errors
/// [`Error::Input`] with what to do about it.
pub fn open(path: &Path) -> Result<File> {
    let about = |e| Error::input(path, remedy(&e));
    match std::fs::metadata(path).map_err(about)? {
        kind if kind.is_file() => {
            let mut file = File::open(path).map_err(about)?;
            if begins_with(&mut file, POINTER).map_err(about)? {
                return Err(Error::input(
                    path,
                    "is a pointer of Git LFS in place of the file: run git lfs pull in its repository",
                ));
            }
            Ok(file)
        }
        kind if kind.is_dir() => Err(Error::input(path, "is a folder: name a file in it")),
        _ => Err(Error::input(path, "is a pipe or a device: save what it holds as a file first")),
    }
}

/// What stands in a repository for a file that Git LFS keeps elsewhere. Read as the buffer of a glTF file it would be a mesh.
const POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";

/// Whether a file begins with these bytes. It is read from its first byte afterwards.
fn begins_with(file: &mut File, beginning: &[u8]) -> std::io::Result<bool> {
    let mut head = Vec::new();
    file.take(beginning.len() as u64).read_to_end(&mut head)?;
    file.rewind()?;
    Ok(head == beginning)
}

/// Reads a whole file of a kind that is never empty.
///
/// # Errors
/// As [`open`], and [`Error::Memory`].
pub fn read(path: &Path) -> Result<Vec<u8>> {
    not_empty(path, read_times(path, 1)?)
}

/// What a full disk or a copy that was broken off leaves behind is named as that.
fn not_empty(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>> {
    match bytes.is_empty() {
        true => Err(Error::input(path, "is empty: take another copy of it")),
        false => Ok(bytes),
    }
}

/// Bytes of memory that a byte of JSON takes at most while it is read.
pub const BYTES_OF_JSON: u64 = 64;

/// Reads a whole text file, if there is memory for `times` its size, which its content will take.
///
/// # Errors
/// As [`read`], and for UTF-16.
pub fn read_text(path: &Path, times: u64) -> Result<Vec<u8>> {
    let bytes = read_times(path, times)?;
    match bytes[..] {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Err(Error::input(path, "is UTF-16 text: save it as UTF-8")),
        _ => Ok(bytes),
    }
}

/// Whether a file is of a format that is not read, by its ending and its first bytes. One that ends as EXR, PNG, JPEG and HDR files do, or has
/// no ending, is damaged instead.
pub fn is_of_another_format(path: &Path) -> bool {
    use ImageFormat::{Hdr, Jpeg, OpenExr, Png};
    let has_mark = ImageFormat::from_path(path).is_ok_and(|format| matches!(format, Png | Jpeg | Hdr | OpenExr));
    let others = path.extension().is_some() && !has_mark;
    others && head_of(path).is_ok_and(|head| !super::is_image(&head))
}

/// Whether an image holds integers, by its first bytes; false for what cannot be read.
pub fn holds_integers(path: &Path) -> bool {
    head_of(path).is_ok_and(|head| !super::holds_floats(&head))
}

fn head_of(path: &Path) -> Result<Vec<u8>> {
    head(path, &mut open(path)?)
}

fn head(path: &Path, file: &mut impl Read) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    file.take(HEAD as u64).read_to_end(&mut head).map_err(|e| Error::input(path, remedy(&e)))?;
    Ok(head)
}

/// As [`read`], for images: only the beginning of another kind of file is read.
///
/// # Errors
/// As [`read`], and for a file of another kind.
pub fn read_image(path: &Path) -> Result<Vec<u8>> {
    let mut file = open(path)?;
    let head = not_empty(path, head(path, &mut file)?)?;
    match super::is_image(&head) {
        true => read_rest(path, file, head, 1),
        false => Err(Error::input(path, NO_IMAGE)),
    }
}

/// Reads a whole file, if there is memory for `times` its size.
fn read_times(path: &Path, times: u64) -> Result<Vec<u8>> {
    read_rest(path, open(path)?, Vec::new(), times)
}

fn read_rest(path: &Path, mut file: File, mut bytes: Vec<u8>, times: u64) -> Result<Vec<u8>> {
    let about = |e| Error::input(path, remedy(&e));
    let size = file.metadata().map_err(about)?.len();
    memory::need(path.display(), size.saturating_mul(times))?;
    memory::reserve(path.display(), &mut bytes, size as usize)?;
    file.read_to_end(&mut bytes).map_err(about)?;
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
