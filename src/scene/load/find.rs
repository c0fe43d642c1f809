//! Finds files that a scene names as another system writes them.
use std::path::{Path, PathBuf};

/// The file that `written` means, below `directory`. Where it does not exist as written: the same letters in another
/// case, or the bare file name next to the MTL (absolute paths of another machine). The flag tells that the name was repaired.
pub fn find_file(directory: &Path, written: &str) -> Option<(PathBuf, bool)> {
    let exact = directory.join(written);
    if exact.is_file() {
        return Some((exact, false));
    }
    let bare = written.rsplit('/').next().unwrap_or(written);
    [written, bare].iter().find_map(|w| any_case(directory, w)).map(|path| (path, true))
}

fn any_case(directory: &Path, written: &str) -> Option<PathBuf> {
    let mut path = directory.to_owned();
    for part in written.split('/').filter(|p| !p.is_empty() && *p != ".") {
        let next = path.join(part);
        path = if part == ".." || next.exists() { next } else { entry_like(&path, part)? };
    }
    path.is_file().then_some(path)
}

fn entry_like(directory: &Path, name: &str) -> Option<PathBuf> {
    let listed = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
    let entries = std::fs::read_dir(listed).ok()?;
    entries
        .flatten()
        .find(|e| e.file_name().to_str().is_some_and(|f| f.eq_ignore_ascii_case(name)))
        .map(|e| directory.join(e.file_name()))
}
