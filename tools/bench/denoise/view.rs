//! What is rendered: scenes as their files say, but small.
use crate::scenes;
use std::path::{Path, PathBuf};
use tallow::render::settings::Settings;

/// A scene and the size of its images; all else is as its file says.
pub struct View {
    /// Name for files and tables.
    pub name: &'static str,
    /// A name known to the converter, or a scene file of the repository.
    scene: &'static str,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

const fn view(name: &'static str, scene: &'static str, size: [u32; 2]) -> View {
    View { name, scene, size }
}

/// Indoors and outdoors, with sky, sun, lamps, textures, gloss and glass. Sibenik by daylight is not among them: after 512 samples the
/// image of it that others would be compared with is as noisy as what a filter makes of 64.
pub const VIEWS: &[View] = &[
    view("crytek-sponza", "crytek-sponza", [320, 180]),
    view("stanford-dragon", "stanford-dragon", [256, 256]),
    view("pine-grove", "pine-grove", [256, 192]),
    view("bitterli-veach-mis", "bitterli-veach-mis", [256, 144]),
    view("nori-table", "nori-table", [256, 192]),
    view("sibenik-lamps", "sibenik-lamps", [256, 192]),
    view("forest", "forest", [256, 192]),
    view("bust", "scenes/bust/scene.toml", [192, 256]),
    view("grass", "scenes/grass/scene.toml", [256, 144]),
    view("cornell-box", "scenes/cornell-box/scene.toml", [256, 256]),
    view("cornell-glass", "scenes/cornell-box/glass.toml", [256, 256]),
    view("cornell-glossy", "scenes/cornell-box/glossy.toml", [256, 256]),
    view("glass-dragon", "glass-dragon", [192, 192]),
    view("fox", "fox", [256, 192]),
    view("bitterli-cornell-box", "bitterli-cornell-box", [256, 256]),
    view("veach-mis", "scenes/veach-mis/scene.toml", [192, 128]),
];

impl View {
    pub fn is_of_repository(&self) -> bool {
        self.scene.ends_with(".toml")
    }

    /// The scene file. An outside scene is converted into a folder.
    pub fn scene_file(&self, data: Option<&Path>, folder: &Path) -> anyhow::Result<PathBuf> {
        match data {
            Some(data) if !self.is_of_repository() => scenes::convert(self.scene, data, folder),
            _ => Ok(Path::new(env!("CARGO_MANIFEST_DIR")).join(self.scene)),
        }
    }

    /// The scene's own settings, for an image of this size.
    pub fn settings(&self, of_scene: &Settings, spp: u32, seed: u32) -> Settings {
        let [width, height] = self.size;
        Settings { width, height, spp, seed, ..of_scene.clone() }
    }
}
