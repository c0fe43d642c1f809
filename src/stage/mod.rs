//! One file per kernel: what it reads and writes, and how it is recorded. Stages never call stages; `frame.rs` lists them.
pub mod fold;
pub mod guide;
pub mod path;

/// Specialisation constants of the kernels that leave their workgroup open: `local_size_x_id`, and the same for
/// `thread_index()`.
pub fn workgroup_constants(size: u32) -> [(u32, u32); 2] {
    [(100, size), (101, size)]
}

/// Tracing on lavapipe runs fastest at 32 (against 16 and 64).
pub const WORKGROUP_CPU: u32 = 32;

/// Two subgroups of the most common width.
pub const WORKGROUP_GPU: u32 = 64;

/// Workgroups along one axis that every Vulkan device can run.
const ROW: u32 = 65_535;

/// Workgroups of `size` threads that cover `threads`, folded into rows; `thread_index()` unfolds them.
pub fn groups(threads: u32, size: u32) -> [u32; 3] {
    let groups = threads.div_ceil(size);
    [groups.min(ROW), groups.div_ceil(ROW), 1]
}

#[cfg(test)]
mod tests {
    #[test]
    fn large_dispatches_fold_into_rows() {
        assert_eq!(super::groups(65, 64), [2, 1, 1]);
        assert_eq!(super::groups(65_535 * 32, 32), [65_535, 1, 1]);
        assert_eq!(super::groups(65_535 * 32 + 1, 32), [65_535, 2, 1]);
    }
}
