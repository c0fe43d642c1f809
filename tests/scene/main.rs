//! Tests scenes from files and from memory: their arrays, and the messages about mistakes.
#[path = "../support/command.rs"]
#[allow(dead_code)]
mod command;
mod files;
mod memory;
#[path = "../support/mod.rs"]
mod support;
mod toml;
