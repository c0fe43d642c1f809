//! Compares whole renders on the device with each other, with known answers and with an independent renderer.
mod adaptive;
#[path = "../support/alike.rs"]
mod alike;
mod analytic;
mod ghosts;
#[path = "../support/glazed.rs"]
mod glazed;
#[allow(dead_code)]
#[path = "../support/gltf.rs"]
mod gltf_file;
mod key;
mod lens;
#[path = "../support/moving.rs"]
mod moving;
mod plan;
mod pose;
#[path = "../support/poses.rs"]
mod poses;
mod references;
mod reproject;
mod rides;
#[path = "../support/scattering.rs"]
#[allow(dead_code)]
mod scattering;
mod significance;
#[path = "../support/statistics.rs"]
mod statistics;
mod still;
mod stride;
#[path = "../support/mod.rs"]
mod support;
mod tuning;
#[path = "../support/twin.rs"]
mod twin;
mod wavefront;
mod whole;
