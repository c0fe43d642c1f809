//! One file per kernel: what it reads and writes, and how it is recorded. Stages never call stages; `frame.rs` lists them.
pub mod fold;
pub mod guide;
pub mod path;

/// Threads per workgroup of the one-dimensional kernels that leave it open (`local_size_x_id = 100`).
pub const WORKGROUP_ID: u32 = 100;

/// Tracing on lavapipe runs fastest at 32 (against 16 and 64).
pub const WORKGROUP_CPU: u32 = 32;

/// Two subgroups of the most common width.
pub const WORKGROUP_GPU: u32 = 64;

/// Workgroups of `size` threads that cover `threads`.
pub fn groups(threads: u32, size: u32) -> [u32; 3] {
    [threads.div_ceil(size), 1, 1]
}
