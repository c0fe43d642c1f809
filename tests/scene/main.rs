//! Tests scenes from files and from memory: their arrays, and the messages about mistakes.
mod animation;
mod baked;
#[path = "../support/command.rs"]
mod command;
mod files;
mod gltf;
mod gltf_allowed;
mod gltf_bad;
mod gltf_deformed;
#[path = "../support/gltf.rs"]
mod gltf_file;
mod gltf_materials;
mod gltf_motion;
mod memory;
mod models;
mod pose;
#[path = "../support/poses.rs"]
mod poses;
#[path = "../support/mod.rs"]
mod support;
mod toml;
