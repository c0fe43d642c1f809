//! Tests on the CPU twins that random choices follow the densities that the code claims.
mod bsdf;
mod gloss;
mod light;
mod metallic;
mod sampler;
#[path = "../support/scattering.rs"]
mod scattering;
#[path = "../support/statistics.rs"]
mod statistics;
#[path = "../support/twin.rs"]
mod twin;
