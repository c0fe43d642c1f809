//! Runs the steps of a render until they end, the image is good enough, or the user has seen enough.
use super::progress::Progress;
use super::resume::Earlier;
use crate::error::Result;
use crate::gpu::{FrameResources, PassTime};
use crate::render::{PathRange, Renderer, Step};
use crate::statistics::BrokenSamples;
use serde::Serialize;
use std::ops::ControlFlow;

/// A render to run.
pub struct Job<'a> {
    /// What runs it.
    pub renderer: &'a Renderer,
    /// Whether to hide the progress bar.
    pub quiet: bool,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// All samples are taken.
    Done,
    /// No pixel wants more: its error is below the threshold, or it has as many samples as it may have.
    Threshold {
        /// Pixels whose estimated error is still above the threshold.
        above: u64,
    },
    /// The user stopped it.
    Interrupted,
}

impl Why {
    /// What is worth saying, with a line break; nothing when all went as planned.
    pub fn line(self) -> String {
        match self {
            Self::Done => String::new(),
            Self::Threshold { above: 0 } => {
                "stopped: the error of every pixel is estimated below the threshold\n".into()
            }
            Self::Threshold { above } => format!("stopped: {above} pixels are above the threshold at their limit\n"),
            // Told when it is known where what there is was written.
            Self::Interrupted => String::new(),
        }
    }
}

/// How it ended.
pub struct End {
    /// Of all passes.
    pub times: Vec<PassTime>,
    /// Samples taken.
    pub traced: u64,
    /// Allocations made, those of a resumed render included.
    pub allocations: u32,
    /// Most priorities of one allocation that were not finite, and so counted for nothing.
    pub broken_priorities: u32,
    /// Samples that were no number, those of a resumed render included; filled in once it has ended.
    pub broken_samples: Option<BrokenSamples>,
    /// What was traced last of the last allocation; none before the first.
    pub last: Option<PathRange>,
    /// Why it ended.
    pub why: Why,
}

impl Job<'_> {
    /// Runs it, from where `earlier` stopped if there is one. Before each step `between` is told how far it is, may read
    /// the renderer's buffers, and says whether to go on.
    ///
    /// # Errors
    /// As [`Renderer::run`], and those of `between`.
    pub fn run(
        &self,
        frame: &mut FrameResources,
        earlier: Option<&Earlier>,
        between: &mut dyn FnMut(&End) -> Result<ControlFlow<()>>,
    ) -> Result<End> {
        let r = self.renderer;
        earlier.map_or(Ok(()), |earlier| earlier.put_back(r, frame))?;
        let steps = || -> Box<dyn Iterator<Item = Step>> {
            match earlier {
                Some(earlier) => Box::new(r.rest(earlier.progress)),
                None => Box::new(r.steps()),
            }
        };
        let allocations = earlier.map_or(0, |e| e.progress.allocations);
        let mut end = End {
            times: Vec::new(),
            traced: 0,
            allocations,
            broken_priorities: 0,
            broken_samples: None,
            last: None,
            why: Why::Done,
        };
        if earlier.is_some() {
            end.last = Some(nothing_yet(steps().next()));
        }
        let threshold = r.settings().allocate.noise_threshold > 0.0;
        let mut progress = Progress::new(steps().map(|step| step.paths()).sum(), self.quiet);
        let (mut listed, mut to_do) = (u64::MAX, steps().peekable());
        while let Some(planned) = to_do.next() {
            if between(&end)?.is_break() {
                end.why = Why::Interrupted;
                break;
            }
            let step = planned.within(listed);
            if let Some(step) = &step {
                end.times.extend(r.run(frame, step)?);
                end.traced += step.paths();
            }
            if let Some(Step::Allocate(_) | Step::Choose(_)) = step {
                end.allocations += 1;
                end.last = Some(nothing_yet(to_do.peek().copied()));
                if r.list_may_be_short() {
                    listed = r.listed()?;
                }
            }
            match step {
                Some(Step::Allocate(_)) => {
                    let state = r.apportionment()?;
                    end.broken_priorities = end.broken_priorities.max(state.non_finite);
                    if threshold && state.wanting == 0 {
                        end.why = Why::Threshold { above: 0 };
                        break;
                    }
                }
                Some(Step::Listed(range)) => end.last = Some(range),
                Some(Step::Start | Step::Uniform(_) | Step::Choose(_)) | None => {}
            }
            progress.add(planned.paths());
            if progress.wants_speed() {
                progress.set_speed(rays_of_a_few(r, step.map_or(0, |step| step.paths()))?);
            }
        }
        progress.finish();
        if threshold && end.why != Why::Interrupted {
            end.why = Why::Threshold { above: above_threshold(r)? };
        }
        Ok(end)
    }
}

/// Rays and samples of 16 runs of up to 64 of the samples that were traced last.
fn rays_of_a_few(renderer: &Renderer, traced: u64) -> Result<[u64; 2]> {
    const RUNS: usize = 16;
    const SAMPLES: usize = 64;
    let records = if renderer.effects().split_light { 3 } else { 1 };
    let (samples, traced) = (&renderer.film().samples, traced as usize);
    let mut sums = [0; 2];
    for first in (0..RUNS).map(|i| i * traced / RUNS) {
        let run = first..traced.min(first + SAMPLES);
        for [_, _, _, rays] in samples.read_range(run.start * records..run.end * records)?.into_iter().step_by(records)
        {
            sums = [sums[0] + rays.abs() as u64, sums[1] + 1];
        }
    }
    Ok(sums)
}

/// The beginning of the round that the next step deals to.
fn nothing_yet(next: Option<Step>) -> PathRange {
    match next {
        Some(Step::Listed(range)) => PathRange { first: 0, paths: 0, ..range },
        _ => PathRange { first: 0, paths: 0, round: 0, rounds: 1 },
    }
}

/// Pixels whose error is estimated above the threshold, however many samples they have.
fn above_threshold(renderer: &Renderer) -> Result<u64> {
    let stats = renderer.film().tiles[0].stats.read()?;
    let wanting = renderer.priorities_of(&stats, u32::MAX)?;
    Ok(wanting.iter().filter(|&&p| p > 0.0).count() as u64)
}
