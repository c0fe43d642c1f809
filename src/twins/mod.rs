//! Plain CPU twins of the kernels and of the functions under `glsl/shared`: same names, same order of operations, `f32`.
//! Tests compare the kernels with them, and run the statistics that a GPU would only slow down. Nothing here is used in
//! a render, but for [`coat::coat_table`].
#![allow(clippy::excessive_precision, clippy::approx_constant, reason = "constants as the GLSL writes them")]
pub mod accumulate;
pub mod apportion;
pub mod bsdf;
pub mod camera;
pub mod coat;
pub mod exact;
pub mod fresnel;
pub mod guide_lookup;
pub mod light;
pub mod microfacet;
pub mod path;
pub mod primary_hit;
pub mod sampler;
pub mod scene;
pub mod sphere;
pub mod surface;
pub mod texture;
pub mod traverse;
pub mod warp;
