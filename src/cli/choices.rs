//! Options that choose what of a glTF file is seen.
use super::overrides::Overrides;
use super::quoted;
use crate::error::Result;
use crate::render::settings::Settings;
use crate::scene::SceneFile;
use std::collections::BTreeMap;
use std::path::Path;

/// What is seen of a glTF file that holds several.
#[derive(Clone, clap::Args, Debug, Default, PartialEq, Eq)]
pub struct Choices {
    /// Look through this camera of a glTF file [default: its first one, or one that frames it]
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Play only this animation of a glTF file [default: all that do not move the same as an earlier one]
    #[arg(long, value_name = "NAME")]
    pub clip: Option<String>,
}

impl Choices {
    /// Opens a scene file with what is chosen of it.
    ///
    /// # Errors
    /// As [`SceneFile::open_clip`] and [`SceneFile::look_through`].
    pub fn open(&self, path: &Path) -> Result<SceneFile<'static>> {
        let mut file = SceneFile::open_clip(path, self.clip.as_deref())?;
        if let Some(name) = &self.camera {
            file.look_through(name)?;
        }
        Ok(file)
    }

    /// The same at rest, with its settings, those of `overrides` in place of its own, which nobody has checked yet.
    ///
    /// # Errors
    /// As [`Choices::open`] and [`SceneFile::settings`].
    pub fn open_at_rest(&self, path: &Path, overrides: &Overrides) -> Result<(SceneFile<'static>, Settings)> {
        let mut file = self.open(path)?;
        file.stays_still();
        let mut settings = file.settings()?;
        overrides.apply(&mut settings);
        Ok((file, settings))
    }

    /// What the metadata of an image tell.
    pub fn of(metadata: &BTreeMap<String, String>) -> Self {
        Self { camera: metadata.get("camera").cloned(), clip: metadata.get("clip").cloned() }
    }

    /// What was chosen, by the names of the options, which are those in an image's metadata too.
    pub fn given(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let named = [("camera", &self.camera), ("clip", &self.clip)];
        named.into_iter().filter_map(|(option, name)| Some((option, name.as_deref()?)))
    }

    /// The options as a shell takes them, a space before each.
    pub fn words(&self) -> String {
        self.given().map(|(option, name)| format!(" --{option} {}", quoted(name))).collect()
    }
}
