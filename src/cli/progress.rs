//! Progress bars on stderr. They are hidden if that is no terminal.
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::RefCell;
use std::time::{Duration, Instant};

/// The bar of a render, with percent, speed and remaining time.
pub struct Progress {
    bar: ProgressBar,
    start: Instant,
    shown: Option<Instant>,
}

impl Progress {
    /// Makes a bar for a total of `total_samples` samples; `quiet` hides it.
    pub fn new(total_samples: u64, quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(10) };
        let bar = ProgressBar::with_draw_target(Some(total_samples), target);
        let template = "{percent:>3} % [{wide_bar}] {msg}, {eta} left";
        let style = ProgressStyle::with_template(template).expect("a constant template");
        bar.set_style(style.progress_chars("=> "));
        Self { bar, start: Instant::now(), shown: None }
    }

    /// Shows the number of samples that are done.
    pub fn set(&mut self, samples: u64) {
        self.bar.set_position(samples);
    }

    /// Whether the bar is visible and its speed older than 200 ms.
    pub fn wants_speed(&self) -> bool {
        !self.bar.is_hidden() && self.shown.is_none_or(|shown| shown.elapsed() > Duration::from_millis(200))
    }

    /// Shows the speed, extrapolated from the number of rays of some of the samples: [rays, samples].
    pub fn set_speed(&mut self, rays_of: [u64; 2]) {
        self.shown = Some(Instant::now());
        self.bar.set_message(speed(self.bar.position(), rays_of, self.start.elapsed().as_secs_f64()));
    }

    /// Removes the bar, so that what is printed next starts on a clean line.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// A bar for each stage of a measurement, one after the other.
pub struct Stages {
    quiet: bool,
    bar: RefCell<Option<(String, Progress)>>,
}

impl Stages {
    /// Makes one that shows nothing if it is `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, bar: RefCell::new(None) }
    }

    /// Shows how much of a stage is done, of a total that may grow.
    pub fn set(&self, stage: &str, done: u64, total: u64) {
        let mut shown = self.bar.borrow_mut();
        if shown.as_ref().is_none_or(|(last, _)| last != stage) {
            shown.iter().for_each(|(_, progress)| progress.finish());
            *shown = Some((stage.to_owned(), Progress::new(total, self.quiet)));
        }
        if let Some((_, Progress { bar, .. })) = shown.as_ref() {
            bar.set_length(total);
            bar.set_position(done);
            bar.set_message(stage.to_owned());
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.borrow().iter().for_each(|(_, progress)| progress.finish());
    }
}

fn speed(samples: u64, [rays, of]: [u64; 2], seconds: f64) -> String {
    if of == 0 {
        return String::new();
    }
    let rays = samples as f64 * rays as f64 / of as f64;
    format!("{:.2} Mray/s", rays * 1e-6 / seconds.max(1e-9))
}

#[cfg(test)]
mod tests {
    use super::speed;

    #[test]
    fn speed_is_millions_of_rays_per_second() {
        assert_eq!(speed(3_000_000, [80, 20], 2.0), "6.00 Mray/s");
        assert_eq!((speed(0, [2, 1], 0.0).as_str(), speed(9, [0, 0], 1.0).as_str()), ("0.00 Mray/s", ""));
    }
}
