//! Lists the paths of one batch of a round: the sample-to-pixel buffer. Kernel: `glsl/batch.comp`. Twin:
//! [`crate::reference::apportion::batch`].
use super::{blocks, pair};
use crate::error::Result;
use crate::gpu::layout::{BatchPush, PixelStats, uvec2};
use crate::gpu::{Buffer, Kernel, Recorder};
use crate::shaders::batch::Bind;

/// The kernel.
pub type Batches = Kernel<Bind<'static>>;

/// Paths of a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathRange {
    /// Place of the first one in the round.
    pub first: u64,
    /// At least 1.
    pub paths: u32,
    /// Of the rounds that the list of paths is dealt to, this one, from 0.
    pub round: u32,
    /// Rounds that the list is dealt to, at least 1.
    pub rounds: u32,
}

/// offset\[P + 1\], stats\[P\] -> paths\[batch\]
pub fn record(
    k: &Batches,
    rec: &mut Recorder,
    offset: &Buffer<uvec2>,
    stats: &Buffer<PixelStats>,
    paths: &Buffer<uvec2>,
    range: &PathRange,
    first_sample: u32,
) -> Result<()> {
    let pixels = offset.len() as u32 - 1;
    let PathRange { first, paths: n, round, rounds } = *range;
    let push = BatchPush { pixels, paths: n, first_path: pair(first), round, rounds, first_sample };
    rec.dispatch(k, Bind { offset, stats, paths }, &push, blocks(pixels))
}
