//! Compares kernels and filters on the device with their CPU twins, and the twins with exact answers.
mod allocate;
mod bsdf;
mod ceilings;
mod dealt;
mod denoiser;
mod edges;
mod filters;
mod gloss;
mod guided;
mod kernels;
mod lookup;
mod materials;
#[path = "../support/moving.rs"]
mod moving;
mod panes;
mod path;
#[path = "../support/picture.rs"]
mod picture;
#[path = "../support/poses.rs"]
mod poses;
mod relief;
mod reproject;
mod shown;
mod sky;
mod sphere;
mod stability;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/twin.rs"]
mod twin;
