//! The built program, run in a folder, and what it leaves there.
#![allow(dead_code)]
use std::path::Path;
use std::process::{Command, Output};
use tallow::image::{self, Film};
use tempfile::TempDir;

/// Path of a scene to render.
pub fn scene() -> String {
    format!("{}/scenes/cornell-box/scene.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Runs it with `folder` as the current one.
pub fn tallow(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tallow")).args(words).current_dir(folder.path()).output().unwrap()
}

/// Standard output of a program.
pub fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Checks the exit code and that stderr is one line which holds all of `parts`.
#[track_caller]
pub fn complains(output: &Output, code: i32, parts: &[&str]) {
    let text = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(parts.iter().all(|p| text.contains(p)), "{text}");
}

/// An image of the folder.
#[track_caller]
pub fn film(folder: &TempDir, name: &str) -> Film {
    image::read(&folder.path().join(name)).unwrap()
}

/// The names of what is in a folder, sorted.
#[track_caller]
pub fn names(folder: &Path) -> Vec<String> {
    let entry = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(entry).collect();
    names.sort();
    names
}
