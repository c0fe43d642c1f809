//! Tests of the built program: exit codes, printed text and files.
mod adaptive;
mod black;
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

/// Primaries that are not those of Rec. 709: of Rec. 2020.
const REC2020: [[f32; 2]; 4] = [[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]];
