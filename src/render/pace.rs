//! Steps of about a given time: how many paths the next one may have, from what the last ones took.
use super::Step;
use super::pass::path::traces_paths;
use crate::gpu::{DeviceKind, PassTime};
use std::time::Duration;

/// Paths of the first step, of which nothing is known: a scene of 100,000 instances takes a CPU a second. A graphics card traces
/// more in some milliseconds, and would idle at the end of every short step.
const fn first(kind: DeviceKind) -> u64 {
    if matches!(kind, DeviceKind::Cpu) { 1 << 12 } else { 1 << 20 }
}

/// Fewer would not keep a device busy.
const LEAST: u64 = 1 << 10;
/// A step may have so many times the paths of the last at most: other pixels may see what takes longer.
const GROWTH: u64 = 4;
/// Paths take so many times what else a step does, such as looking through all pixels of a list, even if it then takes
/// longer.
const WORTH: u32 = 50;

/// The pace of a render.
pub struct Pace {
    step_time: Option<Duration>,
    most: u64,
}

impl Pace {
    /// For steps of about this time on such a device; none: they stay as they are.
    pub fn new(step_time: Option<Duration>, kind: DeviceKind) -> Self {
        Self { step_time, most: step_time.map_or(u64::MAX, |_| first(kind)) }
    }

    /// What is to be done next of `left`, whose last comes first, or else of `steps`; the rest of it goes to the end of
    /// `left`.
    pub fn next(&self, left: &mut Vec<Step>, steps: &mut impl Iterator<Item = Step>) -> Option<Step> {
        let mut step = left.pop().or_else(|| steps.next())?;
        while let Some((first, rest)) = step.split(self.most) {
            left.push(rest);
            step = first;
        }
        Some(step)
    }

    /// Tells what a step took from its beginning to its end, and on the GPU. Of few paths nothing is learned.
    pub fn observe(&mut self, step: &Step, took: Duration, passes: &[PassTime]) {
        let paths = step.paths();
        let Some(step_time) = self.step_time.filter(|_| GROWTH * paths >= self.most) else { return };
        let tracing = passes.iter().filter(|pass| traces_paths(pass.name)).map(PassTime::duration_ns).sum();
        // A queue without timestamps tells nothing.
        let traced = if tracing == 0 { took } else { Duration::from_nanos(tracing) };
        let wanted = step_time.max(took.saturating_sub(traced) * WORTH);
        let most = paths as f64 * wanted.as_secs_f64() / traced.as_secs_f64();
        self.most = (most as u64).clamp(LEAST, GROWTH * self.most);
    }
}

#[cfg(test)]
mod tests {
    use super::super::PathRange;
    use super::*;

    /// Times of the steps of a render of so many paths, each of which takes `path` seconds, and each step `fixed`
    /// seconds more.
    fn steps(pace: &mut Pace, paths: u32, path: f64, fixed: f64) -> Vec<f64> {
        let all = Step::Listed(PathRange { first: 0, paths, round: 0, rounds: 1 });
        let (mut left, mut all, mut times) = (Vec::new(), std::iter::once(all), Vec::new());
        while let Some(step) = pace.next(&mut left, &mut all) {
            let traced = path * step.paths() as f64;
            let pass = PassTime { name: "path", begin_ns: 0, end_ns: (1e9 * traced) as u64 };
            pace.observe(&step, Duration::from_secs_f64(traced + fixed), &[pass]);
            times.push(traced + fixed);
        }
        times
    }

    #[test]
    fn steps_come_to_take_their_time_and_little_else() {
        let mut pace = Pace::new(Some(Duration::from_secs(1)), DeviceKind::Cpu);
        let times = steps(&mut pace, 1 << 23, 4e-6, 0.001);
        assert!(times.is_sorted_by(|a, b| a <= &(1.01 * b)) && times.len() < 45, "{times:?}");
        assert!((0.9..1.01).contains(&times[5]), "{times:?}");
        // What takes a hundred times as long is late once.
        let times = steps(&mut pace, 1 << 18, 4e-4, 0.001);
        assert!(times[0] > 10.0 && times[2..].iter().all(|&t| t < 1.01), "{times:?}");
        // Where every step looks through many pixels, steps are longer.
        let times = steps(&mut pace, 1 << 23, 4e-6, 0.1);
        let longest = times.iter().copied().fold(0.0, f64::max);
        assert!((4.0..5.2).contains(&longest), "{times:?}");
    }

    #[test]
    fn a_queue_that_tells_no_times_and_a_step_of_few_paths_are_no_harm() {
        let step = |paths| Step::Listed(PathRange { first: 0, paths, round: 0, rounds: 1 });
        let mut pace = Pace::new(Some(Duration::from_secs(1)), DeviceKind::Cpu);
        pace.observe(&step(1 << 12), Duration::from_secs(2), &[]);
        assert_eq!(pace.most, 1 << 11);
        pace.observe(&step(1), Duration::from_secs(2), &[]);
        assert_eq!(pace.most, 1 << 11);
        pace.observe(&step(1 << 11), Duration::ZERO, &[]);
        assert_eq!(pace.most, 1 << 13);
        pace.observe(&step(1 << 13), Duration::MAX, &[]);
        assert_eq!(pace.most, LEAST);
    }
}
