//! Films of a render, while it goes on and at its end.
use super::Args;
use crate::cli::job::End;
use crate::cli::{layers, origin, resume};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::{Film, Samples};
use crate::render::Renderer;
use crate::scene::Scene;
use crate::statistics::BrokenSamples;
use std::collections::BTreeMap;
use std::time::SystemTime;

/// What a film is made of while its render goes on, and at its end.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// What the user wants.
    pub args: &'a Args,
    /// What renders it.
    pub gpu: &'a Gpu,
    /// What is rendered.
    pub scene: &'a Scene,
    /// Whose buffers hold the samples.
    pub renderer: &'a Renderer,
    /// Samples of a resumed file that were no number.
    pub broken_before: Option<BrokenSamples>,
}

impl Shot<'_> {
    /// Samples so far that were no number and counted as black.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn broken_samples(&self) -> Result<Option<BrokenSamples>> {
        Ok(BrokenSamples::join(self.broken_before, self.renderer.broken_samples()?))
    }

    /// Reads back what there is, after so many seconds of rendering; of a film that is not `whole`, also what it lacks.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn film(&self, end: &End, seconds: f64, whole: bool) -> Result<Film> {
        let mut film = layers::film(self.renderer)?;
        film.metadata = metadata(self.args, self.gpu, seconds, end.allocations);
        film.metadata
            .extend(origin::metadata(self.scene, self.renderer.settings(), &film)?.map(|(k, v)| (k.to_owned(), v)));
        layers::set_broken_samples(&mut film, self.broken_samples()?);
        if !whole {
            let pending = resume::pending(self.renderer, &film, end)?;
            film.add(layers::PENDING, Samples::U32(pending));
        }
        Ok(film)
    }
}

fn metadata(args: &Args, gpu: &Gpu, seconds: f64, allocations: u32) -> BTreeMap<String, String> {
    let info = gpu.info();
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("software", format!("tallow {}", env!("CARGO_PKG_VERSION"))),
        ("scene", args.scene.display().to_string()),
        (resume::ALLOCATIONS, allocations.to_string()),
        ("device", info.name.clone()),
        ("driver", format!("{} {} {}", info.driver_name, info.driver_version, info.driver_info)),
        ("renderSeconds", format!("{seconds:.3}")),
        ("dateUnix", since_epoch.as_secs().to_string()),
    ];
    entries.map(|(k, v)| (k.to_owned(), v)).into()
}
