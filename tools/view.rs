//! The scenes that the measuring tools render, with size, depth and samples.
use crate::scenes;
use std::path::{Path, PathBuf};

/// A scene with the parameters of its renders, which are small enough to take only minutes on a software device.
pub struct View {
    /// Name for files and tables.
    pub name: &'static str,
    /// A name known to the converter, or a scene file of the repository.
    pub scene: &'static str,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Largest number of path edges.
    pub depth: u32,
    /// Samples per pixel of the reference.
    pub reference: u32,
}

impl View {
    /// Returns the path of the scene file. An outside scene, from the folder `data`, is converted into the folder `output`.
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
