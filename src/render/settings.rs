//! Every choice a user makes about a render: default, unit and range in one place. The command line and the `[render]`
//! table of a scene file fill the same struct; [`Settings::validate`] is the only check.
pub mod entry;

pub use crate::allocate::Placing;
use crate::error::{Error, Result};
use entry::Entry;
use serde::{Deserialize, Serialize};

/// How a pixel's samples are spread over its surroundings. Widths are in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum PixelFilter {
    /// Uniform over the pixel.
    #[default]
    Box,
    /// Triangle of radius 1.
    Tent,
    /// Gaussian of standard deviation 0.5, cut at radius 2.
    Gaussian,
    /// The pixel's centre: samples differ in what happens beyond the first hit only.
    Point,
}

/// Where the random numbers come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Sampler {
    /// Owen-scrambled Sobol points.
    #[default]
    Sobol,
    /// Independent numbers (PCG), the control.
    Independent,
}

/// Where samples go. The `[allocate]` table of a scene file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Allocate {
    /// Name of a row of [`crate::allocate::POLICIES`].
    pub policy: String,
    /// Samples that every pixel gets before any is placed, if the budget allows; 0 to 16777216.
    pub min_spp: u32,
    /// Samples that no pixel exceeds; 0: no limit but [`Settings::MAX_SPP`]. Of the policy `threshold`: rounds until its
    /// threshold is 0 and chance decides; 0: `spp`.
    pub max_spp: u32,
    /// Rounds that the budget is spread over, up to 4096; policies that learn do so before each. 0: one, of policies that
    /// learn one for every two samples a pixel, and no more than four.
    pub rounds: u32,
    /// Edge of the square of pixels that geometry compares, 2 to 10.
    pub window: u32,
    /// Difference of unit normals at which they count as e^-1 alike, above 0.
    pub sigma_normal: f32,
    /// Distance of hits at which they count as e^-1 alike, in diagonals of the scene's bounds, above 0.
    pub sigma_position: f32,
    /// Luminance that is added before noise is compared with it, W/(m^2 sr): below it noise counts by itself. Negative:
    /// noise always counts by itself.
    pub luminance_floor: f32,
    /// Stop when the relative error of every pixel's mean is estimated below this; 0 is off. `spp` is then the limit of a
    /// pixel, if `max_spp` is not.
    pub noise_threshold: f32,
    /// Share of the variance that the filter to come removes where all neighbours are alike, 0 (no filter) to 1.
    pub filtered: f32,
}

impl Default for Allocate {
    fn default() -> Self {
        Self {
            policy: "uniform".into(),
            min_spp: 2,
            max_spp: 0,
            rounds: 0,
            window: 4,
            sigma_normal: 0.35,
            sigma_position: 0.003,
            luminance_floor: 0.05,
            noise_threshold: 0.0,
            filtered: 0.5,
        }
    }
}

impl Allocate {
    /// Names of all policies, for messages.
    fn names() -> String {
        let names: Vec<_> = crate::allocate::POLICIES.iter().map(|row| row.name).collect();
        names.join(", ")
    }

    /// What becomes of the policy's priorities.
    pub fn placing(&self) -> Placing {
        crate::allocate::policy(&self.policy).map_or(Placing::Once, |row| row.placing)
    }

    fn validate(&self) -> Result<()> {
        let Some(row) = crate::allocate::policy(&self.policy) else {
            return Err(Error::Usage(format!("no policy \"{}\": choose one of {}", self.policy, Self::names())));
        };
        if self.noise_threshold > 0.0 && row.placing != Placing::Learning {
            let name = row.name;
            return Err(Error::Usage(format!(
                "noise-threshold needs a policy that learns, variance or both: not {name}"
            )));
        }
        entry::check(&self.entries())?;
        match self.max_spp {
            max if max > 0 && self.min_spp > max => {
                Err(Error::Usage(format!("min-spp is {}: it must not exceed max-spp, {max}", self.min_spp)))
            }
            _ => Ok(()),
        }
    }

    /// All but the policy, whose default depends on other options.
    fn entries(&self) -> [Entry; 9] {
        let above_0 = |name, value: f32| Entry::within(name, value, "a number above 0", value > 0.0);
        [
            Entry::whole("min-spp", self.min_spp, [0, Settings::MAX_SPP]),
            Entry::whole("max-spp", self.max_spp, [0, Settings::MAX_SPP]),
            Entry::whole("rounds", self.rounds, [0, 4096]),
            Entry::whole("window", self.window, [2, 10]),
            above_0("sigma-normal", self.sigma_normal),
            above_0("sigma-position", self.sigma_position),
            Entry::within("luminance-floor", self.luminance_floor, "a number", !self.luminance_floor.is_nan()),
            Entry::within("noise-threshold", self.noise_threshold, "0 or more", self.noise_threshold >= 0.0),
            Entry::within("filtered", self.filtered, "0 to 1", (0.0..=1.0).contains(&self.filtered)),
        ]
    }
}

/// The settings of a render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Film width in pixels, 1 to 16384.
    pub width: u32,
    /// Film height in pixels, 1 to 16384.
    pub height: u32,
    /// Samples per pixel, 1 to 16777216; their mean, where they are placed.
    pub spp: u32,
    /// Index of every pixel's first sample in its sequence, at most 16777216: renders of disjoint ranges are independent.
    pub first_sample: u32,
    /// Path edges: 1 = emission only, 2 = direct light, 3 = one bounce of indirect light. 1 to 1024.
    pub max_depth: u32,
    /// Paths longer than this many edges survive with the probability of their throughput; 0 is off.
    pub roulette_depth: u32,
    /// Upper limit of the largest channel of all indirect light in a sample, W/(m^2 sr), finite; 0 is off. Biases the
    /// image.
    pub clamp_indirect: f32,
    /// Chooses the random sequence.
    pub seed: u32,
    /// Pixel filter.
    pub filter: PixelFilter,
    /// Random numbers.
    pub sampler: Sampler,
    /// Where samples go.
    pub allocate: Allocate,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            spp: 64,
            first_sample: 0,
            max_depth: 8,
            roulette_depth: 0,
            clamp_indirect: 0.0,
            seed: 0,
            filter: PixelFilter::Box,
            sampler: Sampler::Sobol,
            allocate: Allocate::default(),
        }
    }
}

impl Settings {
    /// The largest film edge in pixels.
    pub const MAX_EDGE: u32 = 16_384;
    /// The largest number of samples per pixel.
    pub const MAX_SPP: u32 = 1 << 24;
    /// The longest path in edges.
    pub const MAX_DEPTH: u32 = 1024;

    /// # Errors
    /// [`Error::Usage`] with the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        entry::check(&self.entries())?;
        self.allocate.validate()
    }

    /// Every setting but the policy.
    pub fn entries(&self) -> Vec<Entry> {
        let clamp = self.clamp_indirect;
        let own = [
            Entry::whole("width", self.width, [1, Self::MAX_EDGE]),
            Entry::whole("height", self.height, [1, Self::MAX_EDGE]),
            Entry::whole("spp", self.spp, [1, Self::MAX_SPP]),
            Entry::whole("first-sample", self.first_sample, [0, Self::MAX_SPP]),
            Entry::whole("max-depth", self.max_depth, [1, Self::MAX_DEPTH]),
            Entry::any("roulette-depth", self.roulette_depth),
            Entry::within("clamp-indirect", clamp, "a finite number of 0 or more", clamp.is_finite() && clamp >= 0.0),
            Entry::any("seed", self.seed),
            Entry::one_of("filter", &self.filter),
            Entry::one_of("sampler", &self.sampler),
        ];
        own.into_iter().chain(self.allocate.entries()).collect()
    }

    /// Pixels of the film.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
