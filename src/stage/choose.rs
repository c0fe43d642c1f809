//! Turns priorities into one sample or none for every pixel. Kernel: `glsl/choose.comp`. Twin:
//! [`crate::reference::apportion::choose`].
use super::PerThread;
use super::apportion::Counts;
use crate::error::Result;
use crate::gpu::layout::ChoosePush;
use crate::gpu::{Buffer, Recorder};
use crate::schedule::Choice;
use crate::shaders::choose::Bind;

/// The kernel.
pub type Choose = PerThread<Bind<'static>>;

/// priority\[P\] -> count\[P\], each 0 or 1
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn record(
    k: &Choose,
    rec: &mut Recorder,
    priority: &Buffer<f32>,
    c: &Counts,
    choice: &Choice,
    seed: u32,
) -> Result<()> {
    let Choice { pixels, round, threshold } = *choice;
    let push = ChoosePush { pixels, round, seed, threshold };
    k.record(rec, Bind { priority, count: &c.count }, &push, pixels)
}
