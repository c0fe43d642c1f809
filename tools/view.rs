//! A scene as the measuring tools render it.
use crate::scenes;
use std::path::{Path, PathBuf};

/// A scene, small, so that a software device needs minutes.
pub struct View {
    /// For files and tables.
    pub name: &'static str,
    /// A name known to the converter, or a scene file of the repository.
    pub scene: &'static str,
    /// Pixels.
    pub size: [u32; 2],
    /// Path edges.
    pub depth: u32,
    /// Samples per pixel of the reference.
    pub reference: u32,
}

impl View {
    /// Its scene file; one of the outside scenes, below `data`, is converted into the folder `output`.
    ///
    /// # Errors
    /// When the scene cannot be found.
    pub fn scene_file(&self, data: &Path, output: &Path) -> anyhow::Result<PathBuf> {
        match self.scene.ends_with(".toml") {
            true => Ok(Path::new(env!("CARGO_MANIFEST_DIR")).join(self.scene)),
            false => scenes::convert(self.scene, data, output),
        }
    }
}
