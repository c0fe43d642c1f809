//! The built program, run in a folder.
use std::process::{Command, Output};
use tempfile::TempDir;

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
