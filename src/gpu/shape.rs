//! What passes were recorded with, for those who count their work, and the callback that is told of finished passes.
use super::{Access, PassTime, Slot};
use std::sync::Arc;

/// A range of a buffer that a pass accesses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundRange {
    /// Name of the binding in the GLSL source; `source` or `target` of a copy, a fill, an update or a build.
    pub name: &'static str,
    /// How the pass accesses it.
    pub access: Access,
    /// Its size in bytes: the first element of a uniform block, all that is bound of other buffers.
    pub bytes: u64,
}

/// The code of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KernelCode {
    /// As the build script compiled it.
    pub spirv: &'static [u8],
    /// The specialisation constants, as (constant id, value).
    pub constants: Arc<[(u32, u32)]>,
}

/// The shape of a pass: what is known of its work when it is recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassShape {
    /// Workgroups along x, y and z; all 0 for a copy, a fill, an update or a build.
    pub groups: [u32; 3],
    /// Threads of all workgroups.
    pub threads: u64,
    /// What it accesses.
    pub ranges: Vec<BoundRange>,
    /// The kernel; none for a copy, a fill, an update or a build.
    pub code: Option<KernelCode>,
}

impl PassShape {
    /// Of a dispatch of workgroups of `local_size` threads; `bytes` are those of the slots.
    pub(super) fn of_kernel(
        groups: [u32; 3],
        local_size: [u32; 2],
        slots: &[Slot],
        bytes: impl Iterator<Item = u64>,
        code: KernelCode,
    ) -> Self {
        let range = |(slot, bytes): (&Slot, u64)| BoundRange { name: slot.name, access: slot.access, bytes };
        let threads = groups.iter().chain(&local_size).map(|&n| u64::from(n)).product();
        Self { groups, threads, ranges: slots.iter().zip(bytes).map(range).collect(), code: Some(code) }
    }

    /// Of a copy, a fill, an update, or a build of acceleration structures.
    pub(super) fn of_transfer(accesses: &[Access], bytes: u64) -> Self {
        let is_source = |access| matches!(access, Access::CopySource | Access::BuildRead);
        let name = |access| if is_source(access) { "source" } else { "target" };
        let range = |&access: &Access| BoundRange { name: name(access), access, bytes };
        Self { groups: [0; 3], threads: 0, ranges: accesses.iter().map(range).collect(), code: None }
    }
}

/// A pass that is complete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// Its name, and when it ran.
    pub time: PassTime,
    /// What it was recorded with.
    pub shape: PassShape,
}

/// Is told of the passes of every submission once they are complete, in order: see
/// [`FrameResources::observe`](super::FrameResources::observe).
pub type PassObserver = Box<dyn FnMut(&[Pass]) + Send + Sync>;
