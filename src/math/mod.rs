//! Plain mathematics that the host needs in a render and that kernels have as well, function by function: each file is the
//! CPU twin of a file under `glsl/shared`, with the same names and the same order of operations, in `f32`. Nothing here
//! knows of scenes.
#![allow(clippy::excessive_precision, clippy::approx_constant, reason = "constants as the GLSL writes them")]
pub mod fresnel;
pub mod hash;
pub mod microfacet;
pub mod octahedral;
pub mod portable;
pub mod srgb;
pub mod warp;
