//! Filtered light of guide rays as further eye rays see it. Kernel: `glsl/trace/guide_lookup.comp`. Twin:
//! [`crate::twins::guide_lookup`].
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::PathPush;
pub use crate::shaders::guide_lookup::Bind;

/// The specialised kernel.
pub type Lookup = Kernel<Bind<'static>>;

/// Adds the light of `push.samples` eye rays to the push's pixels: scene, guide\[P\], filtered\[P\] -> indirect\[P\]
pub fn record(k: &Lookup, rec: &mut Recorder, bind: Bind, push: &PathPush) -> Result<()> {
    rec.dispatch_threads(k, bind, push, push.pixels)
}
