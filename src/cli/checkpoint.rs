//! `--checkpoint`: writes an unfinished render to a file at regular intervals, so that a crash loses only the work since
//! the last one.
use super::common::Warnings;
use super::complain;
use super::files::{Files, Item, first_with_layers, partial_name, scene_name};
use crate::error::Checked;
use crate::image::{Film, WriteOptions, output};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The checkpoint file of a render, and the time of the last checkpoint.
pub struct CheckpointFile {
    every: Duration,
    last: Instant,
    path: PathBuf,
    written: Option<PathBuf>,
    complained: bool,
}

/// Path for the checkpoints of a render with these outputs: beside the first that holds all layers, or else the first; in the
/// working folder under the name of the scene where all are pipes.
pub fn path(outputs: &[PathBuf], scene: &Path) -> PathBuf {
    let first = first_with_layers(outputs).or_else(|| outputs.iter().find(|path| !output::is_special(path)));
    partial_name(&first.map_or_else(|| default_output(scene), |path| path.with_extension("exr")))
}

/// Default output: the name of the scene with the extension .exr, in the working folder.
pub fn default_output(scene: &Path) -> PathBuf {
    let mut name = scene_name(scene);
    name.push(".exr");
    name.into()
}

/// Parses a duration that is given in minutes.
pub fn minutes(text: &str) -> Checked<Duration> {
    match text.parse::<f64>() {
        // A time that is too long to be represented never comes.
        Ok(minutes) if minutes > 0.0 => Ok(Duration::try_from_secs_f64(60.0 * minutes).unwrap_or(Duration::MAX)),
        _ => Err("expected a number of minutes above 0".to_owned()),
    }
}

impl CheckpointFile {
    /// Starts the first interval now. `resumed`: the file at `path` that this render continues, if it is the one.
    pub fn new(every: Duration, path: PathBuf, resumed: Option<PathBuf>) -> Self {
        Self { every, last: Instant::now(), path, written: resumed, complained: false }
    }

    /// Whether the interval since the last checkpoint is over.
    pub fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Writes `film` and returns the path of the latest checkpoint. A failure is warned of once, and the render continues.
    pub fn write(&mut self, files: &mut Files, film: &Film, warnings: &mut Warnings) -> Option<PathBuf> {
        let item = Item::image(self.path.clone(), film, WriteOptions::default());
        match files.add(&self.path, &item) {
            Ok(place) => {
                if place != self.path && self.written.as_ref() != Some(&place) {
                    let (old, new) = (self.path.display(), place.display());
                    complain(&format!("note: {old} is another render's checkpoint: this one's is {new}"));
                }
                self.written = Some(place);
            }
            Err(e) if !self.complained => {
                warnings.insist([format!("{e}; the render goes on without this checkpoint")]);
                self.complained = true;
            }
            Err(_) => {}
        }
        self.last = Instant::now();
        self.written.clone()
    }

    /// Removes the file, unless it is in `keep`.
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
        assert_eq!(path(&outputs(&["x/a.png", "b.hdr"]), Path::new("s.toml")), Path::new("x/a.partial.exr"));
        assert_eq!(path(&outputs(&["/dev/null"]), Path::new("scenes/s.toml")), Path::new("s.partial.exr"));
    }

    #[test]
    fn one_that_cannot_be_written_is_warned_of_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gone").join("a.partial.exr");
        let mut checkpoint = CheckpointFile::new(Duration::ZERO, path, None);
        let (mut files, mut warnings) = (Files::new(None), Warnings::new(false));
        let written = [(); 2].map(|()| checkpoint.write(&mut files, &Film::new(1, 1), &mut warnings));
        assert_eq!(written, [None, None]);
        let [line] = warnings.all() else { panic!("{:?}", warnings.all()) };
        assert!(line.contains("a.partial.exr") && line.ends_with("goes on without this checkpoint"), "{line}");
    }

    #[test]
    fn minutes_are_above_zero() {
        assert_eq!(minutes("0.5"), Ok(Duration::from_secs(30)));
        assert_eq!(minutes("1e300"), Ok(Duration::MAX));
        assert!(["0", "-1", "nan", "x"].into_iter().all(|text| minutes(text).is_err()));
        assert!(CheckpointFile::new(Duration::ZERO, PathBuf::new(), None).is_due());
        assert!(!CheckpointFile::new(Duration::MAX, PathBuf::new(), None).is_due());
    }
}
