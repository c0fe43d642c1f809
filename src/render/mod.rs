//! Renders: settings, the schedule of their work, the buffers it runs over, what is recorded for it, the loop that runs it,
//! and its life in files.
pub mod buffers;
mod carriage;
mod carried;
pub mod film;
mod frame;
mod history;
mod job;
mod kernels;
mod merge;
mod moving;
mod pace;
#[doc(hidden)] // Renderer::record runs the passes; tests and benches run them one by one
pub mod pass;
pub(crate) mod provenance;
mod push;
mod rendered;
mod renderer;
mod resume;
#[doc(hidden)] // what an engine needs of it is named below; tests and benches cut work in ways of their own
pub mod schedule;
pub use crate::scene::description::settings;
mod supersampling;
mod update;
mod upload;
mod views;
mod world;

pub use buffers::{DeviceScene, FilmBuffers, FilmTile};
pub use carriage::{Carriage, Carried, carried_samples};
pub use history::{History, Moves, Reproject, ReprojectOverrides, Reprojection};
pub use job::{Job, Status, StopReason};
pub use merge::{Gap, Merged, merge};
pub use moving::can_carry;
pub use pass::path::traces_paths;
pub use provenance::{HISTORY, of_frame as metadata_of_frame};
#[doc(hidden)] // a renderer tells its kernels; tests tell the same to their CPU twins
pub use push::{frame_constants, priority_push};
pub use renderer::*;
pub use resume::{Checkpoint, finished, is_frame};
pub use schedule::{Batch, Choice, PathRange, Plan, Progress, Share, Step};
pub use views::{Layer, OutputView};
pub use world::World;
