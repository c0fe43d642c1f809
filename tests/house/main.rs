//! Tests of the repository itself: which modules import which, and the scripts below `tools`.
mod imports;
mod tools;
