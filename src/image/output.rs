//! Writing of files. A file appears complete or not at all, and one that is replaced keeps its owner and mode.
mod temporary;

use crate::error::{Checked, Error, Result};
use std::fs::Metadata;
use std::io::{BufWriter, Cursor, ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};
use temporary::Temporary;
pub use temporary::{remove_unfinished, with_suffix};

/// A destination for the bytes of a file.
pub trait Stream: Write + Seek {}
impl<T: Write + Seek> Stream for T {}

/// Replaces the content of `path` by `bytes`; see [`write_with`].
///
/// # Errors
/// As [`write_with`].
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_with(path, |stream| stream.write_all(bytes))
}

/// Replaces the content of `path` by what `fill` writes. This goes to a temporary file in the same folder, which is then
/// renamed, so the old file stays if the run is interrupted or the disk fills up. Links are followed. The new file gets
/// the mode of the old one, and its owner and group as far as this user may set them. A file that is read-only or has other
/// names (hard links, which renaming would separate) is not replaced. A pipe or device such as `/dev/stdout` is written to
/// directly.
///
/// # Errors
/// [`Error::Output`] with what to do about it. `fill` returns [`ErrorKind::InvalidData`] for data that cannot be encoded.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> Result<()> {
    let result = if is_special(path) {
        write_through(path, fill).map_err(|e| remedy(path, &e))
    } else {
        write_renamed(path, fill)
    };
    result.map_err(|what| Error::output(path, what))
}

/// Writes what `fill` writes to a new file and returns its name: `path`, or if that exists, a name with a number. Nothing
/// is replaced.
///
/// # Errors
/// As [`write_with`].
pub fn write_new(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> Result<PathBuf> {
    let made = filled(folder(path), None, fill).and_then(|file| file.create(path));
    made.map_err(|e| Error::output(path, remedy(path, &e)))
}

/// Checks that [`write()`] could start: the folder exists and accepts a file, and an existing file may be replaced.
///
/// # Errors
/// As [`write()`].
pub fn check(path: &Path) -> Result<()> {
    let result = match () {
        // Opening a pipe and closing it again would end its reader.
        () if is_special(path) => Ok(()),
        () => check_file(path),
    };
    result.map_err(|what| Error::output(path, what))
}

/// Whether `path` is a pipe or a device, which is written to directly.
pub fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Resolves `path`, with links followed, to a form that is the same for every path of a file. The file need not exist.
///
/// # Errors
/// When a folder of the path is missing, or links form a cycle.
pub fn resolve(path: &Path) -> std::io::Result<PathBuf> {
    let missing = match std::fs::canonicalize(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => e,
        found => return found,
    };
    if let Ok(target) = std::fs::read_link(path) {
        return resolve(&folder(path).join(target));
    }
    let name = path.file_name().ok_or(missing)?;
    Ok(std::fs::canonicalize(folder(path))?.join(name))
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn check_file(path: &Path) -> Checked {
    let target = resolve(path).map_err(|e| remedy(path, &e))?;
    replaceable(&target)?;
    Temporary::new_in(folder(&target)).map(drop).map_err(|e| remedy(path, &e))
}

/// Writes to a pipe or device by way of memory, because some formats seek backwards and a pipe cannot.
fn write_through(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> std::io::Result<()> {
    let mut bytes = Cursor::new(Vec::new());
    fill(&mut bytes)?;
    let mut file = std::fs::OpenOptions::new().write(true).open(path)?;
    file.write_all(bytes.get_ref())?;
    file.flush()
}

fn write_renamed(path: &Path, fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>) -> Checked {
    let target = resolve(path).map_err(|e| remedy(path, &e))?;
    let old = replaceable(&target)?;
    let written = filled(folder(&target), old, fill).and_then(|file| file.replace(&target));
    written.map_err(|e| remedy(path, &e))
}

fn filled(
    folder: &Path,
    old: Option<Metadata>,
    fill: impl FnOnce(&mut dyn Stream) -> std::io::Result<()>,
) -> std::io::Result<Temporary> {
    let temporary = Temporary::new_in(folder)?;
    let mut stream = BufWriter::new(temporary.file());
    fill(&mut stream)?;
    stream.flush()?;
    drop(stream);
    #[cfg(unix)]
    if let Some(old) = old {
        owner::pass_on(&old, temporary.file())?;
    }
    // Without this, a crash of the system soon after the renaming could leave an empty file.
    temporary.file().sync_all()?;
    Ok(temporary)
}

/// Returns the metadata of the file that would be replaced, if there is one.
fn replaceable(target: &Path) -> Checked<Option<Metadata>> {
    let Ok(old) = std::fs::symlink_metadata(target) else { return Ok(None) };
    if old.is_dir() {
        return Err(remedy(target, &ErrorKind::IsADirectory.into()));
    }
    // Root may write to any file, so the permissions are checked too.
    let opened = std::fs::OpenOptions::new().write(true).open(target);
    if old.permissions().readonly() || opened.is_err_and(|e| e.kind() == ErrorKind::PermissionDenied) {
        return Err("cannot be written: it is read-only; make it writable or choose another name".to_owned());
    }
    #[cfg(unix)]
    if std::os::unix::fs::MetadataExt::nlink(&old) > 1 {
        return Err(
            "cannot be written: the same file has other names (hard links), which would keep the old content; \
                    remove it or choose another name"
                .to_owned(),
        );
    }
    Ok(Some(old))
}

#[cfg(unix)]
mod owner {
    use std::fs::{File, Metadata, Permissions};
    use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};

    /// Copies owner, group and mode. Only root can change the owner; others can set groups that they belong to.
    pub fn pass_on(old: &Metadata, file: &File) -> std::io::Result<()> {
        let new = file.metadata()?;
        let same_group = new.gid() == old.gid() || fchown(file, None, Some(old.gid())).is_ok();
        if new.uid() != old.uid() {
            // If this is refused, the file stays the user's.
            let _ = fchown(file, Some(old.uid()), None);
        }
        // Another group than before gets only the permissions of everybody.
        let mode = if same_group { old.mode() } else { old.mode() & !0o070 | (old.mode() & 0o007) << 3 };
        file.set_permissions(Permissions::from_mode(mode & 0o777))
    }
}

/// Whether the process, or the system, has as many files open as it may. An error of the crate `tempfile` does not keep
/// its code.
fn out_of_files() -> bool {
    cfg!(unix) && std::fs::File::open("/").is_err_and(|e| matches!(e.raw_os_error(), Some(23 | 24))) // ENFILE, EMFILE
}

fn remedy(path: &Path, e: &std::io::Error) -> String {
    let (folder, exists) = (folder(path).display(), folder(path).is_dir());
    match e.kind() {
        // Neither the target of the link nor its folder exists.
        _ if path.is_symlink() && resolve(path).is_err() => {
            format!("cannot be written: it is a link that leads nowhere ({e}); remove it or choose another name")
        }
        // Linux returns this for /proc and similar file systems.
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
        ErrorKind::InvalidFilename => format!("cannot be written: {e}; choose a shorter name"),
        ErrorKind::InvalidData => format!("cannot be encoded: {e}"),
        _ if out_of_files() => format!("cannot be written: {e}; close other programs, or raise the limit (ulimit -n)"),
        _ => format!("cannot be written: {e}; choose another folder"),
    }
}
