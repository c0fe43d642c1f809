//! Reads files to meshes, pictures and materials, one module for each format.
pub mod environment;
pub mod find;
pub mod gltf;
pub mod library;
pub mod lines;
pub mod mapping;
pub mod material;
pub mod metal;
pub mod metallic;
pub mod mtl;
pub mod mtl_material;
pub mod obj;
pub mod obj_part;
pub mod texture;
pub mod triangulate;
