//! Tallow: a Vulkan-native path tracer.
pub mod cli;
pub mod error;
pub mod gpu;
pub mod image;
pub mod report;
pub mod scene;
pub mod settings;
