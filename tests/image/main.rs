//! Tests of image files, metrics, cost measurements, and the pages that show them.
mod cost;
mod damage;
mod files;
#[path = "../support/flat.rs"]
mod flat;
mod limits;
#[path = "../support/measurement.rs"]
mod measurement;
mod metrics;
mod report;
mod scattered;
mod significance;
mod source;
