//! The progress bar of a render, on stderr.
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// Percent, speed and time left. Silent when stderr is no terminal.
pub struct Progress {
    bar: ProgressBar,
    start: Instant,
    rays: u64,
}

impl Progress {
    /// A bar for so many samples in all; `quiet` hides it.
    pub fn new(total_samples: u64, quiet: bool) -> Self {
        let hidden = quiet || !std::io::stderr().is_terminal();
        let target = if hidden { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(10) };
        let bar = ProgressBar::with_draw_target(Some(total_samples), target);
        let template = "{percent:>3} % [{wide_bar}] {msg}, {eta} left";
        let style = ProgressStyle::with_template(template).expect("a constant template");
        bar.set_style(style.progress_chars("=> "));
        Self { bar, start: Instant::now(), rays: 0 }
    }

    /// Counts samples that are done, and the rays behind them: 0 when rays are not counted, and then samples per second
    /// are shown instead.
    pub fn add(&mut self, samples: u64, rays: u64) {
        self.rays += rays;
        self.bar.inc(samples);
        self.bar.set_message(speed(self.bar.position(), self.rays, self.start.elapsed().as_secs_f64()));
    }

    /// Removes the bar, so that what is printed next starts on a clean line.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn speed(samples: u64, rays: u64, seconds: f64) -> String {
    let (count, unit) = if rays > 0 { (rays, "Mray/s") } else { (samples, "Msamples/s") };
    format!("{:.2} {unit}", count as f64 * 1e-6 / seconds.max(1e-9))
}

#[cfg(test)]
mod tests {
    use super::speed;

    #[test]
    fn speed_is_millions_per_second_of_rays_where_they_are_counted() {
        assert_eq!(speed(3_000_000, 0, 2.0), "1.50 Msamples/s");
        assert_eq!(speed(3_000_000, 8_000_000, 2.0), "4.00 Mray/s");
    }
}
