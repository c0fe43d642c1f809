//! What is drawn at random, on the CPU twins: it follows the densities that are claimed for it.
mod bsdf;
mod light;
mod sampler;
#[path = "../support/scattering.rs"]
mod scattering;
#[path = "../support/statistics.rs"]
mod statistics;
#[path = "../support/twin.rs"]
mod twin;
