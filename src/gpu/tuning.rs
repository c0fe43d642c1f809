//! Sizes into which work is divided, for CPUs and for GPUs. Every such choice is made here, with its reason.
use super::info::DeviceKind;
use crate::error::{Error, Result};
use crate::shaders::shared;

/// The sizes that suit a kind of device. No choice changes a bit of any image, but for [`Self::whole_lines`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tuning {
    /// Threads in a workgroup that traces rays. lavapipe is fastest with 32 (against 16 and 64); GPUs get two subgroups of
    /// the most common width.
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
    /// these together, while lavapipe is fastest where each thread has a run; not tried on a GPU.
    pub interleaves: bool,
    /// Bytes in a strip of the guided filter's sums. On a CPU most of it fits into the caches; a GPU needs more to be busy.
    pub strip_bytes: u64,
    /// Whether a thread sums the windows of a whole line of the guided filter. Shorter segments each sum their first window
    /// anew, but a GPU needs the additional threads. Floats are then added in another order: pictures of `guided`, and of
    /// `auto`, which uses it, differ by some 1e-6 of their values.
    pub whole_lines: bool,
    /// Lines of the guided filter's windows per workgroup.
    pub lines: u32,
    /// Whether lanes test the triangles of each other's rays, see `glsl/shared/deal.glsl`. Not tried on a GPU. On a CPU they do so
    /// only where its driver has an instruction by which they read each other's values: with AVX2 and eight lanes.
    pub deals: bool,
    /// Whether traversal uses instructions that find and count bits, and makes floats of bytes without converting them, which
    /// many GPUs do slowly. lavapipe takes as long. Not tried on a GPU.
    pub native_bits: bool,
    /// Most triangles that a ray tests before it visits its next node; 0 for all. Rays of a subgroup wait for the one with the
    /// most triangles. Where triangles are dealt, only rays from the eye have such a limit, in scenes without masks and spheres.
    /// With 2 paths in the Cornell box take lavapipe a quarter longer. Not tried on a GPU; in a simulation of one, incoherent
    /// rays gained most from 2.
    pub triangles_a_step: u32,
    /// Whether kernels that trace rays read storage buffers in place of texel buffers, which some GPUs read through the slower
    /// path of textures. An array of a scene can then have at most the bytes of one storage binding. Devices whose kernels can
    /// bind too few of them, and those that trace by ray queries, keep texel buffers. lavapipe takes twice as long. Not tried
    /// on a GPU.
    pub storage_buffers: bool,
    /// Threads in a workgroup of a filter that looks at pixels around its own, all in one row. In larger ones neighbours share
    /// more of what they read, which a GPU may gain from; not tried on one.
    pub filter_workgroup: u32,
    /// Longest edge of a filtered image in pixels; see `glsl/shared/loop_limit.glsl`.
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
        whole_lines: true,
        lines: 8,
        deals: true,
        native_bits: false,
        triangles_a_step: 0,
        storage_buffers: false,
        filter_workgroup: 32,
        longest_edge: 60_000,
    };

    /// For GPUs, and whatever else is no CPU.
    pub const GPU: Self = Self {
        workgroup: 64,
        stripes: 1,
        paths_in_flight: 1 << 22,
        thread_items: 16,
        interleaves: false,
        strip_bytes: 256 << 20,
        whole_lines: false,
        lines: 32,
        deals: false,
        native_bits: false,
        triangles_a_step: 0,
        storage_buffers: false,
        filter_workgroup: 32,
        longest_edge: u64::MAX,
    };

    /// # Errors
    /// [`Error::Usage`] naming a size that cannot be.
    pub(super) fn check(self) -> Result<Self> {
        let sizes = [
            ("workgroup", self.workgroup.into()),
            ("stripes", self.stripes.into()),
            ("paths_in_flight", self.paths_in_flight),
            ("thread_items", self.thread_items.into()),
            ("strip_bytes", self.strip_bytes),
            ("lines", self.lines.into()),
            ("filter_workgroup", self.filter_workgroup.into()),
            ("longest_edge", self.longest_edge),
        ];
        match sizes.iter().find(|(_, size)| *size == 0) {
            Some((name, _)) => Err(Error::Usage(format!("tuning: {name} is 0: choose at least 1"))),
            None => Ok(self),
        }
    }

    /// What suits a kind of device.
    pub(super) fn of(kind: DeviceKind) -> Self {
        if kind == DeviceKind::Cpu { Self::CPU } else { Self::GPU }
    }

    /// Constants of kernels that number their threads with `glsl/shared/thread.glsl`.
    pub fn thread(&self) -> shared::thread::Constants {
        shared::thread::Constants { workgroup: self.workgroup, stripes: self.stripes }
    }

    /// Constants of filters that number their threads with `glsl/shared/filter_thread.glsl`.
    pub fn filter_thread(&self) -> shared::filter_thread::Constants {
        shared::filter_thread::Constants { workgroup: self.filter_workgroup }
    }

    /// Constants of kernels that trace rays; `stack` is the depth that the scene's traversal needs.
    pub fn traverse(&self, stack: u32) -> shared::traverse::Constants {
        let Self { native_bits, triangles_a_step, .. } = *self;
        shared::traverse::Constants { stack, native_bits, triangles_a_step }
    }
}
