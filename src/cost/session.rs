//! Renders the shots of a grid and filters them, with the clock on.
use super::document::{Pass, Run, WarmUp};
use super::grid::{Candidate, Shot};
use super::motion::{Motion, Moving};
use super::rounds::{Measured, Outcome, Runs};
use crate::denoise::{Noisy, Recipe, Timed, check_room, filter, timed};
use crate::error::{Error, Result};
use crate::gpu::{FrameResources, Gpu, PassTime, by_pass, milliseconds};
use crate::image::Picture;
use crate::machine::wake;
use crate::render::{Job, Renderer, Status, called_for};
use crate::scene::{Change, Scene};
use std::time::{Duration, Instant};

/// Part of the device's largest heap that warm renderers may take together.
const KEPT_SHARE: u64 = 4;

/// Renderers that are kept warm, and what they render.
pub struct Session<'a> {
    gpu: &'a Gpu,
    scene: &'a Scene,
    /// The scene of its own, where it moves.
    moving: Option<Moving<'a>>,
    candidates: &'a [Candidate],
    shots: &'a [Shot],
    warm: Vec<Option<Warm>>,
    frame: FrameResources,
}

/// A renderer that has rendered its shot once.
struct Warm {
    renderer: Renderer,
    costs: WarmUp,
    device_bytes: u64,
    /// What has changed in the scene since it was told.
    missed: Change,
}

/// The render of a shot.
struct Rendered {
    gpu_ms: f64,
    wall: Duration,
    passes: Vec<Pass>,
    samples: u64,
    rays: u64,
}

impl<'a> Session<'a> {
    /// Begins with no renderer. A scene with `motion` shows the frame that is judged.
    ///
    /// # Errors
    /// [`Error::Device`], also for a device that does not tell times.
    pub fn new(
        gpu: &'a Gpu,
        scene: &'a Scene,
        motion: Option<&'a Motion>,
        candidates: &'a [Candidate],
        shots: &'a [Shot],
    ) -> Result<Self> {
        gpu.check_clock()?;
        let warm = shots.iter().map(|_| None).collect();
        let moving = motion.map(|motion| Moving::new(scene, motion));
        Ok(Self { gpu, scene, moving, candidates, shots, warm, frame: FrameResources::new(gpu)? })
    }

    /// `None` if it was stopped.
    fn render(&mut self, shot: usize, seed: u32, stop: &dyn Fn() -> bool) -> Result<Option<Rendered>> {
        if self.warm[shot].is_none() && !self.warm_up(shot, seed, stop)? {
            return Ok(None);
        }
        wake(self.gpu)?;
        let Some((status, wall)) = self.shoot(shot, seed, stop)? else {
            self.forget(shot)?;
            return Ok(None);
        };
        let Some(Warm { renderer, .. }) = &self.warm[shot] else { return Ok(None) };
        if let Some(broken) = status.broken_samples {
            return Err(Error::Device(format!(
                "{} samples were no number, or stopped early by the driver",
                broken.count
            )));
        }
        let [rays, of] = Job::new(renderer).rays_of_a_few(&status)?;
        let passes = passes(&status.times);
        Ok(Some(Rendered {
            gpu_ms: passes.iter().map(|pass| pass.ms).sum(),
            wall,
            passes,
            samples: status.traced,
            rays: (status.traced as f64 * rays as f64 / of.max(1) as f64) as u64,
        }))
    }

    /// Makes a renderer and runs it once, so that the driver has compiled everything. Returns false if it was stopped.
    fn warm_up(&mut self, shot: usize, seed: u32, stop: &dyn Fn() -> bool) -> Result<bool> {
        let Shot { settings, outputs, carries, .. } = &self.shots[shot];
        let info = self.gpu.info();
        if self.gpu.allocated_bytes() > info.memory_heap / KEPT_SHARE {
            self.warm.iter_mut().for_each(|warm| *warm = None);
        }
        self.check_room(shot)?;
        let before = self.gpu.allocated_bytes();
        let effects = match &mut self.moving {
            None => called_for(self.scene, settings, *outputs),
            Some(moving) => {
                let (effects, change) = moving.effects(settings, *outputs)?;
                tell(&mut self.warm, &change)?;
                effects
            }
        };
        let begun = Instant::now();
        let scene = self.moving.as_ref().map_or(self.scene, |moving| &moving.scene);
        let mut renderer = Renderer::specialised(self.gpu, scene, settings, *outputs, effects)?;
        if let (Some(how), Some(moving)) = (carries, &self.moving) {
            renderer.keep_history(*how, moving.moves)?;
        }
        let costs = WarmUp { compile_ms: milliseconds(begun.elapsed()), first_run_ms: 0.0 };
        self.warm[shot] = Some(Warm { renderer, costs, device_bytes: 0, missed: Change::default() });
        let begun = Instant::now();
        if self.shoot(shot, seed, stop)?.is_none() {
            self.forget(shot)?;
            return Ok(false);
        }
        if let Some(warm) = &mut self.warm[shot] {
            warm.costs.first_run_ms = milliseconds(begun.elapsed());
            warm.device_bytes = self.gpu.allocated_bytes().saturating_sub(before);
        }
        Ok(true)
    }

    /// Drops a renderer that did not reach its end, and brings the scene to where it is between runs.
    fn forget(&mut self, shot: usize) -> Result<()> {
        self.warm[shot] = None;
        let Some(moving) = &mut self.moving else { return Ok(()) };
        tell(&mut self.warm, &moving.rest()?)?;
        Ok(())
    }

    /// Renders the image of a shot, or the frames that lead to it. Returns what the last took: a scene that has moved into it is
    /// uploaded in that time. `None` if it was stopped.
    fn shoot(&mut self, shot: usize, seed: u32, stop: &dyn Fn() -> bool) -> Result<Option<(Status, Duration)>> {
        let Self { gpu, moving, warm, frame, shots, .. } = self;
        let Some(moving) = moving else {
            let Some(Warm { renderer, .. }) = &mut warm[shot] else { return Ok(None) };
            renderer.set_seed(seed);
            return trace(&Job::new(renderer), frame, stop);
        };
        let carries = shots[shot].carries.is_some();
        let frames = moving.frames(carries);
        let mut last = None;
        for number in frames.clone() {
            tell(warm, &moving.pose(number)?)?;
            let Some(Warm { renderer, missed, .. }) = &mut warm[shot] else { return Ok(None) };
            // Frames that begin with others' samples need random numbers of their own.
            renderer.set_seed(if carries { seed.wrapping_add(number) } else { seed });
            let (begun, change) = (Instant::now(), std::mem::take(missed));
            let moved = gpu.run(frame, |rec| renderer.update(rec, &moving.scene, &change))?;
            let moving_into = begun.elapsed();
            if !carries && number != *frames.end() {
                continue;
            }
            let job = Job { carries: carries && number > *frames.start(), ..Job::new(renderer) };
            let Some((mut status, wall)) = trace(&job, frame, stop)? else { return Ok(None) };
            status.times.splice(..0, moved);
            last = Some((status, moving_into + wall));
        }
        Ok(last)
    }

    fn check_room(&self, shot: usize) -> Result<()> {
        let Shot { settings, points, .. } = &self.shots[shot];
        let filters = points.iter().filter_map(|&point| self.candidates[point].filter);
        check_room(filters, settings, self.gpu.info().unified)
            .map_err(|what| Error::Memory(format!("rendering {what}: choose a smaller film")))
    }

    fn measured(&self, shot: usize, seed: u32, point: usize, rendered: &Rendered) -> Result<Measured> {
        let Some(Warm { renderer, costs, device_bytes, .. }) = &self.warm[shot] else {
            return Err(Error::Device("the renderer is gone".to_owned()));
        };
        let mut run = Run {
            seed,
            gpu_ms: rendered.gpu_ms,
            wall_ms: milliseconds(rendered.wall),
            passes: rendered.passes.clone(),
            samples: rendered.samples,
            rays: Some(rendered.rays),
            ..Run::default()
        };
        let candidate = &self.candidates[point];
        let Some(method) = candidate.filter else {
            let picture = renderer.picture()?.finite().map_err(Error::Device)?;
            return Ok(Measured { point, run, picture, warm_up: *costs, device_bytes: *device_bytes });
        };
        let settings = |scales: &filter::Scales| candidate.filter_settings.scaled_at_defaults(scales);
        let recipe = Recipe { settings: &settings, ..Recipe::new(method) };
        let filtered = timed(self.gpu, Noisy::of_film(renderer)?, &recipe)?;
        let warm_up = add_filter(&mut run, costs, &filtered);
        let device_bytes = device_bytes + filtered.device_bytes;
        let size = renderer.settings().size();
        let picture = Picture::of_planes(size, &filtered.colour).finite().map_err(Error::Device)?;
        Ok(Measured { point, run, picture, warm_up, device_bytes })
    }
}

impl Runs for Session<'_> {
    const ALIKE: bool = false;

    fn groups(&self) -> Vec<Vec<usize>> {
        self.shots.iter().map(|shot| shot.points.clone()).collect()
    }

    /// Renders a shot with a seed and filters it for its points, in the order of `points`.
    fn run(&mut self, shot: usize, seed: u32, points: &[usize], stop: &dyn Fn() -> bool) -> Outcome {
        let failed = |e: Error| points.iter().map(|&point| (point, Err(e.clone()))).collect();
        let rendered = match self.render(shot, seed, stop) {
            Ok(Some(rendered)) => rendered,
            Ok(None) => return Vec::new(),
            Err(e) => return failed(self.forget(shot).err().unwrap_or(e)),
        };
        points.iter().map(|&point| (point, self.measured(shot, seed, point, &rendered))).collect()
    }
}

/// Adds the times of a filter to those of a render, and returns what the first use of both took.
pub fn add_filter(run: &mut Run, render: &WarmUp, filtered: &Timed) -> WarmUp {
    let passes = passes(&filtered.times);
    run.gpu_ms += passes.iter().map(|pass| pass.ms).sum::<f64>();
    run.wall_ms += milliseconds(filtered.wall);
    run.passes.extend(passes);
    WarmUp {
        compile_ms: render.compile_ms + milliseconds(filtered.compile),
        first_run_ms: render.first_run_ms + milliseconds(filtered.first_run),
    }
}

/// Tells all renderers that the scene has changed.
///
/// # Errors
/// What [`Change::add`] refuses.
fn tell(warm: &mut [Option<Warm>], change: &Change) -> Result<()> {
    warm.iter_mut().flatten().try_for_each(|warm| warm.missed.add(change.clone()))
}

/// Runs a whole render, and returns its wall time. `None` if it was stopped.
fn trace(job: &Job, frame: &mut FrameResources, stop: &dyn Fn() -> bool) -> Result<Option<(Status, Duration)>> {
    let begun = Instant::now();
    let status = job.run_until(frame, stop)?;
    Ok(status.map(|status| (status, begun.elapsed())))
}

/// Sums of the times by pass, in the order in which the passes first ran.
fn passes(times: &[PassTime]) -> Vec<Pass> {
    let sum = |(name, ns): (&str, Vec<u64>)| Pass {
        pass: name.to_owned(),
        calls: ns.len(),
        ms: ns.iter().map(|&ns| ns as f64 * 1e-6).sum(),
    };
    by_pass(times).into_iter().map(sum).collect()
}
