//! The document that a cost measurement writes as `cost.json`. It holds every raw run, so that whoever doubts a summary can
//! compute it anew. All numbers in it are finite; what cannot be told is `null`.
use super::motion::JudgedFrame;
pub use super::point::*;
use serde::{Deserialize, Serialize};

/// Version of the format that this program writes. Programs read their own version and older ones.
pub const SCHEMA: u32 = 1;

/// What a measurement found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// [`SCHEMA`] of the program that wrote it.
    pub schema: u32,
    /// Whether every planned run was made or has failed, and every picture was made. The same command completes what is not complete.
    pub complete: bool,
    /// The program that measured.
    pub software: Software,
    /// What was rendered or filtered.
    pub scene: SceneInfo,
    /// Where it ran.
    pub machine: Machine,
    /// What the errors are measured against.
    pub reference: ReferenceInfo,
    /// How it was measured.
    pub measurement: Measurement,
    /// One for every combination of settings, sorted by method and then by samples per pixel. An index into this list names a
    /// point elsewhere.
    pub points: Vec<Point>,
    /// The Pareto front of the medians: points which no other point beats in both GPU time and relMSE, the fastest first.
    pub front: Vec<usize>,
    /// What the data say, in words.
    pub findings: Vec<Finding>,
}

/// The program that measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Software {
    /// Version of Tallow.
    pub version: String,
    /// Commit that it was built from; `None` unless `TALLOW_COMMIT` was set during the build.
    pub commit: Option<String>,
}

/// What was rendered or filtered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneInfo {
    /// File as it was named: a scene, or with `--filter-only` an image.
    pub path: String,
    /// Name for titles.
    pub name: String,
    /// Width of the film in pixels.
    pub width: u32,
    /// Height of the film in pixels.
    pub height: u32,
    /// The frame that is judged of a scene that moves; `None` at rest.
    #[serde(default)]
    pub judged: Option<JudgedFrame>,
}

/// Where it ran.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the Vulkan device.
    pub device: String,
    /// Kind of the device, such as "discrete GPU" or "CPU".
    pub kind: String,
    /// Driver and its version.
    pub driver: String,
    /// Whether the device found by ray queries what rays meet.
    #[serde(default)]
    pub ray_queries: bool,
    /// Model of the host's processor.
    pub cpu: String,
    /// Logical cores that this process may use.
    pub cores: usize,
    /// Lowest and highest clock of the fastest core in MHz that was seen behind a run; `None` where the system does not tell.
    pub cpu_mhz: Option<[u64; 2]>,
    /// The same of the device.
    #[serde(default)]
    pub device_mhz: Option<[u64; 2]>,
}

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceSource {
    /// A file of the user's.
    Given,
    /// Rendered for this measurement, or taken from the cache of an earlier one.
    Rendered,
}

/// What is known of the noise of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoiseKind {
    /// Measured as the variance between independent renders; subtracted from MSE and relMSE, which end at 0.
    Measured,
    /// An upper bound from the file's variance layer, which takes samples to be independent; not subtracted.
    Bound,
    /// The file does not tell.
    Unknown,
}

/// What the errors are measured against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceInfo {
    /// Where it comes from.
    pub source: ReferenceSource,
    /// File that it was read from or cached in.
    pub path: Option<String>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// What is known of its noise.
    pub noise: NoiseKind,
    /// Expected MSE between it and the true image.
    pub mse: Option<f64>,
    /// Expected relMSE between it and the true image.
    pub relmse: Option<f64>,
    /// Remarks for the reader, such as that a limit was reached before the noise was low enough.
    pub notes: Vec<String>,
}

/// How it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Number of runs of each point, besides the one that warms it up. Every run has a seed of its own, so that errors and times
    /// vary independently.
    pub repeats: u32,
    /// Seeds of the runs, in order. All points use the same seeds, so that run i of one point can be compared with run i of another.
    pub seeds: Vec<u32>,
    /// Seed of the random order in which points run.
    pub order_seed: u64,
    /// Limit of the whole measurement in minutes; `None` without limit.
    pub budget_minutes: Option<f64>,
    /// Confidence level of all intervals, such as 0.95. Median times reach it from six runs on: those of fewer have the range of the
    /// runs instead, which covers the median with 1 - 2 / 2^n.
    pub confidence: f64,
    /// Identifies scene, settings, grid, device and driver: only a measurement with the same key is continued.
    pub key: String,
}

/// What a finding says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The data tell.
    Clear,
    /// The data cannot tell: the intervals overlap.
    TooNoisy,
}

/// One sentence about the data.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Whether the data support a statement or leave it open.
    pub verdict: Verdict,
    /// The sentence.
    pub text: String,
}
