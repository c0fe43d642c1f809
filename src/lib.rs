//! Tallow: a Vulkan-native path tracer.
pub mod cli;
pub mod error;
mod frame;
pub mod gpu;
pub mod image;
pub mod reference;
pub mod renderer;
pub mod report;
pub mod scene;
pub mod settings;
mod stage;

/// One module per kernel of `glsl/`: its SPIR-V, and a `Bind` struct with a field per binding.
pub mod shaders {
    #![allow(missing_docs)]
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}
