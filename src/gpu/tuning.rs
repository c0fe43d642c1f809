//! How work is cut for a kind of device: every decision between processors and GPUs, with its reason.
use super::Gpu;
use super::info::DeviceKind;
use crate::shaders::shared;

/// What suits a kind of device. No choice changes a bit of any image.
#[derive(Debug)]
pub struct Tuning {
    /// Threads of a workgroup that traces rays. lavapipe is fastest at 32 (against 16 and 64); GPUs get two subgroups of the
    /// most common width.
    pub workgroup: u32,
    /// Runs of a list of paths that are begun at once, so that expensive pixels are spread over all of lavapipe's threads:
    /// placed samples of Cornell box, Sponza, bust and grass trace in 0.95 to 0.97 of the time. GPUs deal out small groups
    /// anyway.
    pub stripes: u32,
    /// Paths of a dispatch at most: enough to fill the device, few enough that it ends within a fraction of a second.
    pub paths_in_flight: u64,
    /// Pixels that a thread of a kernel over blocks walks over. Two cores are busy with few threads, and a long run spares
    /// barriers; a GPU hides the time that its memory takes behind other threads, of which it wants tens of thousands.
    pub thread_items: u32,
    /// Bytes of a strip of the guided filter's sums: on a processor its caches hold much of it, a GPU is filled by more.
    pub strip_bytes: u64,
    /// Whether a thread sums the windows of a whole line. Each segment of a line sums its first window anew, but a GPU needs the
    /// threads.
    pub whole_lines: bool,
    /// Lines of the guided filter's windows in a workgroup.
    pub lines: u32,
    /// Pixels along an edge of a filtered image at most: see `glsl/shared/loop_limit.glsl`.
    pub longest_edge: u64,
}

const CPU: Tuning = Tuning {
    workgroup: 32,
    stripes: 16,
    paths_in_flight: 1 << 20,
    thread_items: 64,
    strip_bytes: 32 << 20,
    whole_lines: true,
    lines: 8,
    longest_edge: 60_000,
};

const GPU: Tuning = Tuning {
    workgroup: 64,
    stripes: 1,
    paths_in_flight: 1 << 22,
    thread_items: 16,
    strip_bytes: 256 << 20,
    whole_lines: false,
    lines: 32,
    longest_edge: u64::MAX,
};

impl Tuning {
    /// Constants of kernels that number their threads by `shared/thread.glsl`.
    pub fn thread(&self) -> shared::thread::Constants {
        shared::thread::Constants { workgroup: self.workgroup, stripes: self.stripes }
    }
}

impl Gpu {
    /// How work is cut for this device.
    pub fn tuning(&self) -> &'static Tuning {
        if self.info().kind == DeviceKind::Cpu { &CPU } else { &GPU }
    }
}
