//! Tests that damaged, random and senseless input gives errors, and never a panic, a signal or a hang.
#![forbid(unsafe_code)]
mod gltf;
#[path = "../support/gltf.rs"]
mod gltf_file;
mod safe_api;
mod scene;
