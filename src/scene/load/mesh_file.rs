//! Files of one mesh, by the endings of their names.
use super::library::Library;
use super::obj::{self, ObjFile};
use super::obj_part::Numbering;
use super::ply;
use crate::error::{Error, Result};
use crate::image::input;
use std::path::Path;

/// What a file holds, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Anything that is no other.
    Obj,
    /// Also compressed by gzip.
    Ply,
    /// A scene of its own, `.gltf` or `.glb`.
    Gltf,
}

impl Format {
    /// By the ending of a path.
    pub fn of(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
        match () {
            () if ends(&[".ply", ".ply.gz"]) => Self::Ply,
            () if ends(&[".gltf", ".glb"]) => Self::Gltf,
            () => Self::Obj,
        }
    }
}

/// Endings of scenes and models that other programs keep, and can export.
const OF_OTHERS: [&str; 18] = [
    "3ds", "abc", "blend", "c4d", "dae", "fbx", "ma", "max", "mb", "pbrt", "skp", "stl", "usd", "usda", "usdc", "usdz",
    "x3d", "xml",
];

/// What to do with a file of another program, by the ending of its name.
pub fn remedy(path: &Path) -> Option<String> {
    let ending = path.extension()?.to_str()?.to_lowercase();
    let is_known = OF_OTHERS.contains(&&*ending);
    is_known.then(|| format!("{ending} files are not read: export it to glTF (.glb) or OBJ in a program that opens it"))
}

/// Reads the parts of a PLY file or an OBJ file.
///
/// # Errors
/// Those of [`ply::load`] and [`obj::load`], and [`Error::Input`] for a file of another program.
pub fn load(path: &Path, numbering: Numbering, library: &mut Library) -> Result<ObjFile<'static>> {
    if let Some(remedy) = remedy(path) {
        input::open(path)?; // a missing file is that first of all
        return Err(Error::input(path, format!("is no model: {remedy}")));
    }
    match Format::of(path) {
        Format::Ply => ply::load(path, numbering, library),
        _ => obj::load(path, numbering, library),
    }
}
