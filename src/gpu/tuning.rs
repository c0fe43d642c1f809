//! Sizes into which work is divided, for CPUs and for GPUs. Every such choice is made here, with its reason.
use super::info::DeviceKind;
use crate::error::{Error, Result};
use crate::shaders::shared;

/// Depth of a stack that stays in registers.
const IN_REGISTERS: u32 = 2;

/// Edges of a path that a wavefront has stages for. Each is two dispatches for all paths, however few have got so far.
const MOST_STAGES: u32 = 32;

/// The sizes that suit a kind of device. On lavapipe no choice changes a bit of any image, but for [`Self::windows`] and
/// too long a [`Self::longest_edge`]. NVIDIA's driver fuses products and sums of one kernel otherwise than those of
/// another, so that some pictures differ by rounding there. Drivers that run on a CPU may end long loops early
/// (`glsl/shared/loop_limit.glsl`): a device of theirs takes no more than [`Self::CPU`] has of [`Self::paths_in_flight`]
/// and [`Self::thread_items`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tuning {
    /// Threads in a workgroup that traces rays. lavapipe is fastest with 32 (against 16 and 64). With 128 in place of 64 an H200 takes
    /// .97 (bust, Veach's plates) to 1.00 of the time, with 256 up to 1.05.
    pub workgroup: u32,
    /// Number of stripes into which a list of paths is divided and that are traced in parallel, which spreads expensive
    /// pixels over all of lavapipe's threads. Adaptive samples of Cornell box, Sponza, bust and grass take 0.95 to 0.97 of
    /// the time. GPUs schedule small groups anyway.
    pub stripes: u32,
    /// Largest number of paths in a dispatch: enough to fill the device, few enough to end within a fraction of a second.
    pub paths_in_flight: u64,
    /// Pixels per thread of a [`PerBlock`](super::PerBlock) kernel. A few threads keep a CPU busy, and long runs need fewer
    /// barriers; a GPU needs tens of thousands of threads to hide the latency of its memory.
    pub thread_items: u32,
    /// Whether neighbouring threads of such a kernel take neighbouring pixels in turn, where their order does not matter. A GPU reads
    /// these together: on an H200 these passes take .73 of the time. lavapipe is fastest where each thread has a run.
    pub interleaves: bool,
    /// Bytes in a strip of the guided filter's sums. On a CPU most of it fits into the caches; a GPU needs more to be busy.
    pub strip_bytes: u64,
    /// Windows of the guided filter that a thread takes, 0 for those of a whole line, which share most of their sums. A GPU needs
    /// more threads, with fewer registers: on an H200 `guided` takes 4.4 of the time with 0, .64, .52 and .46 with 2 to 4, which
    /// share sums too, of that with 1. In any case the widest windows are taken in segments of at most their length. Floats are
    /// then added in another order: pictures of `guided`, and of `auto`, which uses it, differ by some 1e-6 of their values.
    pub windows: u32,
    /// Lines of the guided filter's windows per workgroup.
    pub lines: u32,
    /// Whether lanes test the triangles of each other's rays, see `glsl/shared/deal.glsl`. They do so only on drivers that run on a
    /// CPU, which keep lanes together, and where those read each other's values by one instruction: with AVX2 and eight lanes.
    pub deals: bool,
    /// Whether traversal uses instructions that find and count bits. lavapipe takes as long, an H200 .99 of the time.
    pub native_bits: bool,
    /// Most triangles that a ray tests before it visits its next node; 0 for all. Rays of a subgroup wait for the one with the
    /// most triangles. Where triangles are dealt, only rays from the eye have such a limit, in scenes without masks and spheres.
    /// Scenes of a few nodes have none. With 2 paths take an H200 .85 (bare Sponza) to .92 (pine grove) of the time of 0.
    pub triangles_a_step: u32,
    /// Whether paths are traced by a wavefront, see `render::pass::wavefront`, in scenes of more than a few nodes and where they have
    /// at most 32 edges. Tracing alone needs half of the registers of whole paths; a path takes 176 bytes. An H200 takes .89 (bare
    /// Sponza) to .45 (pine grove) of the time; lavapipe takes 1.6 to 3.8 of it. Not with ray queries, by which no GPU was
    /// measured. By a wavefront, nothing tells of rays that a driver on a CPU has ended early.
    pub wavefront: bool,
    /// Threads in a workgroup of a filter that looks at pixels around its own, all in one row. In larger ones neighbours share
    /// more of what they read. With 128 in place of 32 an H200 takes .85 (`wavelet`), .97 (`svgf`) and .99 to 1.00 of the time.
    pub filter_workgroup: u32,
    /// Bytes of a film's largest buffer, if the device allows as many. A film that takes more is kept in several, and can neither have
    /// its samples placed, nor be filtered or reprojected. At least those of 64 pixels.
    pub film_buffer_bytes: u64,
    /// Longest edge of a filtered image in pixels. Threads of some filters walk along a whole one, which drivers that run
    /// on a CPU may end early behind as many as [`Self::CPU`] has.
    pub longest_edge: u64,
}

impl Tuning {
    /// For drivers that run on a CPU.
    pub const CPU: Self = Self {
        workgroup: 32,
        stripes: 16,
        paths_in_flight: 1 << 20,
        thread_items: 64,
        interleaves: false,
        strip_bytes: 32 << 20,
        windows: 0,
        lines: 8,
        deals: true,
        native_bits: false,
        triangles_a_step: 0,
        wavefront: false,
        filter_workgroup: 32,
        film_buffer_bytes: u64::MAX,
        longest_edge: 60_000,
    };

    /// For GPUs, and whatever else is no CPU.
    pub const GPU: Self = Self {
        workgroup: 128,
        stripes: 1,
        paths_in_flight: 1 << 22,
        thread_items: 16,
        interleaves: true,
        strip_bytes: 256 << 20,
        windows: 4,
        lines: 32,
        deals: false,
        native_bits: true,
        triangles_a_step: 2,
        wavefront: true,
        filter_workgroup: 128,
        film_buffer_bytes: u64::MAX,
        longest_edge: u64::MAX,
    };

    /// These sizes as a device of this kind takes them: see [`Tuning`].
    ///
    /// # Errors
    /// [`Error::Usage`] naming a size that cannot be.
    pub(super) fn on(self, kind: DeviceKind) -> Result<Self> {
        let sizes = [
            ("workgroup", self.workgroup.into()),
            ("stripes", self.stripes.into()),
            ("paths_in_flight", self.paths_in_flight),
            ("thread_items", self.thread_items.into()),
            ("strip_bytes", self.strip_bytes),
            ("lines", self.lines.into()),
            ("filter_workgroup", self.filter_workgroup.into()),
            ("film_buffer_bytes", self.film_buffer_bytes),
            ("longest_edge", self.longest_edge),
        ];
        match sizes.iter().find(|(_, size)| *size == 0) {
            Some((name, _)) => Err(Error::Usage(format!("tuning: {name} is 0: choose at least 1"))),
            None if kind == DeviceKind::Cpu => Ok(Self {
                paths_in_flight: self.paths_in_flight.min(Self::CPU.paths_in_flight),
                thread_items: self.thread_items.min(Self::CPU.thread_items),
                ..self
            }),
            None => Ok(self),
        }
    }

    /// What suits a device, which traces by ray queries or not.
    pub(super) fn of(kind: DeviceKind, by_ray_query: bool) -> Self {
        let wavefront = Self::GPU.wavefront && !by_ray_query;
        if kind == DeviceKind::Cpu { Self::CPU } else { Self { wavefront, ..Self::GPU } }
    }

    /// Whether paths of at most `max_depth` edges are traced by a wavefront; `stack` is the depth that the scene's traversal needs.
    pub fn has_wavefront(&self, stack: u32, max_depth: u32) -> bool {
        self.wavefront && stack > IN_REGISTERS && max_depth <= MOST_STAGES
    }

    /// Constants of kernels that number their threads with `glsl/shared/thread.glsl`.
    pub fn thread(&self) -> shared::thread::Constants {
        shared::thread::Constants { workgroup: self.workgroup }
    }

    /// Constants of kernels whose threads start paths.
    pub fn eye_path(&self) -> shared::eye_path::Constants {
        shared::eye_path::Constants { stripes: self.stripes }
    }

    /// Constants of kernels that trace rays; `stack` is the depth that the scene's traversal needs. It is rounded up, so that most scenes
    /// of the same effects share what the driver has compiled.
    pub fn traverse(&self, stack: u32) -> shared::traverse::Constants {
        let Self { native_bits, triangles_a_step, .. } = *self;
        let stack = if stack <= IN_REGISTERS { IN_REGISTERS } else { stack.next_multiple_of(8) };
        shared::traverse::Constants { stack, native_bits, triangles_a_step }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpus_trace_whole_paths_by_ray_queries() {
        assert_eq!(Tuning::of(DeviceKind::IntegratedGpu, false), Tuning::GPU);
        assert_eq!(Tuning::of(DeviceKind::IntegratedGpu, true), Tuning { wavefront: false, ..Tuning::GPU });
        assert_eq!([false, true].map(|by_ray_query| Tuning::of(DeviceKind::Cpu, by_ray_query)), [Tuning::CPU; 2]);
    }

    #[test]
    fn stacks_are_of_few_sizes() {
        let sizes = [1, 2, 3, 8, 9, 32].map(|stack| Tuning::CPU.traverse(stack).stack);
        assert_eq!(sizes, [2, 2, 8, 8, 16, 32]);
    }
}
