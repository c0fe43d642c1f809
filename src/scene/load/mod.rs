//! Reads files to meshes, pictures and materials, one module for each format.
pub mod blocks;
pub mod environment;
pub mod find;
pub mod gltf;
pub mod include;
pub mod library;
pub mod mapping;
pub mod material;
pub mod mesh_file;
pub mod metal;
pub mod metallic;
pub mod mtl;
pub mod mtl_material;
pub mod obj;
pub mod obj_block;
pub mod obj_part;
pub mod ply;
pub mod texture;
pub mod triangulate;

/// The first of some names, and how many more there are.
fn few<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> String {
    const SHOWN: usize = 8;
    let names: Vec<S> = names.into_iter().collect();
    let shown = names.iter().take(SHOWN).map(AsRef::as_ref).collect::<Vec<&str>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
