//! Pictures and files.
mod damage;
mod files;
#[path = "../support/flat.rs"]
mod flat;
mod limits;
mod metrics;
mod source;
