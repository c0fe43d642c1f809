//! Traces one path per thread. Kernel: `glsl/trace/path.comp`. Twin: [`crate::twins::path`].
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::PathPush;
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::schedule::Batch;
use crate::shaders::path::Bind;

/// The specialised kernel.
pub type Path = Kernel<Bind<'static>>;

/// scene -> samples\[batch\]
pub fn record(k: &Path, rec: &mut Recorder, s: &DeviceScene, f: &FilmBuffers, b: &Batch) -> Result<()> {
    let push = PathPush {
        first_pixel: b.first_pixel,
        pixels: b.pixels,
        first_sample: b.first_sample,
        samples: b.samples,
        ..Default::default()
    };
    rec.dispatch_threads(k, bind(s, f), &push, b.pixels * b.samples)
}

fn bind<'a>(s: &'a DeviceScene, f: &'a FilmBuffers) -> Bind<'a> {
    Bind {
        scene: s.bind(),
        frame: s.bind_frame(),
        samples: &f.samples,
        counters: &f.counters,
        paths: &f.paths,
        broken: &f.broken,
    }
}

/// scene, paths\[batch\] -> samples\[batch\]
pub fn record_listed(k: &Path, rec: &mut Recorder, s: &DeviceScene, f: &FilmBuffers, paths: u32) -> Result<()> {
    let push = PathPush { pixels: paths, ..PathPush::default() };
    rec.dispatch_threads(k, bind(s, f), &push, paths)
}
