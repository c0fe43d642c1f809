//! Traces paths stage by stage: all leave the camera, then in turn the rays of all that wait are traced, and what they met is shaded
//! (Laine, Karras, Aila 2013). Threads that trace take other paths where theirs have ended, and none of them waits for shading.
//! Kernels: `glsl/trace/path_generate.comp`, `path_extend.comp` and `path_shade.comp`, whose paths have the bits of `path.comp`'s.
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{Effects, PathPush, uvec4};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::shaders::path_extend::PATHS_A_THREAD;
use crate::shaders::shared::path_memory::KINDS;
use crate::shaders::{path_extend, path_generate, path_shade, shared};
use crate::threads::both;
use std::time::Duration;

/// Bytes that a path takes while it waits.
pub const BYTES_PER_PATH: u64 = KINDS as u64 * size_of::<uvec4>() as u64;
/// Those that tracing a ray reads of it: origin, direction, state, seed, and the surface that the ray leaves.
pub const BYTES_OF_RAY: u64 = 40;
/// Those that a closest hit takes: triangle, instance, coordinates, distance.
pub const BYTES_OF_HIT: u64 = 20;

/// The kernels, and the paths that wait between them.
pub struct Wavefront {
    generate: Kernel<path_generate::Bind<'static>>,
    extend: Kernel<path_extend::Bind<'static>>,
    shade: Kernel<path_shade::Bind<'static>>,
    memory: Buffer<uvec4>,
    queue: Buffer<u32>,
}

impl Wavefront {
    /// With room for `paths` paths; `stack` is the depth that traversal needs.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses a kernel, or the paths do not fit.
    pub fn new(gpu: &Gpu, effects: Effects, stack: u32, paths: u32) -> Result<Self> {
        let tuning = gpu.tuning();
        let (thread, eye_path, traverse) = (tuning.thread(), tuning.eye_path(), tuning.traverse(stack));
        let generate = || Kernel::new(gpu, &path_generate::Constants { effects, thread, eye_path });
        let extend = || Kernel::new(gpu, &path_extend::Constants { effects, thread, traverse });
        let shade = || Kernel::new(gpu, &path_shade::Constants { effects, thread });
        let (shade, (extend, generate)) = both(shade, || both(extend, generate))?;
        let paths = paths as usize;
        Ok(Self {
            generate,
            extend,
            shade,
            memory: Buffer::new(gpu, "waiting paths", paths * KINDS as usize, Location::Device)?,
            queue: Buffer::new(gpu, "queue of paths", 2 + 2 * paths, Location::Device)?,
        })
    }

    /// Time that the pipelines took to create.
    pub fn compile_time(&self) -> Duration {
        self.generate.compile_time() + self.extend.compile_time() + self.shade.compile_time()
    }

    /// scene, and paths\[batch\] where they are listed -> samples\[batch\]
    pub fn record(&self, rec: &mut Recorder, s: &DeviceScene, f: &FilmBuffers, push: &PathPush) -> Result<()> {
        let paths = push.pixels * push.samples.max(1);
        let which_path = || shared::which_path::Bind { paths: &f.paths };
        let path_memory = || shared::path_memory::Bind { memory: &self.memory };
        let path_queue = || shared::path_queue::Bind { queue: &self.queue };
        let counters = || shared::counters::Bind { counters: &f.counters };
        let bind = path_generate::Bind { frame: s.bind_frame(), which_path: which_path(), path_memory: path_memory() };
        rec.dispatch_threads(&self.generate, bind, push, paths)?; // batch -> memory
        for stage in 0..push.constants.max_depth {
            let push = PathPush { stage, ..*push };
            let bind = path_extend::Bind {
                scene: s.bind(),
                ray_query: s.bind_world(),
                which_path: which_path(),
                path_memory: path_memory(),
                path_queue: path_queue(),
                counters: counters(),
            };
            // Rays from the eye are alike: where each has its thread, neighbours end together.
            let threads = if stage == 0 { paths } else { paths.div_ceil(PATHS_A_THREAD) };
            rec.dispatch_threads(&self.extend, bind, &push, threads)?; // memory, queue -> memory
            let bind = path_shade::Bind {
                scene: s.bind(),
                light: s.bind_lights(),
                which_path: which_path(),
                path_memory: path_memory(),
                path_queue: path_queue(),
                sample: shared::sample::Bind { samples: &f.samples, broken: &f.broken },
                counters: counters(),
            };
            rec.dispatch_threads(&self.shade, bind, &push, paths)?; // memory -> memory, queue, samples
        }
        Ok(())
    }
}
