//! Temporary files, which get their final name when they are complete.
use std::fs::File;
use std::io::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::NamedTempFile;

/// A file that is not complete. On Linux, if the file system allows it, the file has no name and vanishes however the
/// process ends; otherwise its name is hidden.
pub(super) enum Temporary {
    #[cfg(target_os = "linux")]
    Nameless(File),
    Hidden(NamedTempFile),
}

/// Paths of the hidden files that this process has made, including those completed since.
static HIDDEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes incomplete files, for exits of the process that run no destructors.
pub fn remove_unfinished() {
    if let Ok(hidden) = HIDDEN.try_lock() {
        // A file that was completed has another name by now.
        hidden.iter().for_each(|path| drop(std::fs::remove_file(path)));
    }
}

impl Temporary {
    pub fn new_in(folder: &Path) -> Result<Self> {
        #[cfg(target_os = "linux")]
        if let Ok(file) = linux::nameless(folder) {
            return Ok(Self::Nameless(file));
        }
        builder().tempfile_in(folder).map(noted).map(Self::Hidden)
    }

    pub fn file(&self) -> &File {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(file) => file,
            Self::Hidden(file) => file.as_file(),
        }
    }

    /// Renames the file to `path`, in the same folder, replacing any file there.
    pub fn replace(self, path: &Path) -> Result<()> {
        self.hidden(path)?.persist(path).map(drop).map_err(|e| e.error)
    }

    /// Renames the file to `path`, in the same folder, or if that exists, to a name with a number. Returns the name.
    pub fn create(self, path: &Path) -> Result<PathBuf> {
        let mut file = self.hidden(path)?;
        for number in 1_u32.. {
            let name = numbered(path, number);
            file = match file.persist_noclobber(&name) {
                Ok(_) => return Ok(name),
                Err(taken) if name.symlink_metadata().is_ok() => taken.file,
                Err(failed) => return Err(failed.error),
            };
        }
        Err(Error::other("every name is taken"))
    }

    /// Gives a nameless file a hidden name, because only a file with a name can replace another.
    fn hidden(self, path: &Path) -> Result<NamedTempFile> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Nameless(file) => linux::named(file, super::folder(path)).map(noted),
            Self::Hidden(file) => Ok(file),
        }
    }
}

fn noted(file: NamedTempFile) -> NamedTempFile {
    if let Ok(mut hidden) = HIDDEN.lock() {
        hidden.push(file.path().to_owned());
    }
    file
}

/// Names numbered from 1: `a.exr`, `a-2.exr`, `a-3.exr` and so on.
fn numbered(path: &Path, number: u32) -> PathBuf {
    if number == 1 {
        return path.to_owned();
    }
    with_suffix(path, &format!("-{number}"))
}

/// The path with a suffix behind the name and before the extension: `a.partial.exr` of `a.exr` and `.partial`.
pub fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(suffix);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tallow-").suffix(".part");
    // The crate's default, 0600, would make the image unreadable for others; the umask still applies.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

#[cfg(target_os = "linux")]
mod linux {
    use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, open};
    use std::fs::File;
    use std::io::Result;
    use std::os::fd::AsRawFd;
    use std::path::{Path, PathBuf};
    use tempfile::NamedTempFile;

    /// Makes a file without a name.
    ///
    /// # Errors
    /// When the file system does not support this, or the file could not be given a name later.
    pub fn nameless(folder: &Path) -> Result<File> {
        let mode = Mode::from_raw_mode(0o666);
        let file = File::from(open(folder, OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC, mode)?);
        link(&file).symlink_metadata()?;
        Ok(file)
    }

    /// Gives the file a hidden name in `folder`, which must be on the same file system.
    pub fn named(file: File, folder: &Path) -> Result<NamedTempFile> {
        let link = link(&file);
        let made =
            super::builder().make_in(folder, |path| Ok(linkat(CWD, &link, CWD, path, AtFlags::SYMLINK_FOLLOW)?))?;
        Ok(NamedTempFile::from_parts(file, made.into_temp_path()))
    }

    /// The link by which Linux shows a file that the process has open.
    fn link(file: &File) -> PathBuf {
        format!("/proc/self/fd/{}", file.as_raw_fd()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_before_the_extension() {
        assert_eq!(numbered(Path::new("x/a.b.exr"), 1), Path::new("x/a.b.exr"));
        assert_eq!(numbered(Path::new("x/a.b.exr"), 2), Path::new("x/a.b-2.exr"));
        assert_eq!(numbered(Path::new("trace"), 3), Path::new("trace-3"));
    }

    #[test]
    fn hidden_files_are_removed_by_hand_and_complete_ones_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let hidden = || Temporary::Hidden(noted(builder().tempfile_in(folder.path()).unwrap()));
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        let unfinished = hidden();
        hidden().replace(&folder.path().join("a.exr")).unwrap();
        assert_eq!(hidden().create(&folder.path().join("a.exr")).unwrap(), folder.path().join("a-2.exr"));
        assert_eq!(count(), 3);
        remove_unfinished();
        assert_eq!(count(), 2, "{unfinished:?}", unfinished = unfinished.file());
    }
}
