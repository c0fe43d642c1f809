//! Tests the renderer on a device that an engine made, with one engine at a time in the process.
mod device;
mod entry_points;
#[cfg(feature = "cli")] // compares with the program
mod frames;
#[path = "../support/hooks.rs"]
mod hooks;
mod job;
mod memory;
mod moving;
#[path = "../support/poses.rs"]
mod poses;
#[path = "../support/mod.rs"]
mod support;
