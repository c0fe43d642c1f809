//! The measurements of `tools/filters`, with one file per table.
pub mod breakdown;
mod case;
pub mod energy;
mod frames;
pub mod lookup;
pub mod neural;
pub mod ranking;
mod sheet;
mod sweep;
pub mod textures;
pub mod times;
