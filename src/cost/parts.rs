//! The sum of independent renders of one image, in memory and in a file.
use super::judge::Noise;
use super::reference::noise_of;
use crate::error::{Error, Result};
use crate::image::{self, Film, Picture, WriteOptions};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// References that are kept, the newest.
const KEPT: usize = 32;
/// Metadata of a kept file.
const PARTS: &str = "parts";

/// Mean and squared deviations of independent renders.
pub struct Parts {
    /// Width and height.
    pub size: [u32; 2],
    /// Number of renders.
    pub count: u32,
    mean: Vec<[f64; 3]>,
    m2: Vec<[f64; 3]>,
}

impl Parts {
    /// Nothing yet, for images of this size.
    pub fn new(size: [u32; 2]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self { size, count: 0, mean: vec![[0.0; 3]; pixels], m2: vec![[0.0; 3]; pixels] }
    }

    /// Adds a render, by Welford's update.
    pub fn add(&mut self, part: &Picture) {
        self.count += 1;
        let n = f64::from(self.count);
        for ((mean, m2), value) in self.mean.iter_mut().zip(&mut self.m2).zip(&part.pixels) {
            for c in 0..3 {
                let off = f64::from(value[c]) - mean[c];
                mean[c] += off / n;
                m2[c] += off * (f64::from(value[c]) - mean[c]);
            }
        }
    }

    /// Their mean.
    pub fn picture(&self) -> Picture {
        let pixels = self.mean.iter().map(|mean| mean.map(|v| v as f32)).collect();
        Picture { width: self.size[0], height: self.size[1], pixels }
    }

    /// Squared standard error of every pixel; 0 before the second part.
    fn variance(&self) -> Vec<[f32; 3]> {
        let n = f64::from(self.count.max(2));
        self.m2.iter().map(|m2| m2.map(|v| (v / (n * (n - 1.0))) as f32)).collect()
    }

    /// Expected error of the mean.
    pub fn noise(&self) -> Noise {
        noise_of(&self.picture(), &self.variance())
    }

    /// Writes them to a file, and removes old files beside it.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn store(&self, file: &Path) -> Result<()> {
        let folder = file.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map_err(|e| Error::output(folder, e))?;
        let mut film = Film::from(&self.picture());
        film.add_vec3("variance", ["R", "G", "B"], &self.variance());
        film.metadata.insert(PARTS.to_owned(), self.count.to_string());
        image::write(file, &film, &WriteOptions::default())?;
        prune(folder);
        Ok(())
    }

    /// Reads them from a file. `None` if there is no file, or none that this program wrote whole.
    pub fn load(file: &Path, size: [u32; 2]) -> Option<Self> {
        let film = image::read(file).ok()?;
        let count: u32 = film.metadata.get(PARTS)?.parse().ok()?;
        let (mean, variance) = (film.picture(None).ok()?, film.picture(Some("variance")).ok()?);
        if film.size() != size || mean.non_finite() + variance.non_finite() > 0 {
            return None;
        }
        let n = f64::from(count);
        let wide = |pixels: &[[f32; 3]], factor: f64| pixels.iter().map(|p| p.map(|v| f64::from(v) * factor)).collect();
        Some(Self { size, count, mean: wide(&mean.pixels, 1.0), m2: wide(&variance.pixels, n * (n - 1.0)) })
    }
}

/// Removes all but the newest kept references.
fn prune(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let changed = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
    let mut files: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(|p| p.extension() == Some("exr".as_ref())).collect();
    files.sort_by_key(|path| std::cmp::Reverse(changed(path)));
    files.into_iter().skip(KEPT).for_each(|path| drop(std::fs::remove_file(path)));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(value: f32) -> Picture {
        Picture { width: 1, height: 1, pixels: vec![[value, 2.0 * value, 1.0]] }
    }

    #[test]
    fn independent_renders_tell_their_noise_and_survive_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let mut sum = Parts::new([1, 1]);
        [1.0, 3.0].iter().for_each(|&v| sum.add(&part(v)));
        sum.store(&file).unwrap();
        let mut sum = Parts::load(&file, [1, 1]).unwrap();
        [2.0, 2.0].iter().for_each(|&v| sum.add(&part(v)));
        assert_eq!((sum.count, sum.picture().pixels[0]), (4, [2.0, 4.0, 1.0]));
        // Squared deviations 1, 1, 0, 0: sum 2 over 4 * 3, four times that for the second channel.
        let variance = sum.variance()[0];
        assert!((variance[0] - 2.0 / 12.0).abs() < 1e-6 && (variance[1] - 8.0 / 12.0).abs() < 1e-6, "{variance:?}");
        let noise = sum.noise();
        assert!((noise.mse - 10.0 / 36.0).abs() < 1e-6, "{noise:?}");
        assert!((noise.relmse - (2.0 / 12.0 / 4.01 + 8.0 / 12.0 / 16.01) / 3.0).abs() < 1e-6, "{noise:?}");
        assert!(Parts::load(&file, [2, 1]).is_none());
    }
}
