//! SPIR-V, the code of kernels as drivers take it: read, computed with, specialised and numbered afresh.
pub mod compact;
mod evaluate;
mod flow;
mod instruction;
pub mod op;
mod specialise;

pub use evaluate::evaluate;
pub use instruction::{Instruction, instructions};
pub use specialise::specialise;
