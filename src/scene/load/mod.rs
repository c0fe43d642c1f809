//! Files become meshes, pictures and materials. What reads another format stands here as a file of its own.
pub mod environment;
pub mod find;
pub mod library;
pub mod lines;
pub mod material;
pub mod metal;
pub mod mtl;
pub mod mtl_material;
pub mod obj;
pub mod obj_part;
pub mod texture;
pub mod triangulate;
