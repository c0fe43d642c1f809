//! What makes a pixel worth samples: one file per policy, one row in [`POLICIES`]. A policy writes a priority per pixel;
//! `stage::apportion` turns priorities into counts that sum to the budget exactly, `stage::choose` into one sample or none.
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

/// A policy, ready to be recorded.
pub trait Policy: Send + Sync {
    /// guide\[P\] -> what stays the same from round to round, if there is any; once per camera.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    fn prepare(&self, _rec: &mut Recorder, _buffers: &Inputs, _push: &PriorityPush) -> Result<()> {
        Ok(())
    }

    /// guide\[P\], stats\[P\] -> priority\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    fn record(&self, rec: &mut Recorder, buffers: &Inputs, push: &PriorityPush) -> Result<()>;
}

/// What a policy reads, and the priorities it writes.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Primary hits; of the policies that do not ask for them, one unused element.
    pub guide: &'a Buffer<Guide>,
    /// What the samples so far have said.
    pub stats: &'a Buffer<PixelStats>,
    /// Direct and indirect light; of the policies that do not ask for it, one unused element.
    pub light: &'a Buffer<PixelLight>,
    /// Shares of the samples, at least 0, in any unit up to 4095.
    pub priority: &'a Buffer<f32>,
}

/// The same on the host, for the twins.
#[derive(Clone, Copy, Debug)]
pub struct HostInputs<'a> {
    /// Of every pixel.
    pub guide: &'a [Guide],
    /// Of every pixel.
    pub stats: &'a [PixelStats],
    /// Of every pixel, for policies that ask for it.
    pub light: &'a [PixelLight],
    /// Those of the round before.
    pub priority: &'a [f32],
    /// What the kernel gets.
    pub push: PriorityPush,
}

/// What priorities mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placing {
    /// As many samples for every pixel: nothing is placed.
    Even,
    /// Shares of the budget, found once.
    Once,
    /// Shares of all samples, past and next, found anew for every round.
    Learning,
    /// Every round, pixels whose priority reaches a threshold get a sample; after the last threshold priorities are
    /// probabilities.
    Chosen,
}

/// One policy.
pub struct Row {
    /// Name on the command line and basename of its files.
    pub name: &'static str,
    /// One line for the help.
    pub about: &'static str,
    /// Whether it reads primary hits.
    pub guides: bool,
    /// Whether it reads direct and indirect light apart.
    pub split_light: bool,
    /// What becomes of its priorities.
    pub placing: Placing,
    /// Compiles it for a film of so many pixels.
    pub make: fn(&Gpu, pixels: u32) -> Result<Box<dyn Policy>>,
    /// The kernel's twin.
    pub reference: fn(&HostInputs) -> Vec<f32>,
}

/// Every policy, in the order of the help.
pub const POLICIES: &[&Row] = &[&uniform::ROW, &geometry::ROW, &variance::ROW, &both::ROW, &threshold::ROW];

/// The policy of this name.
pub fn policy(name: &str) -> Option<&'static Row> {
    POLICIES.iter().copied().find(|row| row.name == name)
}

impl PartialEq for Row {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Row {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Its name.
impl Serialize for Row {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

/// By its name.
impl<'de> Deserialize<'de> for &'static Row {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let names = || POLICIES.iter().map(|row| row.name).collect::<Vec<_>>().join(", ");
        policy(&name).ok_or_else(|| D::Error::custom(format!("no policy \"{name}\": choose one of {}", names())))
    }
}
