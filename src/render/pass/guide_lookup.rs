//! Filtered light of guide rays as further eye rays see it. Kernel: `glsl/trace/guide_lookup.comp`. Twin:
//! [`crate::twins::guide_lookup`].
use crate::error::Result;
use crate::gpu::{Buffer, Kernel, Recorder};
use crate::layout::{Guide, PathPush, vec3, vec4};
use crate::render::buffers::DeviceScene;
use crate::shaders::guide_lookup::Bind;

/// The specialised kernel.
pub type Lookup = Kernel<Bind<'static>>;

/// Adds the light of `push.samples` eye rays to the push's pixels: scene, guide\[P\], filtered\[P\] -> indirect\[P\]
pub fn record(
    k: &Lookup,
    rec: &mut Recorder,
    s: &DeviceScene,
    guides: &Buffer<Guide>,
    filtered: &Buffer<vec4>,
    indirect: &Buffer<vec3>,
    push: &PathPush,
) -> Result<()> {
    rec.dispatch_threads(
        k,
        Bind { scene: s.bind(), frame: s.bind_frame(), guides, filtered, indirect },
        push,
        push.pixels,
    )
}
