//! The renderer on a device that an engine made, one engine at a time in the process.
mod device;
mod entry_points;
mod frames;
#[path = "../support/hooks.rs"]
mod hooks;
#[path = "../support/mod.rs"]
mod support;
