//! Turns priorities into one sample or none for every pixel. Kernel: `glsl/choose.comp`. Twin:
//! [`crate::reference::apportion::choose`].
use super::apportion::Counts;
use crate::error::Result;
use crate::gpu::layout::ChoosePush;
use crate::gpu::{Buffer, Kernel, Recorder};
use crate::schedule::Choice;
use crate::shaders::choose::Bind;

/// The kernel.
pub type Choose = Kernel<Bind<'static>>;

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
    rec.dispatch_threads(k, Bind { priority, count: &c.count }, &push, pixels)
}
