//! The points of a [`Document`](super::Document): settings, raw runs, and their summary.
use serde::{Deserialize, Serialize};

/// One combination of settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The settings.
    pub method: Method,
    /// Command line that renders this point's image of the first seed.
    pub command: String,
    /// Runs so far, in the order of the seeds.
    pub runs: Vec<Run>,
    /// Costs of the first use, which no run includes.
    pub warm_up: Option<WarmUp>,
    /// Device memory in bytes that the renderer and the filter took at most.
    pub device_bytes: Option<u64>,
    /// Summary of the runs; `None` if there are none.
    pub summary: Option<Summary>,
    /// Why the point could not be measured, in one line; `None` for points that did not fail.
    pub failed: Option<String>,
    /// Whether another renderer made its images: its times are wall times that were given.
    #[serde(default)]
    pub is_other: bool,
}

impl Point {
    /// A point that nothing is known of yet.
    pub fn unmeasured(method: Method, command: String) -> Self {
        let (runs, warm_up, device_bytes, summary) = (Vec::new(), None, None, None);
        Self { method, command, runs, warm_up, device_bytes, summary, failed: None, is_other: false }
    }

    /// Whether it failed here; a picture of another renderer stays what it is.
    pub fn can_be_tried_again(&self) -> bool {
        self.failed.is_some() && !self.is_other
    }

    /// Whether it belongs on a curve of error against time: it has runs, and samples per pixel.
    pub fn is_compared(&self) -> bool {
        self.failed.is_none() && self.method.spp > 0 && !self.runs.is_empty()
    }

    /// Whether a run has no error above the noise of the reference, so that nothing tells by which factor it differs from others.
    pub fn ends_at_0(&self) -> bool {
        self.runs.iter().any(|run| run.errors.relmse == Some(0.0))
    }
}

/// The settings of a point. Points that differ only in `spp` belong to one method.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Method {
    /// Name of the allocation policy; empty with `--filter-only`.
    pub allocate: String,
    /// Name of the filter; "none" without.
    pub filter: String,
    /// Rounds that the budget is spread over; `None` is the policy's own choice.
    pub rounds: Option<u32>,
    /// How samples of earlier frames are carried, as `--reproject` has it; `None` if they are not.
    #[serde(default)]
    pub reproject: Option<String>,
    /// Further options that differ from the defaults, such as "--max-depth 4".
    pub options: Vec<String>,
    /// Samples per pixel; 0 with `--filter-only`.
    pub spp: u32,
}

/// One timed run of a point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Seed of the random sequence.
    pub seed: u32,
    /// Sum of all passes in milliseconds: by the device's timestamps, but for what runs on the host and says so in its name. Of another
    /// renderer, the wall time.
    pub gpu_ms: f64,
    /// Wall time of rendering and filtering in milliseconds, without reading results back and judging them.
    pub wall_ms: f64,
    /// Time by pass, in the order in which the passes first ran. Passes of the renderer come before those of the filter.
    pub passes: Vec<Pass>,
    /// Samples that were traced.
    pub samples: u64,
    /// Rays that were traced, extrapolated from some of the samples; `None` with `--filter-only`.
    pub rays: Option<u64>,
    /// Errors of the image.
    pub errors: Errors<f64>,
}

/// Time of one pass within a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// The kernel's name, or what was done without one: see [`PassTime::name`](crate::gpu::PassTime::name).
    pub pass: String,
    /// Number of times that it ran.
    pub calls: usize,
    /// Sum of its durations in milliseconds.
    pub ms: f64,
}

/// Costs of the first use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WarmUp {
    /// Wall time of uploading the scene and making pipelines, in milliseconds.
    pub compile_ms: f64,
    /// Wall time of the first run, in which drivers compile what they put off, in milliseconds.
    pub first_run_ms: f64,
}

/// One value per metric: of a run, or summarised over runs. Metrics that an image is too small or too far out of range for are
/// `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors<T> {
    /// Mean squared error, linear, less the noise of the reference if that was measured.
    pub mse: Option<T>,
    /// Mean of `(a - b)^2 / (b^2 + 0.01)`, less the noise of the reference if that was measured.
    pub relmse: Option<T>,
    /// relMSE without the 0.1 % of pixels that contribute most to it; noise is not subtracted.
    pub relmse_trimmed: Option<T>,
    /// Peak signal-to-noise ratio in dB of the sRGB-encoded images; higher is better.
    pub psnr: Option<T>,
    /// Structural similarity; 1 is best.
    pub ssim: Option<T>,
    /// Mean FLIP error of the images cut to [0, 1].
    pub flip: Option<T>,
    /// Mean HDR-FLIP error over a range of exposures.
    pub hdr_flip: Option<T>,
    /// Share of pixels that are off by more than the value of the reference (squared relative error above 1).
    pub outliers: Option<T>,
}

/// A value with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best estimate.
    pub value: f64,
    /// Lower end of the interval; `None` if there are too few runs.
    pub low: Option<f64>,
    /// Upper end of the interval; `None` if there are too few runs.
    pub high: Option<f64>,
}

impl Estimate {
    /// Both ends of the interval in words; `None` without one. Ends that are a factor of 1000 apart tell not even a magnitude.
    pub fn interval(&self, number: fn(f64) -> String) -> Option<String> {
        let (low, high) = self.low.zip(self.high)?;
        Some(match self.is_vague() {
            true => "too few runs to tell".to_owned(),
            false => format!("{} to {}", number(low), number(high)),
        })
    }

    /// Whether the ends of the interval are a factor of 1000 apart.
    pub fn is_vague(&self) -> bool {
        self.low.zip(self.high).is_some_and(|(low, high)| low > 0.0 && high > 1000.0 * low)
    }
}

/// A factor relative to uniform unfiltered rendering.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Factor {
    /// The factor and its interval.
    pub estimate: Estimate,
    /// Whether uniform unfiltered rendering was not measured that far, so that its curve was continued by the law that error is
    /// inversely proportional to time.
    pub extrapolated: bool,
}

/// Summary of the runs of one point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Median GPU time in milliseconds, and an interval from order statistics: for fewer than six runs the range of them all, which is
    /// less than an interval of 95 %.
    pub gpu_ms: Estimate,
    /// Median wall time in milliseconds, in the same way.
    pub wall_ms: Estimate,
    /// Median time by pass.
    pub passes: Vec<Pass>,
    /// Mean of every error over the seeds, and its interval by Student's t. Both are of logarithms, so that they are of a typical run, but
    /// for PSNR, SSIM, and errors that are 0 in a run.
    pub errors: Errors<Estimate>,
    /// relMSE times GPU time in seconds, a mean as of errors: lower is better, and the same for any number of samples of an unbiased
    /// method.
    pub inefficiency: Option<Estimate>,
    /// GPU time that uniform unfiltered rendering needs for this point's relMSE, divided by this point's GPU time.
    pub speed_up: Option<Factor>,
    /// relMSE of uniform unfiltered rendering in this point's GPU time, divided by this point's relMSE.
    pub error_gain: Option<Factor>,
    /// What the point's options change; `None` for a point without options.
    #[serde(default)]
    pub change: Option<Change>,
}

/// Factors relative to the same point without its options, run by run of the same seed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Of GPU time.
    pub time: Option<Estimate>,
    /// Of relMSE.
    pub relmse: Option<Estimate>,
    /// Of relMSE times GPU time: an option that lowers it buys more accuracy than as much time for samples would, of a method whose
    /// error is inversely proportional to time.
    pub product: Option<Estimate>,
}

impl Method {
    /// The method without its samples per pixel, such as "both + auto".
    pub fn name(&self) -> String {
        let mut words = Vec::new();
        if !self.allocate.is_empty() {
            words.push(self.allocate.clone());
        }
        match self.reproject.as_deref() {
            Some("forward") => words.push("reprojection".to_owned()),
            Some(way) => words.push(format!("{way} reprojection")),
            None => {}
        }
        if self.filter != "none" || words.is_empty() {
            words.push(self.filter.clone());
        }
        let mut name = words.join(" + ");
        if let Some(rounds) = self.rounds {
            name += &format!(", {rounds} rounds");
        }
        for option in &self.options {
            name += &format!(", {}", option.trim_start_matches('-'));
        }
        name
    }

    /// The method with its samples per pixel, such as "both + auto, 8 spp".
    pub fn label(&self) -> String {
        match self.spp {
            0 => self.name(),
            spp => format!("{}, {spp} spp", self.name()),
        }
    }

    /// Whether it is the method that [`Summary::speed_up`] compares with.
    pub fn is_baseline(&self) -> bool {
        self.allocate == "uniform"
            && self.filter == "none"
            && self.rounds.is_none()
            && self.reproject.is_none()
            && self.options.is_empty()
    }
}

impl<T: Copy> Errors<T> {
    /// Names of the metrics, in the order of [`Errors::values`].
    pub const NAMES: [&'static str; 8] =
        ["MSE", "relMSE", "relMSE without 0.1 %", "PSNR", "SSIM", "FLIP", "HDR-FLIP", "outliers"];

    /// The metrics in the order of [`Errors::NAMES`].
    pub fn values(&self) -> [Option<T>; 8] {
        let Self { mse, relmse, relmse_trimmed, psnr, ssim, flip, hdr_flip, outliers } = *self;
        [mse, relmse, relmse_trimmed, psnr, ssim, flip, hdr_flip, outliers]
    }

    /// The inverse of [`Errors::values`].
    pub fn from_values([mse, relmse, relmse_trimmed, psnr, ssim, flip, hdr_flip, outliers]: [Option<T>; 8]) -> Self {
        Self { mse, relmse, relmse_trimmed, psnr, ssim, flip, hdr_flip, outliers }
    }
}
