//! Tests of image files and metrics.
mod cost;
mod damage;
mod files;
#[path = "../support/flat.rs"]
mod flat;
mod limits;
mod metrics;
mod source;
