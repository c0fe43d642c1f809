//! Plain CPU twins of the kernels and of the functions under `glsl/shared`, in `f32`, mostly with the same names and order of operations.
//! Tests compare the kernels with them, and run statistics on them that a GPU would only slow down. No render uses them: code
//! that a render runs on the CPU is in [`crate::math`] and [`crate::scene`], and twins call it there.
#![allow(clippy::excessive_precision, clippy::approx_constant, reason = "constants as the GLSL writes them")]
pub mod accumulate;
pub mod apportion;
pub mod bsdf;
pub mod camera;
pub mod coat;
pub mod gather;
pub mod guide_lookup;
pub mod light;
pub mod light_change;
pub mod light_tree;
pub mod metallic;
pub mod path;
pub mod primary_hit;
pub mod reproject;
pub mod sampler;
pub mod scene;
pub mod sphere;
pub mod surface;
pub mod texture;
pub mod traverse;
