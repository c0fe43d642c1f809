//! A steady frame time: how many samples the next frame may take, from what the last ones took.
use crate::gpu::{PassTime, milliseconds};
use std::time::Duration;

/// Weight of the newest frame in the time of a sample.
const NEWEST: f64 = 0.3;
/// A frame is planned for this share of its budget, because times spread.
const AIM: f64 = 0.9;

/// Chooses samples per pixel from frame to frame so that the GPU time of a frame stays near a budget.
///
/// ```
/// # use tallow::plan::FramePacer;
/// # use std::time::Duration;
/// let mut pacer = FramePacer::new(Duration::from_millis(16), 64);
/// let samples = pacer.samples(); // Renderer::samples(0, samples) behind Step::Start
/// pacer.observe(samples, Duration::from_millis(4)); // what the frame's timestamps tell
/// assert!(pacer.samples() > samples);
/// ```
#[derive(Clone, Debug)]
pub struct FramePacer {
    budget: f64,
    most: u32,
    /// Milliseconds of a frame without samples, and of each sample.
    fixed: f64,
    per_sample: Option<f64>,
}

impl FramePacer {
    /// For frames of `budget` and at most `most` samples a pixel, which count as 1 if they are 0. What else a frame does, such as a filter,
    /// is told by [`Self::with_fixed`].
    pub fn new(budget: Duration, most: u32) -> Self {
        Self { budget: milliseconds(budget), most: most.max(1), fixed: 0.0, per_sample: None }
    }

    /// With the time of what does not depend on samples.
    pub fn with_fixed(self, fixed: Duration) -> Self {
        Self { fixed: milliseconds(fixed), ..self }
    }

    /// Samples of the next frame, at least 1. The first frame has 1.
    pub fn samples(&self) -> u32 {
        let Some(per_sample) = self.per_sample else { return 1 };
        let room = (AIM * self.budget - self.fixed).max(0.0);
        (room / per_sample.max(1e-9)).floor().clamp(1.0, f64::from(self.most)) as u32
    }

    /// Tells what a frame of so many samples took on the GPU. A slower frame counts at once, a faster one bit by bit, so that
    /// the budget is exceeded by few frames.
    pub fn observe(&mut self, samples: u32, took: Duration) {
        let now = (milliseconds(took) - self.fixed).max(0.0) / f64::from(samples.max(1));
        self.per_sample = Some(match self.per_sample {
            Some(before) if now < before => before + NEWEST * (now - before),
            _ => now,
        });
    }

    /// [`Self::observe`] by the passes of a frame. Without any, as on a queue without timestamps, nothing is learned.
    pub fn observe_passes(&mut self, samples: u32, passes: &[PassTime]) {
        if passes.is_empty() {
            return;
        }
        self.observe(samples, Duration::from_nanos(passes.iter().map(PassTime::duration_ns).sum()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of a device that takes `fixed` plus `per_sample` milliseconds, which spread by a tenth; returns their times.
    fn frames(pacer: &mut FramePacer, fixed: f64, per_sample: f64, count: usize) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(3);
        let mut frame = |_| {
            let samples = pacer.samples();
            let took = fixed + per_sample * f64::from(samples) * (0.95 + 0.1 * random.f64());
            pacer.observe(samples, Duration::from_secs_f64(took * 1e-3));
            took
        };
        (0..count).map(&mut frame).collect()
    }

    #[test]
    fn frames_settle_below_the_budget() {
        let mut pacer = FramePacer::new(Duration::from_millis(16), 1000).with_fixed(Duration::from_millis(4));
        let times = frames(&mut pacer, 4.0, 0.5, 40);
        let settled = &times[10..];
        assert!(settled.iter().all(|&t| (11.0..16.0).contains(&t)), "{settled:?}");
        // The camera turns to something four times as slow: one frame is late.
        let times = frames(&mut pacer, 4.0, 2.0, 20);
        assert_eq!(times.iter().filter(|&&t| t > 16.0).count(), 1, "{times:?}");
        // And back: the budget is used again after some frames.
        let times = frames(&mut pacer, 4.0, 0.5, 40);
        assert!(times.iter().all(|&t| t < 16.0) && times[30] > 11.0, "{times:?}");
    }

    #[test]
    fn there_is_always_a_sample_and_never_too_many() {
        let mut pacer = FramePacer::new(Duration::from_millis(1), 8);
        assert_eq!(pacer.samples(), 1);
        pacer.observe(1, Duration::from_secs(5));
        assert_eq!(pacer.samples(), 1);
        let mut fast = FramePacer::new(Duration::from_millis(16), 8);
        fast.observe(1, Duration::ZERO);
        assert_eq!(fast.samples(), 8);
        assert_eq!(FramePacer::new(Duration::ZERO, 0).samples(), 1);
        let mut untold = FramePacer::new(Duration::from_millis(16), 8);
        untold.observe_passes(1, &[]);
        assert_eq!(untold.samples(), 1);
    }
}
