//! A reference that is rendered: the mean of independent renders, whose differences tell its noise. The variance of samples
//! would not, because samples of one Sobol sequence are not independent. It is kept in a folder between runs and goes on there.
use super::document::{NoiseKind, ReferenceInfo, ReferenceSource};
use super::parts::Parts;
use super::plan::Watch;
use super::reference::Reference;
use crate::allocate::Allocate;
use crate::error::Result;
use crate::gpu::{FrameResources, Gpu};
use crate::image::{Picture, metrics};
use crate::render::settings::Settings;
use crate::render::{Job, Outputs, Renderer};
use crate::scene::{Fingerprint, Scene};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Samples per pixel of each independent render.
const PART_SPP: u32 = 16;
/// Renders that tell noise at all.
const FEWEST_PARTS: u32 = 4;
/// Seeds of these renders begin here, far from those of the points.
const FIRST_SEED: u32 = 0x8000_0000;
/// The noise of a reference is rendered down to this share of the smallest relMSE: a tenth of its root.
const NOISE_SHARE: f64 = 0.01;
/// A reference that can still grow.
pub struct Converging {
    renderer: Renderer,
    frame: FrameResources,
    parts: Parts,
    file: Option<PathBuf>,
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
            indirect_stride: 1,
            allocate: Allocate::default(),
            ..settings.clone()
        };
        let size = part.size();
        let file = folder
            .map(|folder| folder.join(format!("{}.exr", key(scene, &part))))
            .filter(|_| scene.fingerprint(size).is_ok());
        let kept = file.as_deref().and_then(|file| Parts::load(file, size));
        let renderer = Renderer::new(gpu, scene, &part, Outputs::default())?;
        Ok(Self { renderer, frame: FrameResources::new(gpu)?, parts: kept.unwrap_or_else(|| Parts::new(size)), file })
    }

    /// Samples per pixel so far.
    fn spp(&self) -> u32 {
        self.parts.count * PART_SPP
    }

    /// Adds renders until its noise is small beside the smallest error of `pilots`, until it has `most_spp` samples per pixel, or
    /// until `limit`; and keeps it.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn grow_below(
        &mut self,
        pilots: &[Picture],
        most_spp: u32,
        limit: Option<Instant>,
        watch: &Watch,
    ) -> Result<Reference> {
        let most = (most_spp / PART_SPP).max(FEWEST_PARTS);
        let mut goal = FEWEST_PARTS;
        loop {
            let reaches = self.grow_to(goal, limit, watch)?;
            let (reference, parts) = (self.reference(), self.parts.count);
            let wanted = parts_wanted(&reference, pilots, parts);
            if wanted <= parts || parts >= most || !reaches {
                self.keep();
                return Ok(with_note(reference, wanted > parts));
            }
            goal = wanted.min(2 * parts).min(most);
        }
    }

    /// The reference of `spp` samples per pixel that an earlier measurement had, to the same bits: errors against a better one are no
    /// errors of the same kind. What was kept with more is left alone and made anew with fewer. Only a user who stops it leaves its
    /// picture incomplete; what is told of it stays that by which the earlier runs were judged.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn again(&mut self, spp: u32, earlier: &ReferenceInfo, watch: &Watch) -> Result<Reference> {
        let parts = spp / PART_SPP;
        if self.parts.count > parts {
            (self.parts, self.file) = (Parts::new(self.parts.size), None);
        }
        let was = self.parts.count;
        let is_whole = self.grow_to(parts, None, watch)?;
        if self.parts.count > was {
            self.keep();
        }
        let mut reference = self.reference();
        match is_whole {
            true => reference.info.notes.clone_from(&earlier.notes),
            false => reference.info = earlier.clone(),
        }
        Ok(reference)
    }

    /// Returns false if time was up before, or the user stopped it.
    fn grow_to(&mut self, parts: u32, limit: Option<Instant>, watch: &Watch) -> Result<bool> {
        while self.parts.count < parts {
            (watch.progress)("reference", self.spp().into(), (parts * PART_SPP).into());
            let is_late = limit.is_some_and(|limit| Instant::now() >= limit);
            if (is_late && self.parts.count >= FEWEST_PARTS) || !self.grow(watch.stop)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Adds one render, unless `stop` ends it before. Returns whether it was added.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    fn grow(&mut self, stop: &dyn Fn() -> bool) -> Result<bool> {
        self.renderer.set_seed(FIRST_SEED.wrapping_add(self.parts.count));
        if Job::new(&self.renderer).run_until(&mut self.frame, stop)?.is_none() {
            return Ok(false);
        }
        self.parts.add(&self.renderer.picture()?);
        Ok(true)
    }

    /// The reference so far.
    fn reference(&self) -> Reference {
        let (picture, noise) = (self.parts.picture(), self.parts.noise());
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
    fn keep(&self) {
        if let Some(file) = &self.file {
            let _ = self.parts.store(file);
        }
    }
}

/// Everything that the image depends on.
fn key(scene: &Scene, settings: &Settings) -> String {
    let mut key = Fingerprint::default();
    let scene = scene.fingerprint(settings.size()).map(|f| f.to_string()).unwrap_or_default();
    let settings = serde_json::to_string(settings).unwrap_or_default();
    key.add(scene.as_bytes());
    key.add(settings.as_bytes());
    key.add(&crate::shaders::HASH.to_le_bytes());
    key.to_string()
}

/// Independent renders that a reference needs to be far below the smallest error.
fn parts_wanted(reference: &Reference, pilots: &[Picture], parts: u32) -> u32 {
    let noise = reference.noise.relmse;
    let error = |picture: &Picture| metrics::relmse(picture, &reference.picture) - noise;
    // An error that drowns in the noise is taken to be as large as the noise, and is looked at again once that is smaller.
    let smallest = pilots.iter().map(error).fold(f64::INFINITY, f64::min).max(noise);
    let times = noise / (NOISE_SHARE * smallest);
    if times.is_finite() { (f64::from(parts) * times).ceil().min(1e9) as u32 } else { parts }
}

fn with_note(mut reference: Reference, is_short: bool) -> Reference {
    if is_short {
        reference.info.notes.push(
            "a limit of time or samples was reached before the standard error of the reference was a tenth of the smallest \
             error; its noise is subtracted from MSE and relMSE, but not from the other errors"
                .to_owned(),
        );
    }
    reference
}
