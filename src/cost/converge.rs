//! A reference that is rendered: the mean of independent renders, whose differences tell its noise. The variance of samples
//! would not, because samples of one Sobol sequence are not independent. It is kept in a folder between runs and goes on there.
use super::document::{NoiseKind, ReferenceInfo, ReferenceSource};
use super::judge::Noise;
use super::reference::{Reference, noise_of};
use crate::allocate::Allocate;
use crate::error::Result;
use crate::gpu::{FrameResources, Gpu};
use crate::image::{self, Film, Picture, WriteOptions};
use crate::render::settings::Settings;
use crate::render::{Job, Outputs, Renderer, StopReason};
use crate::scene::{Fingerprint, Scene};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Samples per pixel of each independent render.
pub const PART_SPP: u32 = 16;
/// Renders that tell noise at all.
pub const FEWEST_PARTS: u32 = 4;
/// Seeds of these renders begin here, far from those of the points.
const FIRST_SEED: u32 = 0x8000_0000;
/// References that are kept, the newest.
const KEPT: usize = 32;
/// Metadata of a kept file.
const PARTS: &str = "parts";

/// A reference that can still grow.
pub struct Converging {
    renderer: Renderer,
    frame: FrameResources,
    sum: Sum,
    file: Option<PathBuf>,
}

/// Mean and squared deviations of independent renders.
struct Sum {
    size: [u32; 2],
    parts: u32,
    mean: Vec<[f64; 3]>,
    m2: Vec<[f64; 3]>,
}

impl Converging {
    /// Begins a reference, or takes up what `folder` holds of it.
    ///
    /// # Errors
    /// Those of [`Renderer::new`].
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings, folder: Option<&Path>) -> Result<Self> {
        let part = Settings {
            spp: PART_SPP,
            seed: FIRST_SEED,
            first_sample: 0,
            allocate: Allocate::default(),
            ..settings.clone()
        };
        let size = [part.width, part.height];
        let file = folder
            .map(|folder| folder.join(format!("{}.exr", key(scene, &part))))
            .filter(|_| scene.fingerprint(size).is_ok());
        let kept = file.as_deref().and_then(|file| Sum::load(file, size));
        let renderer = Renderer::new(gpu, scene, &part, Outputs::default())?;
        Ok(Self { renderer, frame: FrameResources::new(gpu)?, sum: kept.unwrap_or_else(|| Sum::new(size)), file })
    }

    /// Samples per pixel so far.
    pub fn spp(&self) -> u32 {
        self.sum.parts * PART_SPP
    }

    /// Adds one render, unless `stop` ends it before. Returns whether it was added.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn grow(&mut self, stop: &dyn Fn() -> bool) -> Result<bool> {
        self.renderer.set_seed(FIRST_SEED.wrapping_add(self.sum.parts));
        let mut between = |_: &_| Ok(if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) });
        let status = Job::new(&self.renderer).run(&mut self.frame, &mut between)?;
        if status.stopped == StopReason::Interrupted {
            return Ok(false);
        }
        self.sum.add(&picture(&self.renderer)?);
        Ok(true)
    }

    /// The reference so far.
    pub fn reference(&self) -> Reference {
        let (picture, noise) = (self.sum.picture(), self.sum.noise());
        Reference {
            picture,
            noise,
            info: ReferenceInfo {
                source: ReferenceSource::Rendered,
                path: self.file.as_ref().map(|file| file.display().to_string()),
                spp: Some(self.spp()),
                noise: NoiseKind::Measured,
                mse: Some(noise.mse),
                relmse: Some(noise.relmse),
                notes: Vec::new(),
            },
        }
    }

    /// Keeps it for the next run. A folder that cannot be written to only costs time, later.
    pub fn keep(&self) {
        if let Some(file) = &self.file {
            let _ = self.sum.store(file);
        }
    }
}

/// Radiance of all pixels that a renderer holds.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn picture(renderer: &Renderer) -> Result<Picture> {
    let settings = renderer.settings();
    let mut pixels = Vec::with_capacity(settings.pixels());
    for tile in &renderer.film().tiles {
        for window in tile.windows() {
            let stats = tile.stats.read_range(window.start as usize..window.end as usize)?;
            pixels.extend(stats.iter().map(|s| s.mean));
        }
    }
    Ok(Picture { width: settings.width, height: settings.height, pixels })
}

/// Everything that the image depends on.
fn key(scene: &Scene, settings: &Settings) -> String {
    let mut key = Fingerprint::default();
    let scene = scene.fingerprint([settings.width, settings.height]).map(|f| f.to_string()).unwrap_or_default();
    let settings = serde_json::to_string(settings).unwrap_or_default();
    key.add(scene.as_bytes());
    key.add(settings.as_bytes());
    key.add(&crate::shaders::HASH.to_le_bytes());
    key.to_string()
}

impl Sum {
    fn new(size: [u32; 2]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self { size, parts: 0, mean: vec![[0.0; 3]; pixels], m2: vec![[0.0; 3]; pixels] }
    }

    /// Welford's update.
    fn add(&mut self, part: &Picture) {
        self.parts += 1;
        let n = f64::from(self.parts);
        for ((mean, m2), value) in self.mean.iter_mut().zip(&mut self.m2).zip(&part.pixels) {
            for c in 0..3 {
                let off = f64::from(value[c]) - mean[c];
                mean[c] += off / n;
                m2[c] += off * (f64::from(value[c]) - mean[c]);
            }
        }
    }

    fn picture(&self) -> Picture {
        let pixels = self.mean.iter().map(|mean| mean.map(|v| v as f32)).collect();
        Picture { width: self.size[0], height: self.size[1], pixels }
    }

    /// Squared standard error of every pixel; 0 before the second part.
    fn variance(&self) -> Vec<[f32; 3]> {
        let n = f64::from(self.parts.max(2));
        self.m2.iter().map(|m2| m2.map(|v| (v / (n * (n - 1.0))) as f32)).collect()
    }

    fn noise(&self) -> Noise {
        noise_of(&self.picture(), &self.variance())
    }

    fn store(&self, file: &Path) -> Result<()> {
        let folder = file.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map_err(|e| crate::error::Error::output(folder, e))?;
        let mut film = Film::new(self.size[0], self.size[1]);
        film.add_vec3("", ["R", "G", "B"], &self.picture().pixels);
        film.add_vec3("variance", ["R", "G", "B"], &self.variance());
        film.metadata.insert(PARTS.to_owned(), self.parts.to_string());
        image::write(file, &film, &WriteOptions::default())?;
        prune(folder);
        Ok(())
    }

    /// `None` if there is no file, or none that this program wrote whole.
    fn load(file: &Path, size: [u32; 2]) -> Option<Self> {
        let film = image::read(file).ok()?;
        let parts: u32 = film.metadata.get(PARTS)?.parse().ok()?;
        let (mean, variance) = (film.picture(None).ok()?, film.picture(Some("variance")).ok()?);
        if [film.width, film.height] != size || mean.non_finite() + variance.non_finite() > 0 {
            return None;
        }
        let n = f64::from(parts);
        let wide = |pixels: &[[f32; 3]], factor: f64| pixels.iter().map(|p| p.map(|v| f64::from(v) * factor)).collect();
        Some(Self { size, parts, mean: wide(&mean.pixels, 1.0), m2: wide(&variance.pixels, n * (n - 1.0)) })
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
        let mut sum = Sum::new([1, 1]);
        [1.0, 3.0].iter().for_each(|&v| sum.add(&part(v)));
        sum.store(&file).unwrap();
        let mut sum = Sum::load(&file, [1, 1]).unwrap();
        [2.0, 2.0].iter().for_each(|&v| sum.add(&part(v)));
        assert_eq!((sum.parts, sum.picture().pixels[0]), (4, [2.0, 4.0, 1.0]));
        // Squared deviations 1, 1, 0, 0: sum 2 over 4 * 3, four times that for the second channel.
        let variance = sum.variance()[0];
        assert!((variance[0] - 2.0 / 12.0).abs() < 1e-6 && (variance[1] - 8.0 / 12.0).abs() < 1e-6, "{variance:?}");
        let noise = sum.noise();
        assert!((noise.mse - 10.0 / 36.0).abs() < 1e-6, "{noise:?}");
        assert!((noise.relmse - (2.0 / 12.0 / 4.01 + 8.0 / 12.0 / 16.01) / 3.0).abs() < 1e-6, "{noise:?}");
        assert!(Sum::load(&file, [2, 1]).is_none());
    }
}
