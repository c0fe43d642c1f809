//! Allocation policies, which decide how many samples each pixel gets. Each has a file of its own and an entry in
//! [`POLICIES`]. A policy writes one priority per pixel. From these, `render::pass::apportion` computes counts that sum
//! exactly to the budget, or `render::pass::choose` decides for each pixel between one sample and none.
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::layout::{Guide, PixelLight, PixelStats, PriorityPush};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

pub mod both;
pub mod geometry;
mod settings;
pub mod threshold;
pub mod uniform;
pub mod variance;

pub use settings::{Allocate, AllocateOverrides};

/// The compiled kernels of a policy, which record its passes.
pub trait PolicyPass: Send + Sync {
    /// Computes what does not change between rounds from guide\[P\], where P is the number of pixels. Runs once per camera.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    fn prepare(&self, _rec: &mut Recorder, _buffers: &Inputs, _push: &PriorityPush) -> Result<()> {
        Ok(())
    }

    /// Computes priority\[P\] from guide\[P\], stats\[P\] and light\[P\], where P is the number of pixels.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    fn record(&self, rec: &mut Recorder, buffers: &Inputs, push: &PriorityPush) -> Result<()>;
}

/// The buffers that a policy reads, and the priorities that it writes.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Primary hits; one unused element for policies that do not ask for them.
    pub guide: &'a Buffer<Guide>,
    /// Statistics of the samples so far.
    pub stats: &'a Buffer<PixelStats>,
    /// Direct and indirect light; one unused element for policies that do not ask for it.
    pub light: &'a Buffer<PixelLight>,
    /// Shares of the samples, from 0 to 4095, in any unit.
    pub priority: &'a Buffer<f32>,
}

/// The same inputs on the host, for the CPU twins of the kernels.
#[derive(Clone, Copy, Debug)]
pub struct HostInputs<'a> {
    /// Primary hit of every pixel.
    pub guide: &'a [Guide],
    /// Statistics of every pixel's samples.
    pub stats: &'a [PixelStats],
    /// Direct and indirect light of every pixel, for policies that ask for it.
    pub light: &'a [PixelLight],
    /// Priorities of the previous round.
    pub priority: &'a [f32],
    /// Push constants of the kernel.
    pub push: PriorityPush,
}

/// How priorities become samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placing {
    /// Every pixel gets the same number of samples; priorities are not used.
    Even,
    /// Priorities are shares of the budget and are computed once.
    Once,
    /// Priorities are shares of all samples, past and future, and are computed anew for every round.
    Learning,
    /// In every round, pixels whose priority reaches a threshold get a sample; after the last threshold, priorities are
    /// probabilities.
    Chosen,
}

/// An allocation policy, as an entry of [`POLICIES`].
pub struct Policy {
    /// Name on the command line, and basename of its Rust and GLSL files.
    pub name: &'static str,
    /// Description in one line for the help.
    pub about: &'static str,
    /// Whether it reads primary hits.
    pub guides: bool,
    /// Whether it reads direct and indirect light separately.
    pub split_light: bool,
    /// How its priorities become samples.
    pub placing: Placing,
    /// Compiles its kernels for a film of `pixels` pixels.
    pub make: fn(&Gpu, pixels: u32) -> Result<Box<dyn PolicyPass>>,
    /// CPU twin of its kernels: returns the priority of every pixel.
    pub reference: fn(&HostInputs) -> Vec<f32>,
}

/// All policies, in the order of the help.
pub const POLICIES: &[&Policy] = &[&uniform::ROW, &geometry::ROW, &variance::ROW, &both::ROW, &threshold::ROW];

impl Policy {
    /// Whether it reads the setting of this option. What no policy in particular reads is read by all.
    pub fn reads(&self, option: &str) -> bool {
        let readers: &[&Self] = match option {
            "min-spp" | "max-spp" | "rounds" => return self.placing != Placing::Even,
            "window" | "sigma-normal" | "sigma-position" => &[&geometry::ROW, &both::ROW],
            "luminance-floor" => &[&variance::ROW, &both::ROW, &threshold::ROW],
            "filtered" => &[&both::ROW],
            _ => return true,
        };
        readers.contains(&self)
    }
}

/// Finds a policy by its name.
pub fn policy(name: &str) -> Option<&'static Policy> {
    POLICIES.iter().copied().find(|row| row.name == name)
}

impl PartialEq for Policy {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Policy {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// A policy is written as its name.
impl Serialize for Policy {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

/// A policy is read by its name.
impl<'de> Deserialize<'de> for &'static Policy {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let names = || POLICIES.iter().map(|row| row.name).collect::<Vec<_>>().join(", ");
        policy(&name).ok_or_else(|| D::Error::custom(format!("no policy \"{name}\": choose one of {}", names())))
    }
}
