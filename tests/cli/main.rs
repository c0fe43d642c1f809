//! Tests of the built program: exit codes, printed text and files.
mod adaptive;
#[cfg(target_os = "linux")]
#[path = "../support/child.rs"]
mod child;
mod codes;
#[path = "../support/command.rs"]
mod command;
mod cost;
mod device;
mod effects;
mod filter;
#[path = "../support/flat.rs"]
mod flat;
mod oidn;
mod outputs;
mod plan;
mod profile;
mod resume_merge;
mod sequence;
mod signals;
mod statistical;
mod stride;
