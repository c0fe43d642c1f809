//! The loop of a render: it runs the steps until they end, the image is good enough, or the caller has seen enough.
use super::pace::Pace;
use super::{Checkpoint, PathRange, Renderer, Step, film, provenance, resume};
use crate::error::{Error, Result};
use crate::gpu::{FrameResources, PassTime};
use crate::image::primaries::REC709;
use crate::image::{Film, SOFTWARE, Samples};
use crate::render::schedule::Cut;
use crate::statistics::BrokenSamples;
use serde::Serialize;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// A render to run.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// What runs it.
    pub renderer: &'a Renderer,
    /// Where it goes on from, if it does not begin anew. Make the renderer with [`Renderer::resumable`] then.
    pub checkpoint: Option<&'a Checkpoint>,
    /// Paths that one step traces at most, at least 1; the renderer's own limit where that is lower. Fewer paths make
    /// shorter steps, and change no bit of the result.
    pub paths_at_once: u32,
    /// Time that a step takes, about, so that the caller is asked as often: steps are cut by what the last ones took,
    /// the first of all are short, and none is so short that the render becomes slower by much. It changes no bit of
    /// the result either. None: steps are as long as [`Job::paths_at_once`] lets them be.
    pub step_time: Option<Duration>,
    /// The only pixel to render, by its row-major index; all pixels if none. It gets [`Settings::spp`] samples, those that it has
    /// in the whole render, however its renderer places them. Such a film can be neither resumed nor merged.
    ///
    /// [`Settings::spp`]: crate::render::settings::Settings::spp
    pub pixel: Option<u32>,
    /// Whether it begins with the samples of the last frame, as [`Renderer::begin_frame`] has it. Such a film can be neither resumed
    /// nor merged.
    pub carries: bool,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StopReason {
    /// All samples are taken.
    Done,
    /// No pixel wants more: its error is below the threshold, or it has as many samples as it may have.
    Threshold {
        /// Pixels whose estimated error is still above the threshold.
        above: u64,
    },
    /// The caller stopped it.
    Interrupted,
}

/// How far a render is, and how it ended.
#[derive(Clone, Debug)]
pub struct Status {
    /// GPU time of every pass so far.
    pub times: Vec<PassTime>,
    /// Samples that this job traced.
    pub traced: u64,
    /// Samples that its last step traced.
    pub traced_last: u64,
    /// Samples that it has dealt with out of [`Status::planned`]; those that nobody wanted count as well.
    pub done: u64,
    /// Samples that it takes at most.
    pub planned: u64,
    /// Allocations made, those before the checkpoint included.
    pub allocations: u32,
    /// Most priorities of one allocation that were not finite, and so counted for nothing.
    pub broken_priorities: u32,
    /// Samples that were no number or ended early, those before the checkpoint included; found once the job has ended.
    pub broken_samples: Option<BrokenSamples>,
    /// Why it ended; while it goes on, [`StopReason::Interrupted`], as if it stopped here.
    pub stopped: StopReason,
    /// What was traced last of the last allocation; none before the first.
    pub(super) last: Option<PathRange>,
}

impl<'a> Job<'a> {
    /// A render from its beginning to its end.
    pub fn new(renderer: &'a Renderer) -> Self {
        Self { renderer, checkpoint: None, paths_at_once: u32::MAX, step_time: None, pixel: None, carries: false }
    }

    /// Runs it. Before each step `between` is told how far it is, may read the renderer's buffers (the renderer waits), and
    /// says whether to go on: that is the place to show progress, to look at a clock or a button, and to write a
    /// [`Job::film`] every so often. What the last step brought is told by the returned status alone.
    ///
    /// # Errors
    /// As [`Renderer::run`] and [`Renderer::resume`], and those of `between`; [`Error::Usage`] for a job that has more than one of a
    /// checkpoint, a pixel, and samples that it carries.
    pub fn run(
        &self,
        frame: &mut FrameResources,
        between: &mut dyn FnMut(&Status) -> Result<ControlFlow<()>>,
    ) -> Result<Status> {
        let renderer = self.renderer;
        let begins = [self.checkpoint.is_some(), self.pixel.is_some(), self.carries];
        if begins.iter().filter(|begins| **begins).count() > 1 {
            let what = "a job has more than one of checkpoint, pixel and carries: each begins with samples of its own";
            return Err(Error::Usage(what.to_owned()));
        }
        let pixels = renderer.settings().pixels();
        if let Some(pixel) = self.pixel.filter(|&pixel| pixel as usize >= pixels) {
            return Err(Error::Usage(format!("pixel {pixel} is outside of the film, which has {pixels} pixels")));
        }
        if let Some(checkpoint) = self.checkpoint {
            renderer.resume(frame, checkpoint)?;
        }
        let (begun, steps) = self.begin(frame)?;
        let (mut status, mut steps, mut listed) = (self.at_start(), steps.peekable(), u64::MAX);
        let (mut pace, mut left) = (Pace::new(self.step_time, renderer.gpu.info().kind), Vec::new());
        status.times.extend(begun);
        let mut has_begun = self.checkpoint.is_some() || self.carries;
        while let Some(planned) = pace.next(&mut left, &mut steps) {
            if between(&status)?.is_break() {
                if !has_begun {
                    status.times.extend(renderer.run(frame, &Step::Start)?); // a film without a sample
                }
                return self.ended(status);
            }
            let step = planned.within(listed);
            if let Some(step) = &step {
                let begin = Instant::now();
                let times = renderer.run(frame, step)?;
                has_begun = true;
                pace.observe(step, begin.elapsed(), &times);
                status.times.extend(times);
            }
            status.count(&planned, step.as_ref());
            if let Some(Step::Allocate(_) | Step::Choose(_)) = step {
                status.last = Some(nothing_of(steps.peek()));
                listed = if renderer.list_may_be_short() { renderer.listed()? } else { u64::MAX };
            }
            if let Some(Step::Allocate(_)) = step
                && self.nobody_wants_more(&mut status)?
            {
                break;
            }
        }
        status.stopped = StopReason::Done;
        if renderer.settings().allocate.has_threshold() {
            status.stopped = StopReason::Threshold { above: above_threshold(renderer)? };
        }
        self.ended(status)
    }

    /// [`Job::run`] without interruption.
    ///
    /// # Errors
    /// As [`Renderer::run`] and [`Renderer::resume`].
    pub fn run_to_end(&self, frame: &mut FrameResources) -> Result<Status> {
        self.run(frame, &mut |_| Ok(ControlFlow::Continue(())))
    }

    /// [`Job::run`] until `stop` says so between two steps; `None` if it did.
    pub(crate) fn run_until(&self, frame: &mut FrameResources, stop: &dyn Fn() -> bool) -> Result<Option<Status>> {
        let mut between = |_: &_| Ok(if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) });
        let status = self.run(frame, &mut between)?;
        Ok((status.stopped != StopReason::Interrupted).then_some(status))
    }

    /// Reads back what there is: the layers that the renderer's [`super::Outputs`] ask for, and as metadata what
    /// [`Checkpoint::read`] and [`super::merge`] go by. Written as EXR, such a file can be resumed and merged; not once the
    /// renderer's camera was moved, as its samples are then of no scene that was loaded, and not before the first sample.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn film(&self, status: &Status) -> Result<Film> {
        let mut film = film::read_back(self.renderer)?;
        film.primaries = Some(REC709);
        film.metadata.insert(SOFTWARE.to_owned(), format!("tallow {}", env!("CARGO_PKG_VERSION")));
        film.metadata.insert(film::ALBEDO.to_owned(), film::OF_SAMPLES.to_owned());
        film.metadata.insert(film::SHARP_DIRECT.to_owned(), self.renderer.sharp_direct().to_string());
        film.metadata.insert(film::INDIRECT_STRIDE.to_owned(), self.renderer.settings().indirect_stride.to_string());
        if self.pixel.is_none() {
            film.metadata.extend(provenance::metadata(self.renderer, &film)?);
        }
        film.metadata.insert(resume::ALLOCATIONS.to_owned(), status.allocations.to_string());
        film::set_broken_samples(&mut film, self.broken_samples()?);
        if status.stopped == StopReason::Interrupted {
            let pending = resume::pending(self.renderer, &film, status.last.as_ref())?;
            film.add(film::PENDING, Samples::U32(pending));
        }
        Ok(film)
    }

    /// Rays and samples of 16 runs of up to 64 of the samples that the last step traced: their quotient times
    /// [`Status::traced`] is the number of rays so far, about.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn rays_of_a_few(&self, status: &Status) -> Result<[u64; 2]> {
        const RUNS: usize = 16;
        const SAMPLES: usize = 64;
        let records = self.renderer.effects().records_per_path();
        let (samples, traced) = (&self.renderer.film().samples, status.traced_last as usize);
        let mut sums = [0; 2];
        for first in (0..RUNS).map(|i| i * traced / RUNS) {
            let run = first..traced.min(first + SAMPLES);
            let run = samples.read_range(run.start * records..run.end * records)?;
            for [_, _, _, rays] in run.into_iter().step_by(records) {
                sums = [sums[0] + rays.abs() as u64, sums[1] + 1];
            }
        }
        Ok(sums)
    }

    fn steps(&self) -> Box<dyn Iterator<Item = Step>> {
        let cut = self.renderer.cut();
        let cut = Cut { paths: cut.paths.min(self.paths_at_once).max(1), ..cut };
        let settings = self.renderer.settings();
        if let Some(pixel) = self.pixel {
            return Box::new(super::schedule::steps_of_pixel(settings, &cut, pixel));
        }
        match self.checkpoint {
            Some(checkpoint) => Box::new(super::schedule::rest(settings, &cut, checkpoint.progress())),
            None => Box::new(super::schedule::steps(settings, &cut)),
        }
    }

    /// What is left to do once it has begun, and what its beginning took.
    fn begin(&self, frame: &mut FrameResources) -> Result<(Vec<PassTime>, Box<dyn Iterator<Item = Step>>)> {
        if !self.carries {
            return Ok((Vec::new(), self.steps()));
        }
        let (times, steps) = self.renderer.begin_frame(frame)?;
        Ok((times, Box::new(steps.into_iter())))
    }

    fn at_start(&self) -> Status {
        Status {
            times: Vec::new(),
            traced: 0,
            traced_last: 0,
            done: 0,
            planned: self.planned(),
            allocations: self.checkpoint.map_or(0, |checkpoint| checkpoint.allocations),
            broken_priorities: 0,
            broken_samples: None,
            stopped: StopReason::Interrupted,
            last: self.checkpoint.map(|_| nothing_of(self.steps().next().as_ref())),
        }
    }

    /// Samples to take at most.
    fn planned(&self) -> u64 {
        let settings = self.renderer.settings();
        if self.carries {
            return u64::from(settings.spp) * settings.pixels() as u64;
        }
        self.steps().map(|step| step.paths()).sum()
    }

    fn ended(&self, status: Status) -> Result<Status> {
        Ok(Status { broken_samples: self.broken_samples()?, ..status })
    }

    fn broken_samples(&self) -> Result<Option<BrokenSamples>> {
        let before = self.checkpoint.and_then(|checkpoint| checkpoint.broken);
        Ok(BrokenSamples::join(before, self.renderer.broken_samples()?))
    }

    /// Looks at how the last allocation went. Only a noise threshold makes pixels want nothing.
    fn nobody_wants_more(&self, status: &mut Status) -> Result<bool> {
        let state = self.renderer.apportionment()?;
        status.broken_priorities = status.broken_priorities.max(state.non_finite);
        Ok(self.renderer.settings().allocate.has_threshold() && state.wanting == 0)
    }
}

impl Status {
    /// Counts what was planned, and what of it was done.
    fn count(&mut self, planned: &Step, step: Option<&Step>) {
        self.traced_last = step.map_or(0, Step::paths);
        self.traced += self.traced_last;
        self.done += planned.paths();
        match step {
            Some(Step::Allocate(_) | Step::Choose(_)) => self.allocations += 1,
            Some(Step::Listed(range)) => self.last = Some(*range),
            Some(Step::Start | Step::Reproject | Step::Uniform(_)) | None => {}
        }
    }
}

/// The beginning of the round that the next step deals to.
fn nothing_of(next: Option<&Step>) -> PathRange {
    match next {
        Some(Step::Listed(range)) => PathRange { first: 0, paths: 0, ..*range },
        _ => PathRange { first: 0, paths: 0, round: 0, rounds: 1 },
    }
}

/// Pixels whose error is estimated above the threshold, however many samples they have.
fn above_threshold(renderer: &Renderer) -> Result<u64> {
    let stats = renderer.film().tiles[0].stats.read()?;
    let wanting = renderer.priorities_of(&stats, u32::MAX)?;
    Ok(wanting.iter().filter(|&&p| p > 0.0).count() as u64)
}
