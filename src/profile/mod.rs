//! Profiles: where the time of a frame goes, what its passes do in that time, and how near that is to what the device can do.
//!
//! [`Workload::run`] runs frames, [`Profile::new`] judges them, and [`Comparison::new`] tells two profiles apart.
pub mod ceilings;
pub mod code;
mod compare;
mod frames;
mod measure;
mod record;
mod spread;
pub mod work;

pub use crate::machine::wake;
pub use ceilings::Ceilings;
pub use compare::{Change, Comparison, Row, Verdict};
pub use frames::{FrameRun, Frames, Workload};
pub use measure::{Measured, denoiser, measure};
pub use record::{Host, Limit, Overhead, PassProfile, Profile, SCHEMA, Subject, Timer};
pub use spread::{Spread, median};
pub use work::{Amount, Work};
