//! The progress bar of a render, on stderr.
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// Percent, speed and time left. Silent when stderr is no terminal.
pub struct Progress {
    bar: ProgressBar,
    start: Instant,
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
        Self { bar, start: Instant::now() }
    }

    /// Whether nobody sees it.
    pub fn is_hidden(&self) -> bool {
        self.bar.is_hidden()
    }

    /// Counts samples that are done; `rays_of` some of all samples so far, (rays, samples), tells how many rays they took.
    pub fn add(&mut self, samples: u64, rays_of: [u64; 2]) {
        self.bar.inc(samples);
        self.bar.set_message(speed(self.bar.position(), rays_of, self.start.elapsed().as_secs_f64()));
    }

    /// Removes the bar, so that what is printed next starts on a clean line.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn speed(samples: u64, [rays, of]: [u64; 2], seconds: f64) -> String {
    let rays = samples as f64 * rays as f64 / of.max(1) as f64;
    format!("{:.2} Mray/s", rays * 1e-6 / seconds.max(1e-9))
}

#[cfg(test)]
mod tests {
    use super::speed;

    #[test]
    fn speed_is_millions_of_rays_per_second() {
        assert_eq!(speed(3_000_000, [80, 20], 2.0), "6.00 Mray/s");
        assert_eq!(speed(0, [0, 0], 0.0), "0.00 Mray/s");
    }
}
