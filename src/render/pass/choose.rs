//! Turns priorities into one sample or none for every pixel. Kernel: `glsl/allocate/choose.comp`. Twin:
//! [`crate::twins::apportion::choose`].
use super::counts::Counts;
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::ChoosePush;
use crate::render::schedule::Choice;
use crate::shaders::choose::Bind;

/// The kernel.
pub type Choose = Kernel<Bind<'static>>;

/// priority\[P\] -> count\[P\], each 0 or 1
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn record(k: &Choose, rec: &mut Recorder, c: &Counts, choice: &Choice, seed: u32) -> Result<()> {
    let Choice { pixels, round, threshold } = *choice;
    let push = ChoosePush { pixels, round, seed, threshold, ..Default::default() };
    rec.dispatch_threads(k, Bind { priority: &c.priority, count: &c.count }, &push, pixels)
}
