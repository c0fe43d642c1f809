//! Tests whether two renders have the same expectation, given what their files say of their noise.
//!
//! A *region* is a pixel, a square block, an object or the whole image, and a *scale* is a set of regions that share no
//! pixel. Let a and b be the two estimates of a pixel, d = a - b, and let bars be means over the N pixels of a region. With
//! m2 the sum of squared deviations of n samples, the test of a region and a channel is
//!
//! ```text
//! t = (|d̄| - accepted) / s     compared with Student's t with ν degrees of freedom, where
//!
//! of a pixel:    s² = max(s_a² + s_b², p)     s_a² = m2_a / (n_a (n_a - 1)), s_b² likewise       (Welch)
//!                                             p = (m2_a + m2_b) / (n_a + n_b - 2) (1/n_a + 1/n_b)   (Student)
//!                ν = (s_a² + s_b²)² / (s_a⁴ / (n_a - 1) + s_b⁴ / (n_b - 1))
//! of a region:   s² = max(Σ (d - d̄)² / (N (N - 1)), Σ ρ p / N²)     ρ = |n_a - n_b| / (n_a + n_b)
//!                ν = 3 (Σ (d - d̄)²)² / Σ (d - d̄)⁴, from 1 to N - 1
//! ```
//!
//! **Correlated samples.** The samples of a pixel are an Owen-scrambled net: their mean is unbiased, but its variance is not
//! σ²/n. It is smaller where the integrand is smooth, and at most twice as large for one that is made against two dimensions
//! of the net (Owen 1997, "Monte Carlo variance of scrambled net quadrature"). In the Cornell box with 64 samples, the
//! squared errors of pixels are half of what m2 says, and their sum over the image is a tenth of it. So m2 is used as it is
//! for single pixels, where the test is then conservative, and regions are judged by how much d varies from pixel to pixel.
//! Pixels are scrambled independently of each other, so this is an unbiased estimate of the variance of d̄ however the samples
//! of one pixel are correlated, and however unlike its pixels are. It holds as well for two renders that share their seed.
//!
//! **Heavy tails.** Where few samples carry most of the light, a set that missed them has too low a mean and too low an m2 at
//! the same time. Between two sets of equally many samples this cancels: d is distributed symmetrically, and ratios like t
//! have lighter tails than the normal distribution then (Efron 1969, "Student's t-test under symmetry conditions"). Between
//! unequal sets it does not, and p and ρ are there for that: p takes the variance that both sets show together, and for a
//! region it counts by ρ, the part of the noise that nothing equal stands against. ν is Satterthwaite's, with the fourth
//! power of one deviation for 3 σ⁴: a few pixels that carry the noise make few degrees of freedom. Pixels with fewer than
//! [`MIN_SAMPLES`] samples are not judged by themselves.
//!
//! **Many tests.** The smallest p-value of the three channels counts three times (Bonferroni), since channels share their
//! paths. Within a scale, regions share no pixel and are independent, which is what the procedure of Benjamini and Hochberg
//! (1995) asks for; the level is divided by the number of scales, which do overlap. So among the regions that are reported,
//! the expected share of false ones is at most [`Options::false_alarms`], and that is also the probability that two renders
//! with the same expectation are called different. The procedure of Benjamini and Yekutieli holds under any dependence, but
//! multiplies p-values by 1 + 1/2 + ... + 1/m (13 for a quarter of a million pixels) and here guards against nothing.
//!
//! What no test can see is light that neither set of samples has met. Renders whose samples were placed by what earlier
//! samples showed have a slight bias of their own.
mod distribution;
mod estimate;
mod judge;
mod map;
mod region;

use crate::error::Checked;
pub use estimate::{Estimate, Noise};
pub use map::{Overlay, overlay};
pub use region::{Scale, Where};

use region::Partition;
use serde::Serialize;

/// Fewest samples in a pixel that is judged by itself.
pub const MIN_SAMPLES: f64 = 16.0;

/// Fewest pixels in a block or an object that is judged.
pub const MIN_PIXELS: usize = 16;

/// What the test should find, and how sure it should be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Options {
    /// Probability that renders with the same expectation are called different, above 0 and at most 0.3.
    pub false_alarms: f64,
    /// Differences that do not matter, relative to the mean of the region or, if that is darker, of the image: 0 or more. Below
    /// [`Options::ROUNDING`], the last bits of drivers may count.
    pub accept: f64,
    /// Relative difference, beyond the accepted one, that must be visible, or else the images are too noisy to be called the
    /// same: [`Options::LEAST`] or more.
    pub resolve: f64,
    /// The scale at which it must be visible.
    pub at: Scale,
}

impl Options {
    /// Relative difference that rounding makes: drivers differ in the last bits, and so do sums of many samples.
    pub const ROUNDING: f64 = 1e-5;

    /// The smallest difference that may be asked for.
    pub const LEAST: f64 = 1e-12;
}

impl Default for Options {
    fn default() -> Self {
        Self { false_alarms: 0.01, accept: Self::ROUNDING, resolve: 0.01, at: Scale::Image }
    }
}

/// What the test says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "verdict", rename_all = "snake_case")]
pub enum Verdict {
    /// No difference was found, and one of [`Options::resolve`] would have been.
    Same {
        /// Relative difference that would have been found nine times in ten, at the scale [`Options::at`], even if it were in the noisiest
        /// channel alone: less is enough for one of all channels.
        visible: f64,
    },
    /// At least one region differs.
    Different,
    /// No difference was found, but one of [`Options::resolve`] could have been missed.
    TooNoisy {
        /// As of [`Verdict::Same`].
        visible: f64,
        /// Times the samples of both images that would do, if errors fall like 1 / √n.
        samples: f64,
    },
}

/// A region that differs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Which region it is.
    pub place: Where,
    /// The channel with the smallest p-value: 0 to 2.
    pub channel: usize,
    /// Means of that channel over the region, of both images.
    pub means: [f64; 2],
    /// Difference of the means, relative to the second image's, or to the mean of that image where the region is darker.
    pub difference: f64,
    /// Standard error of `difference`.
    pub error: f64,
    /// Probability of such a difference by chance in this region; three channels are accounted for.
    pub p: f64,
}

/// What was found at one scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// The scale.
    pub scale: Scale,
    /// Regions that were judged.
    pub regions: usize,
    /// Regions that differ.
    pub different: usize,
    /// Relative difference that would have been found nine times in ten, in nine of ten regions, in any single channel.
    pub visible: f64,
    /// The regions that differ most surely, at most [`WORST`] of them, the smallest p-value first.
    pub worst: Vec<Finding>,
    /// For each pixel the relative difference of the region that it lies in, or 0 if that does not differ. Empty if no
    /// region differs.
    #[serde(skip)]
    pub map: Vec<f32>,
}

/// Most regions that are kept of one scale.
pub const WORST: usize = 16;

/// The result of a test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    /// In one word.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// From the finest scale to the coarsest. A scale at which nothing can be judged is left out.
    pub levels: Vec<Level>,
    /// Pixels with fewer than two samples in one of the images, which were left out.
    pub left_out: usize,
}

impl Outcome {
    /// What was found at a scale, if it was judged.
    pub fn level(&self, scale: Scale) -> Option<&Level> {
        self.levels.iter().find(|level| level.scale == scale)
    }
}

/// Tests whether two renders have the same expectation; see the [module](self) for how.
///
/// # Errors
/// When the sizes differ, an option is out of range, too few pixels have two samples, or [`Options::at`] is a scale at which
/// nothing can be judged, in one line that says what to do.
pub fn test(a: &Estimate, b: &Estimate, options: &Options) -> Checked<Outcome> {
    check(a, b, options)?;
    let judge = judge::Judge::new(a, b, options);
    let left_out = a.mean.len() - judge.usable();
    if judge.usable() < MIN_PIXELS {
        return Err(format!(
            "only {} of {} pixels have two samples or more in both images: a test needs {MIN_PIXELS}; take more samples \
             (--spp)",
            judge.usable(),
            a.mean.len()
        ));
    }
    let judged = judge.judge(Partition::all(a, b));
    let share = options.false_alarms / judged.len() as f64;
    let levels: Vec<Level> = judged.into_iter().map(|judged| judge.level(judged, share)).collect();
    let mut outcome = Outcome { verdict: Verdict::Different, levels, left_out };
    let names = outcome.levels.iter().map(|level| level.scale.to_string()).collect::<Vec<_>>().join(", ");
    let Some(asked) = outcome.level(options.at) else {
        return Err(format!("there is nothing to judge at the scale \"{}\": these images have {names}", options.at));
    };
    let visible = asked.visible;
    // What is accepted is no noise, and no number of samples makes it visible.
    let noise = visible - options.accept;
    if outcome.levels.iter().all(|level| level.different == 0) {
        outcome.verdict = match noise <= options.resolve {
            true => Verdict::Same { visible },
            false => Verdict::TooNoisy { visible, samples: (noise / options.resolve).powi(2) },
        };
    }
    Ok(outcome)
}

/// The pixels that differ most surely by themselves, at most [`WORST`] of them: in the finest regions that differ, or in the
/// whole image if none does.
///
/// # Panics
/// When the sizes differ.
pub fn suspects(a: &Estimate, b: &Estimate, outcome: &Outcome) -> Vec<Finding> {
    assert_eq!((a.width, a.height), (b.width, b.height), "images of one size");
    judge::Judge::new(a, b, &Options::default()).suspects(outcome)
}

fn check(a: &Estimate, b: &Estimate, options: &Options) -> Checked {
    if (a.width, a.height) != (b.width, b.height) {
        return Err(format!(
            "images of {}x{} and {}x{}: compare images of one size",
            a.width, a.height, b.width, b.height
        ));
    }
    for (name, image) in [("A", a), ("B", b)] {
        image.check().map_err(|what| format!("image {name}: {what}"))?;
    }
    if !(options.false_alarms > 0.0 && options.false_alarms <= 0.3) {
        return Err(format!("false alarms of {}: choose a rate above 0, up to 0.3", options.false_alarms));
    }
    let are_finite = options.resolve.is_finite() && options.accept.is_finite();
    match are_finite && options.resolve >= Options::LEAST && options.accept >= 0.0 {
        true => Ok(()),
        false => {
            let least = Options::LEAST;
            Err(format!("the difference to resolve must be at least {least:e}, the accepted one 0, both finite"))
        }
    }
}
