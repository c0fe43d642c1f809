//! What the samples of a frame come from besides its own scene and settings: the frames before it.
use crate::error::Result;
use crate::image::Film;
use crate::render::settings::Settings;
use crate::render::{HISTORY, Reproject, is_frame, metadata_of_frame};
use crate::scene::{Fingerprint, Scene};

/// What a film that begins anew says of the frames before it.
const NONE: &str = "none";

/// The frames up to one, as a number that tells them from others; none where the next frame begins anew.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chain(Option<String>);

impl Chain {
    /// Whether there is a frame that the next one can go on from.
    pub fn is_begun(&self) -> bool {
        self.0.is_some()
    }

    fn text(&self) -> &str {
        self.0.as_deref().unwrap_or(NONE)
    }

    /// The chain that a finished film goes on, where this one has not begun.
    pub fn or_of(&self, film: &Film) -> Self {
        let said = || film.metadata.get(HISTORY)?.split(' ').next().filter(|text| *text != NONE).map(str::to_owned);
        Self(self.0.clone().or_else(said))
    }

    /// What a film says: the frames before it, and how it takes their samples.
    fn said(&self, how: Option<Reproject>) -> String {
        let Some(before) = &self.0 else { return NONE.to_owned() };
        let mut all = Fingerprint::default();
        all.add(format!("{how:?}").as_bytes());
        format!("{before} {all}")
    }

    /// Goes on by a frame.
    ///
    /// # Errors
    /// Those of [`Scene::fingerprint`].
    pub fn with(&self, scene: &Scene, settings: &Settings, how: Option<Reproject>) -> Result<Self> {
        let mut all = Fingerprint::default();
        let of_frame = metadata_of_frame(scene, settings, self.text())?;
        of_frame.values().for_each(|text| all.add(text.as_bytes()));
        all.add(format!("{how:?}").as_bytes());
        Ok(Self(Some(all.to_string())))
    }

    /// Makes a film say that it goes on from here.
    ///
    /// # Errors
    /// Those of [`Scene::fingerprint`].
    pub fn tell(&self, film: &mut Film, scene: &Scene, settings: &Settings, how: Option<Reproject>) -> Result<()> {
        film.metadata.extend(metadata_of_frame(scene, settings, &self.said(how))?);
        Ok(())
    }

    /// Whether a film is the next frame. The first frame of a run may go on from frames that this run knows nothing of.
    pub fn ends_in(&self, film: &Film, scene: &Scene, settings: &Settings, how: Option<Reproject>) -> bool {
        is_frame(film, scene, settings, &self.or_of(film).said(how))
    }
}
