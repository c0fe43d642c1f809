//! Tests of the repository itself: which modules import which, what kernels may not ask for, and the scripts below `tools`.
mod imports;
mod kernels;
mod tools;
