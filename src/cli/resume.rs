//! Taking up a render where it stopped: everything that it needs is in the EXR file that it wrote.
use super::job::End;
use super::layers;
use super::origin::Origin;
use super::rendered::Rendered;
use crate::error::{Error, Result};
use crate::gpu::FrameResources;
use crate::image::{self, Film};
use crate::layout::{PixelLight, PixelStats};
use crate::render::schedule;
use crate::render::settings::Settings;
use crate::render::{Progress, Renderer};
use crate::scene::Scene;
use crate::statistics::{BrokenSamples, Pixel};
use serde_json::Value;
use std::path::Path;

/// Metadata that tells how many allocations a render had made.
pub const ALLOCATIONS: &str = "allocations";

/// What an earlier render left.
pub struct Earlier {
    /// Where it stopped.
    pub progress: Progress,
    /// Samples that were no number.
    pub broken: Option<BrokenSamples>,
    pixels: Vec<Pixel>,
    priority: Vec<f32>,
    pending: Vec<u32>,
}

impl Earlier {
    /// Reads the file of a render of this scene with its settings; one that spread its samples evenly may have had fewer
    /// of them.
    ///
    /// # Errors
    /// [`Error::Input`] when it is no such file.
    pub fn read(path: &Path, scene: &Scene, settings: &Settings) -> Result<Self> {
        let film = image::read(path)?;
        Self::of(&film, scene, settings).map_err(|what| Error::input(path, what))
    }

    fn of(film: &Film, scene: &Scene, settings: &Settings) -> std::result::Result<Self, String> {
        let rendered = Rendered::of(film)?;
        check(&rendered.origin, scene, settings)?;
        let priority = rendered.priority(film)?;
        let Rendered { pixels, broken, pending, .. } = rendered;
        let pending = match pending {
            _ if settings.allocate.is_even() => {
                pixels.iter().map(|p| settings.spp.saturating_sub(p.stats.count)).collect()
            }
            pending => pending.unwrap_or_else(|| vec![0; pixels.len()]),
        };
        let progress =
            Progress { allocations: allocations(film)?, pending: pending.iter().map(|&n| u64::from(n)).sum() };
        Ok(Self { progress, broken, pixels, priority, pending })
    }

    /// Puts it into the renderer's buffers and returns the steps that are left.
    ///
    /// # Errors
    /// As [`Renderer::resume`].
    pub fn put_back(&self, renderer: &Renderer, frame: &mut FrameResources) -> Result<()> {
        let stats: Vec<PixelStats> = self.pixels.iter().map(|p| p.stats).collect();
        let light: Vec<PixelLight> = self.pixels.iter().map(|p| p.light).collect();
        renderer.resume(frame, &stats, &light, &self.priority, &self.pending)
    }
}

/// Whether a render of this scene can go on where the file's ended.
fn check(origin: &Origin, scene: &Scene, settings: &Settings) -> std::result::Result<(), String> {
    let uniform = settings.allocate.is_even();
    // By way of text: a number's shortest decimal is not its value in double precision.
    let text = serde_json::to_string(settings).map_err(|e| e.to_string())?;
    let mut wanted: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let mut had = origin.settings.clone();
    if uniform {
        for settings in [&mut wanted, &mut had] {
            settings.as_object_mut().map(|s| s.remove("spp"));
        }
    }
    if wanted != had {
        let free = if uniform { "; only spp may differ" } else { "" };
        return Err(format!("was rendered with other settings{free}: {}", origin.settings));
    }
    origin.shows(scene, settings)?;
    // A pixel goes on at the index of its first sample plus their number.
    match &origin.samples[..] {
        [one] if (one.seed, one.first) == (settings.seed, settings.first_sample) => Ok(()),
        _ => Err("was merged, and cannot be resumed unless its samples are spread evenly and close up to one range from the \
                  scene's first: render more samples with --first-sample, and merge those"
            .into()),
    }
}

/// Allocations that the render had made.
fn allocations(film: &Film) -> std::result::Result<u32, String> {
    // Each adds a sample to some pixel, but for those behind a threshold, which may find nothing to add.
    const MOST: u32 = Settings::MAX_SPP + u32::BITS;
    let made = film.metadata.get(ALLOCATIONS).and_then(|n| n.parse().ok());
    made.filter(|&n| n <= MOST)
        .ok_or_else(|| format!("has no number of {ALLOCATIONS}: take the file as tallow wrote it"))
}

/// What the pixels of an interrupted render still lack of what they were to have by then.
///
/// # Errors
/// [`Error::Device`].
pub fn pending(renderer: &Renderer, film: &Film, end: &End) -> Result<Vec<u32>> {
    let Some(last) = &end.last else {
        let first = schedule::first_spp(renderer.settings());
        let counts = layers::counts(film, "samples").map_err(Error::Usage)?;
        return Ok(counts.iter().map(|n| first - n).collect());
    };
    Ok(schedule::pending(&renderer.film().counts.count.read()?, last))
}
