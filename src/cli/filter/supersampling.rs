//! `filter --scene`: the filtered light is looked up along several eye rays per pixel.
use crate::cli::choices::Choices;
use crate::cli::render::FRAME;
use crate::denoise::Filtered;
use crate::error::{Checked, Error, Result};
use crate::gpu::{Gpu, PassTime};
use crate::image::aov::{Aov, Aovs};
use crate::layout::vec3;
use crate::render::provenance::Provenance;
use crate::render::settings::{Allocate, Settings};
use crate::render::{Outputs, Renderer};
use crate::scene::Loaded;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// The scene and the number of rays.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Supersampling (of images that tallow rendered)")]
pub struct Supersampling {
    /// Look the filtered light up along eye rays through this scene, the one that the image shows
    #[arg(long, value_name = "FILE", conflicts_with = "no_demodulate")]
    pub scene: Option<PathBuf>,
    /// Eye rays per pixel, 1 to 4096
    #[arg(long, value_name = "N", requires = "scene", conflicts_with = "no_demodulate", default_value_t = 16,
        value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub eye_rays: u32,
}

impl Supersampling {
    /// Returns the indirect light of every pixel, if a scene is given. `image` is the path for messages.
    ///
    /// # Errors
    /// [`Error::Input`] when the image was not rendered by tallow or shows another scene, and errors of the scene and the
    /// device.
    pub fn look_up(
        &self,
        gpu: &Gpu,
        image: &Path,
        aovs: &Aovs,
        filtered: &Filtered,
    ) -> Result<Option<(Vec<vec3>, Vec<PassTime>)>> {
        let Some(path) = &self.scene else { return Ok(None) };
        let of_image = |what| Error::input(image, what);
        if let Some(frame) = aovs.film.metadata.get(FRAME) {
            let what = format!("is frame {frame} of a sequence: --scene knows a scene only as tallow render shows it");
            return Err(of_image(what));
        }
        let provenance = Provenance::of(aovs.film).map_err(of_image)?;
        let settings = settings(aovs, &provenance).map_err(of_image)?;
        settings.validate()?;
        let mut file = Choices::of(&aovs.film.metadata).open(path)?;
        file.stays_still(); // as the render did
        let Loaded { scene, .. } = file.load()?;
        provenance.shows(&scene, &settings).map_err(of_image)?;
        let renderer = Renderer::new(gpu, &scene, &settings, Outputs::default())?;
        let (guide, light) = (filtered.guide().read()?, filtered.light().read()?);
        renderer.look_up(&guide, &light, self.eye_rays).map(Some)
    }
}

/// The settings of the render, without those of sample allocation.
fn settings(aovs: &Aovs, provenance: &Provenance) -> Checked<Settings> {
    aovs.get(Aov::Direct).ok_or("has no direct light: --scene needs an .exr file of tallow render")?;
    let settings = Settings::deserialize(&provenance.settings).map_err(|e| format!("settings: {e}"))?;
    if settings.size() != aovs.film.size() {
        let [width, height] = aovs.film.size();
        return Err(format!("is {width}x{height}, but was rendered as {}x{}", settings.width, settings.height));
    }
    Ok(Settings { allocate: Allocate::default(), ..settings })
}
