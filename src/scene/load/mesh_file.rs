//! Files of one mesh, by the endings of their names.
use super::library::Library;
use super::obj::{self, ObjFile};
use super::obj_part::Numbering;
use super::ply;
use crate::error::Result;
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

/// Reads the parts of a PLY file or an OBJ file.
///
/// # Errors
/// Those of [`ply::load`] and [`obj::load`].
pub fn load(path: &Path, numbering: Numbering, library: &mut Library) -> Result<ObjFile<'static>> {
    match Format::of(path) {
        Format::Ply => ply::load(path, numbering, library),
        _ => obj::load(path, numbering, library),
    }
}
