//! Builds the flat arrays that kernels read from a description; [`assemble`] calls the steps in order.
pub mod alias;
pub mod assemble;
pub mod attributes;
pub mod bake;
pub mod bvh;
pub mod coat;
pub mod encode;
pub mod environment;
pub mod fresnel;
pub mod geometry;
pub mod hierarchy;
pub mod light_tree;
pub mod lights;
pub mod plan;
pub mod soft;
pub mod sources;
pub mod store;
