//! Lists the paths of one batch of a round: the sample-to-pixel buffer. Kernel: `glsl/apportion/sample_list.comp`. Twin:
//! [`crate::twins::apportion::batch`].
use super::pair;
use crate::error::Result;
use crate::gpu::{PerBlock, Recorder};
use crate::layout::BatchPush;
use crate::render::schedule::PathRange;
pub use crate::shaders::sample_list::Bind;

/// The kernel.
pub type Batches = PerBlock<Bind<'static>>;

/// offset\[P + 1\], stats\[P\], carried\[P\] -> paths\[batch\]. Where nothing is carried, `bind.carried` is one element.
pub fn record(k: &Batches, rec: &mut Recorder, bind: Bind, range: &PathRange, first_sample: u32) -> Result<()> {
    let pixels = bind.offset.len() as u32 - 1;
    let PathRange { first, paths: n, round, rounds } = *range;
    let push = BatchPush {
        pixels,
        paths: n,
        first_path: pair(first),
        round,
        rounds,
        first_sample,
        carries: u32::from(bind.carried.len() == pixels as usize),
        ..Default::default()
    };
    k.record(rec, bind, &push, pixels)
}
