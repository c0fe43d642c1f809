//! Traces one path per thread. Kernel: `glsl/trace/path.comp`. Twin: [`crate::twins::path`].
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::{PathConstants, PathPush};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::schedule::Batch;
use crate::shaders::path::Bind;

/// The specialised kernel.
pub type Path = Kernel<Bind<'static>>;

/// The same number of samples for every pixel of a run.
pub fn push_of_batch(constants: &PathConstants, b: &Batch) -> PathPush {
    let (first_pixel, first_sample) = (b.first_pixel, b.first_sample);
    PathPush {
        constants: *constants,
        first_pixel,
        pixels: b.pixels,
        first_sample,
        samples: b.samples,
        ..Default::default()
    }
}

/// So many paths of a list.
pub fn push_of_list(constants: &PathConstants, paths: u32) -> PathPush {
    PathPush { constants: *constants, pixels: paths, ..PathPush::default() }
}

/// scene, and paths\[batch\] where they are listed -> samples\[batch\]
pub fn record(k: &Path, rec: &mut Recorder, s: &DeviceScene, f: &FilmBuffers, push: &PathPush) -> Result<()> {
    let bind = Bind {
        scene: s.bind(),
        frame: s.bind_frame(),
        ray_query: s.bind_world(),
        samples: &f.samples,
        counters: &f.counters,
        paths: &f.paths,
        broken: &f.broken,
    };
    rec.dispatch_threads(k, bind, push, push.pixels * push.samples.max(1))
}
