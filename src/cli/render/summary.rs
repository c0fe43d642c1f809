//! What is said of a render at its end.
use super::{Args, planned};
use crate::cli::readable;
use crate::plan::Plan;
use crate::render::{Counters, StopReason};
use crate::report::table::{self, PassRow};
use crate::statistics::BrokenSamples;
use serde::Serialize;

/// What `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Files written; what is not UTF-8 in their names is replaced.
    pub files: Vec<String>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples of all pixels, those of a resumed file included.
    pub samples: u64,
    /// Samples traced now.
    pub traced: u64,
    /// Of any pixel.
    pub least_samples: u32,
    /// Of any pixel.
    pub most_samples: u32,
    /// Why it ended.
    pub stopped: StopReason,
    /// Most priorities of one allocation that were not finite.
    pub broken_priorities: u32,
    /// Samples that were no number and counted as black, or ended early, those of a resumed file included.
    pub broken_samples: Option<BrokenSamples>,
    /// What was planned, where it was.
    pub plan: Option<Plan>,
    /// Rays and nodes; none without `--counters`.
    pub counters: Option<Counters>,
    /// Wall time of reading the scene and building its hierarchy.
    pub load_seconds: f64,
    /// Wall time of the upload and of making pipelines.
    pub compile_seconds: f64,
    /// Wall time of the render without loading, filtering and writing.
    pub seconds: f64,
    /// Wall time of `--denoise`, its pipelines made and its images moved; 0 without.
    pub filter_seconds: f64,
    /// Name of the device.
    pub device: String,
    /// GPU time of all passes in milliseconds.
    pub gpu_ms: f64,
    /// GPU time by pass.
    pub passes: Vec<PassRow>,
    /// What the filter says of its work: pixels that were cut, the error that it expects. Whether the time was far from the planned one.
    pub notes: Vec<String>,
    /// What is odd in the scene and the options.
    pub warnings: Vec<String>,
}

/// In words.
pub fn text(args: &Args, s: &Summary) -> String {
    let speed = s.traced as f64 * 1e-6 / s.seconds.max(1e-9);
    let filtered =
        if s.filter_seconds > 0.0 { format!(", filtered in {:.2} s", s.filter_seconds) } else { String::new() };
    let mut text = format!(
        "{} x {}, {} samples in {:.2} s ({speed:.2} Msamples/s) on {}; loaded in {:.2} s, compiled in {:.2} s{filtered}\n",
        s.width, s.height, s.traced, s.seconds, s.device, s.load_seconds, s.compile_seconds
    );
    if s.least_samples != s.most_samples {
        let mean = s.samples as f64 / (f64::from(s.width) * f64::from(s.height));
        text += &format!("{} to {} samples per pixel, {mean:.2} on average\n", s.least_samples, s.most_samples);
    }
    text += &s.plan.as_ref().map_or_else(String::new, |plan| plan_lines(args, plan, s.gpu_ms));
    text += &stop_line(s.stopped);
    if let Some(c) = &s.counters {
        let per_ray = c.nodes as f64 / c.rays().max(1) as f64;
        text += &format!("{} closest-hit rays, {} any-hit rays, {per_ray:.1} nodes each\n", c.closest, c.any);
    }
    text += &s.notes.iter().map(|note| note.clone() + "\n").collect::<String>();
    text += &table::timing_table(&s.passes);
    // Of an interruption the last line on stderr tells.
    if s.stopped != StopReason::Interrupted && !s.files.is_empty() {
        let files: Vec<_> = s.files.iter().map(|name| readable(name)).collect();
        text += &format!("written: {}\n", files.join(", "));
    }
    text
}

/// What was planned, and what came of it.
fn plan_lines(args: &Args, plan: &Plan, took: f64) -> String {
    let reasons: String = plan.reasons().into_iter().map(|line| line + "\n").collect();
    let probe =
        if planned::is_made(args) { format!(", and the probe before {:.1} ms", plan.probe_ms) } else { String::new() };
    format!("{reasons}it took {took:.1} ms of GPU time{probe}\n")
}

/// What is worth saying of why it ended, with a line break; nothing when all went as planned. An interruption is told when it
/// is known where what there is was written.
fn stop_line(reason: StopReason) -> String {
    match reason {
        StopReason::Done | StopReason::Interrupted => String::new(),
        StopReason::Threshold { above: 0 } => {
            "stopped: the error of every pixel is estimated below the threshold\n".into()
        }
        StopReason::Threshold { above } => format!("stopped: {above} pixels are above the threshold at their limit\n"),
    }
}
