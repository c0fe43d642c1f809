//! Scenes from files and from memory: what they become, and what is said about mistakes.
#[path = "../support/command.rs"]
#[allow(dead_code)]
mod command;
mod files;
mod memory;
#[path = "../support/mod.rs"]
mod support;
mod toml;
