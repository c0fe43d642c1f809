//! Renders: settings, the schedule of their work, the buffers it runs over, and what is recorded for it.
pub mod buffers;
mod frame;
mod kernels;
pub mod pass;
mod push;
mod renderer;
pub mod schedule;
pub mod settings;
mod supersampling;
mod views;

pub use buffers::{DeviceScene, FilmBuffers, FilmTile};
pub use push::{path_push, priority_push};
pub use renderer::*;
pub use schedule::{Batch, Choice, PathRange, Plan, Progress, Share, Step};
pub use views::{Layer, OutputView};
