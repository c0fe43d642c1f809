//! Buffer accesses of passes: the table that maps them to Vulkan's stage and access masks, and the barriers that follow.
use super::Untyped;
use ash::vk;
use std::collections::HashMap;
use std::sync::Arc;

/// How one pass accesses one buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Storage buffer marked `readonly`.
    Read,
    /// Storage buffer marked `writeonly`.
    Write,
    /// Storage buffer with neither mark.
    ReadWrite,
    /// Uniform texel buffer, which kernels can only read.
    TexelRead,
    /// Uniform buffer, which kernels can only read.
    UniformRead,
    /// Source of a copy.
    CopySource,
    /// Target of a copy, a fill or an update.
    CopyTarget,
    /// What acceleration structures are built of.
    BuildRead,
    /// Acceleration structures, and the scratch memory of builds.
    BuildWrite,
    /// Acceleration structures that rays are traced through.
    Trace,
}

/// Those of every device.
const COMMON: [Access; 7] = [
    Access::Read,
    Access::Write,
    Access::ReadWrite,
    Access::TexelRead,
    Access::UniformRead,
    Access::CopySource,
    Access::CopyTarget,
];

/// Those of devices that trace by ray queries. Others know no such stages.
const OF_RAY_QUERIES: [Access; 3] = [Access::BuildRead, Access::BuildWrite, Access::Trace];

/// Returns (stage, reads, writes) of an access. No other code maps accesses to masks.
fn masks(access: Access) -> (vk::PipelineStageFlags2, vk::AccessFlags2, vk::AccessFlags2) {
    use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
    match access {
        Access::Read => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ, A::NONE),
        Access::Write => (S::COMPUTE_SHADER, A::NONE, A::SHADER_STORAGE_WRITE),
        Access::ReadWrite => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ, A::SHADER_STORAGE_WRITE),
        Access::TexelRead => (S::COMPUTE_SHADER, A::SHADER_SAMPLED_READ, A::NONE),
        Access::UniformRead => (S::COMPUTE_SHADER, A::UNIFORM_READ, A::NONE),
        Access::CopySource => (S::ALL_TRANSFER, A::TRANSFER_READ, A::NONE),
        Access::CopyTarget => (S::ALL_TRANSFER, A::NONE, A::TRANSFER_WRITE),
        Access::BuildRead => {
            (S::ACCELERATION_STRUCTURE_BUILD_KHR, A::SHADER_READ | A::ACCELERATION_STRUCTURE_READ_KHR, A::NONE)
        }
        Access::BuildWrite => (
            S::ACCELERATION_STRUCTURE_BUILD_KHR,
            A::ACCELERATION_STRUCTURE_READ_KHR,
            A::ACCELERATION_STRUCTURE_WRITE_KHR,
        ),
        Access::Trace => (S::COMPUTE_SHADER, A::ACCELERATION_STRUCTURE_READ_KHR, A::NONE),
    }
}

impl Access {
    fn reads(self) -> bool {
        !masks(self).1.is_empty()
    }

    fn writes(self) -> bool {
        !masks(self).2.is_empty()
    }
}

/// A barrier between all accesses that passes can make. Because it covers every kind of access, a later pass of another
/// kind needs no second barrier for the same earlier work.
fn between_passes(ray_queries: bool) -> vk::MemoryBarrier2<'static> {
    let (mut stages, mut reads, mut writes) =
        (vk::PipelineStageFlags2::NONE, vk::AccessFlags2::NONE, vk::AccessFlags2::NONE);
    let more = if ray_queries { &OF_RAY_QUERIES[..] } else { &[] };
    for (stage, read, write) in COMMON.iter().chain(more).copied().map(masks) {
        (stages, reads, writes) = (stages | stage, reads | read, writes | write);
    }
    vk::MemoryBarrier2::default()
        .src_stage_mask(stages)
        .src_access_mask(writes)
        .dst_stage_mask(stages)
        .dst_access_mask(reads | writes)
}

/// Makes everything written before visible to everything that reads later, the host included. A recording begins and
/// ends with it.
///
/// # Safety
/// `commands` is recording on `device`.
pub(super) unsafe fn whole_barrier(device: &ash::Device, commands: vk::CommandBuffer) {
    use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
    let barrier = vk::MemoryBarrier2::default()
        .src_stage_mask(S::ALL_COMMANDS)
        .src_access_mask(A::MEMORY_WRITE)
        .dst_stage_mask(S::ALL_COMMANDS | S::HOST)
        .dst_access_mask(A::MEMORY_READ | A::MEMORY_WRITE | A::HOST_READ);
    unsafe { emit(device, commands, barrier) };
}

/// # Safety
/// `commands` is recording on `device`, which was opened for `ray_queries` if that is set.
pub(super) unsafe fn pass_barrier(device: &ash::Device, commands: vk::CommandBuffer, ray_queries: bool) {
    unsafe { emit(device, commands, between_passes(ray_queries)) };
}

unsafe fn emit(device: &ash::Device, commands: vk::CommandBuffer, barrier: vk::MemoryBarrier2<'_>) {
    let barriers = [barrier];
    let info = vk::DependencyInfo::default().memory_barriers(&barriers);
    // SAFETY: the callers guarantee that `commands` is recording on `device`.
    unsafe { device.cmd_pipeline_barrier2(commands, &info) };
}

/// How each buffer was accessed since the last barrier.
#[derive(Default)]
pub(super) struct Hazards {
    touched: HashMap<vk::Buffer, Touch>,
    /// Keeps every buffer of the recording until the work is complete.
    kept: HashMap<vk::Buffer, Arc<Untyped>>,
}

#[derive(Clone, Copy, Default)]
struct Touch {
    read: bool,
    written: bool,
}

impl Hazards {
    /// Records the accesses of a pass and returns whether a barrier must precede it.
    pub fn note(&mut self, accesses: &[(&Arc<Untyped>, Access)]) -> bool {
        for (buffer, _) in accesses {
            self.kept.entry(buffer.raw).or_insert_with(|| (*buffer).clone());
        }
        self.note_raw(accesses.iter().map(|(buffer, access)| (buffer.raw, *access)))
    }

    fn note_raw(&mut self, accesses: impl Iterator<Item = (vk::Buffer, Access)> + Clone) -> bool {
        let conflict = accesses.clone().any(|(buffer, access)| {
            let before = self.touched.get(&buffer).copied().unwrap_or_default();
            before.written || (before.read && access.writes())
        });
        if conflict {
            self.touched.clear();
        }
        for (buffer, access) in accesses {
            let touch = self.touched.entry(buffer).or_default();
            touch.read |= access.reads();
            touch.written |= access.writes();
        }
        conflict
    }

    /// Those that the recording uses.
    pub fn buffers(&self) -> impl Iterator<Item = &Untyped> {
        self.kept.values().map(|buffer| &**buffer)
    }

    /// Forgets all accesses and releases the buffers. The work that used them must be complete.
    pub fn clear(&mut self) {
        self.touched.clear();
        self.kept.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ash::vk::Handle;

    /// Returns for each pass whether it needs a barrier before it.
    fn barriers(passes: &[&[(u64, Access)]]) -> Vec<bool> {
        let mut hazards = Hazards::default();
        let raw = |pass: &[(u64, Access)]| pass.iter().map(|(b, a)| (vk::Buffer::from_raw(*b), *a)).collect::<Vec<_>>();
        passes.iter().map(|pass| hazards.note_raw(raw(pass).into_iter())).collect()
    }

    #[test]
    fn every_dependence_gets_one_barrier() {
        use Access::*;
        assert_eq!(barriers(&[&[(1, Write)], &[(1, Read)]]), [false, true], "read after write");
        assert_eq!(barriers(&[&[(1, Write)], &[(1, CopySource)]]), [false, true], "copy after write");
        assert_eq!(barriers(&[&[(1, CopyTarget)], &[(1, TexelRead)]]), [false, true], "texels after copy");
        assert_eq!(barriers(&[&[(1, Write)], &[(1, Write)]]), [false, true], "write after write");
        assert_eq!(barriers(&[&[(1, TexelRead)], &[(1, Write)]]), [false, true], "write after read");
        assert_eq!(barriers(&[&[(1, ReadWrite)], &[(1, ReadWrite)]]), [false, true], "update after update");
        assert_eq!(barriers(&[&[(1, CopyTarget)], &[(1, BuildRead)]]), [false, true], "build after copy");
        assert_eq!(barriers(&[&[(1, BuildWrite)], &[(1, BuildWrite)]]), [false, true], "copies after meshes");
        assert_eq!(barriers(&[&[(1, BuildWrite)], &[(1, Trace)], &[(1, BuildWrite)]]), [false, true, true], "rays");
    }

    #[test]
    fn independent_passes_get_none() {
        use Access::*;
        assert_eq!(barriers(&[&[(1, Read)], &[(1, TexelRead)], &[(1, CopySource)]]), [false; 3], "reads");
        assert_eq!(barriers(&[&[(1, Write)], &[(2, Write)]]), [false; 2], "two buffers");
        // The barrier before the second pass covers the first buffer as well.
        let passes: [&[(u64, Access)]; 3] = [&[(1, Write), (2, Write)], &[(1, Read), (3, Write)], &[(2, Read)]];
        assert_eq!(barriers(&passes), [false, true, false], "one barrier serves all");
    }
}
