//! Whole frames, run again and again: with timestamps and without them in turn, so that their cost is known.
use crate::denoise::Denoiser;
use crate::error::Result;
use crate::gpu::{self, FrameResources, Gpu, Pass, PassTime};
use crate::render::{Job, Renderer};
use std::sync::{Arc, Mutex, PoisonError};

/// What a frame consists of.
#[derive(Clone, Copy)]
pub struct Workload<'a> {
    /// What runs it.
    pub gpu: &'a Gpu,
    /// All of its render.
    pub renderer: &'a Renderer,
    /// The filter behind it, if there is one.
    pub denoiser: Option<&'a Denoiser>,
}

/// A frame that was run.
#[derive(Clone, Debug)]
pub struct FrameRun {
    /// From before its recording to after its end, on the host's clock.
    pub wall: PassTime,
    /// Its passes, where they were timed.
    pub passes: Vec<Pass>,
}

/// Frames with timestamps and as many without.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Those that were timed.
    pub timed: Vec<FrameRun>,
    /// Those that were not.
    pub untimed: Vec<FrameRun>,
}

impl Workload<'_> {
    /// Runs a frame before the others, for what drivers compile on first use, and then `count` frames with and `count` without
    /// timestamps, alternately. `done` is told of each.
    ///
    /// # Errors
    /// As [`Job::run`] and [`Denoiser::record`].
    pub fn run(&self, count: usize, done: &mut dyn FnMut()) -> Result<Frames> {
        let passes: Arc<Mutex<Vec<Pass>>> = Arc::default();
        let mut frame = FrameResources::new(self.gpu)?;
        let seen = passes.clone();
        frame.observe(move |more| seen.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(more));
        let mut run = |timed: bool| {
            frame.set_timed(timed);
            let wall = self.run_one(&mut frame)?;
            done();
            let passes = std::mem::take(&mut *passes.lock().unwrap_or_else(PoisonError::into_inner));
            Ok(FrameRun { wall, passes })
        };
        run(true)?;
        let mut frames = Frames::default();
        for i in 0..count {
            // Whichever comes first in a pair does so in every second one.
            for timed in [i % 2 == 0, i % 2 == 1] {
                let list = if timed { &mut frames.timed } else { &mut frames.untimed };
                list.push(run(timed)?);
            }
        }
        Ok(frames)
    }

    fn run_one(&self, frame: &mut FrameResources) -> Result<PassTime> {
        let begin_ns = gpu::host_ns();
        Job::new(self.renderer).run_to_end(frame)?;
        if let Some(denoiser) = self.denoiser {
            self.gpu.run(frame, |rec| denoiser.record(rec))?;
        }
        Ok(PassTime { name: "frame", begin_ns, end_ns: gpu::host_ns() })
    }
}
