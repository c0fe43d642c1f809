//! The settings of sample allocation. Those that only one policy reads are declared in its own file.
use super::both::{BothOverrides, BothSettings};
use super::geometry::{GeometryOverrides, GeometrySettings};
use super::variance::{VarianceOverrides, VarianceSettings};
use super::{Placing, Policy, uniform};
use crate::error::{Error, Result};
use crate::settings::entry::Value;
use crate::settings::{FINITE_FROM_0, settings};
use serde::{Deserialize, Serialize};

impl Value for &'static Policy {
    fn text(&self) -> String {
        self.name.to_owned()
    }
}

settings! {
    /// The `[allocate]` table of a scene file, which says how samples are distributed over the pixels.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(from = "AllocateOverrides")]
    pub struct Allocate {
        /// The settings of the `[allocate]` table that are given; the others are `None`.
        AllocateOverrides {
            /// Policy [default: uniform; variance with --noise-threshold]
            policy: &'static Policy = &uniform::ROW, .., [long = "allocate", value_name = "POLICY"];
            /// Samples that every pixel gets before any is placed.
            min_spp: u32 = 2, 0..=Self::MAX_SPP;
            /// Samples that no pixel exceeds; 0 is off. Of threshold: the rounds until chance decides; 0 is --spp.
            max_spp: u32 = 0, 0..=Self::MAX_SPP;
            /// Rounds that the budget is spread over; 0: one, of policies that learn one for every 2 samples a pixel, up to 4.
            rounds: u32 = 0, 0..=4096;
            /// Stop when every pixel's relative error is estimated below this, or at --max-spp (else --spp); for variance and both; 0 is off.
            noise_threshold: f32 = 0.0, FINITE_FROM_0;
            ..geometry: GeometrySettings, GeometryOverrides, [serde(flatten)];
            ..variance: VarianceSettings, VarianceOverrides, [serde(flatten)];
            ..both: BothSettings, BothOverrides, [serde(flatten)];
        }
    }
}

impl Allocate {
    /// The largest number of samples per pixel.
    pub const MAX_SPP: u32 = 1 << 24;

    /// Whether every pixel gets the same number of samples.
    pub fn is_even(&self) -> bool {
        self.policy.placing == Placing::Even
    }

    /// Whether pixels want samples until their errors are below a threshold.
    pub(crate) fn has_threshold(&self) -> bool {
        self.noise_threshold > 0.0
    }

    /// Whether only the device knows how many paths of a list there are to trace: where pixels are chosen, and where a noise
    /// threshold may ask for less than its round has room for.
    pub(crate) fn list_may_be_short(&self) -> bool {
        self.policy.placing == Placing::Chosen || self.has_threshold()
    }

    /// Checks the constraints that involve more than one setting.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the settings that contradict each other.
    pub fn check_together(&self) -> Result<()> {
        let Self { policy, min_spp, max_spp, .. } = self;
        if self.has_threshold() && policy.placing != Placing::Learning {
            let name = policy.name;
            return Err(Error::Usage(format!(
                "noise-threshold needs a policy that learns, variance or both: not {name}"
            )));
        }
        if *max_spp > 0 && min_spp > max_spp && !self.is_even() {
            return Err(Error::Usage(format!("min-spp is {min_spp}: it must not exceed max-spp, {max_spp}")));
        }
        Ok(())
    }
}

impl From<AllocateOverrides> for Allocate {
    fn from(given: AllocateOverrides) -> Self {
        let mut settings = Self::default();
        given.apply(&mut settings);
        settings
    }
}
