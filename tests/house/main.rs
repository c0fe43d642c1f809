//! Tests of the repository itself: which modules import which, what kernels may not ask for, and the scripts below `tools`.
mod imports;
mod kernels;
mod tools;

use std::path::{Path, PathBuf};

/// All files in a folder and in those inside it.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|p| p.is_dir());
    files.into_iter().chain(folders.iter().flat_map(|f| files_below(f))).collect()
}
