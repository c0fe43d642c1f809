//! `--checkpoint`: what there is of a render is written every so often, so that nothing but a part of it can be lost.
use super::complain;
use super::files::{Files, Item, partial_name};
use crate::image::{self, Film, WriteOptions};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// When to write, and where.
pub struct CheckpointFile {
    every: Duration,
    last: Instant,
    path: PathBuf,
    written: Option<PathBuf>,
    complained: bool,
}

/// Where checkpoints of a render go that writes these files: beside its first one with all layers, or in the working folder
/// under the name of the scene.
pub fn path(outputs: &[PathBuf], scene: &Path) -> PathBuf {
    let first = outputs.iter().find(|path| image::has_layers(path));
    partial_name(&first.cloned().unwrap_or_else(|| default_output(scene)))
}

/// The scene's name + .exr, in the working folder.
pub fn default_output(scene: &Path) -> PathBuf {
    // A folder has no name of its own to give: `.` and `..`.
    let mut name = scene.file_stem().unwrap_or("image".as_ref()).to_owned();
    name.push(".exr");
    name.into()
}

/// A length of time in minutes, as the command line takes it.
pub fn minutes(text: &str) -> std::result::Result<Duration, String> {
    match text.parse::<f64>() {
        // What no clock can measure never comes.
        Ok(minutes) if minutes > 0.0 => Ok(Duration::try_from_secs_f64(60.0 * minutes).unwrap_or(Duration::MAX)),
        _ => Err("expected a number of minutes above 0".to_owned()),
    }
}

impl CheckpointFile {
    /// Begins to count now.
    pub fn new(every: Duration, path: PathBuf) -> Self {
        Self { every, last: Instant::now(), path, written: None, complained: false }
    }

    /// Whether it is time.
    pub fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Writes `film`, and returns where. A failure is told once, and the render goes on.
    pub fn write(&mut self, files: &mut Files, film: &Film) -> Option<PathBuf> {
        let item = Item::image(self.path.clone(), film, WriteOptions::default());
        match files.add(&self.path, &item) {
            Ok(place) => self.written = Some(place),
            Err(e) if !self.complained => {
                complain(&format!("warning: {e}; the render goes on without this checkpoint"));
                self.complained = true;
            }
            Err(_) => {}
        }
        self.last = Instant::now();
        self.written.clone()
    }

    /// Removes the file, unless it is one of those that are to stay.
    pub fn remove(self, keep: &[PathBuf]) {
        if let Some(path) = self.written.filter(|path| !keep.contains(path)) {
            let _ = std::fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_beside_the_first_file_with_layers() {
        let outputs = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert_eq!(path(&outputs(&["a.png", "x/b.exr", "c.exr"]), Path::new("s.toml")), Path::new("x/b.partial.exr"));
        assert_eq!(path(&outputs(&["a.png"]), Path::new("scenes/s.toml")), Path::new("s.partial.exr"));
    }

    #[test]
    fn minutes_are_above_zero() {
        assert_eq!(minutes("0.5"), Ok(Duration::from_secs(30)));
        assert_eq!(minutes("1e300"), Ok(Duration::MAX));
        assert!(["0", "-1", "nan", "x"].into_iter().all(|text| minutes(text).is_err()));
        assert!(CheckpointFile::new(Duration::ZERO, PathBuf::new()).is_due());
        assert!(!CheckpointFile::new(Duration::MAX, PathBuf::new()).is_due());
    }
}
