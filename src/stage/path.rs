//! Traces one path per thread. Kernel: `glsl/path.comp`. Twin: [`crate::reference::path`].
use super::PerThread;
use crate::error::Result;
use crate::frame::{Batch, DeviceScene, FilmBuffers};
use crate::gpu::Recorder;
use crate::gpu::layout::PathPush;
use crate::shaders::path::Bind;

/// The specialised kernel.
pub type Path = PerThread<Bind<'static>>;

/// scene -> samples\[batch\]
pub fn record(
    k: &Path,
    rec: &mut Recorder,
    s: &DeviceScene,
    f: &FilmBuffers,
    push: &PathPush,
    b: &Batch,
) -> Result<()> {
    let push = PathPush {
        first_pixel: b.first_pixel,
        pixels: b.pixels,
        first_sample: b.first_sample,
        samples: b.samples,
        ..*push
    };
    let bind = Bind { scene: s.bind(), samples: &f.samples, counters: &f.counters };
    k.record(rec, bind, &push, b.pixels * b.samples)
}
