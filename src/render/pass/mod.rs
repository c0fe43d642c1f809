//! One file per kernel: what it reads and writes, and how it is recorded. Stages never call stages; `frame.rs` lists them.
pub(crate) mod accumulate;
pub mod apportion;
pub mod choose;
pub mod counts;
pub mod light_change;
pub(crate) mod path;
pub(crate) mod primary_hit;
pub mod reproject;
pub mod sample_list;
pub mod scan;
pub(crate) mod wavefront;

/// A 64-bit number as buffers and push constants hold it, low word first.
fn pair(n: u64) -> [u32; 2] {
    [n as u32, (n >> 32) as u32]
}
