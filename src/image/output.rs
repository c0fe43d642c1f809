//! Writing files so that they appear complete or not at all.
use crate::error::{Error, Result};
use std::io::{BufWriter, Cursor, ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};

/// Where the bytes of a file go.
pub trait Stream: Write + Seek {}
impl<T: Write + Seek> Stream for T {}

/// Replaces `path` by `bytes`: see [`write_with`].
///
/// # Errors
/// As [`write_with`].
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |stream| stream.write_all(bytes))
}

/// Replaces `path` by what `fill` writes: it goes to a temporary name in the same folder, which is then renamed, so that a run
/// that is interrupted, or a disk that fills up, leaves the old file. Links are followed. What exists and is no regular
/// file (a pipe, `/dev/stdout`) is written to as it is.
///
/// # Errors
/// [`Error::Output`] with what to do about it. Of `fill`, [`ErrorKind::InvalidData`] says that there is no way to write this.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> Result<()> {
    let result = if is_special(path) { write_through(path, fill) } else { write_renamed(&target(path), fill) };
    result.map_err(|e| Error::output(path, remedy(path, &e)))
}

/// Checks that [`write()`] could start: the folder exists and accepts a file, and `path` is not a folder itself.
///
/// # Errors
/// As [`write()`].
pub fn check(path: &Path) -> Result<()> {
    let result = match () {
        () if path.is_dir() => Err(ErrorKind::IsADirectory.into()),
        // Opening a pipe and closing it again would be the end of its reader.
        () if is_special(path) => Ok(()),
        () => temporary(&target(path)).map(drop),
    };
    result.map_err(|e| Error::output(path, remedy(path, &e)))
}

fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// The file behind a link, so that renaming replaces the file and not the link.
fn target(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Pipes cannot go back, as some formats must.
fn write_through(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> std::io::Result<()> {
    let mut bytes = Cursor::new(Vec::new());
    fill(&mut bytes)?;
    let mut file = std::fs::OpenOptions::new().write(true).open(path)?;
    file.write_all(bytes.get_ref())?;
    file.flush()
}

fn write_renamed(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> std::io::Result<()> {
    let mut file = temporary(path)?;
    let mut stream = BufWriter::new(&mut file);
    fill(&mut stream)?;
    stream.flush()?;
    drop(stream);
    // Without this a crash of the system soon after the renaming could leave an empty file.
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|e| e.error)
}

fn temporary(path: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tallow-").suffix(".part");
    // The crate's own default, 0600, would hide the image from everybody else; the umask still applies.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder(path))
}

fn remedy(path: &Path, e: &std::io::Error) -> String {
    let (folder, exists) = (folder(path).display(), folder(path).is_dir());
    match e.kind() {
        // Linux says so of /proc and the like.
        ErrorKind::NotFound if exists => {
            format!("cannot be written: {folder} takes no new files; choose another folder")
        }
        ErrorKind::NotFound => format!("cannot be written: the folder {folder} does not exist; create it"),
        ErrorKind::PermissionDenied => format!("cannot be written: no permission for {folder}; choose another folder"),
        ErrorKind::IsADirectory => "cannot be written: it is a folder; name a file in it".to_owned(),
        ErrorKind::NotADirectory => format!("cannot be written: {folder} is not a folder; choose another one"),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            format!("cannot be written: {e}; free some space or choose another folder")
        }
        ErrorKind::InvalidData => format!("cannot be encoded: {e}"),
        _ => format!("cannot be written: {e}; choose another folder"),
    }
}
