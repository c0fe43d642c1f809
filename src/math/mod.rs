//! Mathematics that both the host and the kernels need in a render: twins of functions under `glsl/shared`, with the same order of
//! operations, in `f32` where nothing else is said. Nothing here depends on scenes.
#![allow(clippy::excessive_precision, clippy::approx_constant, reason = "constants as the GLSL writes them")]
pub mod fresnel;
pub mod hash;
pub mod microfacet;
pub mod octahedral;
pub mod portable;
pub mod rgb9e5;
pub mod srgb;
pub mod warp;
