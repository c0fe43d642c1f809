//! Damaged, random and senseless input: errors, never a panic, a signal or a hang.
#![forbid(unsafe_code)]
mod safe_api;
mod scene;
