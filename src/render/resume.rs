//! Taking up a render where it stopped: everything that it needs is in the EXR file that it wrote.
use super::provenance;
use super::rendered::Rendered;
use super::{PathRange, Progress, Renderer, Step, film};
use crate::error::{Checked, Error, Result};
use crate::gpu::FrameResources;
use crate::image::{self, FILTERED, Film};
use crate::render::schedule;
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::statistics::{BrokenSamples, Pixel, next_sample};
use std::path::Path;

/// Metadata that tells how many allocations a render had made.
pub(crate) const ALLOCATIONS: &str = "allocations";

/// What an earlier render left.
#[derive(Clone, Debug, Default)]
pub struct Checkpoint {
    /// What its samples say of every pixel, row-major.
    pub pixels: Vec<Pixel>,
    /// The last priority of every pixel; empty where the policy keeps none from round to round.
    pub priority: Vec<f32>,
    /// Samples that each pixel still lacked of what it was to have by then.
    pub pending: Vec<u32>,
    /// Allocations that it had made.
    pub allocations: u32,
    /// Its samples that were no number or ended early.
    pub broken: Option<BrokenSamples>,
    /// Whether its pixels tell direct and indirect light apart.
    pub splits_light: bool,
    /// The filter that made the picture, which is left out: samples are added to those that it was made of.
    pub filtered: Option<String>,
}

impl Checkpoint {
    /// Reads the EXR file of a render of this scene with its settings; one that spread its samples evenly may have had
    /// fewer of them.
    ///
    /// # Errors
    /// [`Error::Input`] when it is no such file; [`Error::Usage`] when it has more samples than `settings` ask for.
    pub fn read(path: &Path, scene: &Scene, settings: &Settings) -> Result<Self> {
        let film = image::read(path)?;
        let checkpoint = Self::of(&film, scene, settings).map_err(|what| Error::input(path, what))?;
        let (least, most) = checkpoint.samples();
        if !settings.allocate.is_even() || most <= settings.spp {
            return Ok(checkpoint);
        }
        // The image would have the former samples, and its metadata would say fewer.
        let (name, spp) = (path.display(), settings.spp);
        let has = if least == most { format!("{most}") } else { format!("{least} to {most}") };
        Err(Error::Usage(format!("{name}: has {has} samples a pixel, more than --spp {spp}: choose {most} or more")))
    }

    /// Of the pixel that has least, and of that which has most.
    fn samples(&self) -> (u32, u32) {
        let counts = self.pixels.iter().map(|pixel| next_sample(&pixel.stats));
        (counts.clone().min().unwrap_or(0), counts.max().unwrap_or(0))
    }

    fn of(film: &Film, scene: &Scene, settings: &Settings) -> Checked<Self> {
        let rendered = Rendered::of(film)?;
        check(&rendered, scene, settings)?;
        let priority = rendered.priority(film)?;
        let Rendered { pixels, broken, pending, .. } = rendered;
        let pending = match pending {
            _ if settings.allocate.is_even() => {
                pixels.iter().map(|p| settings.spp.saturating_sub(next_sample(&p.stats))).collect()
            }
            pending => pending.unwrap_or_else(|| vec![0; pixels.len()]),
        };
        let splits_light = film::splits_light(film)?;
        let (allocations, filtered) = (allocations(film)?, film.metadata.get(FILTERED).cloned());
        Ok(Self { pixels, priority, pending, allocations, broken, splits_light, filtered })
    }

    /// Where in the schedule it stopped.
    pub fn progress(&self) -> Progress {
        let pending = self.pending.iter().map(|&n| u64::from(n)).sum();
        Progress { allocations: self.allocations, pending }
    }
}

impl Renderer {
    /// Puts back what an earlier render had, as [`super::Job`] does before it goes on. Make the renderer
    /// with [`Renderer::resumable`].
    ///
    /// # Errors
    /// [`Error::Usage`] when the renderer cannot go on, or when the checkpoint is of a film of another size, or without the split light
    /// that this renderer keeps; [`Error::Device`].
    pub fn resume(&self, frame: &mut FrameResources, checkpoint: &Checkpoint) -> Result<()> {
        let allocation = self.frame.allocation()?;
        let Checkpoint { pixels, priority, pending, .. } = checkpoint;
        let size = self.settings.pixels();
        let of_film = |what: &str, len: usize| {
            if len == size {
                return Ok(());
            }
            Err(Error::Usage(format!("{len} {what} for a film of {size} pixels: give one each")))
        };
        of_film("statistics", pixels.len())?;
        of_film("pending counts", pending.len())?;
        if !priority.is_empty() {
            of_film("priorities", priority.len())?;
        }
        self.check_split(checkpoint.splits_light)?;
        self.run(frame, &Step::Start)?;
        self.write_pixels(pixels)?;
        let counts = &self.frame.film.counts;
        counts.priority.write(0, priority)?;
        counts.count.write(0, pending)?;
        self.gpu.run(frame, |rec| allocation.scan.record(rec, counts))?;
        Ok(())
    }

    /// Samples without direct and indirect light would count as black ones of both.
    pub(super) fn check_split(&self, is_split: bool) -> Result<()> {
        if is_split || !self.effects.split_light {
            return Ok(());
        }
        let what = "these samples do not tell direct and indirect light apart, which this renderer does: render them with \
                    Outputs::FILTERED, as this one";
        Err(Error::Usage(what.to_owned()))
    }

    /// Puts samples into a film of one tile.
    pub(super) fn write_pixels(&self, pixels: &[Pixel]) -> Result<()> {
        let tile = &self.frame.film.tiles[0];
        tile.stats.write(0, &pixels.iter().map(|p| p.stats).collect::<Vec<_>>())?;
        if self.effects.split_light {
            tile.light.write(0, &pixels.iter().map(|p| p.light).collect::<Vec<_>>())?;
        }
        Ok(())
    }
}

/// The film of an EXR file that holds all samples of a render of this scene with these settings, and none else; `None` for any other
/// file, or none.
pub fn finished(path: &Path, scene: &Scene, settings: &Settings) -> Option<Film> {
    let film = image::read(path).ok()?;
    let rendered = Rendered::of(&film).ok()?;
    check(&rendered, scene, settings).ok()?;
    let done = if settings.allocate.is_even() {
        rendered.pixels.iter().all(|pixel| pixel.stats.count == settings.spp)
    } else {
        rendered.pending.is_none()
    };
    done.then_some(film)
}

/// Whether a film is the whole of a frame that begins with samples of earlier ones: of this scene and these settings, with what
/// `history` says of those.
pub fn is_frame(film: &Film, scene: &Scene, settings: &Settings, history: &str) -> bool {
    let wanted = provenance::of_frame(scene, settings, history);
    let says = |(key, value): (&String, &String)| film.metadata.get(key) == Some(value);
    wanted.is_ok_and(|wanted| wanted.iter().all(says)) && film.channel(film::PENDING).is_none()
}

/// Whether a render of this scene can go on where the file's ended.
fn check(rendered: &Rendered, scene: &Scene, settings: &Settings) -> Checked {
    let (Rendered { provenance, settings: former, .. }, uniform) = (rendered, settings.allocate.is_even());
    let mut wanted = provenance::values(settings).map_err(|e| e.to_string())?;
    let mut had = provenance.settings.clone();
    if uniform {
        for settings in [&mut wanted, &mut had] {
            settings.as_object_mut().map(|s| s.remove("spp"));
        }
    }
    if wanted != had {
        let free = if uniform { "; only spp may differ" } else { "" };
        let former = Settings { spp: if uniform { settings.spp } else { former.spp }, ..former.clone() };
        return Err(format!("was rendered with other settings{free}: {}", settings.differences(&former)));
    }
    provenance.shows(scene, settings)?;
    // A pixel goes on at the index of its first sample plus their number.
    match &provenance.samples[..] {
        [one] if (one.seed, one.first) == (settings.seed, settings.first_sample) => Ok(()),
        _ => Err("was merged, and cannot be resumed unless its samples are spread evenly and close up to one range from the \
                  scene's first: render more samples with --first-sample, and merge those"
            .into()),
    }
}

/// Allocations that the render had made.
fn allocations(film: &Film) -> Checked<u32> {
    // Each adds a sample to some pixel, but for those behind a threshold, which may find nothing to add.
    const MOST: u32 = Settings::MAX_SPP + u32::BITS;
    let made = film.metadata.get(ALLOCATIONS).and_then(|n| n.parse().ok());
    made.filter(|&n| n <= MOST)
        .ok_or_else(|| format!("has no number of {ALLOCATIONS}: take the file as tallow wrote it"))
}

/// What the pixels of an interrupted render still lack of what they were to have by then. `last`: what was traced last of the last
/// allocation; none before the first.
///
/// # Errors
/// [`Error::Device`].
pub(super) fn pending(renderer: &Renderer, film: &Film, last: Option<&PathRange>) -> Result<Vec<u32>> {
    let Some(last) = last else {
        let first = schedule::first_spp(renderer.settings());
        let counts = film::counts(film, "samples").map_err(Error::Usage)?;
        return Ok(counts.iter().map(|n| first.saturating_sub(*n)).collect()); // some may be carried
    };
    Ok(schedule::pending(&renderer.film().counts.count.read()?, last))
}
