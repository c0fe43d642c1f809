//! From a description to the flat arrays that kernels read: [`assemble`] goes through the steps.
pub mod alias;
pub mod assemble;
pub mod bvh;
pub mod coat;
pub mod environment;
pub mod fresnel;
pub mod geometry;
pub mod hierarchy;
pub mod lights;
pub mod plan;
pub mod sources;
pub mod store;
