//! Scene files become flat arrays, ready to be copied to the device as they are. Nothing here talks to a GPU.
use crate::gpu::layout::{AliasEntry, BvhNode, Camera, Instance, Light, Material, Shading, Texture, Triangle};
use crate::settings::Settings;

/// Everything a render reads, in the form that kernels read it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// World-space camera; made for the film's aspect ratio.
    pub camera: Camera,
    /// The scene file's own settings; the command line overrides them.
    pub settings: Settings,
    /// All nodes of all levels; indices inside are global.
    pub nodes: Vec<BvhNode>,
    /// Node where traversal starts: the top level with instances, else the only one.
    pub root: u32,
    /// In leaf order.
    pub triangles: Vec<Triangle>,
    /// Same order as `triangles`; empty when no mesh has vertex normals or texture coordinates.
    pub shading: Vec<Shading>,
    /// In leaf order of the top level; empty when the scene has one level.
    pub instances: Vec<Instance>,
    /// At least one.
    pub materials: Vec<Material>,
    /// May be empty.
    pub textures: Vec<Texture>,
    /// RGBA8 texels of all textures, R in the low byte.
    pub texels: Vec<u32>,
    /// May be empty: then only emission that paths run into is seen (none).
    pub lights: Vec<Light>,
    /// Alias table over `lights`, in proportion to power; same length.
    pub light_table: Vec<AliasEntry>,
    /// The environment image, when the environment is not a constant.
    pub environment: Option<Environment>,
    /// World-space bounds of all geometry; zero when there is none.
    pub bounds: [[f32; 3]; 2],
    /// What calls for what, for `tallow explain`: names by index of object and material.
    pub names: Names,
    /// What was repaired on loading, a readable line each.
    pub warnings: Vec<String>,
}

/// Latitude-longitude image: row 0 is straight up (+y), column 0 starts at direction -z turning towards -x… see `light.rs`.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// Texels across (longitude).
    pub width: u32,
    /// Texels down (latitude).
    pub height: u32,
    /// Linear radiance in xyz; in w the probability that `table` returns this texel.
    pub texels: Vec<[f32; 4]>,
    /// Alias table over `texels`.
    pub table: Vec<AliasEntry>,
}

/// Names for reports.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// By object index.
    pub objects: Vec<String>,
    /// By material index.
    pub materials: Vec<String>,
}
