//! Traces paths. Kernel: `glsl/trace/path.comp`, or those of [`wavefront`](super::wavefront). Twin: [`crate::twins::path`].
use super::wavefront::Wavefront;
use crate::error::Result;
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::layout::{Effects, PathConstants, PathPush};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::schedule::Batch;
use crate::shaders::path::{self, Bind};
use crate::shaders::shared;
use std::time::Duration;

/// The specialised kernels that trace paths.
pub enum Paths {
    /// A thread traces a path from end to end.
    Whole(Kernel<Bind<'static>>),
    /// Kernels for the parts of all paths in turn.
    Wavefront(Box<Wavefront>),
}

impl Paths {
    /// For at most `paths` paths at once, of at most `max_depth` edges; `stack` is the depth that traversal needs.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses a kernel, or the paths do not fit.
    pub fn new(gpu: &Gpu, effects: Effects, stack: u32, max_depth: u32, paths: u32) -> Result<Self> {
        if gpu.tuning().has_wavefront(stack, max_depth) {
            return Ok(Self::Wavefront(Box::new(Wavefront::new(gpu, effects, stack, paths)?)));
        }
        let tuning = gpu.tuning();
        let (thread, eye_path, traverse) = (tuning.thread(), tuning.eye_path(), tuning.traverse(stack));
        Ok(Self::Whole(Kernel::new(gpu, &path::Constants { effects, thread, eye_path, traverse, deal: gpu.deal() })?))
    }

    /// Time that the pipelines took to create.
    pub fn compile_time(&self) -> Duration {
        match self {
            Self::Whole(kernel) => kernel.compile_time(),
            Self::Wavefront(kernels) => kernels.compile_time(),
        }
    }
}

/// Whether a pass of this name traces paths: `path`, or a stage of a wavefront.
pub fn traces_paths(pass: &str) -> bool {
    matches!(pass, "path" | "path_generate" | "path_extend" | "path_shade")
}

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
pub fn record(k: &Paths, rec: &mut Recorder, s: &DeviceScene, f: &FilmBuffers, push: &PathPush) -> Result<()> {
    let kernel = match k {
        Paths::Whole(kernel) => kernel,
        Paths::Wavefront(kernels) => return kernels.record(rec, s, f, push),
    };
    let bind = Bind {
        scene: s.bind(),
        light: s.bind_lights(),
        frame: s.bind_frame(),
        ray_query: s.bind_world(),
        which_path: shared::which_path::Bind { paths: &f.paths },
        sample: shared::sample::Bind { samples: &f.samples, broken: &f.broken },
        counters: shared::counters::Bind { counters: &f.counters },
    };
    rec.dispatch_threads(kernel, bind, push, push.pixels * push.samples.max(1))
}
